"""Recordings and live readings with temperatures, as the command line has them."""

import pickle
import subprocess
import warnings

import numpy as np
import pandas as pd
import pytest
from conftest import PROGRAM, read, run

import ohmstrain as oh

pytestmark = pytest.mark.filterwarnings("ignore::ohmstrain.OhmstrainWarning")


@pytest.fixture(scope="module")
def chamber(tmp_path_factory):
    """A folder with trace.csv, recorded in a climate chamber, and sensor.toml, calibrated on it."""
    folder = tmp_path_factory.mktemp("chamber")
    words = "simulate --protocol mixed --duration-s 1200 --sample-rate-hz 2 --speed-mm-s 5 --material representative"
    run(folder, *words.split(), "--chamber", "period_s=400 rest_per_k=0.004", "-o", "trace.csv")
    run(folder, "calibrate", "trace.csv", "-o", "sensor.toml", "--estimator", "ekf", "--branches", "1")
    return folder


def test_calibration_finds_what_the_command_line_finds(chamber):
    made = oh.calibrate(read(chamber / "trace.csv"), estimator="ekf", branches=1)
    expected = oh.Sensor.load(chamber / "sensor.toml")
    assert made.params["temperature"] == expected.params["temperature"]
    given = oh.calibrate(read(chamber / "trace.csv"), estimator="ekf", branches=1, temperature=((0.003, 0.0002), (0.0, 0.001)))
    assert given.params["temperature"]["rest_per_k"] == 0.003
    assert given.params["temperature"]["gain_per_k_sd"] == 0.001


def test_filter_of_a_table_live_and_the_program_agree(chamber):
    sensor, rows = oh.Sensor.load(chamber / "sensor.toml"), read(chamber / "trace.csv").head(300)
    run(chamber, "filter", "trace.csv", "--sensor", "sensor.toml", "-o", "estimates.csv", "--force")
    program = read(chamber / "estimates.csv").head(300)
    whole = sensor.filter(rows)
    live = sensor.filter()
    names = ["time_s", "resistance_ohm", "temperature_c"]
    stepped = pd.DataFrame([live.step(*row) for row in rows[names].itertuples(index=False)])
    for name in ("resistance_ohm", "strain", "strain_sd"):
        assert np.array_equal(whole[name], program[name]) and np.array_equal(stepped[name], program[name])


def test_without_temperatures_intervals_are_those_of_the_sensor_without(chamber):
    sensor, rows = oh.Sensor.load(chamber / "sensor.toml"), read(chamber / "trace.csv").head(300)
    blind = rows.drop(columns="temperature_c")
    without = sensor.without_temperature()
    assert "temperature" not in without.params
    assert sensor.filter(blind).equals(without.filter(blind))
    # The same readings, known to be at the reference temperature.
    still = blind.assign(temperature_c=sensor.params["temperature"]["reference_c"])
    assert sensor.filter(blind)["strain_sd"].mean() > sensor.filter(still)["strain_sd"].mean()


NAMES = ["time_s", "resistance_ohm", "temperature_c"]


@pytest.fixture(scope="module")
def gappy(chamber):
    """Rows whose thermometer reads something implausible, and is silent for long, at a temperature far from the reference."""
    rows = read(chamber / "trace.csv").head(600)[NAMES]
    far = next(k for k in range(60, 500) if abs(rows["temperature_c"][k] - 25) > 12)
    rows.loc[20:30, "temperature_c"] = -127.0
    rows.loc[far : far + 60, "temperature_c"] = np.nan
    rows.loc[far - 1, "resistance_ohm"] = np.nan
    return rows, far


def test_pieces_and_steps_are_the_whole_when_temperatures_are_missing(chamber, gappy):
    sensor, (rows, far) = oh.Sensor.load(chamber / "sensor.toml"), gappy
    rows.to_csv(chamber / "gappy.csv", index=False)
    run(chamber, "filter", "gappy.csv", "--sensor", "sensor.toml", "-o", "estimates.csv", "--force")
    program, live, other = read(chamber / "estimates.csv"), sensor.filter(), sensor.filter()
    pieces = pd.concat([live.run(rows[:far]), live.run(rows[far:])])
    steps = pd.DataFrame([other.step(*row) for row in rows.itertuples(index=False)])
    for name in ("resistance_ohm", "strain", "strain_sd"):
        assert np.array_equal(pieces[name], program[name], equal_nan=True), name
        assert np.array_equal(steps[name].astype(float), program[name], equal_nan=True), name


