"""Tables of every kind, and what is wrong with them."""

import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pytest

import ohmstrain as oh


def test_the_kind_comes_back(trace, sensor):
    columns = ["time_s", "resistance_ohm"]
    first = trace[columns].head(200)
    expected = sensor.smooth(first)
    arrow = pa.Table.from_pandas(first, preserve_index=False)
    kinds = {
        pd.DataFrame: first,
        pl.DataFrame: pl.from_pandas(first),
        pa.Table: arrow,
        pa.RecordBatch: arrow.to_batches()[0],
        dict: {name: first[name].to_numpy() for name in columns},
    }
    for kind, recording in kinds.items():
        found = sensor.smooth(recording)
        assert isinstance(found, kind)
        np.testing.assert_array_equal(np.asarray(found["strain"]), expected["strain"].to_numpy())
    shifted = first.set_axis(first.index + 7)
    assert (sensor.smooth(shifted).index == shifted.index).all()
    chunked = pa.concat_tables([arrow.slice(0, 50), arrow.slice(50)])
    np.testing.assert_array_equal(sensor.smooth(chunked)["strain"], expected["strain"].to_numpy())
    nothing = sensor.smooth(first.assign(resistance_ohm=np.nan))
    assert sensor.smooth(first.assign(resistance_ohm=None)).equals(nothing)


def test_units_are_converted(trace, sensor):
    first = trace.head(300)
    micro = pd.DataFrame({"time_us": (first["time_s"] * 1e6).round().astype("int64"), "resistance_ohm": first["resistance_ohm"]})
    np.testing.assert_allclose(sensor.filter(micro)["strain"], sensor.filter(first)["strain"], rtol=1e-9, atol=1e-12)
    moved = first.rename(columns={"strain": "displacement_mm"}).assign(displacement_mm=30 * first["strain"])
    scores = sensor.evaluate(moved, gauge_length_mm=30.0)
    # 30 ε / 30 is off by a rounding at most, so that the errors' mean square is, too.
    assert scores.filter.rmse == pytest.approx(sensor.evaluate(first).filter.rmse, rel=1e-12)


@pytest.mark.parametrize(
    ("change", "row", "column", "text"),
    [
        (lambda t: t.assign(resistance_ohm=t["resistance_ohm"].where(t.index != 5, -1.0)), 5, "resistance_ohm", "positive"),
        (lambda t: t.assign(time_s=t["time_s"].where(t.index != 7, 0.0)), 7, "time_s", "a time after"),
        (lambda t: t.assign(resistance_ohm="x"), None, "resistance_ohm", "numbers"),
        (lambda t: t.assign(resistance_ohm=t["resistance_ohm"] / 1000), None, "resistance_ohm", "kilo-ohms"),
        (lambda t: t.drop(columns="resistance_ohm"), None, None, "resistance_ratio"),
        (lambda t: t.head(0), None, None, "at least one row"),
    ],
)
def test_errors_name_the_place(trace, sensor, change, row, column, text):
    with pytest.raises(oh.OhmstrainError, match=text) as raised:
        sensor.smooth(change(trace.head(100)), name="knee 3")
    assert (raised.value.file, raised.value.row, raised.value.column) == ("knee 3", row, column)
    assert str(raised.value).startswith("knee 3: ")
    assert str(raised.value).count("column") <= 1 + (row is None and "resistance_ratio" in text)
    for no_table in ([1, 2, 3], trace["resistance_ohm"]):
        with pytest.raises(TypeError, match="expected a table"):
            sensor.smooth(no_table)


def test_the_users_columns_are_named(trace, sensor):
    first = trace.head(50)[["time_s", "resistance_ohm"]].rename(columns={"time_s": "t"}).assign(other=1.0)
    for table in (first, first.to_dict("list"), pa.Table.from_pandas(first, preserve_index=False), pl.from_pandas(first)):
        with pytest.raises(oh.OhmstrainError, match="expected a column `time_s` or `time_us`, found `t,resistance_ohm,other`"):
            sensor.filter(table)


def test_a_column_that_exists_twice(trace, sensor):
    time_s, ohm = trace["time_s"].head(50), trace["resistance_ohm"].head(50)
    for names in (["time_s", "resistance_ohm", "resistance_ohm"], ["time_s", "resistance_ohm", "resistance_ohm", "other"]):
        table = pa.table([time_s, ohm, 2 * ohm, ohm][: len(names)], names=names)
        with pytest.raises(oh.OhmstrainError, match="found `resistance_ohm` and `resistance_ohm`"):
            sensor.filter(table)


def test_errors_of_python_have_a_place(trace, sensor):
    with pytest.raises(oh.OhmstrainError) as raised:
        oh.Hand.load(__file__)
    assert (raised.value.file, raised.value.row, raised.value.column) == (__file__, None, None)
    stamps = np.arange(2).astype("datetime64[s]")
    with pytest.raises(oh.OhmstrainError, match="one column of times") as raised:
        sensor.filter({"a": stamps, "b": stamps, "resistance_ohm": [1600.0, 1601.0]})
    assert (raised.value.file, raised.value.row, raised.value.column) == (None, None, None)


def test_a_reference_is_needed_where_it_is(trace):
    with pytest.raises(oh.OhmstrainError, match="expected a reference"):
        oh.calibrate([trace.drop(columns="strain")])
    with pytest.raises(oh.OhmstrainError, match="rows"):
        oh.calibrate([trace.head(5)])
