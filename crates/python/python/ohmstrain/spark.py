"""Recordings in a Spark DataFrame: ``pip install 'ohmstrain[spark]'``, Spark 4.0 or newer.

Each group of rows with the same keys is a recording. Rows may come in any order; they are put in order of time inside the
group. The result is the same as on one machine, to the bit. A recording that fails gives a row with a text in the column
``error``, and the job goes on. Warnings are in the column ``warnings``, in the recording's first row.

>>> from ohmstrain import spark as oh_spark
>>> done = oh_spark.smooth(df, sensors, by=["sensor_id", "recording_id"])     # doctest: +SKIP
>>> done.where("error is null").drop("error", "warnings").write.parquet("estimates")      # doctest: +SKIP
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

import pyarrow as pa
from pyspark.sql.pandas.types import from_arrow_schema, to_arrow_type

from ._groups import BY, Work
from ._tables import COLUMNS

if TYPE_CHECKING:
    from pyspark.sql import DataFrame


def filter(df: DataFrame, sensors: Any, by: Iterable[str] = BY, *, streaming: bool = False, **options: Any) -> DataFrame:
    """Filter each recording: estimates from the readings up to each row.

    Parameters
    ----------
    df
        Columns of a trace CSV, and the keys.
    sensors
        One :class:`ohmstrain.Sensor` (or its text) for all, or a dict of them by the first key.
    by
        Columns that distinguish recordings.
    streaming
        Keep one Arrow batch of a recording in memory at a time, whatever its length; needs Spark 4.1 and sorts by time on disk.
    **options
        As in :meth:`ohmstrain.Sensor.filter`.

    Returns
    -------
    DataFrame
        Keys and columns of ``estimates.csv``; ``warnings``, null except in the first row of a doubtful recording (of the batch
        in which the doubt arises, if ``streaming``); and ``error``, null except in the single row of a recording that fails.
    """
    work = Work("filter", by, sensors, **options)
    return _streamed(df, work) if streaming else _grouped(df, work)


def smooth(df: DataFrame, sensors: Any, by: Iterable[str] = BY, **options: Any) -> DataFrame:
    """Smooth each recording: estimates from all its readings. Parameters and result are those of :func:`filter`."""
    return _grouped(df, Work("smooth", by, sensors, **options))


def evaluate(df: DataFrame, sensors: Any, by: Iterable[str] = BY, **options: Any) -> DataFrame:
    """Score each recording in one row: errors in percent of full scale, coverage of the 95 % interval as a share."""
    return _grouped(df, Work("evaluate", by, sensors, **options))


def calibrate(df: DataFrame, by: Iterable[str] = ("sensor_id",), **choices: Any) -> DataFrame:
    """Calibrate a sensor per group; return the text of its ``sensor.toml``, with scores on held-out quarters."""
    return _grouped(df, Work("calibrate", by, **choices))


def _prepared(df: DataFrame, work: Work) -> tuple[DataFrame, Any]:
    """Return the columns that are passed on, and the schema of the result; refuse invalid tables before the job starts."""
    known = {*work.by, *COLUMNS}
    kinds = {name: to_arrow_type(df.schema[name].dataType) if name in known else None for name in df.columns}
    work.check(kinds)
    return df.select(work.needed(df.columns)), from_arrow_schema(work.schema(kinds))


def _grouped(df: DataFrame, work: Work) -> DataFrame:
    needed, schema = _prepared(df, work)

    def one(group: pa.Table) -> pa.Table:
        return work(group)

    return needed.groupBy(*work.by).applyInArrow(one, schema)


def _streamed(df: DataFrame, work: Work) -> DataFrame:
    needed, schema = _prepared(df, work)
    time = "time_s" if "time_s" in df.columns else "time_us"

    def pieces(batches: Iterator[pa.RecordBatch]) -> Iterator[pa.RecordBatch]:
        yield from work.stream(batches)

    # Grouping keeps the order inside a partition that is sorted by more than the keys; a filter refuses rows out of order.
    ordered = needed.repartition(*work.by).sortWithinPartitions(*work.by, time)
    return ordered.groupBy(*work.by).applyInArrow(pieces, schema)
