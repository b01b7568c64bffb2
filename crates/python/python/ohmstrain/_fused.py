"""Several channels that measure one strain."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from . import _core
from ._sensor import Sensor


class FusedSensor:
    """Several sensors that measure one strain, as ``ohmstrain calibrate`` makes them from a recording with a column of readings each.

    >>> knee = oh.FusedSensor.load(["knee-knit1.toml", "knee-knit2.toml"], "knee-fusion.toml")  # doctest: +SKIP
    >>> knee.filter().step(0.0, [1.02, 1.31])["strain"]  # doctest: +SKIP
    """

    def __init__(self, sensors: Iterable[Sensor], text: str, file: str | None = None) -> None:
        """Fuse sensors by the text of a fusion file; ``file`` is its name in messages."""
        self._sensors = list(sensors)
        self._core = _core.FusedSensor([sensor._core for sensor in self._sensors], text, file)

    @classmethod
    def load(cls, sensors: Iterable[str | os.PathLike[str]], fusion: str | os.PathLike[str]) -> FusedSensor:
        """Read the sensor files of the channels, in the order of the fusion, and the fusion file."""
        text = Path(fusion).read_text(encoding="utf-8")
        return cls([Sensor.load(path) for path in sensors], text, os.fspath(fusion))

    def to_toml(self) -> str:
        """Return the text of the fusion file."""
        return self._core.to_toml()

    def filter(self) -> FusedFilter:
        """Create a running filter of all channels."""
        return FusedFilter(self._core.filter())

    def __reduce__(self) -> tuple[Any, ...]:
        return FusedSensor, (self._sensors, self.to_toml())


class FusedFilter:
    """A running filter of several channels: their readings in, one estimate out."""

    def __init__(self, core: _core.FusedFilter) -> None:
        self._core = core

    def step(self, time_s: float, readings: Sequence[float | None]) -> dict[str, Any]:
        """Take a reading of each channel at a time, s; a missing reading is None or NaN.

        The result contains ``strain`` (in degrees if the sensors were calibrated on an angle) with ``strain_sd``; ``angle_deg`` and
        ``angle_sd`` for sensors on a joint; ``faulty``, the index of a channel that disagrees with all others and was left out; and
        ``is_unlike``, true if the readings together are unlike any in the calibration; and ``flags``, those of each channel. An error leaves the filter as it was.
        """
        return self._core.step(time_s, list(readings))
