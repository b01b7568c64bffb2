#!/usr/bin/env python3
"""What Python, Spark, Ray and `ohmstrain batch` cost beside the Rust library: processor time of all processes together.

PYTHON scripts/overhead.py PROGRAM LIBRARY FOLDER [REPETITIONS, 3 [ESTIMATOR SMALLER LARGER]]

PYTHON has the wheel, pyspark and ray (`scripts/python.sh --engines` prints it), PROGRAM is the command line, LIBRARY
`crates/python/target/release/examples/library_time` of the same build. Everything is repeated in turn, medians are compared; of an
engine what the larger fleet costs more than the smaller one, so that its start is left out. Wants root, for a control group
that counts the time of every process that is started in it, whoever starts it.
"""

import os
import shutil
import statistics
import struct
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

FLEET = Path(__file__).resolve().parents[1] / "crates/python/examples/fleet.py"
#: Unless told otherwise: estimator, and recordings of 1000 rows in the smaller and in the larger fleet.
CASES = [("ekf", 500, 2500), ("auto", 50, 250)]
ENGINES = ["plain", "spark", "ray"]
GROUPS = [Path("/sys/fs/cgroup/cpuacct"), Path("/sys/fs/cgroup/unified"), Path("/sys/fs/cgroup")]
SMOOTH = """
import sys, time
import pyarrow as pa, pyarrow.parquet as pq
import ohmstrain as oh
sensor, estimator, path = oh.Sensor.load(sys.argv[1]), sys.argv[2], sys.argv[3]
ids = pq.read_table(path)["recording_id"].to_numpy()
table = pq.read_table(path, columns=["time_s", "resistance_ohm"])
starts = [0, *(k + 1 for k in range(len(ids) - 1) if ids[k] != ids[k + 1]), len(ids)]
parts = [table.slice(a, b - a).combine_chunks() for a, b in zip(starts, starts[1:])]
for _ in range(int(sys.argv[4])):
    start = time.process_time()
    for part in parts:
        sensor.smooth(part, estimator=estimator)
    print(time.process_time() - start)
"""


class Group:
    """A control group; ``run`` gives what a command printed and the seconds of processor time of it and all that it started."""

    def __init__(self):
        root = next(root for root in GROUPS if (root / "cgroup.procs").exists())
        self.path = root / f"ohmstrain-{os.getpid()}"
        self.path.mkdir()

    def seconds(self):
        nanoseconds = self.path / "cpuacct.usage"
        if nanoseconds.exists():
            return int(nanoseconds.read_text()) / 1e9
        return int((self.path / "cpu.stat").read_text().split()[1]) / 1e6

    def run(self, *words):
        before = self.seconds()
        join = lambda: (self.path / "cgroup.procs").write_text(str(os.getpid()))  # noqa: E731
        done = subprocess.run([str(word) for word in words], capture_output=True, text=True, preexec_fn=join)
        assert done.returncode == 0, done.stderr
        for _ in range(100):  # Until what an engine leaves behind has gone.
            if not (self.path / "cgroup.procs").read_text():
                break
            time.sleep(0.1)
        return done.stdout, self.seconds() - before


def flat(recordings, path):
    """Recordings as LIBRARY reads them, and in one Parquet file as SMOOTH does."""
    with path.with_suffix(".f64").open("wb") as out:
        for rows in recordings:
            out.write(struct.pack("<Q", len(rows)))
            for name in ("time_s", "resistance_ohm"):
                out.write(rows[name].to_numpy().astype("<f8").tobytes())
    pq.write_table(pa.concat_tables(recordings), path.with_suffix(".parquet"))


def make(python, fleet, size, sensor):
    """A fleet; its recordings in one file (`short`), and as a single recording (`long`)."""
    if (fleet / "long.parquet").exists():
        return
    subprocess.run([python, FLEET, "make", fleet, "--recordings", str(size)], check=True, stdout=sys.stderr)
    if sensor != fleet / "sensor.toml":
        shutil.copy(sensor, fleet / "sensor.toml")
    recordings, end = [], 0.0
    for part in sorted((fleet / "recordings").glob("*.parquet")):
        table = pq.read_table(part)
        ids = table["recording_id"].to_numpy()
        recordings += [table.filter(ids == key) for key in dict.fromkeys(ids)]
    flat(recordings, fleet / "short")
    columns = {"time_s": [], "resistance_ohm": []}
    for rows in recordings:
        columns["time_s"].append(rows["time_s"].to_numpy() + end)
        columns["resistance_ohm"].append(rows["resistance_ohm"].to_numpy())
        end = columns["time_s"][-1][-1] + 0.2
    joined = pa.table({name: np.concatenate(parts) for name, parts in columns.items()})
    flat([joined.append_column("recording_id", pa.repeat(0, len(joined)))], fleet / "long")


def main():
    program, library, folder = (Path(word).absolute() for word in sys.argv[1:4])
    repetitions = int(sys.argv[4]) if len(sys.argv) > 4 else 3
    cases = [(sys.argv[5], int(sys.argv[6]), int(sys.argv[7]))] if len(sys.argv) > 5 else CASES
    python = sys.executable
    os.environ.update(OHMSTRAIN=str(program), PYTHONWARNINGS="ignore", RAYON_NUM_THREADS="1", PYSPARK_PYTHON=python)
    group = Group()
    for estimator, *sizes in cases:
        found = {}
        note = lambda what, seconds: found.setdefault(what, []).append(seconds)  # noqa: E731
        fleets = [folder / f"fleet-{size}" for size in sizes]
        for fleet, size in zip(fleets, sizes):
            make(python, fleet, size, fleets[0] / "sensor.toml")
        small = fleets[0]
        name = {"auto": "corrected"}.get(estimator, estimator)
        for repetition in range(repetitions):
            for of in ("short", "long"):
                said, _ = group.run(library, small / "sensor.toml", name, small / f"{of}.f64", 1)
                note(f"library, {of}", float(said.split()[0]))
                said, _ = group.run(python, "-c", SMOOTH, small / "sensor.toml", estimator, small / f"{of}.parquet", 1)
                note(f"python, {of}", float(said))
            for engine in ENGINES:
                pair = []
                for fleet in fleets:
                    shutil.rmtree(fleet / f"estimates-{engine}", ignore_errors=True)
                    said, seconds = group.run(python, FLEET, "run", fleet, engine, "--estimator", estimator)
                    print(repetition, said.strip(), f"{seconds:.2f} s of processor time", file=sys.stderr, flush=True)
                    pair.append(seconds)
                note(engine, (pair[1] - pair[0]) * sizes[0] / (sizes[1] - sizes[0]))
        for what, seconds in found.items():
            base = found["library, long" if what.endswith("long") else "library, short"]
            ratio = statistics.median(a / b for a, b in zip(seconds, base))
            each = ", ".join(f"{second / sizes[0] * 1e3:.2f}" for second in seconds)
            print(f"| {estimator} | {what} | {statistics.median(seconds) / sizes[0] * 1e3:.2f} | {each} | {ratio:.2f} |", flush=True)
    os.rmdir(group.path)


main()
