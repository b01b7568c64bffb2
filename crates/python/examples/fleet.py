"""Ten thousand recordings on Spark, on Ray, and on one core, with the same result.

    fleet.py make FOLDER --recordings 10000      recordings as Parquet, and a sensor
    fleet.py run FOLDER plain --workers 1        estimates on one core: what the others are compared with
    fleet.py run FOLDER spark --master URL --kill PID
    fleet.py run FOLDER ray --kill any
    fleet.py check FOLDER spark                  nothing lost, nothing doubled, the same numbers

`--estimator ekf` takes the quick filter in place of the sensor's default. `--task copy` computes nothing: the reading stands in
every column of the estimates, so that what is left is the engine's own cost.

`make` needs the program `ohmstrain`: in PATH, or where the environment's OHMSTRAIN says.
"""

import argparse
import concurrent.futures
import hashlib
import multiprocessing
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
from ohmstrain import _groups

BY = ["sensor_id", "recording_id"]
#: Rows of a recording that take 200 s, at 5 Hz; with more rows the sample rate is higher.
ROWS = 1000
#: Recordings that the simulator makes; the others are these with another R0 and other noise.
SIMULATED = 50
#: Recordings in a file.
PER_FILE = 50
#: Columns that are compared, and rows of them at a time.
CHECKED = [*BY, "time_s", "strain", "strain_sd", "nis", "flags", "error"]
COMPARED = 10_000_000


class Copy(_groups.Work):
    """As many columns as of estimates, and nothing computed."""

    def _columns(self, keys, group):
        flags = pa.repeat("", len(group))
        return {name: flags if name == "flags" else group["resistance_ohm"] for name in self.columns}


def work_of(task, folder, estimator):
    sensor = oh.Sensor.load(folder / "sensor.toml")
    made, task = (Copy, "smooth") if task == "copy" else (_groups.Work, task)
    return made(task, BY, sensor, estimator=estimator)


def program(*words):
    subprocess.run([os.environ.get("OHMSTRAIN", "ohmstrain"), "-q", *map(str, words)], check=True)


