"""Plots in the style of the report. They need matplotlib: ``pip install 'ohmstrain[plot]'``."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyarrow as pa

from . import _core, _tables

#: Colours of the report: estimate, reference, others.
ESTIMATE, REFERENCE, OTHER = "#1f5fa8", "#222222", "#b3541e"


#: Largest strain that is not taken for percent, as in calibration.
_LARGEST_STRAIN = 3.0


def _axes(ax: Any) -> Any:
    if ax is not None:
        return ax
    import matplotlib.pyplot as plt

    return plt.subplots(figsize=(8, 3.2), layout="constrained")[1]


def _scale(quantity: str) -> tuple[float, str]:
    return (100.0, "strain, %") if quantity == "strain" else (1.0, "angle, °")


def _column(table: Any, name: str) -> np.ndarray:
    arrow = table if isinstance(table, pa.Table) else pa.table(table) if not hasattr(table, "to_numpy") else None
    cells = table[name].to_numpy() if arrow is None else arrow[name].to_numpy(zero_copy_only=False)
    return np.asarray(cells, dtype=float)


def strain(
    estimates: Any,
    recording: Any = None,
    *,
    gauge_length_mm: float | None = None,
    strain_unit: str | None = None,
    ax: Any = None,
) -> Any:
    """Draw strain with its 95 % interval against time, and the reference, if the recording has one.

    Parameters
    ----------
    estimates
        Result of :meth:`Sensor.filter` or :meth:`Sensor.smooth`.
    recording
        The recording, for its reference.
    gauge_length_mm
        Length that converts a reference in ``displacement_mm`` to strain; without it such a reference is not drawn.
    strain_unit
        Unit of the reference, ``fraction`` or ``percent``. Without it a strain above 3 is an error.
    ax
        Axes to draw in; new ones by default.

    Returns
    -------
    matplotlib.figure.Figure
    """
    if strain_unit not in (None, "fraction", "percent"):
        raise _core.OhmstrainError(f"strain_unit: expected `fraction` or `percent`, found `{strain_unit}`")
    ax = _axes(ax)
    names = list(estimates.columns) if hasattr(estimates, "columns") else list(estimates)
    names = estimates.column_names if isinstance(estimates, pa.Table) else names
    quantity = "strain" if "strain" in names else "angle_deg"
    scale, unit = _scale(quantity)
    time_s = _column(estimates, "time_s")
    mean = scale * _column(estimates, quantity)
    sd = scale * _column(estimates, "strain_sd" if quantity == "strain" else "angle_sd")
    ax.fill_between(time_s, mean - 1.96 * sd, mean + 1.96 * sd, color=ESTIMATE, alpha=0.2, lw=0, label="95 % interval")
    ax.plot(time_s, mean, color=ESTIMATE, lw=1, label="estimate")
    if recording is not None:
        table = _tables.to_arrow(recording)
        reference, factor = quantity, 1.0 if strain_unit == "percent" and quantity == "strain" else scale
        if gauge_length_mm is not None and quantity == "strain" and "displacement_mm" in table.column_names:
            reference, factor = "displacement_mm", scale / gauge_length_mm
        if reference in table.column_names:
            values = _column(table, reference)
            if reference == "strain" and strain_unit is None and np.nanmax(values, initial=0.0) > _LARGEST_STRAIN:
                raise _core.OhmstrainError(
                    f'column `strain`: strains of up to {np.nanmax(values):.3g}: are they in percent? Then say so with strain_unit="percent"'
                )
            times = _column(table, "time_s") if "time_s" in table.column_names else _column(table, "time_us") / 1e6
            ax.plot(times, factor * values, color=REFERENCE, lw=0.8, label="reference")
    ax.set(xlabel="time, s", ylabel=unit)
    ax.legend(loc="lower right", bbox_to_anchor=(1, 1), frameon=False, ncols=3)
    return ax.figure


class SensorPlots:
    """Plots of a sensor: ``sensor.plot.calibration()``."""

    def __init__(self, sensor: Any) -> None:
        self._sensor = sensor

    def gauge(self, *, ax: Any = None) -> Any:
        """Draw the quasi-static curve g: relative change of the settled resistance against strain.

        Returns
        -------
        matplotlib.figure.Figure
        """
        params = self._sensor.params
        limits, gauge = params["limits"], params["law"]["gauge"]
        strain = np.linspace(limits["lower"], limits["upper"], 200)
        scale, unit = _scale(self._sensor.quantity)
        ax = _axes(ax)
        ax.plot(scale * strain, 100 * _gauge(gauge, strain), color=ESTIMATE, lw=1.2)
        ax.set(xlabel=unit, ylabel="R/R₀ − 1, %")
        return ax.figure

    def calibration(self) -> Any:
        """Draw the calibration: the quasi-static curve, the distribution of the recorded strains, and the error on held-out
        quarters beside the static cubic's.

        Returns
        -------
        matplotlib.figure.Figure
        """
        import matplotlib.pyplot as plt

        findings = self._sensor.findings
        if findings is None:
            fig, ax = plt.subplots(figsize=(4, 3.2), layout="constrained")
            return self.gauge(ax=ax)
        fig, (curve, seen, error) = plt.subplots(1, 3, figsize=(11, 3.2), layout="constrained")
        self.gauge(ax=curve)
        span = findings["seen"]["range"]
        scale, unit = _scale(self._sensor.quantity)
        edges = scale * np.linspace(span["lower"], span["upper"], len(findings["seen"]["tenths"]) + 1)
        seen.stairs(100 * np.asarray(findings["seen"]["tenths"]), edges, fill=True, color=ESTIMATE, alpha=0.6)
        seen.set(xlabel=unit, ylabel="rows, %", title="seen")
        bars = {"filter": findings["filter"], "smoother": findings["smoother"], "static cubic": findings["static_cubic"]}
        bars = {name: scores["rmse_percent_fs"] for name, scores in bars.items() if scores is not None}
        error.bar(list(bars), list(bars.values()), color=[ESTIMATE, ESTIMATE, OTHER][-len(bars) :])
        error.set(ylabel="error, % of full scale", title="on quarters left out")
        return fig


def _gauge(gauge: dict[str, Any], strain: np.ndarray) -> np.ndarray:
    """Return g(strain), by the formulas of NOTATION.md."""
    family = gauge["family"]
    if family == "polynomial":
        return sum(c * strain ** (k + 1) for k, c in enumerate(gauge["coefficients"]))
    if family == "decaying-exponential":
        return gauge["slope"] * strain * np.exp(-strain / gauge["decay_strain"])
    c, a, w = gauge["gap"], gauge["barrier"], gauge["path_loss"]
    return (1 + c * strain) * np.exp(a * strain + w * strain**2) - 1