def test_a_state_has_the_last_temperature(chamber, gappy, tmp_path):
    sensor, (rows, far) = oh.Sensor.load(chamber / "sensor.toml"), gappy

    def due(live, rows):
        found = [live.step(*row) for row in rows.itertuples(index=False)]
        return found if isinstance(live, oh.LiveFilter) else sum(found, [])

    for options in ({}, {"lag_s": 1.0}):
        live = sensor.filter(**options)
        due(live, rows[:far])
        live.save(tmp_path / "state.toml")
        others = [pickle.loads(pickle.dumps(live)), sensor.filter(resume=tmp_path / "state.toml", **options)]
        expected = due(live, rows[far : far + 20])
        assert all(due(other, rows[far : far + 20]) == expected for other in others), options
    live = sensor.filter()
    live.run(rows[:far])
    live.save(chamber / "python.toml")
    rows[far:].to_csv(chamber / "later.csv", index=False)
    run(chamber, "filter", "later.csv", "--sensor", "sensor.toml", "--resume", "python.toml", "-o", "later_estimates.csv")
    assert read(chamber / "later_estimates.csv")["strain"].to_list() == live.run(rows[far:])["strain"].to_list()


def test_a_refused_row_changes_no_temperature(chamber):
    sensor = oh.Sensor.load(chamber / "sensor.toml")
    for options in ({}, {"lag_s": 0.5}):
        live, other = sensor.filter(**options), sensor.filter(**options)
        for each in (live, other):
            each.step(0.0, 5000.0, 25.0)
        with pytest.raises(oh.OhmstrainError):
            live.step(-1.0, 5000.0, 38.0)
        assert [live.step(time_s, 5000.0) for time_s in (1.0, 2.0)] == [other.step(time_s, 5000.0) for time_s in (1.0, 2.0)]


def test_a_running_filter_without_temperatures_is_doubted(chamber):
    sensor, rows = oh.Sensor.load(chamber / "sensor.toml"), read(chamber / "trace.csv").head(100)
    blind = rows[["time_s", "resistance_ohm"]]
    with pytest.warns(oh.OhmstrainWarning, match=r"no column `temperature_c`: .* sensor.without_temperature\(\)"):
        sensor.filter().run(blind)
    with pytest.warns(oh.OhmstrainWarning, match="1 temperature far from those of the calibration counted as missing"):
        sensor.filter().run(rows.assign(temperature_c=rows["temperature_c"].where(rows.index != 7, -127.0)))
    live, without = sensor.filter(), sensor.without_temperature().filter()
    live.step(-1.0, None, 25.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error", oh.OhmstrainWarning)
        live.run(blind)
        found = without.run(blind)
    assert found.equals(sensor.filter(blind))
    without.save(chamber / "blind.toml")
    with pytest.raises(oh.OhmstrainError, match="readings with or without temperatures"):
        sensor.filter(resume=chamber / "blind.toml")


def test_warnings_are_those_of_the_program(chamber):
    """No temperatures, a probe that is disconnected, milliseconds."""
    sensor, rows = oh.Sensor.load(chamber / "sensor.toml"), read(chamber / "trace.csv").head(300)[NAMES]
    far = rows.assign(temperature_c=rows["temperature_c"].where((rows.index < 90) | (rows.index > 99), -127.0))
    slow = rows.assign(time_s=1000 * rows["time_s"])
    for table, texts in [
        (rows.drop(columns="temperature_c"), ["no column `temperature_c`: intervals are wider by what 10 to 40 °C do"]),
        (far, ["10 temperatures far from those of the calibration counted as missing: is the probe connected?"]),
        (slow, ["rows are 500 s apart, 0.5 s in the calibration: if `time_s` is in milliseconds, "]),
    ]:
        table.to_csv(chamber / "odd.csv", index=False)
        for command in ("filter", "smooth"):
            words = [PROGRAM, command, "odd.csv", "--sensor", "sensor.toml", "-o", "odd_estimates.csv", "--force"]
            printed = subprocess.run(words, cwd=chamber, capture_output=True, text=True, check=True).stderr
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always")
                getattr(sensor, command)(table, name="odd.csv")
            found = "\n".join(str(one.message) for one in caught)
            for text in texts:
                assert text in printed and text in found, (command, text)
            unlike = printed.count("of the rows are flagged `extrapolated`")
            assert found.count("odd.csv: ") == printed.count("warning: odd.csv") - unlike
