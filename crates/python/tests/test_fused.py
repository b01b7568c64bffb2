"""Several channels of one strain: the same numbers as ``ohmstrain hand`` prints."""

import io
import math
import pickle

import numpy as np
import pytest
from conftest import read, run

import ohmstrain as oh

CHANNELS = ("inner", "middle", "outer")


@pytest.fixture(scope="module")
def knee(tmp_path_factory):
    folder = tmp_path_factory.mktemp("knee")
    time_s = 0.1 * np.arange(900)
    strain = 0.15 - 0.10 * np.cos(0.9 * time_s) - 0.05 * np.cos(0.33 * time_s + 1.0)
    rate = np.gradient(strain, time_s)
    chance = np.random.default_rng(1).normal(0.0, 0.01, (3, len(time_s)))
    ln_r = np.stack([2 * strain + 0.3 * rate, 3 * strain - 2 * strain**2, 1.5 * strain + 3 * strain**2 - 0.2 * rate]) + chance
    ohm = 1000.0 * np.exp(ln_r)
    rows = [f"{t:.1f},{a:.2f},{b:.2f},{c:.2f},{e:.6f}" for t, a, b, c, e in zip(time_s, *ohm, strain, strict=True)]
    header = "time_s," + ",".join(f"{channel}_ohm" for channel in CHANNELS) + ",strain"
    (folder / "knee.csv").write_text("\n".join([header, *rows]) + "\n")
    run(folder, "calibrate", "knee.csv", "-o", "knee.toml", "--estimator", "ekf")
    return folder


def load(knee):
    return oh.FusedSensor.load([knee / f"knee-{channel}.toml" for channel in CHANNELS], knee / "knee-fusion.toml")


def test_rows_are_those_of_hand(knee):
    expected = read(io.StringIO(run(knee, "hand", "knee.toml", "knee.csv")))
    table = read(knee / "knee.csv")
    fused = load(knee)
    for sensor in (fused, pickle.loads(pickle.dumps(fused))):
        live = sensor.filter()
        rows = [live.step(row[0], row[1:4]) for row in table[table.columns].to_numpy(float)]
        for name in ("strain", "strain_sd"):
            np.testing.assert_array_equal([row[name] for row in rows], expected[f"knee_{name}"].to_numpy(float))
        assert not any(row["is_unlike"] for row in rows)
    assert live.step(100.0, [None, math.nan, None])["faulty"] is None


def test_errors_are_reported(knee):
    with pytest.raises(oh.OhmstrainError, match="expected 3 channels, those of the fusion, found 1"):
        oh.FusedSensor.load([knee / "knee-inner.toml"], knee / "knee-fusion.toml")
    (knee / "worse.toml").write_text((knee / "knee-fusion.toml").read_text().replace("novelty = ", "novelty = -"))
    with pytest.raises(oh.OhmstrainError, match=r"worse.toml: ?.*novelty"):
        oh.FusedSensor.load([knee / f"knee-{channel}.toml" for channel in CHANNELS], knee / "worse.toml")
    live = load(knee).filter()
    live.step(1.0, [1000.0, 1000.0, 1000.0])
    with pytest.raises(oh.OhmstrainError, match="found 2"):
        live.step(2.0, [1000.0, 1000.0])
    with pytest.raises(oh.OhmstrainError):
        live.step(0.5, [1000.0, 1000.0, 1000.0])
