"""From the resistance of a soft, stretchable strain sensor to strain, with an honest error bar.

A :class:`Sensor` is what a calibration knows: made by :func:`calibrate` of recordings with known strain, or read from a
``sensor.toml``. It filters and smooths recordings, and makes filters for readings as they come.

>>> import ohmstrain as oh
>>> sensor = oh.calibrate([bench])                    # doctest: +SKIP
>>> estimates = sensor.smooth(recording)              # doctest: +SKIP

Recordings are tables: pandas, polars or pyarrow, anything else with the Arrow C stream interface, or a dict of arrays. Their
columns are those of a trace CSV: ``time_s`` or ``time_us``; ``resistance_ohm``, ``resistance_ratio`` or ``adc``; and, where
the strain is known, ``strain``, ``displacement_mm`` or ``angle_deg``. What is missing is null or NaN.
"""

from . import plot
from ._core import MADE_BY, OhmstrainError
from ._evaluation import Evaluation, Scores, evaluate
from ._fused import FusedFilter, FusedSensor
from ._read import read
from ._sensor import LaggedFilter, LiveFilter, OhmstrainWarning, Prior, Sensor, calibrate

__version__ = MADE_BY.split()[-1]

__all__ = [
    "Evaluation",
    "FusedFilter",
    "FusedSensor",
    "LaggedFilter",
    "LiveFilter",
    "OhmstrainError",
    "OhmstrainWarning",
    "Prior",
    "Scores",
    "Sensor",
    "calibrate",
    "evaluate",
    "plot",
    "read",
]
