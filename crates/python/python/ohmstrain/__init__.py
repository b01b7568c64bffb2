"""From the resistance of a soft, stretchable strain sensor to strain, with an honest error bar.

A :class:`Sensor` holds the result of a calibration: it is made by :func:`calibrate` from recordings with known strain, or read
from a ``sensor.toml``. It filters and smooths recordings, and creates filters for live readings.

>>> import ohmstrain as oh
>>> sensor = oh.calibrate([bench])                    # doctest: +SKIP
>>> estimates = sensor.smooth(recording)              # doctest: +SKIP

Recordings are tables: pandas, polars or pyarrow, anything else with the Arrow C stream interface, or a dict of arrays. Their
columns are those of a trace CSV: ``time_s`` or ``time_us``; ``resistance_ohm``, ``resistance_ratio`` or ``adc``; and, if
the strain is known, ``strain``, ``displacement_mm`` or ``angle_deg``. Missing values are null or NaN.
"""

from . import plot
from ._core import MADE_BY, OhmstrainError
from ._evaluation import Evaluation, Scores
from ._fused import FusedFilter, FusedSensor
from ._hand import Hand, HandFilter
from ._read import read
from ._sensor import LaggedFilter, LiveFilter, OhmstrainWarning, Prior, Sensor, calibrate, evaluate

__version__ = MADE_BY.split()[-1]

__all__ = [
    "Evaluation",
    "FusedFilter",
    "FusedSensor",
    "Hand",
    "HandFilter",
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
