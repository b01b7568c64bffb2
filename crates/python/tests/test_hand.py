"""Joints of a hand: the same numbers as ``ohmstrain hand`` and ``ohmstrain smooth`` print."""

import io

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest
from conftest import read, run

import ohmstrain as oh


@pytest.fixture(scope="module")
def hand(tmp_path_factory):
    """Return a folder with a knee of two fused channels and a thumb of one, whose column has converter codes."""
    folder = tmp_path_factory.mktemp("hand")
    time_s = 0.1 * np.arange(900)
    strain = 0.15 - 0.10 * np.cos(0.9 * time_s) - 0.05 * np.cos(0.33 * time_s + 1.0)
    rate = np.gradient(strain, time_s)
    chance = np.random.default_rng(1).normal(0.0, 0.01, (3, len(time_s)))
    thumb = 0.15 - 0.15 * np.cos(0.7 * time_s)
    ohm = 1000.0 * np.exp(np.stack([2 * strain + 0.3 * rate, 3 * strain - 2 * strain**2, 2.5 * thumb]) + chance)
    rows = [f"{t:.1f},{a:.2f},{b:.2f},{c:.2f},{e:.6f},{f:.6f}" for t, a, b, c, e, f in zip(time_s, *ohm, strain, thumb, strict=True)]
    header = "time_s,inner_ohm,outer_ohm,thumb_ohm,strain,thumb_strain"
    (folder / "hand.csv").write_text("\n".join([header, *rows]) + "\n")
    run(folder, "calibrate", "hand.csv", "-o", "hand.toml", "--estimator", "ekf")
    return folder


def assert_same(table, expected):
    assert list(table.columns) == list(expected.columns)
    for name in expected.columns:
        if name == "flags":
            assert list(table[name]) == [words if isinstance(words, str) else "" for words in expected[name]]
        else:
            np.testing.assert_array_equal(table[name].to_numpy(float), expected[name].to_numpy(float), err_msg=name)


def test_recordings_are_estimated_as_on_the_command_line(hand):
    table = read(hand / "hand.csv")
    table.loc[300:310, "inner_ohm"] = np.nan
    table.loc[500:510, "thumb_ohm"] = 1.0
    table.to_csv(hand / "faulty.csv", index=False)
    joints = oh.Hand.load(hand / "hand.toml")
    assert set(joints.joints) == {"hand", "thumb"} and len(joints.columns) == 3
    assert_same(joints.filter(table), read(io.StringIO(run(hand, "hand", "hand.toml", "faulty.csv"))))
    expected = read(io.StringIO(run(hand, "smooth", "faulty.csv", "--sensor", "hand.toml")))
    smoothed = joints.smooth(table)
    assert_same(smoothed, expected)
    # The result has the kind of the recording.
    of_dict = joints.smooth({name: table[name].to_numpy() for name in table.columns})
    np.testing.assert_array_equal(of_dict["thumb_strain"], smoothed["thumb_strain"].to_numpy(float))
    assert isinstance(joints.smooth(pa.Table.from_pandas(table)), pa.Table)
    # Dates and times begin at 0 s.
    moments = pd.Timestamp("2025-10-31 18:35:45") + pd.to_timedelta((1e9 * table["time_s"]).round(), unit="ns")
    assert_same(joints.smooth(table.assign(time_s=moments)), expected)


def test_live_rows_are_those_of_the_recording(hand):
    table = read(hand / "hand.csv")[:60]
    joints = oh.Hand.load(hand / "hand.toml")
    live, expected = joints.filter(), joints.filter(table)
    rows = [live.step(row["time_s"], row) for row in table.to_dict("records")]
    assert_same(pd.DataFrame(rows), expected)
    assert "thumb:missing" in live.step(100.0, {"inner_ohm": 1200.0})["flags"]


def test_electronics_and_errors(hand):
    """A column of converter codes gives the estimates of its ohms, to the resolution of a converter of 24 bits."""
    table = read(hand / "hand.csv")
    spec = "divider reference_ohm=2000 side=low bits=24"
    text = (hand / "hand.toml").read_text()
    (hand / "codes.toml").write_text(text.replace('column = "thumb_ohm"', f'column = "thumb_adc"\nfront_end = "{spec}"'))
    codes = table.rename(columns={"thumb_ohm": "thumb_adc"})
    codes["thumb_adc"] = np.round((2**24 - 1) * table["thumb_ohm"] / (table["thumb_ohm"] + 2000.0))
    found, expected = oh.Hand.load(hand / "codes.toml").filter(codes), oh.Hand.load(hand / "hand.toml").filter(table)
    np.testing.assert_allclose(found["thumb_strain"], expected["thumb_strain"], atol=1e-5)
    with pytest.raises(oh.OhmstrainError, match="joint `thumb`: `front_end` in hand.toml"):
        oh.Hand.load(hand / "codes.toml").filter()
    with pytest.raises(oh.OhmstrainError, match="expected a column `thumb_ohm`"):
        oh.Hand.load(hand / "hand.toml").filter(codes)
    (hand / "odd.toml").write_text(text.replace("format = 1", "format = 7"))
    with pytest.raises(oh.OhmstrainError, match="odd.toml.*expected `format = 1`, found 7"):
        oh.Hand.load(hand / "odd.toml")
    (hand / "bent.toml").write_text(text.replace('name = "thumb"', 'name = "thumb"\njoint = "prestrain=0 moment_arm_mm=6.4 gauge_length_mm=30"'))
    bent = oh.Hand.load(hand / "bent.toml")
    assert "thumb_deg" in bent.smooth(table).columns
    with pytest.raises(oh.OhmstrainError, match="joint `thumb`: `joint` in hand.toml"):
        bent.filter()
