"""Ten thousand recordings on Spark, on Ray, and on one core, with the same result.

    fleet.py make FOLDER --recordings 10000      recordings as Parquet, and a sensor
    fleet.py run FOLDER plain                    estimates on one core: what the others are compared with
    fleet.py run FOLDER spark --master URL --kill PID
    fleet.py run FOLDER ray --kill any
    fleet.py check FOLDER spark                  nothing lost, nothing doubled, the same numbers

`--estimator ekf` takes the quick filter in place of the sensor's default.

`make` needs the program `ohmstrain`: in PATH, or where the environment's OHMSTRAIN says.
"""

import argparse
import hashlib
import os
import shutil
import signal
import subprocess
import threading
import time
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.dataset as ds
import pyarrow.parquet as pq

import ohmstrain as oh
from ohmstrain._groups import Work

BY = ["sensor_id", "recording_id"]
#: Rows of a recording, at most.
ROWS = 1000
#: Recordings that the simulator makes; the others are these with another R0 and other noise.
SIMULATED = 50
#: Recordings in a file.
PER_FILE = 50
#: Recordings that are compared at a time.
COMPARED = 1000


def program(*words):
    subprocess.run([os.environ.get("OHMSTRAIN", "ohmstrain"), "-q", *map(str, words)], check=True)


def make(folder, recordings, rows_each=ROWS, seed=1):
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "recordings").mkdir(exist_ok=True)
    simulate = ["simulate", "--protocol", "mixed", "--speed-mm-s", 5, "--sample-rate-hz", 5, "--mismatched"]
    made = []
    for k in range(min(SIMULATED, recordings)):
        path = folder / f"simulated-{k}.csv"
        program(*simulate, "--seed", seed + k, "-o", path, "--force")
        rows = np.loadtxt([line for line in path.read_text().splitlines() if line[0].isdigit()], delimiter=",")
        made.append(rows[:ROWS])
    if not (folder / "sensor.toml").exists():
        names = ["time_s", "resistance_ohm", "strain"]
        oh.calibrate(dict(zip(names, made[0].T.copy()))).save(folder / "sensor.toml")
    chance = np.random.default_rng(seed)
    for first in range(0, recordings, PER_FILE):
        tables = []
        for k in range(first, min(first + PER_FILE, recordings)):
            rows = made[k % len(made)][:rows_each]
            reading = rows[:, 1] * (1 + 2e-4 * chance.standard_normal(len(rows)))
            keys = [pa.repeat("s1", len(rows)), pa.repeat(k, len(rows))]
            tables.append(pa.table([*keys, rows[:, 0], reading, rows[:, 2]], [*BY, "time_s", "resistance_ohm", "strain"]))
        pq.write_table(pa.concat_tables(tables), folder / "recordings" / f"part-{first:06}.parquet")
    print(f"{recordings} recordings, {recordings * rows_each} rows")


def plain(folder, task, estimator):
    """One recording after another, on one core."""
    work = Work(task, BY, oh.Sensor.load(folder / "sensor.toml"), estimator=estimator)
    (folder / "estimates-plain").mkdir(exist_ok=True)
    for path in sorted((folder / "recordings").glob("*.parquet")):
        table = pq.read_table(path)
        starts = np.flatnonzero(np.diff(table["recording_id"].to_numpy(), prepend=-1))
        ends = [*starts[1:], len(table)]
        done = [work(table.slice(a, b - a)) for a, b in zip(starts, ends)]
        pq.write_table(pa.concat_tables(done), folder / "estimates-plain" / path.name)


def spark(folder, task, estimator, master, partitions):
    from pyspark.sql import SparkSession

    from ohmstrain import spark as oh_spark

    settings = {
        "spark.ui.enabled": "false",
        "spark.driver.bindAddress": "127.0.0.1",
        "spark.driver.host": "127.0.0.1",
        "spark.sql.shuffle.partitions": str(partitions),
        "spark.sql.adaptive.enabled": "false",
        "spark.executor.memory": "1g",
    }
    builder = SparkSession.builder.master(master).appName("ohmstrain")
    for key, value in settings.items():
        builder = builder.config(key, value)
    session = builder.getOrCreate()
    session.sparkContext.setLogLevel("ERROR")
    start = time.perf_counter()
    df = session.read.parquet(str((folder / "recordings").absolute()))
    done = getattr(oh_spark, task)(df, oh.Sensor.load(folder / "sensor.toml"), estimator=estimator)
    done.write.mode("overwrite").parquet(str((folder / "estimates-spark").absolute()))
    seconds = time.perf_counter() - start
    session.stop()
    return seconds


def ray(folder, task, estimator, cpus, partitions):
    import ray
    import ray.data

    from ohmstrain import ray as oh_ray

    ray.init(num_cpus=cpus, include_dashboard=False, _node_ip_address="127.0.0.1", log_to_driver=False)
    ray.data.DataContext.get_current().default_hash_shuffle_parallelism = partitions
    start = time.perf_counter()
    dataset = ray.data.read_parquet(str(folder / "recordings"))
    done = getattr(oh_ray, task)(dataset, oh.Sensor.load(folder / "sensor.toml"), estimator=estimator)
    done.write_parquet(str(folder / "estimates-ray"), mode=ray.data.SaveMode.OVERWRITE)
    seconds = time.perf_counter() - start
    ray.shutdown()
    return seconds


