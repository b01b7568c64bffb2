"""Sensors and filters."""

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


class OhmstrainWarning(UserWarning):
    """What casts doubt on a result: a use outside of what the calibration has seen, rows that were left out."""


def _warn(messages: Iterable[str], depth: int = 1) -> None:
    """Warn at the line of the user, so many calls above the one that asks for it."""
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
) -> dict[str, Any]:
    if prior is not None and not isinstance(prior, Prior):
        prior = Prior.load(prior)
    text = None if prior is None else prior.to_toml()
    return {"estimator": estimator, "branches": branches, "gauge": gauge, "prior": text, "align": align}


def _split(arguments: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Arguments about the recording, and those about the work."""
    names = _about.__code__.co_varnames[: _about.__code__.co_argcount]
    about = {name: arguments.pop(name) for name in names if name in arguments}
    return _about(**about), arguments


def _write(path: str | os.PathLike[str], text: str) -> None:
    """Whole or not at all."""
    target = Path(path)
    with tempfile.NamedTemporaryFile("w", encoding="utf-8", dir=target.parent, delete=False) as draft:
        draft.write(text)
    os.chmod(draft.name, 0o644)
    os.replace(draft.name, target)


class Prior:
    """What calibrated sensors of one make have in common: with it a short motion calibrates the next one."""

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
        """The text of its ``prior.toml``."""
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
            With file, line and column, if it is none or has a number that no sensor can have.
        """
        name = os.fspath(path)
        return cls(_core.Sensor.from_toml(Path(path).read_text(encoding="utf-8"), file=name), name)

    @classmethod
    def from_toml(cls, text: str) -> Sensor:
        """Take the text of a ``sensor.toml``."""
        return cls(_core.Sensor.from_toml(text))

    def to_toml(self) -> str:
        """The text of its ``sensor.toml``."""
        return self._core.to_toml()

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write a ``sensor.toml``, whole or not at all."""
        _write(path, self.to_toml())
        self._file = os.fspath(path)

    @property
    def params(self) -> dict[str, Any]:
        """All its numbers, as they stand in ``sensor.toml``."""
        return json.loads(self._core.json())

    @property
    def findings(self) -> dict[str, Any] | None:
        """What the calibration is worth on quarters left out, what limits it, what to record next; if that could be told."""
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
        """Estimates of a recording, each from the readings up to it; or, without one, a filter for readings as they come.

        Parameters
        ----------
        recording
            A table. Times are ``time_s`` or ``time_us``, or dates and times (of the first row is 0 s) or durations, in a column or a
            pandas index. If there is none, a :class:`LiveFilter` is returned, or a :class:`LaggedFilter`.
        lag_s
            Wait so many seconds for later readings; for live filters.
        resume
            Path of a state file, from which a live filter of the same sensor and options goes on: written by its ``save``, or by
            ``ohmstrain filter --save-state``. It knows R₀ and known strains; what is said here counts from now on.
        estimator : str
            ``auto`` (the sensor's choice), ``corrected``, ``ekf``, ``ukf``, ``imm``, ``sign-split``, ``hypotheses``.
        correction : bool
            With the learned correction of the strain, the default.
        initial_strain : float
            Strain at the first row, if it is known; the body is at rest there.
        known : list of tuples
            Strains (or angles) that are known, ``(time_s, strain)`` or ``(time_s, strain, sd)``: of the first row from that
            time on. What the estimates lack then is known of the rows after it, too (a smoother's: around it).
        rest_resistance : float or str
            What the rested, unstretched sensor reads now, or ``calibrated`` for what it read in calibration. Without it
            R₀ is that too, but follows readings that stay beyond those of the calibration.
        gate : float
            Turn down readings whose normalised innovation squared is above this, two in a row at most.
        influence : str
            How surprising readings are taken: ``redescending:K`` (``redescending:3`` by default), ``huber:K``,
            ``student-t:DOF`` or ``none``, as they are.
        columns : list of str
            Columns of the estimates that are wanted, of :attr:`columns`; all by default.
        name, gauge_length_mm, front_end, joint, strain_unit, resistance_unit
            What messages call the recording, and what stands above the header of a trace CSV; units are ``fraction`` or
            ``percent`` and ``ohm`` or ``kohm``. A table of :func:`ohmstrain.read` knows them.

        Returns
        -------
        A table of the recording's kind with the columns of ``estimates.csv``; what is not known is null.

        Raises
        ------
        OhmstrainError
            Names row and column.
        """
        if recording is not None:
            if lag_s is not None or resume is not None:
                raise TypeError("lag_s and resume are for live filters; smooth() estimates from all readings")
            return self._estimate(self._core.filter, recording, options)
        if "columns" in options and options["columns"] is not None:
            options["columns"] = list(options["columns"])
        if resume is not None:
            return _resumed(self, options, lag_s, Path(resume).read_text(encoding="utf-8"), os.fspath(resume))
        if lag_s is None:
            return LiveFilter(self._core.live(_options(**options)), self, options)
        return LaggedFilter(self._core.lagged(_options(**options), lag_s), self, options, lag_s)

    def smooth(self, recording: Any, **options: Any) -> Any:
        """Estimates of a recording, each from all readings.

        Parameters and result are those of :meth:`filter`.
        """
        return self._estimate(self._core.smooth, recording, options)

    def evaluate(self, recording: Any, *, from_s: float = float("-inf"), **options: Any) -> Any:
        """Scores of filter, smoother and static cubic on the rows at ``from_s`` or later; the filter starts at the first.

        Returns
        -------
        Evaluation
        """
        from ._evaluation import Evaluation

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
            of its candidates that fits is exported. Without it all of the filter is.
        prefix
            What the names of the C code begin with.

        Returns
        -------
        What was promised of the filter, and what it costs on a Cortex-M4F: a table.

        Raises
        ------
        OhmstrainError
            If the filter has no form for a microcontroller, or nothing fits. Then nothing is written.
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
            f"Left out     {known['left_out_percent_fs']:.2g} % of full scale on quarters not fitted to, static cubic "
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

    ``pickle``, ``copy`` and :meth:`save` keep all that it knows: what goes on from there estimates, to the last digit, what it would have.
    """

    def __init__(self, core: _core.LiveFilter, sensor: Sensor, options: Mapping[str, Any]) -> None:
        self._core = core
        self._sensor, self._options = sensor, _of_later(options)
        self._origin = _tables.Origin()

    def step(self, time_s: float, reading: float | None = None) -> dict[str, Any]:
        """Take the reading at a time, s; a missing one is None or NaN. An error leaves the filter as it was."""
        return self._core.step(time_s, reading)

    def run(self, rows: Any, **about: Any) -> Any:
        """Take the rows of a table, and go on from the last one with the next: a recording in pieces. Of dates and times the first of
        the first piece is 0 s.
        """
        table, doubts = self._core.run(_tables.to_arrow(rows, self._origin), _about(**about))
        _warn(doubts)
        return _tables.converter(rows)(_tables.from_core(table))

    def rest_resistance(self, measured: float) -> None:
        """What the rested, unstretched sensor is found to read from now on."""
        self._core.rest_resistance(measured)

    def state(self) -> str:
        """All that the next row depends on, as the text of a state file."""
        return self._core.store(self._origin.first_ns)

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write a state file, whole or not at all: for ``sensor.filter(resume=path)`` and ``ohmstrain filter --resume``."""
        _write(path, self.state())

    def __reduce__(self) -> tuple[Any, ...]:
        return _resumed, (self._sensor, self._options, None, self.state())


class LaggedFilter:
    """A running filter that waits: each row is estimated from the readings up to a fixed lag after it. It is kept as a
    :class:`LiveFilter` is, with the rows that wait.
    """

    def __init__(self, core: _core.LaggedFilter, sensor: Sensor, options: Mapping[str, Any], lag_s: float) -> None:
        self._core = core
        self._sensor, self._options, self._lag_s = sensor, _of_later(options), lag_s

    def step(self, time_s: float, reading: float | None = None) -> list[dict[str, Any]]:
        """Take a reading; the rows that have become due."""
        return self._core.step(time_s, reading)

    def finish(self) -> list[dict[str, Any]]:
        """The rows that still wait."""
        return self._core.finish()

    def rest_resistance(self, measured: float) -> None:
        """What the rested, unstretched sensor is found to read from now on."""
        self._core.rest_resistance(measured)

    def state(self) -> str:
        """All that the next row depends on, as the text of a state file."""
        return self._core.store()

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write a state file, whole or not at all: for ``sensor.filter(lag_s=…, resume=path)`` and ``ohmstrain filter --resume``."""
        _write(path, self.state())

    def __reduce__(self) -> tuple[Any, ...]:
        return _resumed, (self._sensor, self._options, self._lag_s, self.state())


def _of_later(options: Mapping[str, Any]) -> dict[str, Any]:
    """Options without what a state knows: the start, R₀ and known strains."""
    return {name: value for name, value in options.items() if name not in ("initial_strain", "rest_resistance", "known")}


def _resumed(
    sensor: Sensor, options: dict[str, Any], lag_s: float | None, state: str, file: str | None = None
) -> LiveFilter | LaggedFilter:
    if lag_s is not None:
        core = sensor._core.resume_lagged(_options(**options), lag_s, state, file)
        return LaggedFilter(core, sensor, options, lag_s)
    live = LiveFilter(sensor._core.resume(_options(**options), state, file), sensor, options)
    live._origin.first_ns = live._core.zero_ns
    return live


def calibrate(
    recordings: Any,
    *,
    estimator: str = "auto",
    branches: int | None = None,
    gauge: str = "auto",
    prior: Prior | str | os.PathLike[str] | None = None,
    align: bool = False,
    **about: Any,
) -> Sensor:
    """Calibrate a sensor on recordings with known strain.

    Parameters
    ----------
    recordings
        Tables, each with a reference, or one table; or a dict of tables by the names that messages call them.
    estimator : str
        The estimator to calibrate and to make the default; ``auto`` is what the command line does.
    branches : int
        Relaxing branches of the law, 0 to 4, in place of what the filter does best with.
    gauge : str
        Family of the quasi-static curve: ``auto``, ``polynomial``, ``decaying-exponential`` or ``tunnelling``.
    prior : Prior
        What other sensors of the make have taught, or the path of a ``prior.toml``: a short motion is enough then. It brings
        the law's structure; ``branches`` and ``gauge`` do not count.
    align : bool
        Move a reference that is late or early to where the readings say it belongs. Without it, one that is certainly too late is
        an error, one that may be a warning.
    gauge_length_mm, front_end, joint, strain_unit, resistance_unit
        What stands above the header of a trace CSV. Units that are said, ``percent`` or ``fraction`` and ``kohm`` or ``ohm``, are not
        asked about. A table of :func:`ohmstrain.read` knows them.

    Returns
    -------
    Sensor
        The same as ``ohmstrain calibrate`` writes, but for the recordings' names.

    Raises
    ------
    OhmstrainError
        Names recording, row and column; or says what recordings lack.
    """
    if isinstance(recordings, Mapping) and not any(name in _tables.COLUMNS for name in recordings):
        named = list(recordings.items())
    elif isinstance(recordings, (list, tuple)):
        named = [(None, recording) for recording in recordings]
    else:
        named = [(None, recordings)]
    tables = [(_tables.to_arrow(table), _about(name=name, **about)) for name, table in named]
    core, doubts = _core.calibrate(tables, _choices(estimator, branches, gauge, prior, align))
    _warn(doubts)
    return Sensor(core)
