"""Recordings in a Ray dataset: ``pip install 'ohmstrain[ray]'``.

As :mod:`ohmstrain.spark`: each group of rows with the same keys is a recording, a bad one gives a row with a text in the
column ``error``, and doubts are in ``warnings``.

>>> from ohmstrain import ray as oh_ray
>>> oh_ray.smooth(ray.data.read_parquet("recordings"), sensors).write_parquet("estimates")     # doctest: +SKIP
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import pyarrow as pa

from ._groups import BY, Work

if TYPE_CHECKING:
    from ray.data import Dataset


def filter(ds: Dataset, sensors: Any, by: Iterable[str] = BY, **options: Any) -> Dataset:
    """Filter each recording: estimates from the readings up to each row. See :func:`ohmstrain.spark.filter`."""
    return _grouped(ds, Work("filter", by, sensors, **options))


def smooth(ds: Dataset, sensors: Any, by: Iterable[str] = BY, **options: Any) -> Dataset:
    """Smooth each recording: estimates from all its readings. See :func:`ohmstrain.spark.smooth`."""
    return _grouped(ds, Work("smooth", by, sensors, **options))


def evaluate(ds: Dataset, sensors: Any, by: Iterable[str] = BY, **options: Any) -> Dataset:
    """Score each recording in one row. See :func:`ohmstrain.spark.evaluate`."""
    return _grouped(ds, Work("evaluate", by, sensors, **options))


def calibrate(ds: Dataset, by: Iterable[str] = ("sensor_id",), **choices: Any) -> Dataset:
    """Calibrate a sensor per group. See :func:`ohmstrain.spark.calibrate`."""
    return _grouped(ds, Work("calibrate", by, **choices))


def _grouped(ds: Dataset, work: Work) -> Dataset:
    schema = ds.schema()
    names = schema.names if schema else []
    work.check(dict(zip(names, schema.types)) if schema else {})
    needed = work.needed(names)
    ds = ds if needed == names else ds.select_columns(needed)

    def one(group: pa.Table) -> pa.Table:
        return work(group)

    return ds.groupby(work.by if len(work.by) > 1 else work.by[0]).map_groups(one, batch_format="pyarrow")
