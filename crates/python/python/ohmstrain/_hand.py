"""Several joints in one recording."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from . import _core, _tables
from ._fused import FusedSensor
from ._sensor import Sensor, _about


class Hand:
    """All joints of a ``hand.toml``, as ``ohmstrain calibrate`` makes it from a recording with a column of readings for each channel.

    >>> hand = oh.Hand.load("hand.toml")                 # doctest: +SKIP
    >>> angles = hand.filter(recording)                  # doctest: +SKIP
    >>> hand.filter().step(0.0, {"index_ohm": 1612.0, "thumb_ohm": None})["index_deg"]  # doctest: +SKIP
    """

    def __init__(self, joints: list[_Joint]) -> None:
        self._joints = joints

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Hand:
        """Read ``hand.toml``, and the sensors and fusions beside it."""
        found = _core.read_hand(Path(path).read_text(encoding="utf-8"), os.fspath(path))
        return cls([_Joint(joint, Path(path).parent) for joint in found])

    @property
    def joints(self) -> list[str]:
        """Names of the joints."""
        return [joint.name for joint in self._joints]

    @property
    def columns(self) -> list[str]:
        """Columns of a recording that are read, one for each channel."""
        return [channel["column"] for joint in self._joints for channel in joint.channels]

    def filter(self, recording: Any = None) -> Any:
        """Filter a recording, each row from the readings up to it; or, without a recording, create a filter for live readings.

        Parameters
        ----------
        recording
            A table with ``time_s`` or ``time_us`` and the columns of :attr:`columns`.

        Returns
        -------
        A table of the recording's kind with the columns of ``ohmstrain hand``: ``time_s``; for each joint ``NAME_deg`` and
        ``NAME_sd_deg``, or ``NAME_strain`` and ``NAME_strain_sd``; and ``flags``. Or a :class:`HandFilter`.
        """
        return HandFilter(self._joints) if recording is None else self._estimate(recording, False)

    def smooth(self, recording: Any) -> Any:
        """Smooth a recording: each estimate uses all readings. The result is that of :meth:`filter`."""
        return self._estimate(recording, True)

    def _estimate(self, recording: Any, smooths: bool) -> Any:
        table = _table(recording, self.columns)
        columns, flags = {}, []
        for joint in self._joints:
            row, of_joint = joint.estimate(table, smooths)
            columns.setdefault("time_s", row["time_s"])
            columns.update(zip(joint.columns, joint.value(row), strict=True))
            flags.append(of_joint)
        columns["flags"] = ["|".join(filter(None, words)) for words in zip(*flags, strict=True)]
        return _tables.converter(recording)(pa.table(columns))


class HandFilter:
    """A running filter of all joints: the readings of all channels in, all angles out."""

    def __init__(self, joints: list[_Joint]) -> None:
        self._joints = [(joint, joint.live()) for joint in joints]

    def step(self, time_s: float, readings: Mapping[str, float | None]) -> dict[str, Any]:
        """Take the readings at a time, s, by their columns; one that is missing is None, NaN or not there.

        The result has the columns of :meth:`Hand.filter`. ``front_end`` and ``joint`` in ``hand.toml``, and ``rest_resistance`` of fused
        channels, are for recordings, and refused here: a live filter takes ohms or ratios, as the sensors were calibrated.
        """
        row: dict[str, Any] = {"time_s": time_s}
        flags = []
        for joint, running in self._joints:
            found = [readings.get(channel["column"]) for channel in joint.channels]
            estimate = running.step(time_s, found) if joint.fused else running.step(time_s, found[0])
            row.update(zip(joint.columns, joint.value(estimate), strict=True))
            flags.append(joint.live_flags(estimate))
        row["flags"] = "|".join(filter(None, flags))
        return row


class _Joint:
    """A joint with its channels and their sensors."""

    def __init__(self, found: dict[str, Any], folder: Path) -> None:
        self.name: str = found["name"]
        self.channels: list[dict[str, Any]] = found["channels"]
        self.spec: str | None = found["joint"]
        self.sensors = [Sensor.load(folder / channel["sensor"]).without_temperature() for channel in self.channels]
        self.fused = None
        if found["fusion"] is not None:
            path = folder / found["fusion"]
            self.fused = FusedSensor(self.sensors, path.read_text(encoding="utf-8"), os.fspath(path))
        has_joint = self.spec is not None or any(sensor.params.get("joint") for sensor in self.sensors)
        is_strain = not has_joint and all(sensor.quantity == "strain" for sensor in self.sensors)
        self.columns = [f"{self.name}_strain", f"{self.name}_strain_sd"] if is_strain else [f"{self.name}_deg", f"{self.name}_sd_deg"]
        self.spans = has_joint

    def value(self, row: Any) -> tuple[Any, Any]:
        """Return what is reported of a row or of a table, and its standard deviation."""
        known = row.column_names if isinstance(row, pa.Table) else row
        if self.spans or "strain" not in known:
            return row["angle_deg"], row["angle_sd"]
        return row["strain"], row["strain_sd"]

    def estimate(self, table: pa.Table, smooths: bool) -> tuple[pa.Table, list[str]]:
        """Return the joint's estimates of a recording, and its flags in each row."""
        tables = [self._of_channel(table, k) for k in range(len(self.channels))]
        if self.fused is None:
            channel, sensor = self.channels[0], self.sensors[0]
            method = sensor.smooth if smooths else sensor.filter
            rested = channel["rest_resistance"]
            row = method(tables[0], rest_resistance=rested, **self._about(channel))
            return row, [_named(self.name, words) for words in row["flags"].to_pylist()]
        arguments = zip(tables, self.channels, strict=True)
        channels = [(one, _about(**self._about(channel)), channel["rest_resistance"]) for one, channel in arguments]
        row = _tables.from_core(self.fused._core.estimate(channels, smooths))
        of_channels = zip(*(row[f"flags_{k}"].to_pylist() for k in range(len(self.channels))), strict=True)
        judged = zip(row["is_unlike"].to_pylist(), row["faulty"].to_pylist(), of_channels, strict=True)
        return row, [self._flags(unlike, faulty, words) for unlike, faulty, words in judged]

    def live(self) -> Any:
        """Create a filter for live readings."""
        if self.spec is not None:
            raise _core.OhmstrainError(f"joint `{self.name}`: `joint` in hand.toml is for recordings, not for a live filter")
        if any(channel["front_end"] is not None for channel in self.channels):
            raise _core.OhmstrainError(f"joint `{self.name}`: `front_end` in hand.toml is for recordings, not for a live filter")
        rested = [channel["rest_resistance"] for channel in self.channels]
        if self.fused is None:
            return self.sensors[0].filter(rest_resistance=rested[0])
        if any(reading is not None for reading in rested):
            raise _core.OhmstrainError(f"joint `{self.name}`: rest_resistance of fused channels is for recordings")
        return self.fused.filter()

    def live_flags(self, row: dict[str, Any]) -> str:
        """Return the flags of a live row."""
        if self.fused is None:
            return _named(self.name, row["flags"])
        return self._flags(row["is_unlike"], row["faulty"], row["flags"])

    def _flags(self, unlike: bool, faulty: int | None, words: Any) -> str:
        flags = [f"{self.name}:unlike_calibration"] if unlike else []
        if faulty is not None:
            flags.append(f"{self.channels[faulty]['column']}:faulty")
        flags += [_named(channel["column"], of_channel) for channel, of_channel in zip(self.channels, words, strict=True)]
        return "|".join(filter(None, flags))

    def _about(self, channel: dict[str, Any]) -> dict[str, Any]:
        return {"name": channel["column"], "front_end": channel["front_end"], "joint": self.spec}

    def _of_channel(self, table: pa.Table, k: int) -> pa.Table:
        """Return the recording of a channel."""
        reading = "adc" if self.channels[k]["front_end"] is not None else self.sensors[k].reading
        time = "time_s" if "time_s" in table.column_names else "time_us"
        return pa.table({time: table[time], reading: table[self.channels[k]["column"]]})


def _named(name: str, words: str) -> str:
    return "|".join(f"{name}:{word}" for word in words.split("|") if word)


def _table(recording: Any, wanted: list[str]) -> pa.Table:
    """Return the times and these columns of a table of any kind."""
    if isinstance(recording, Mapping):
        has = list(recording)
    elif hasattr(recording, "columns") and not isinstance(recording, (pa.Table, pa.RecordBatch)):
        has = list(recording.columns)
    else:
        recording = pa.table(recording)
        has = recording.column_names
    times = [name for name in _tables.TIMES if name in has]
    missing = [name for name in wanted if name not in has]
    if not times or missing:
        expected = missing[0] if times else "time_s"
        raise _core.OhmstrainError(f"expected a column `{expected}`, found `{','.join(map(str, has))}`")

    def column(name: str) -> Any:
        cells = recording[name]
        return cells if isinstance(cells, (pa.Array, pa.ChunkedArray)) else pa.array(np.asarray(cells), from_pandas=True)

    return _tables.in_seconds(pa.table({name: column(name) for name in (times[0], *wanted)}), _tables.Origin())
