"""A scikit-learn regressor: ``pip install 'ohmstrain[sklearn]'``."""

from __future__ import annotations

from typing import Any

import numpy as np
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.utils.validation import check_is_fitted, validate_data

from ._sensor import calibrate


class StrainRegressor(RegressorMixin, BaseEstimator):
    """Strain from time and resistance, as a regressor of scikit-learn.

    Rows of ``X`` are time, s, and reading, Ω. Recordings follow one another; a new one begins where time does not increase. The
    order of rows matters: use ``GroupKFold`` by recording or ``TimeSeriesSplit``, not shuffled splits.

    Parameters
    ----------
    estimator : str
        As in :func:`ohmstrain.calibrate`.
    smooth : bool
        Predict each strain from all readings of its recording, instead of those up to it.

    Attributes
    ----------
    sensor_ : ohmstrain.Sensor
        The calibrated sensor.
    """

    def __init__(self, estimator: str = "auto", smooth: bool = True) -> None:
        self.estimator = estimator
        self.smooth = smooth

    def fit(self, X: Any, y: Any) -> StrainRegressor:
        """Calibrate on recordings with strains ``y``; missing values are NaN."""
        X, y = validate_data(self, X, y, y_numeric=True, dtype=float, ensure_all_finite="allow-nan", ensure_min_samples=2)
        self._check_columns(X)
        recordings = [
            {"time_s": X[rows, 0], "resistance_ohm": X[rows, 1], "strain": y[rows]} for rows in _recordings(X[:, 0])
        ]
        self.sensor_ = calibrate(recordings, estimator=self.estimator)
        return self

    def predict(self, X: Any, return_std: bool = False) -> Any:
        """Predict strains, and their standard deviations if requested."""
        check_is_fitted(self)
        X = validate_data(self, X, reset=False, dtype=float, ensure_all_finite="allow-nan")
        mean, sd = np.empty(len(X)), np.empty(len(X))
        estimate = self.sensor_.smooth if self.smooth else self.sensor_.filter
        for rows in _recordings(X[:, 0]):
            estimates = estimate({"time_s": X[rows, 0], "resistance_ohm": X[rows, 1]})
            mean[rows], sd[rows] = estimates["strain"], estimates["strain_sd"]
        return (mean, sd) if return_std else mean

    @staticmethod
    def _check_columns(X: np.ndarray) -> None:
        if X.shape[1] != 2:
            raise ValueError(f"expected two columns, time_s and resistance_ohm, found {X.shape[1]}")

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.input_tags.allow_nan = True
        tags.non_deterministic = False
        return tags


def _recordings(time_s: np.ndarray) -> list[slice]:
    """Return the rows of each recording."""
    starts = [0, *(np.flatnonzero(np.diff(time_s) <= 0) + 1), len(time_s)]
    return [slice(first, end) for first, end in zip(starts, starts[1:])]
