"""Recordings in one table: what an engine calls for each of them."""

import pickle

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest

import ohmstrain as oh
from ohmstrain._groups import Work

BY = ("sensor_id", "recording_id")


def fleet(trace, recordings=4, rows=300, bad=(2,)):
    """Recordings of two sensors, rows shuffled; those that are bad have a negative reading."""
    parts = []
    for k in range(recordings):
        part = trace.iloc[k * 20 : k * 20 + rows][["time_s", "resistance_ohm", "strain"]].copy()
        if k in bad:
            part.iloc[10, 1] = -1.0
        parts.append(part.assign(sensor_id=["left", "right"][k % 2], recording_id=k, other="x"))
    return pd.concat(parts).sample(frac=1, random_state=1)


def kinds(table):
    schema = pa.Schema.from_pandas(table, preserve_index=False)
    return dict(zip(schema.names, schema.types))


def of(table, recording):
    rows = table[table["recording_id"] == recording].sort_values("time_s")
    return rows.reset_index(drop=True)


def check(done, table, sensor, bad=(2,)):
    """Nothing lost, nothing doubled, and the numbers of one machine."""
    errors = done[done["error"].notna()]
    assert sorted(errors["recording_id"]) == list(bad)
    assert errors["error"].str.contains("expected a positive number").all()
    for k in set(table["recording_id"]) - set(bad):
        expected = sensor.smooth(of(table, k)[["time_s", "resistance_ohm"]])
        found = of(done, k)
        for name in ("time_s", "strain", "strain_sd", "nis"):
            np.testing.assert_array_equal(found[name].to_numpy(float), expected[name].to_numpy(float))


def test_work(trace, sensor):
    table = fleet(trace)
    work = pickle.loads(pickle.dumps(Work("smooth", BY, {"left": sensor, "right": sensor})))
    work.check(kinds(table))
    assert "other" not in work.needed(table.columns)
    groups = [pa.Table.from_pandas(group, preserve_index=False) for _, group in table.groupby(list(BY))]
    done = pa.concat_tables([work(group) for group in groups])
    assert done.schema.names == [*BY, *sensor.columns, "warnings", "error"]
    check(done.to_pandas(), table, sensor)


def test_columns_that_are_wanted(trace, sensor):
    group = pa.Table.from_pandas(trace.head(250).assign(sensor_id="left", recording_id=1), preserve_index=False)
    whole, joint = sensor.smooth(group), "prestrain=0.05 moment_arm_mm=4.4 gauge_length_mm=30"
    for columns, about in ((["time_s", "strain"], {}), (["strain", "flags"], {}), (["angle_deg"], {"joint": joint})):
        found = Work("smooth", BY, sensor, columns=columns, **about)(group)
        assert found.column_names == [*BY, *columns, "warnings", "error"]
        assert all(found[name].equals(whole[name]) for name in columns if name in whole.column_names)
    assert found["angle_deg"].null_count == 0
    everything = Work("smooth", BY, sensor, joint=joint)(group)
    assert everything["angle_deg"].equals(found["angle_deg"])
    filtered = Work("filter", BY, sensor, joint=joint)(group)
    pieces = Work("filter", BY, sensor, joint=joint).stream(iter(group.to_batches(max_chunksize=64)))
    assert pa.Table.from_batches(list(pieces))["angle_deg"].to_pylist() == filtered["angle_deg"].to_pylist()


def test_pieces_are_the_whole(trace, sensor):
    rows = trace.head(250)[["time_s", "resistance_ohm"]].assign(sensor_id="left", recording_id=1)
    batches = pa.Table.from_pandas(rows, preserve_index=False).to_batches(max_chunksize=64)
    work = Work("filter", BY, sensor)
    done = pa.Table.from_batches(list(work.stream(iter(batches)))).to_pandas()
    np.testing.assert_array_equal(done["strain"], sensor.filter(rows)["strain"])
    backwards = list(work.stream(iter(batches[::-1])))
    errors = pa.Table.from_batches(backwards).to_pandas()["error"].dropna()
    assert len(errors) == 1 and "time" in errors.iloc[0]


def test_doubts_stand_in_a_column(trace, sensor):
    readings = trace["resistance_ohm"] * np.where(trace.index < 200, 1.0, 3.0)
    rows = trace.head(250)[["time_s"]].assign(resistance_ohm=readings, sensor_id="left", recording_id=1)
    with pytest.warns(oh.OhmstrainWarning) as warned:
        sensor.filter(rows)
    table = pa.Table.from_pandas(rows, preserve_index=False)
    found = Work("filter", BY, sensor)(table)["warnings"]
    assert found[0].as_py() == "; ".join(str(one.message) for one in warned) and found.null_count == 249
    pieces = list(Work("filter", BY, sensor).stream(iter(table.to_batches(max_chunksize=64))))
    assert "".join(text for piece in pieces for text in piece["warnings"].drop_null().to_pylist()) == found[0].as_py()
    with pytest.warns(oh.OhmstrainWarning):
        sensor.filter().run(rows)


def test_scores_and_sensors(trace, sensor):
    rows = trace[["time_s", "resistance_ohm", "strain"]].assign(sensor_id="left", recording_id=1)
    group = pa.Table.from_pandas(rows, preserve_index=False)
    [scores] = Work("evaluate", BY, sensor)(group).to_pylist()
    assert scores["filter_percent_fs"] == sensor.evaluate(trace).filter.rmse_percent_fs
    [made] = Work("calibrate", ["sensor_id"], estimator="ekf")(group).to_pylist()
    assert oh.Sensor.from_toml(made["sensor_toml"]) == oh.calibrate(trace, estimator="ekf")
    assert made["error"] is None and made["coverage_95"] > 0.5


def test_what_cannot_work_is_refused_before(trace, sensor):
    with pytest.raises(oh.OhmstrainError, match="recording_id"):
        Work("smooth", BY, sensor).check(dict.fromkeys(["sensor_id", "time_s", "resistance_ohm"]))
    with pytest.raises(oh.OhmstrainError, match="resistance_ratio"):
        Work("smooth", BY, sensor).check(dict.fromkeys([*BY, "time_s"]))
    with pytest.raises(oh.OhmstrainError, match="as the sensors', `resistance_ohm`"):
        Work("smooth", BY, sensor).check(dict.fromkeys([*BY, "time_s", "resistance_ratio"]))
    table = fleet(trace)
    for wrong in (table.assign(resistance_ohm="x"), table.assign(time_s=pd.Timestamp("2020-01-01", tz="Europe/Berlin"))):
        with pytest.raises(oh.OhmstrainError, match="expected numbers"):
            Work("smooth", BY, sensor).check(kinds(wrong))
    with pytest.raises(oh.OhmstrainError, match="sensors"):
        Work("smooth", BY, {})
    with pytest.raises(oh.OhmstrainError, match="estimator"):
        Work("smooth", BY, sensor, estimator="kalman")
    for choice, value in (("estimator", "kalman"), ("gauge", "linear"), ("branches", 9)):
        with pytest.raises(oh.OhmstrainError, match=choice):
            Work("calibrate", BY, **{choice: value})
    with pytest.raises(oh.OhmstrainError, match="columns"):
        Work("smooth", BY, sensor, columns=["strian"])
    rows = trace.head(50).assign(sensor_id="unknown", recording_id=1)
    [row] = Work("smooth", BY, {"left": sensor})(pa.Table.from_pandas(rows, preserve_index=False)).to_pylist()
    assert "expected one for sensor_id `unknown`" in row["error"]
