"""Recordings in a Dask dataframe: ``pip install 'ohmstrain[dask]'``.

As :mod:`ohmstrain.spark`: each group of rows with the same keys is a recording, a bad one gives a row with a text in the
column ``error``, and doubts are in ``warnings``.

>>> from ohmstrain import dask as oh_dask
>>> oh_dask.smooth(dask.dataframe.read_parquet("recordings"), sensors).to_parquet("estimates")     # doctest: +SKIP
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import pyarrow as pa

from ._groups import BY, Work
from ._tables import COLUMNS

if TYPE_CHECKING:
    from dask.dataframe import DataFrame


def filter(df: DataFrame, sensors: Any, by: Iterable[str] = BY, **options: Any) -> DataFrame:
    """Filter each recording: estimates from the readings up to each row. See :func:`ohmstrain.spark.filter`."""
    return _grouped(df, Work("filter", by, sensors, **options))


def smooth(df: DataFrame, sensors: Any, by: Iterable[str] = BY, **options: Any) -> DataFrame:
    """Smooth each recording: estimates from all its readings. See :func:`ohmstrain.spark.smooth`."""
    return _grouped(df, Work("smooth", by, sensors, **options))


def evaluate(df: DataFrame, sensors: Any, by: Iterable[str] = BY, **options: Any) -> DataFrame:
    """Score each recording in one row. See :func:`ohmstrain.spark.evaluate`."""
    return _grouped(df, Work("evaluate", by, sensors, **options))


def calibrate(df: DataFrame, by: Iterable[str] = ("sensor_id",), **choices: Any) -> DataFrame:
    """Calibrate a sensor per group. See :func:`ohmstrain.spark.calibrate`."""
    return _grouped(df, Work("calibrate", by, **choices))


def _grouped(df: DataFrame, work: Work) -> DataFrame:
    known = [name for name in df.columns if name in work.by or name in COLUMNS]
    schema = pa.Schema.from_pandas(df._meta_nonempty[known], preserve_index=False)
    work.check({**dict.fromkeys(df.columns), **dict(zip(schema.names, schema.types))})
    needed = df[work.needed(df.columns)]
    types = {key: needed._meta[key].dtype for key in work.by}
    empty = work.schema({key: schema.field(key).type for key in work.by}).empty_table().to_pandas().astype(types)

    def of_partition(rows: Any) -> Any:
        groups = rows.groupby(work.by, sort=False, observed=True, dropna=False)
        done = [work(pa.Table.from_pandas(group, preserve_index=False)) for _, group in groups]
        return pa.concat_tables(done).to_pandas().astype(types) if done else empty

    # All rows of a recording go into one partition; nothing else is needed from Dask.
    return needed.shuffle(on=work.by).map_partitions(of_partition, meta=empty)
