"""Sensors and filters, their calibration and its test."""

from __future__ import annotations

import json
import os
import tempfile
import textwrap
import warnings
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from . import _core, _tables
from ._evaluation import Evaluation


class OhmstrainWarning(UserWarning):
    """A doubt about a result: a use outside the calibrated range, or rows that were left out."""


def _warn(messages: Iterable[str], depth: int = 1) -> None:
    """Warn at the user's line, ``depth`` calls above the caller."""
    for message in messages:
        warnings.warn(message, OhmstrainWarning, stacklevel=depth + 2)


def _about(
    name: str | None = None,
    gauge_length_mm: float | None = None,
    front_end: str | None = None,
    joint: str | None = None,
    strain_unit: str | None = None,
    resistance_unit: str | None = None,
) -> dict[str, Any]:
    return {
        "name": name,
        "gauge_length_mm": gauge_length_mm,
        "front_end": front_end,
        "joint": joint,
        "strain_unit": strain_unit,
        "resistance_unit": resistance_unit,
    }


def _known(time_s: float, strain: float, sd: float | None = None) -> tuple[float, float, float | None]:
    return (time_s, strain, sd)


def _options(
    estimator: str = "auto",
    correction: bool = True,
    initial_strain: float | None = None,
    known: Iterable[tuple[float, ...]] = (),
    rest_resistance: float | str | None = None,
    gate: float | None = None,
    influence: str | None = None,
    columns: Iterable[str] | None = None,
) -> dict[str, Any]:
    return {
        "estimator": estimator,
        "correction": correction,
        "initial_strain": initial_strain,
        "known": [_known(*strain) for strain in known],
        "rest_resistance": rest_resistance,
        "gate": gate,
        "influence": influence,
        "columns": None if columns is None else list(columns),
    }


def _choices(
    estimator: str = "auto",
    branches: int | None = None,
    gauge: str = "auto",
    prior: Prior | str | os.PathLike[str] | None = None,
    align: bool = False,
    temperature: tuple[tuple[float, float], tuple[float, float]] | None = None,
) -> dict[str, Any]:
    if prior is not None and not isinstance(prior, Prior):
        prior = Prior.load(prior)
    text = None if prior is None else prior.to_toml()
    choices = {"estimator": estimator, "branches": branches, "gauge": gauge, "prior": text, "align": align}
    return choices | {"temperature": temperature}