def make(folder, recordings, rows_each=ROWS, seed=1):
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "recordings").mkdir(exist_ok=True)
    oversampling = max(1, -(-rows_each // ROWS))
    simulate = ["simulate", "--protocol", "mixed", "--speed-mm-s", 5, "--sample-rate-hz", 5 * oversampling, "--mismatched"]
    made = []
    for k in range(min(SIMULATED, recordings)):
        path = folder / f"simulated-{k}.csv"
        program(*simulate, "--seed", seed + k, "-o", path, "--force")
        rows = np.loadtxt([line for line in path.read_text().splitlines() if line[0].isdigit()], delimiter=",")
        made.append(rows[: ROWS * oversampling])
    if not (folder / "sensor.toml").exists():
        names = ["time_s", "resistance_ohm", "strain"]
        oh.calibrate(dict(zip(names, made[0][::oversampling].T.copy()))).save(folder / "sensor.toml")
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


def plain_file(work, path, to, columns):
    table = pq.read_table(path)
    starts = np.flatnonzero(np.diff(table["recording_id"].to_numpy(), prepend=-1))
    ends = [*starts[1:], len(table)]
    done = [work(table.slice(a, b - a)) for a, b in zip(starts, ends)]
    pq.write_table(pa.concat_tables(done).select(columns or done[0].column_names), to / path.name)


def plain(folder, task, estimator, workers, columns):
    """One recording after another, in each worker; writes some columns, or all."""
    work = work_of(task, folder, estimator)
    to = folder / "estimates-plain"
    to.mkdir(exist_ok=True)
    files = sorted((folder / "recordings").glob("*.parquet"))
    spawned = multiprocessing.get_context("spawn")
    with Clock() as clock, concurrent.futures.ProcessPoolExecutor(workers, spawned) as pool:
        list(pool.map(plain_file, [work] * len(files), files, [to] * len(files), [columns] * len(files)))
    return clock


def spark(folder, task, estimator, workers, partitions, master):
    from pyspark.sql import SparkSession

    from ohmstrain import spark as oh_spark

    settings = {
        "spark.ui.enabled": "false",
        "spark.driver.bindAddress": "127.0.0.1",
        "spark.driver.host": "127.0.0.1",
        "spark.sql.shuffle.partitions": str(partitions),
        "spark.sql.adaptive.enabled": "false",
        "spark.executor.memory": "1g",
        "spark.cores.max": str(workers),
    }
    builder = SparkSession.builder.master(master).appName("ohmstrain")
    for key, value in settings.items():
        builder = builder.config(key, value)
    session = builder.getOrCreate()
    session.sparkContext.setLogLevel("ERROR")
    with Clock() as clock:
        df = session.read.parquet(str((folder / "recordings").absolute()))
        done = oh_spark._grouped(df, work_of(task, folder, estimator))
        done.write.mode("overwrite").parquet(str((folder / "estimates-spark").absolute()))
    session.stop()
    return clock


def ray(folder, task, estimator, workers, partitions):
    import ray
    import ray.data

    from ohmstrain import ray as oh_ray

    ray.init(num_cpus=workers, include_dashboard=False, _node_ip_address="127.0.0.1", log_to_driver=False)
    ray.data.DataContext.get_current().default_hash_shuffle_parallelism = partitions
    with Clock() as clock:
        dataset = ray.data.read_parquet(str(folder / "recordings"))
        done = oh_ray._grouped(dataset, work_of(task, folder, estimator))
        done.write_parquet(str(folder / "estimates-ray"), mode=ray.data.SaveMode.OVERWRITE)
    ray.shutdown()
    return clock


def descendants(pid):
    """A process and all below it."""
    tasks = Path(f"/proc/{pid}/task").glob("*/children")
    below = [child for children in tasks for child in children.read_text().split()]
    return [pid, *(found for child in below for found in descendants(int(child)))]


def kill_later(what, output, after_files, remarks):
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
        remarks.append(f"killed {len(pids)} processes when {begun} files of the output were begun")

    threading.Thread(target=kill, daemon=True).start()


class Clock:
    """Elapsed time, s, and processor time of the control group OHMSTRAIN_GROUP, if there is one, from start to end."""

    @staticmethod
    def now():
        group = os.environ.get("OHMSTRAIN_GROUP")
        if not group:
            return time.perf_counter(), 0.0
        nanoseconds = Path(group, "cpuacct.usage")
        if nanoseconds.exists():
            return time.perf_counter(), int(nanoseconds.read_text()) / 1e9
        return time.perf_counter(), int(Path(group, "cpu.stat").read_text().split()[1]) / 1e6

    def __enter__(self):
        self.start = self.now()
        return self

    def __exit__(self, *_):
        self.elapsed_s, self.processor_s = (b - a for a, b in zip(self.start, self.now()))


class PeakMemory(threading.Thread):
    """The largest resident memory of Python workers by what they do, looked at four times a second."""

    def __init__(self):
        super().__init__(daemon=True)
        self.peak_kb = {}
        self.start()

    def run(self):
        while True:
            for status in Path("/proc").glob("[0-9]*/status"):
                try:
                    command = (status.parent / "cmdline").read_bytes()
                    if b"pyspark.daemon" in command or command.startswith(b"ray::"):
                        rss = [line for line in status.read_text().splitlines() if line.startswith("VmHWM")]
                        name = "pyspark" if b"pyspark" in command else command.split(b"\0")[0].decode().split(".")[0]
                        self.peak_kb[name] = max(self.peak_kb.get(name, 0), *(int(line.split()[1]) for line in rss), 0)
                except OSError:
                    pass
            time.sleep(0.25)


def run(folder, engine, task, estimator, workers, partitions, master, kill, after_files, columns):
    remarks = []
    if kill:
        kill_later(kill, folder / f"estimates-{engine}", after_files, remarks)
    peak = PeakMemory()
    if engine == "plain":
        clock = plain(folder, task, estimator, workers, columns)
    elif engine == "spark":
        clock = spark(folder, task, estimator, workers, partitions, master)
    else:
        clock = ray(folder, task, estimator, workers, partitions)
    assert remarks or not kill, "it was over before a worker was killed"
    rows = ds.dataset(folder / "recordings").count_rows()
    seconds = clock.elapsed_s
    found = f"{engine} {task} ({estimator}, workers: {workers}): {rows} rows in {seconds:.1f} s, {rows / seconds:.0f} rows/s"
    if clock.processor_s:
        remarks.insert(0, f"{clock.processor_s / rows * 1e6:.2f} us of processor time a row")
    if engine != "plain":
        largest = ", ".join(f"{name} {kb / 1024:.0f}" for name, kb in sorted(peak.peak_kb.items()))
        remarks.insert(0, f"MB in the largest workers: {largest}")
    print("; ".join([found, *remarks]), flush=True)


def check(folder, engine):
    """Every row of the input once, and the numbers of one core: some recordings at a time, so that memory stays small."""
    order = [("recording_id", "ascending"), ("time_s", "ascending")]
    plain, found = (ds.dataset(folder / f"estimates-{of}") for of in ("plain", engine))
    recordings = ds.dataset(folder / "recordings")
    rows = recordings.count_rows()
    assert plain.count_rows() == found.count_rows() == rows, (rows, plain.count_rows(), found.count_rows())
    last = pc.max(recordings.to_table(columns=["recording_id"])["recording_id"]).as_py()
    compared, digest, step = 0, hashlib.sha256(), max(1, COMPARED * (last + 1) // rows)
    for first in range(0, last + 1, step):
        some = (ds.field("recording_id") >= first) & (ds.field("recording_id") < first + step)
        given = recordings.to_table(columns=["recording_id", "time_s"], filter=some).sort_by(order)
        one, other = (of.to_table(columns=CHECKED, filter=some).sort_by(order) for of in (plain, found))
        assert other["error"].null_count == len(other)
        for name in given.column_names:
            assert other[name].combine_chunks().equals(given[name].combine_chunks()), (first, name)
        for name in CHECKED:
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
    parser.add_argument("--rows", type=int, default=ROWS, help="of a recording")
    parser.add_argument("--task", choices=["filter", "smooth", "copy"], default="smooth")
    parser.add_argument("--estimator", default="auto", help="in place of the sensor's default")
    parser.add_argument("--workers", type=int, default=2, help="of one core each")
    parser.add_argument("--master", default="local[2]", help="of Spark")
    parser.add_argument("--partitions", type=int, default=32)
    parser.add_argument("--kill", help="a worker's process, or any")
    parser.add_argument("--after-files", type=int, default=8, help="when so many of its output have been begun")
    parser.add_argument("--checked-only", action="store_true", help="plain writes what `check` compares, a third of it all")
    args = parser.parse_args()
    if args.what == "make":
        make(args.folder, args.recordings, args.rows)
    elif args.what == "run":
        todo = (args.engine, args.task, args.estimator, args.workers, args.partitions, args.master)
        run(args.folder, *todo, args.kill, args.after_files, CHECKED if args.checked_only else None)
    else:
        check(args.folder, args.engine)


if __name__ == "__main__":
    main()
