#!/usr/bin/env python3
"""What Python costs beside the Rust library: processor time of smoothing recordings of 1000 rows, and of one long recording,
from tables of pyarrow, polars and pandas.

PYTHON scripts/overhead.py PROGRAM LIBRARY FOLDER [REPETITIONS, 3 [ESTIMATOR RECORDINGS]]

PYTHON has the wheel (`scripts/python.sh` prints it), PROGRAM is the command line, LIBRARY
`crates/python/target/release/examples/library_time` of the same build. Everything is repeated in turn, medians are compared.
What engines cost: `scripts/spark-cluster.sh --scaling`.
"""

import os
import statistics
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

FLEET = Path(__file__).resolve().parents[1] / "crates/python/examples/fleet.py"
#: Unless told otherwise: estimator, and recordings of 1000 rows.
CASES = [("ekf", 500), ("auto", 50)]
SMOOTH = """
import sys, time
import pyarrow as pa, pyarrow.parquet as pq
import ohmstrain as oh
sensor, estimator, path = oh.Sensor.load(sys.argv[1]), sys.argv[2], sys.argv[3]
ids = pq.read_table(path)["recording_id"].to_numpy()
table = pq.read_table(path, columns=["time_s", "resistance_ohm"])
starts = [0, *(k + 1 for k in range(len(ids) - 1) if ids[k] != ids[k + 1]), len(ids)]
parts = [table.slice(a, b - a).combine_chunks() for a, b in zip(starts, starts[1:])]
if sys.argv[4] == "pandas":
    parts = [part.to_pandas() for part in parts]
if sys.argv[4] == "polars":
    import polars
    parts = [polars.from_arrow(part) for part in parts]
start = time.process_time()
for part in parts:
    sensor.smooth(part, estimator=estimator)
print(time.process_time() - start)
"""
TABLES = ("pyarrow", "polars", "pandas")


def flat(recordings, path):
    """Recordings as LIBRARY reads them, and in one Parquet file as SMOOTH does."""
    with path.with_suffix(".f64").open("wb") as out:
        for rows in recordings:
            out.write(struct.pack("<Q", len(rows)))
            for name in ("time_s", "resistance_ohm"):
                out.write(rows[name].to_numpy().astype("<f8").tobytes())
    pq.write_table(pa.concat_tables(recordings), path.with_suffix(".parquet"))


def make(python, fleet, size):
    """A fleet; its recordings in one file (`short`), and as a single recording (`long`)."""
    if (fleet / "long.parquet").exists():
        return
    subprocess.run([python, FLEET, "make", fleet, "--recordings", str(size)], check=True, stdout=sys.stderr)
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
    cases = [(sys.argv[5], int(sys.argv[6]))] if len(sys.argv) > 5 else CASES
    os.environ.update(OHMSTRAIN=str(program), PYTHONWARNINGS="ignore", RAYON_NUM_THREADS="1")

    def seconds(*words):
        printed = subprocess.run([str(word) for word in words], capture_output=True, text=True, check=True).stdout
        return float(printed.split()[0])

    for estimator, size in cases:
        fleet = folder / f"fleet-{size}"
        make(sys.executable, fleet, size)
        name = {"auto": "corrected"}.get(estimator, estimator)
        for of in ("short", "long"):
            found = {what: [] for what in ("library", *TABLES)}
            for _ in range(repetitions):
                found["library"].append(seconds(library, fleet / "sensor.toml", name, fleet / f"{of}.f64", 1))
                python = (sys.executable, "-c", SMOOTH, fleet / "sensor.toml", estimator, fleet / f"{of}.parquet")
                for table in TABLES:
                    found[table].append(seconds(*python, table))
            for what, each in found.items():
                ratio = statistics.median(a / b for a, b in zip(each, found["library"]))
                rows = ", ".join(f"{second / size * 1e3:.2f}" for second in each)
                print(f"| {estimator} | {what}, {of} | {statistics.median(each) / size * 1e3:.2f} | {rows} | {ratio:.2f} |", flush=True)


main()