def _split(arguments: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Separate arguments about the recording from those about the task."""
    names = _about.__code__.co_varnames[: _about.__code__.co_argcount]
    about = {name: arguments.pop(name) for name in names if name in arguments}
    return _about(**about), arguments


def _write(path: str | os.PathLike[str], text: str) -> None:
    """Write a file, whole or not at all."""
    target, draft = Path(path), None
    try:
        with tempfile.NamedTemporaryFile("w", encoding="utf-8", dir=target.parent, delete=False) as draft:
            draft.write(text)
        os.chmod(draft.name, 0o644)
        os.replace(draft.name, target)
    except OSError as error:
        # Names the file, and not the temporary one.
        raise OSError(error.errno, error.strerror, os.fspath(path)) from None
    finally:
        if draft is not None:
            Path(draft.name).unlink(missing_ok=True)


class Prior:
    """Common properties of calibrated sensors of one make, with which a short motion calibrates the next one."""

    def __init__(self, text: str, file: str | None = None) -> None:
        _core.check_prior(text, file)
        self._text = text

    @classmethod
    def fit(cls, sensors: Iterable[Sensor]) -> Prior:
        """Learn from at least three sensors, as ``ohmstrain fleet fit`` does."""
        return cls(_core.fit_prior([sensor._core for sensor in sensors]))

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Prior:
        """Read a ``prior.toml``."""
        return cls(Path(path).read_text(encoding="utf-8"), os.fspath(path))

    def to_toml(self) -> str:
        """Return the text of its ``prior.toml``."""
        return self._text

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write a ``prior.toml``, whole or not at all."""
        _write(path, self._text)


class Sensor:
    """A calibrated sensor: made by :func:`calibrate`, :meth:`load` or :meth:`from_toml`."""

    def __init__(self, core: _core.Sensor, file: str | None = None) -> None:
        self._core = core
        self._file = file

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Sensor:
        """Read a ``sensor.toml``.

        Raises
        ------
        OhmstrainError
            With file, line and column, if it is not a sensor or has a number out of its range.
        """
        name = os.fspath(path)
        return cls(_core.Sensor.from_toml(Path(path).read_text(encoding="utf-8"), file=name), name)

    @classmethod
    def from_toml(cls, text: str) -> Sensor:
        """Parse the text of a ``sensor.toml``."""
        return cls(_core.Sensor.from_toml(text))

    def to_toml(self) -> str:
        """Return the text of its ``sensor.toml``."""
        return self._core.to_toml()

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write a ``sensor.toml``, whole or not at all."""
        _write(path, self.to_toml())
        self._file = os.fspath(path)

    def without_temperature(self) -> Sensor:
        """Return the sensor for readings whose temperature is not measured: its intervals are wider by what the calibration's temperatures
        do to the strain.
        """
        return Sensor(self._core.without_temperature(), self._file)

    @property
    def params(self) -> dict[str, Any]:
        """All its numbers, as in ``sensor.toml``."""
        return json.loads(self._core.json())

    @property
    def findings(self) -> dict[str, Any] | None:
        """Errors on held-out quarters, what limits them, and what to record next; None if they could not be measured."""
        return self.params.get("findings")

    @property
    def quantity(self) -> str:
        """``strain`` or ``angle_deg``."""
        return self._core.quantity

    @property
    def reading(self) -> str:
        """Column of the readings: ``resistance_ohm`` or ``resistance_ratio``."""
        return self._core.reading

    @property
    def estimator(self) -> str:
        """The default estimator."""
        return self._core.estimator

    @property
    def columns(self) -> list[str]:
        """Columns of its estimates."""
        return self._core.columns(_about(), _options())

    def filter(
        self,
        recording: Any = None,
        *,
        lag_s: float | None = None,
        resume: str | os.PathLike[str] | None = None,
        **options: Any,
    ) -> Any:
        """Filter a recording, each row from the readings up to it; or, without a recording, create a filter for live readings.

        Parameters
        ----------
        recording
            A table. Times are ``time_s`` or ``time_us``, or dates and times (with the first row at 0 s) or durations, in a column or a
            pandas index. Without a recording, a :class:`LiveFilter` or a :class:`LaggedFilter` is returned.
        lag_s
            Delay of the estimates, s, in which later readings are used; for live filters.
        resume
            Path of a state file, from which a live filter of the same sensor and options resumes; written by its ``save``, or by
            ``ohmstrain filter --save-state``. R₀ and known strains come from the state; known strains given here are added.
        estimator : str
            ``auto`` (the sensor's choice), ``corrected``, ``ekf``, ``ukf``, ``imm``, ``sign-split``, ``hypotheses``,
            ``static-cubic``.
        correction : bool
            Apply the learned correction of the strain; true by default.
        initial_strain : float
            Strain at the first row, if it is known; the body is at rest there.
        known : list of tuples
            Known strains (or angles), ``(time_s, strain)`` or ``(time_s, strain, sd)``; each applies to the first row at or after
            its time. The error of the estimate there also corrects later rows (in a smoother, rows before it, too).
        rest_resistance : float or str
            Present reading of the rested, unstretched sensor, or ``calibrated`` for its reading in calibration. The default is the
            latter, but R₀ then adapts to readings that stay outside the calibrated range.
        gate : float
            Reject readings whose normalised innovation squared is above this, at most two in a row.
        influence : str
            Influence of surprising readings: ``redescending:K`` (``redescending:3`` by default), ``huber:K``, ``student-t:DOF``, or
            ``none``, which uses them unchanged.
        columns : list of str
            Requested columns of the estimates, from :attr:`columns`; all by default.
        joint : str
            Joint that the sensor is mounted on, as above the header of a trace CSV.
        name, gauge_length_mm, front_end, strain_unit, resistance_unit
            Name of the recording in messages, and the other metadata above the header of a trace CSV; units are ``fraction`` or
            ``percent`` and ``ohm`` or ``kohm``. A table of :func:`ohmstrain.read` contains them. A live filter does not take them.

        Returns
        -------
        A table of the recording's kind with the columns of ``estimates.csv``; unknown values are null.

        Raises
        ------
        OhmstrainError
            Names row and column.
        """
        if recording is not None:
            if lag_s is not None or resume is not None:
                raise TypeError("lag_s and resume are for live filters; smooth() estimates from all readings")
            return self._estimate(self._core.filter, recording, options)
        if options.get("joint") is not None:
            on_joint = Sensor(self._core.on_joint(options.pop("joint")), self._file)
            return on_joint.filter(lag_s=lag_s, resume=resume, **options)
        if "columns" in options and options["columns"] is not None:
            options["columns"] = list(options["columns"])
        if resume is not None:
            return _resumed(self, options, lag_s, Path(resume).read_text(encoding="utf-8"), os.fspath(resume))
        if lag_s is None:
            return LiveFilter(self._core.live(_options(**options)), self, options)
        return LaggedFilter(self._core.lagged(_options(**options), lag_s), self, options, lag_s)

    def smooth(self, recording: Any, **options: Any) -> Any:
        """Smooth a recording: each estimate uses all readings.

        Parameters and result are those of :meth:`filter`.
        """
        return self._estimate(self._core.smooth, recording, options)

    def evaluate(self, recording: Any, *, from_s: float = float("-inf"), **options: Any) -> Any:
        """Score filter, smoother and static cubic on the rows at ``from_s`` or later; the filter starts at the first row.

        Returns
        -------
        Evaluation
        """
        about, options = _split(options)
        scored = self._core.evaluate(_tables.to_arrow(recording), about, _options(**options), from_s)
        return Evaluation(scored, about["name"], None)

    def export(
        self,
        folder: str | os.PathLike[str],
        *,
        target: str = "c",
        dt_s: float | None = None,
        budget: str | None = None,
        prefix: str = "ohmstrain",
    ) -> str:
        """Write the filter as source code for a microcontroller into a folder, as ``ohmstrain export`` does.

        Parameters
        ----------
        target
            ``c``: C99 in the layout of an Arduino library, with a self-test; or ``rust``: constants for the crate ``ohmstrain-ekf``.
        dt_s
            Usual time between two readings, s; by default that of the calibration's recordings.
        budget
            Largest cost, as ``--budget`` takes it: ``lean``, or some of ``board=NAME,instructions=N,flash=BYTES,ram=BYTES``; the first
            of its candidates that fits is exported. Without it, the whole filter is.
        prefix
            Prefix of the names in the C code.

        Returns
        -------
        A table of the filter's expected errors and of its cost on a Cortex-M4F.

        Raises
        ------
        OhmstrainError
            If the filter cannot be exported, or nothing fits. Nothing is written then.
        """
        files, promise, words = self._core.export(target, dt_s, budget, prefix)
        for path, content in files:
            place = Path(folder, path)
            place.parent.mkdir(parents=True, exist_ok=True)
            _write(place, content)
        return "\n".join([*promise, words])

    def _estimate(self, method: Any, recording: Any, options: dict[str, Any]) -> Any:
        about, options = _split(options)
        table, doubts = method(_tables.to_arrow(recording), about, _options(**options))
        _warn(doubts, 2)
        return _tables.converter(recording)(_tables.from_core(table))

    @property
    def plot(self) -> Any:
        """Its plots: ``sensor.plot.calibration()``. Needs matplotlib."""
        from .plot import SensorPlots

        return SensorPlots(self)

    def __repr__(self) -> str:
        closing = self._core.closing(self._file)
        if closing is not None:
            indent = " " * 13
            lines = (textwrap.fill(text, 100, initial_indent=f"{name:13}", subsequent_indent=indent) for name, text in closing)
            return "\n".join(lines)
        params = self.params
        lower, upper = params["limits"]["lower"], params["limits"]["upper"]
        branches = len(params["law"]["branches"])
        file = self._file or "made of parameters"
        known = params.get("summary")
        left_out = known and (
            f"Left out     {known['left_out_percent_fs']:.2g} % of full scale on held-out quarters, static cubic "
            f"{known['static_cubic_percent_fs']:.2g} %; the\n             95 % interval, "
            f"{known['width_95_percent_fs']:.3g} % wide, holds {known['coverage_95_percent']:.3g} % of their rows\n"
        )
        return (left_out or "") + (
            f"Sensor       {file}, estimator {self.estimator}, a law of {branches} branch{'es' * (branches != 1)}\n"
            f"Reports      {self.quantity} {lower:.4g} to {upper:.4g} of `{self.reading}`, "
            f"R0 {params['rest_reading']:.5g}"
        )

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Sensor) and self.params == other.params

    __hash__ = None  # type: ignore[assignment]

    def __reduce__(self) -> tuple[Any, ...]:
        return Sensor.from_toml, (self.to_toml(),)


class LiveFilter:
    """A running filter: readings in, estimates out. See :meth:`Sensor.filter`.

    ``pickle``, ``copy`` and :meth:`save` keep its whole state: a filter that resumes from there gives the same estimates, to the last
    digit.
    """

    def __init__(self, core: _core.LiveFilter, sensor: Sensor, options: Mapping[str, Any]) -> None:
        self._core = core
        self._sensor, self._options = sensor, _of_later(options)

    def step(self, time_s: float, reading: float | None = None, temperature_c: float | None = None) -> dict[str, Any]:
        """Take the reading at a time, s, and the temperature, °C; a missing reading is None or NaN. An error leaves the filter as it
        was. Without any temperature use the filter of :meth:`Sensor.without_temperature`.
        """
        return self._core.step(time_s, reading, temperature_c)

    def run(self, rows: Any, **about: Any) -> Any:
        """Take the rows of a table, one piece of a recording; the next call continues after the last row. For dates and times, the
        first row of the first piece is at 0 s. ``about`` is that of :meth:`Sensor.filter`.
        """
        origin = _tables.Origin(self._core.zero_ns)
        table, doubts = self._core.run(_tables.to_arrow(rows, origin), _about(**about), origin.first_ns)
        _warn(doubts)
        return _tables.converter(rows)(_tables.from_core(table))

    def rest_resistance(self, measured: float) -> None:
        """Set the reading of the rested, unstretched sensor from now on."""
        self._core.rest_resistance(measured)

    def state(self) -> str:
        """Return everything that the next row depends on, as the text of a state file."""
        return self._core.store()

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write a state file, whole or not at all: for ``sensor.filter(resume=path)`` and ``ohmstrain filter --resume``."""
        _write(path, self.state())

    def __reduce__(self) -> tuple[Any, ...]:
        return _resumed, (self._sensor, self._options, None, self.state())


class LaggedFilter:
    """A running fixed-lag smoother: each row is estimated from the readings up to a fixed lag after it. It can be stored like a
    :class:`LiveFilter`, with its pending rows.
    """

    def __init__(self, core: _core.LaggedFilter, sensor: Sensor, options: Mapping[str, Any], lag_s: float) -> None:
        self._core = core
        self._sensor, self._options, self._lag_s = sensor, _of_later(options), lag_s

    def step(self, time_s: float, reading: float | None = None, temperature_c: float | None = None) -> list[dict[str, Any]]:
        """Take a reading, and return the rows that have become due."""
        return self._core.step(time_s, reading, temperature_c)

    def finish(self) -> list[dict[str, Any]]:
        """Return the pending rows."""
        return self._core.finish()

    def rest_resistance(self, measured: float) -> None:
        """Set the reading of the rested, unstretched sensor from now on."""
        self._core.rest_resistance(measured)

    def state(self) -> str:
        """Return everything that the next row depends on, as the text of a state file."""
        return self._core.store()

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write a state file, whole or not at all: for ``sensor.filter(lag_s=…, resume=path)`` and ``ohmstrain filter --resume``."""
        _write(path, self.state())

    def __reduce__(self) -> tuple[Any, ...]:
        return _resumed, (self._sensor, self._options, self._lag_s, self.state())


def _of_later(options: Mapping[str, Any]) -> dict[str, Any]:
    """Return the options without those stored in a state: the start, R₀ and known strains."""
    return {name: value for name, value in options.items() if name not in ("initial_strain", "rest_resistance", "known")}


def _resumed(
    sensor: Sensor, options: dict[str, Any], lag_s: float | None, state: str, file: str | None = None
) -> LiveFilter | LaggedFilter:
    if lag_s is not None:
        core = sensor._core.resume_lagged(_options(**options), lag_s, state, file)
        return LaggedFilter(core, sensor, options, lag_s)
    return LiveFilter(sensor._core.resume(_options(**options), state, file), sensor, options)


def calibrate(
    recordings: Any,
    *,
    estimator: str = "auto",
    branches: int | None = None,
    gauge: str = "auto",
    prior: Prior | str | os.PathLike[str] | None = None,
    align: bool = False,
    temperature: tuple[tuple[float, float], tuple[float, float]] | None = None,
    **about: Any,
) -> Sensor:
    """Calibrate a sensor on recordings with known strain.

    Parameters
    ----------
    recordings
        Tables, each with a reference, or one table; or a dict of tables by their names in messages.
    estimator : str
        The estimator that is calibrated and becomes the default; ``auto`` chooses as the command line does.
    branches : int
        Number of relaxing branches of the law, 0 to 4, instead of choosing it by the filter's error.
    gauge : str
        Family of the quasi-static curve: ``auto``, ``polynomial``, ``decaying-exponential`` or ``tunnelling``.
    prior : Prior
        Prior learned from other sensors of the same make, or the path of a ``prior.toml``; a short motion is enough then. The
        law's structure is the prior's; ``branches`` and ``gauge`` are ignored.
    align : bool
        Shift a late or early reference to match the readings. Without it, one that is certainly too late is an error, and one that
        may be too late is a warning.
    temperature : ((a, sd), (b, sd))
        Effect of temperature, for recordings with a column ``temperature_c``: relative changes per kelvin, with standard deviations, of R₀
        and of the change with strain. Without it they are fitted, if the temperature moves enough.
    gauge_length_mm, front_end, joint, strain_unit, resistance_unit
        Metadata above the header of a trace CSV. Units that are given, ``percent`` or ``fraction`` and ``kohm`` or ``ohm``, are not
        doubted. A table of :func:`ohmstrain.read` contains them.

    Returns
    -------
    Sensor
        The same as ``ohmstrain calibrate`` writes, apart from the recordings' names.

    Raises
    ------
    OhmstrainError
        Names recording, row and column, or what the recordings lack.
    """
    if isinstance(recordings, Mapping) and not any(name in _tables.COLUMNS for name in recordings):
        named = list(recordings.items())
    elif isinstance(recordings, (list, tuple)):
        named = [(None, recording) for recording in recordings]
    else:
        named = [(None, recordings)]
    tables = [(_tables.to_arrow(table), _about(name=name, **about)) for name, table in named]
    core, doubts = _core.calibrate(tables, _choices(estimator, branches, gauge, prior, align, temperature))
    _warn(doubts)
    return Sensor(core)


def evaluate(
    recording: Any, *, splits: Iterable[float] = (0.5,), estimator: str = "auto", **about: Any
) -> list[Evaluation]:
    """Calibrate on the first rows of a recording, score the rest, and compare with four baselines.

    Parameters
    ----------
    recording
        A table with a reference.
    splits
        Shares of the rows used for calibration, between 0 and 1.
    estimator : str
        As in :func:`calibrate`.

    Returns
    -------
    list of Evaluation
        One per split, with the scores of ``ohmstrain evaluate --splits``.
    """
    about = _about(**about)
    table = _tables.to_arrow(recording)
    evaluations = []
    for share in splits:
        core, doubts, scored = _core.evaluate_split(table, about, _choices(estimator), share)
        _warn(doubts)
        evaluation = Evaluation(scored, about["name"], share)
        evaluation.sensor = Sensor(core)
        evaluations.append(evaluation)
    return evaluations