def descendants(pid):
    """A process and all below it."""
    tasks = Path(f"/proc/{pid}/task").glob("*/children")
    below = [child for children in tasks for child in children.read_text().split()]
    return [pid, *(found for child in below for found in descendants(int(child)))]


def kill_later(what, output, after_files, said):
    """Kills a worker with all that it started, without a warning, when so many files of the output have been begun."""
    shutil.rmtree(output, ignore_errors=True)

    def kill():
        while (begun := len({path.name for path in output.rglob("*.parquet")})) < after_files:
            time.sleep(0.02)
        if what == "any":
            names = ((p, Path(f"/proc/{p}/comm")) for p in descendants(os.getpid()))
            busy = [p for p, name in names if name.exists() and name.read_text().startswith("ray::")]
            pids = busy[-1:]
        else:
            pids = descendants(int(what))
        for pid in pids:
            try:
                os.kill(pid, signal.SIGKILL)
            except ProcessLookupError:
                pass
        said.append(f"killed {len(pids)} processes when {begun} files of the output were begun")

    threading.Thread(target=kill, daemon=True).start()


class PeakMemory(threading.Thread):
    """The largest resident memory of any Python worker, looked at four times a second."""

    def __init__(self):
        super().__init__(daemon=True)
        self.peak_kb = 0
        self.start()

    def run(self):
        while True:
            for status in Path("/proc").glob("[0-9]*/status"):
                try:
                    command = (status.parent / "cmdline").read_bytes()
                    if b"pyspark.daemon" in command or command.startswith(b"ray::"):
                        rss = [line for line in status.read_text().splitlines() if line.startswith("VmHWM")]
                        self.peak_kb = max(self.peak_kb, *(int(line.split()[1]) for line in rss), 0)
                except OSError:
                    pass
            time.sleep(0.25)


def run(folder, engine, task, estimator, master, partitions, kill, after_files):
    said = []
    if kill:
        kill_later(kill, folder / f"estimates-{engine}", after_files, said)
    peak = PeakMemory()
    start = time.perf_counter()
    if engine == "plain":
        plain(folder, task, estimator)
        seconds = time.perf_counter() - start
    elif engine == "spark":
        seconds = spark(folder, task, estimator, master, partitions)
    else:
        seconds = ray(folder, task, estimator, int(master) if master.isdigit() else 2, partitions)
    assert said or not kill, "it was over before a worker was killed"
    rows = ds.dataset(folder / "recordings").count_rows()
    memory = f", {peak.peak_kb / 1024:.0f} MB in the largest worker" if engine != "plain" else ""
    print("; ".join([f"{engine} {task} ({estimator}): {rows} rows in {seconds:.1f} s, {rows / seconds:.0f} rows/s{memory}", *said]))


def check(folder, engine):
    """Every row of the input once, and the numbers of one core: some recordings at a time, so that memory stays small."""
    columns = [*BY, "time_s", "strain", "strain_sd", "nis", "flags", "error"]
    order = [("recording_id", "ascending"), ("time_s", "ascending")]
    plain, found = (ds.dataset(folder / f"estimates-{of}") for of in ("plain", engine))
    recordings = ds.dataset(folder / "recordings")
    rows = recordings.count_rows()
    assert plain.count_rows() == found.count_rows() == rows, (rows, plain.count_rows(), found.count_rows())
    last = pc.max(recordings.to_table(columns=["recording_id"])["recording_id"]).as_py()
    compared, digest = 0, hashlib.sha256()
    for first in range(0, last + 1, COMPARED):
        some = (ds.field("recording_id") >= first) & (ds.field("recording_id") < first + COMPARED)
        given = recordings.to_table(columns=["recording_id", "time_s"], filter=some).sort_by(order)
        one, other = (of.to_table(columns=columns, filter=some).sort_by(order) for of in (plain, found))
        assert other["error"].null_count == len(other)
        for name in given.column_names:
            assert other[name].combine_chunks().equals(given[name].combine_chunks()), (first, name)
        for name in columns:
            cells = other[name].combine_chunks().cast(one.schema.field(name).type)
            assert one[name].combine_chunks().equals(cells), (first, name)
        digest.update(other["strain"].to_numpy().tobytes())
        compared += len(other)
    assert compared == rows, (compared, rows)
    print(f"{engine}: all {rows} rows once, the same numbers to the bit; SHA-256 of the strains {digest.hexdigest()[:16]}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["make", "run", "check"])
    parser.add_argument("folder", type=Path)
    parser.add_argument("engine", nargs="?", choices=["plain", "spark", "ray"])
    parser.add_argument("--recordings", type=int, default=10_000)
    parser.add_argument("--rows", type=int, default=ROWS, help="of a recording, at most 1000")
    parser.add_argument("--task", choices=["filter", "smooth"], default="smooth")
    parser.add_argument("--estimator", default="auto", help="in place of the sensor's default")
    parser.add_argument("--master", default="local[2]", help="of Spark; or processors of Ray")
    parser.add_argument("--partitions", type=int, default=32)
    parser.add_argument("--kill", help="a worker's process, or any")
    parser.add_argument("--after-files", type=int, default=8, help="when so many of its output have been begun")
    args = parser.parse_args()
    if args.what == "make":
        make(args.folder, args.recordings, args.rows)
    elif args.what == "run":
        run(args.folder, args.engine, args.task, args.estimator, args.master, args.partitions, args.kill, args.after_files)
    else:
        check(args.folder, args.engine)


if __name__ == "__main__":
    main()
