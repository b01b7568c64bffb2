"""Conversion of tables of any kind to Arrow tables, and back."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pyarrow as pa

from . import _core

#: Columns of times.
TIMES = ("time_s", "time_us")
#: Columns of readings, and of a recording; others are not passed on.
READINGS = ("time_s", "time_us", "resistance_ohm", "resistance_ratio", "adc", "temperature_c")
COLUMNS = (*READINGS, "strain", "displacement_mm", "angle_deg")


class Origin:
    """Time of 0 s: the first one in a column of dates and times."""

    def __init__(self, first_ns: int | None = None) -> None:
        self.first_ns = first_ns


def to_arrow(table: Any, origin: Origin | None = None) -> pa.Table:
    """Return the columns of a recording in a table, without a copy if they have Arrow's layout.

    Timestamps become seconds from the origin, or from the first row without one; durations become seconds.
    """
    refused = TypeError(f"expected a table (pandas, polars, pyarrow) or a dict of arrays, found {type(table).__name__}")
    if isinstance(table, (pa.Table, pa.RecordBatch)):
        arrow = table
    elif isinstance(table, Mapping):
        wanted = _wanted(list(table), lambda name: _is_time_column(table[name]))
        arrow = pa.table({name: _array(table[name]) for name in wanted})
    elif _is_pandas(table):
        wanted = _wanted(list(table.columns), lambda name: _is_time_kind(table.dtypes[name]))
        arrow = pa.Table.from_pandas(table[wanted], preserve_index=False)
        if not any(name in TIMES for name in wanted) and _is_time_kind(table.index.dtype):
            arrow = arrow.append_column("time_s", pa.array(table.index))
    elif hasattr(table, "__arrow_c_stream__"):
        try:
            arrow = pa.table(table)
        except pa.ArrowInvalid as error:  # A single column is a stream as well.
            raise refused from error
    else:
        raise refused
    known = _wanted(arrow.column_names, lambda name: _is_time(arrow.schema.field(name).type))
    places = [place for place, name in enumerate(arrow.column_names) if name in known]
    names = table if isinstance(table, Mapping) else table.columns if _is_pandas(table) else arrow.column_names
    # All names, for the message about a missing column.
    metadata = {**(arrow.schema.metadata or {}), "ohmstrain_columns": ",".join(map(str, names))}
    return in_seconds(arrow.select(places).replace_schema_metadata(metadata), origin or Origin())


def _wanted(names: list[str], is_time: Callable[[str], bool]) -> list[str]:
    """Return the columns of a recording; if none of them is the time, also the one with dates and times or durations."""
    known = [name for name in names if name in COLUMNS]
    if not any(name in TIMES for name in known):
        times = [name for name in names if name not in COLUMNS and is_time(name)]
        if len(times) > 1:
            listed = "`, `".join(str(name) for name in times)
            raise _core.OhmstrainError(f"expected one column of times, found `{listed}`; call the right one `time_s`")
        known = times + known
    return known


def _is_time_kind(dtype: Any) -> bool:
    """True if a dtype of numpy or pandas is a timestamp or a duration."""
    return getattr(dtype, "kind", None) in ("M", "m")


def _is_time_column(cells: Any) -> bool:
    """True if a column of a dict begins with timestamps or durations."""
    try:
        return _is_time(_array(cells[:100]).type)
    except (TypeError, ValueError, KeyError, pa.ArrowException):
        return False


def _is_time(kind: pa.DataType) -> bool:
    return pa.types.is_timestamp(kind) or pa.types.is_duration(kind)


def in_seconds(arrow: pa.Table, origin: Origin) -> pa.Table:
    """Convert the column of times, if they are timestamps or durations."""
    for place, field in enumerate(arrow.schema):
        if _is_time(field.type) and (field.name in TIMES or field.name not in COLUMNS):
            column = arrow.column(place)
            is_moment = pa.types.is_timestamp(field.type)
            passed = pa.array(seconds(column, field, origin if is_moment else Origin(0)))
            return pa.table(arrow).set_column(place, "time_s", passed)
    return arrow


def seconds(column: Any, field: pa.Field, origin: Origin) -> np.ndarray:
    """Return seconds from the origin, each rounded to the nearest double."""
    column = column.combine_chunks() if isinstance(column, pa.ChunkedArray) else column
    if column.null_count:
        row = column.is_null().to_pylist().index(True)
        error = _core.OhmstrainError(f"row {row}: column `{field.name}`: expected a time, found none")
        error.row, error.column = row, field.name
        raise error
    ticks = column.cast(pa.int64()).to_numpy()
    tick_ns = {"s": 10**9, "ms": 10**6, "us": 10**3, "ns": 1}[field.type.unit]
    if origin.first_ns is None and len(ticks):
        origin.first_ns = int(ticks[0]) * tick_ns
    first_ns = origin.first_ns or 0
    if first_ns % tick_ns:
        ticks, tick_ns = ticks * tick_ns, 1
    passed, per_second = ticks - first_ns // tick_ns, 10**9 // tick_ns
    if not len(passed) or abs(passed).max() <= 2**53:
        return passed / per_second
    # Python divides whole numbers of any size without rounding them first.
    return np.array([int(count) / per_second for count in passed])


def from_core(batch: Any) -> pa.Table:
    """Convert a result of the compiled part."""
    return pa.Table.from_batches([pa.record_batch(batch)])


def converter(like: Any) -> Callable[[Any], Any]:
    """Return a function that converts an Arrow table to the kind of ``like``."""
    if isinstance(like, Mapping):
        return lambda table: {
            name: column.to_numpy(zero_copy_only=False) for name, column in zip(table.column_names, table.columns)
        }
    if isinstance(like, pa.RecordBatch):
        return lambda table: table.combine_chunks().to_batches()[0]
    if _is_pandas(like):
        index = like.index
        return lambda table: table.to_pandas().set_axis(index)
    if type(like).__module__.split(".")[0] == "polars":
        import polars

        return polars.from_arrow
    return lambda table: table


def _array(column: Any) -> Any:
    """Convert a column to Arrow without visiting each cell."""
    return column if isinstance(column, (pa.Array, pa.ChunkedArray)) else pa.array(column)


def _is_pandas(table: Any) -> bool:
    return type(table).__module__.split(".")[0] == "pandas" and hasattr(table, "columns")
