"""Tables of any kind as Arrow tables, and back."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import pyarrow as pa

#: Columns of readings, and of a recording; others are not handed over.
READINGS = ("time_s", "time_us", "resistance_ohm", "resistance_ratio", "adc")
COLUMNS = (*READINGS, "strain", "displacement_mm", "angle_deg")


def to_arrow(table: Any) -> pa.Table:
    """The columns of a recording that a table has, without a copy where the table has them as Arrow has them."""
    refused = TypeError(f"expected a table (pandas, polars, pyarrow) or a dict of arrays, found {type(table).__name__}")
    if isinstance(table, (pa.Table, pa.RecordBatch)):
        arrow = table
    elif isinstance(table, Mapping):
        arrow = pa.table({name: _array(column) for name, column in table.items() if name in COLUMNS})
    elif _is_pandas(table):
        known = table[[name for name in table.columns if name in COLUMNS]]
        arrow = pa.Table.from_pandas(known, preserve_index=False)
    elif hasattr(table, "__arrow_c_stream__"):
        try:
            arrow = pa.table(table)
        except pa.ArrowInvalid as error:  # A single column is a stream as well.
            raise refused from error
    else:
        raise refused
    known = [name for name in arrow.column_names if name in COLUMNS]
    # Without a known column all names go on, for the message that says what is missing.
    return arrow if known in ([], arrow.column_names) else arrow.select(known)


def from_core(batch: Any) -> pa.Table:
    """What the compiled part gives back."""
    return pa.Table.from_batches([pa.record_batch(batch)])


def converter(like: Any) -> Callable[[Any], Any]:
    """What turns an Arrow table into one of the kind of ``like``."""
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
    """A column as Arrow takes it without a look at each cell."""
    return column if isinstance(column, (pa.Array, pa.ChunkedArray)) else pa.array(column)


def _is_pandas(table: Any) -> bool:
    return type(table).__module__.split(".")[0] == "pandas" and hasattr(table, "columns")
