"""The regressor, and which of scikit-learn's checks apply to it."""

import numpy as np
import pytest

pytest.importorskip("sklearn")
from sklearn.base import clone  # noqa: E402
from sklearn.model_selection import GroupKFold, cross_val_score  # noqa: E402
from sklearn.utils.estimator_checks import check_estimator  # noqa: E402

import ohmstrain as oh  # noqa: E402
from ohmstrain.sklearn import StrainRegressor  # noqa: E402

pytestmark = pytest.mark.filterwarnings("ignore::ohmstrain.OhmstrainWarning")


def test_it_is_the_sensor(trace):
    X, y = trace[["time_s", "resistance_ohm"]].to_numpy(), trace["strain"].to_numpy()
    model = StrainRegressor(estimator="ekf").fit(X, y)
    sensor = oh.calibrate(trace, estimator="ekf")
    assert model.sensor_ == sensor
    mean, sd = model.predict(X, return_std=True)
    np.testing.assert_array_equal(mean, sensor.smooth(trace)["strain"])
    assert (sd > 0).all() and model.score(X, y) < 1


def test_recordings_stand_below_each_other(trace):
    rows = trace[["time_s", "resistance_ohm"]].to_numpy()
    X, y = np.vstack([rows, rows]), np.tile(trace["strain"].to_numpy(), 2)
    groups = np.repeat([0, 1], len(rows))
    scores = cross_val_score(clone(StrainRegressor(estimator="ekf")), X, y, groups=groups, cv=GroupKFold(2))
    assert scores[0] == scores[1]


def test_checks_of_scikit_learn():
    results = check_estimator(StrainRegressor(estimator="ekf"), on_fail=None, on_skip=None)
    passed = {result["check_name"] for result in results if result["status"] == "passed"}
    failed = {result["check_name"]: result["exception"] for result in results if result["status"] == "failed"}
    for name, error in failed.items():
        assert isinstance(error, (ValueError, AssertionError)), (name, error)
    needed = {
        "check_estimator_cloneable",
        "check_estimator_repr",
        "check_no_attributes_set_in_init",
        "check_parameters_default_constructible",
        "check_get_params_invariance",
        "check_set_params",
        "check_estimators_unfitted",
    }
    assert needed <= passed, needed - passed
