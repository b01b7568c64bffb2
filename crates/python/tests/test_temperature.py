"""Recordings and live readings with temperatures, as the command line has them."""

import numpy as np
import pandas as pd
import pytest
from conftest import read, run

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
