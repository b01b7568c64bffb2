"""Columns of dates and times, and of durations, in every kind of table."""

from datetime import datetime, timedelta, timezone

import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pytest

import ohmstrain as oh
from ohmstrain._tables import to_arrow

START = np.datetime64("2025-10-31T18:35:45.123456789")


@pytest.fixture(scope="module")
def recording(trace):
    """The first 200 rows at 5 Hz; times from 0 s."""
    first = trace.head(200)[["resistance_ohm", "strain"]]
    return first.assign(time_s=np.arange(200) * 200_000_000 / 1e9)


def passed(unit):
    return (np.arange(200) * 200_000_000).astype("timedelta64[ns]").astype(f"timedelta64[{unit}]")


def tables(recording):
    """The same recording in other clocks."""
    rest = recording[["resistance_ohm", "strain"]]
    for unit in ("ms", "us", "ns"):
        moments = START.astype(f"datetime64[{unit}]") + passed(unit)
        yield rest.assign(time_s=moments)
        yield rest.set_index(pd.DatetimeIndex(moments, tz="Europe/Berlin"))
        yield rest.assign(stamp=moments)
        yield {"time_s": moments, "resistance_ohm": rest["resistance_ohm"].to_numpy(), "strain": rest["strain"].to_numpy()}
        yield pa.table({"when": pa.array(moments), "resistance_ohm": rest["resistance_ohm"], "strain": rest["strain"]})
        yield pl.from_pandas(rest).with_columns(pl.Series("time_s", moments))
        yield rest.assign(time_s=passed(unit))
        yield rest.set_index(pd.TimedeltaIndex(passed(unit)))
        yield {"when": pa.array(moments), **rest.to_dict("list")}
        yield {"when": pl.Series(moments), **rest.to_dict("list")}
    begin = datetime(2025, 3, 30, 0, 59, 50, tzinfo=timezone.utc)
    yield {**rest.to_dict("list"), "when": [begin + timedelta(seconds=0.2 * k) for k in range(200)]}
    yield {**rest.to_dict("list"), "time_s": [begin + timedelta(seconds=0.2 * k) for k in range(200)]}


def test_every_clock_gives_the_same(recording, sensor):
    expected = sensor.smooth(recording)
    for table in tables(recording):
        found = sensor.smooth(table)
        for name in ("time_s", "strain", "strain_sd"):
            np.testing.assert_array_equal(np.asarray(found[name]), expected[name].to_numpy(), err_msg=str(type(table)))
    assert sensor.filter(next(tables(recording)))["strain"].equals(sensor.filter(recording)["strain"])
    quick = {"estimator": "ekf", "branches": 1}
    by_index = recording.drop(columns="time_s").set_index(pd.DatetimeIndex(START + passed("ns")))
    assert oh.calibrate(by_index, **quick) == oh.calibrate(recording, **quick)


def test_seconds_are_the_nearest_doubles():
    # A year apart, in nanoseconds that no double holds.
    ticks = np.array([7, 8, 1_000_000_007, 31_536_000_123_456_789, 31_536_000_123_456_796], dtype="int64")
    table = {"time_s": ticks.astype("datetime64[ns]"), "resistance_ohm": np.full(5, 1600.0)}
    found = to_arrow(table)["time_s"].to_pylist()
    assert found == [int(tick - 7) / 10**9 for tick in ticks]


def test_pieces_have_one_clock(recording, sensor):
    moments = recording.assign(time_s=START + passed("ns"))
    whole = sensor.filter(moments)
    live = sensor.filter()
    pieces = [live.run(part) for part in (moments.head(70), moments.iloc[70:71], moments.iloc[71:])]
    pd.testing.assert_frame_equal(pd.concat(pieces), whole)


def test_durations_keep_their_zero(recording, sensor):
    later = recording.assign(time_s=passed("ns") + np.timedelta64(90, "s"))
    assert sensor.filter(later)["time_s"].iloc[0] == 90.0


def test_times_that_are_missing_or_twofold(recording, sensor):
    moments = recording.assign(time_s=pd.Series(START + passed("ns")).where(recording.index != 3))
    with pytest.raises(oh.OhmstrainError, match="row 3: column `time_s`: expected a time, found none") as raised:
        sensor.filter(moments)
    assert raised.value.row == 3
    twofold = recording.drop(columns="time_s").assign(sent=START + passed("ns"), came=START + passed("ns"))
    with pytest.raises(oh.OhmstrainError, match="expected one column of times, found `sent`, `came`; call the right one `time_s`"):
        sensor.filter(twofold)
    # A column of seconds is the time, whatever others there are.
    assert sensor.filter(recording.assign(came=START + passed("ns"))).equals(sensor.filter(recording))


@pytest.mark.filterwarnings("ignore::ohmstrain.OhmstrainWarning")
@pytest.mark.parametrize("name", ["time", "time_s", "stamp"])
@pytest.mark.parametrize("unit", ["ms", "us", "ns"])
def test_files_with_dates_and_durations(recording, tmp_path, name, unit):
    feather, parquet = pytest.importorskip("pyarrow.feather"), pytest.importorskip("pyarrow.parquet")
    for times in (START.astype(f"datetime64[{unit}]") + passed(unit), passed(unit)):
        table = pa.table({name: pa.array(times), "resistance_ohm": recording["resistance_ohm"]})
        parquet.write_table(table, tmp_path / "run.parquet")
        feather.write_feather(table, tmp_path / "run.feather")
        for file in ("run.parquet", "run.feather"):
            found = oh.read(tmp_path / file)
            assert found["time_s"].to_pylist() == recording["time_s"].to_list(), (file, times.dtype)
            assert found["resistance_ohm"].to_pylist() == recording["resistance_ohm"].to_list()
