"""A simulated recording, and a sensor that the command line calibrated on it."""

import os
import subprocess
from pathlib import Path

import pandas as pd
import pytest

import ohmstrain as oh

ROOT = Path(__file__).parents[3]
PROGRAM = os.environ.get("OHMSTRAIN", str(ROOT / "target/debug/ohmstrain"))


@pytest.fixture(scope="session")
def folder(tmp_path_factory):
    """trace.csv, 2000 rows, and sensor.toml, calibrated on three quarters of it."""
    folder = tmp_path_factory.mktemp("bench")
    run(folder, "simulate", "--protocol", "mixed", "--speed-mm-s", "5", "--sample-rate-hz", "5", "--mismatched", "-o", "trace.csv")
    run(folder, "calibrate", "trace.csv", "--until", "300", "-o", "sensor.toml", "--estimator", "sign-split")
    return folder


def run(folder, *words):
    """What a command prints."""
    done = subprocess.run([PROGRAM, "-q", *words], cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="session")
def trace(folder):
    return read(folder / "trace.csv")


@pytest.fixture(scope="session")
def sensor(folder):
    return oh.Sensor.load(folder / "sensor.toml")


def read(path):
    """A CSV with its numbers unchanged."""
    cells = pd.read_csv(path, comment="#", dtype=str, keep_default_na=False)
    numbers = {name: cells[name].replace("", "nan").astype(float) for name in cells if name != "flags"}
    return cells.assign(**numbers)
