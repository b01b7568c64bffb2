#!/usr/bin/env python3
"""Worth of marks in place of a reference, as the Markdown tables of docs/no-rig.md.

scripts/marks.py PROGRAM people [SEED ...] > people.md
scripts/marks.py PROGRAM recordings FOLDER [NAME ...] > recordings.md

PROGRAM is the command line, FOLDER holds the public recordings that docs/accuracy.md names. Needs numpy.

`people` simulates persons who follow a protocol of `plan`, each with a sensor of their own, and tests on another run of the protocol
and on a motion of the bench. `recordings` erases the reference of a first half but for marks at turning points, each wrong by 3 % of
the range and 0.2 s: the first 10, 20 and 40 of them, as far as there are as many. It calibrates up to the last mark, and tests on the
second half.
"""

import csv
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

MATERIALS = ["ecoflex-00-30", "representative", "vytaflex-10"]
SEEDS = [21, 22, 23, 24, 25, 26]
PERSONS = ["mark_sd=0.02 missed=0 cut_short=0", "mark_sd=0.03 missed=0.03 cut_short=0.05"]
POSITIONS = "rest=0 half=0.15 full=0.3"
RECORDINGS = ["cbs-slow-sine", "cbs-triangles", "cbs-short-ramps", "cbs-multisine", "cbs-sawtooth", "knee-bend"]
NAMES = {"cbs-slow-sine": "slow sine", "cbs-triangles": "triangles", "cbs-short-ramps": "short ramps", "cbs-multisine": "six sines", "cbs-sawtooth": "sawtooth", "knee-bend": "knee"}
MARKS = [10, 20, 40]
STRAIN_ERROR = 0.03
TIME_ERROR_S = 0.2
SETTLING_S = 5.0


class Program:
    def __init__(self, path, folder):
        self.path, self.folder = path, Path(folder)

    def __call__(self, *arguments):
        done = subprocess.run([self.path, "-q", *map(str, arguments)], cwd=self.folder, capture_output=True, text=True)
        if done.returncode:
            raise RuntimeError(f"{arguments}: {done.stderr}")

    def columns(self, name):
        """Columns of a CSV as arrays; NaN where a cell is empty."""
        with open(self.folder / name) as file:
            rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
        number = lambda cell: float(cell) if cell not in ("", "NaN") else np.nan
        return {key: np.array([number(row[key]) for row in rows]) for key in rows[0] if key not in ("flags", None)}

    def scores(self, sensor, trace, since_s, span):
        """Error in percent of the span and percent of rows within the 95 % interval, of filter and smoother."""
        truth = self.columns(trace)
        strain = truth.get("strain", truth.get("angle_deg"))
        name = "strain" if "strain" in truth else "angle_deg"
        sd = "strain_sd" if name == "strain" else "angle_sd"
        found = []
        for command in ("filter", "smooth"):
            self(command, trace, "--sensor", sensor, "-o", "estimates.csv", "--force")
            rows = self.columns("estimates.csv")
            used = (truth["time_s"] >= since_s) & np.isfinite(strain)
            error = (rows[name] - strain)[used]
            found.append((100 * np.sqrt(np.mean(error**2)) / span, 100 * np.mean(np.abs(error) <= 1.96 * rows[sd][used])))
        return found


def curves(readings, strains, test, span):
    """Errors of `map()` between the two ends, and of a cubic through the same marks."""
    reading, truth = test
    known = np.isfinite(reading) & np.isfinite(truth)
    reading, truth = reading[known], truth[known]
    scale = np.mean(readings)
    cubic = np.polyfit(readings / scale, strains, min(3, len(strains) - 1))
    low, high = np.min(strains), np.max(strains)
    near = lambda end: np.mean(readings[np.abs(strains - end) <= 0.1 * (high - low)])
    share = np.clip((reading - near(low)) / (near(high) - near(low)), 0, 1)
    error = lambda estimate: 100 * np.sqrt(np.mean((estimate - truth) ** 2)) / span
    return error(low + share * (high - low)), error(np.polyval(cubic, reading / scale))


def person(path, seed, faults):
    with tempfile.TemporaryDirectory() as folder:
        program = Program(path, folder)
        program("plan", "--strains", POSITIONS, "-o", "protocol.toml")
        sensor = ["--material", MATERIALS[seed % 3], "--mismatched", "--sample-rate-hz", 20, "--individual", seed]
        for name, add in (("board.csv", 0), ("again.csv", 100)):
            program("simulate", "--follow", "protocol.toml", "--person", faults, *sensor, "--seed", seed + add, "-o", name)
        program("simulate", "--protocol", "mixed", "--speed-mm-s", 5, "--elongation-mm", 9, *sensor, "--seed", seed + 200, "-o", "bench.csv")
        program("record", "--port", "board.csv", "--speed", 1e6, "--protocol", "protocol.toml", "-o", "trace.csv")
        program("calibrate", "trace.csv", "-o", "marks.toml")
        program("calibrate", "board.csv", "-o", "full.toml")
        trace = program.columns("trace.csv")
        known = np.isfinite(trace["strain"])
        found = {}
        for name in ("again.csv", "bench.csv"):
            test = program.columns(name)
            lines = curves(trace["resistance_ohm"][known], trace["strain"][known], (test["resistance_ohm"], test["strain"]), 0.3)
            scores = [program.scores(sensor, name, SETTLING_S, 0.3) for sensor in ("marks.toml", "full.toml")]
            found[name] = (*scores, *lines)
        return found


def people(path, seeds):
    print("| person | test | filter | smoother | filter, all of the strain known | smoother | `map()` | cubic | worst ÷ `map()` |")
    print("|---|---|---|---|---|---|---|---|---|")
    for faults in PERSONS:
        with ThreadPoolExecutor(2) as pool:
            found = list(pool.map(lambda seed: person(path, seed, faults), seeds))
        for name, title in (("again.csv", "the protocol again"), ("bench.csv", "another motion")):
            cases = [case[name] for case in found]
            cell = lambda which, how: f"{mean([case[which][how][0] for case in cases]):.1f} ({min(case[which][how][1] for case in cases):.0f})"
            lines = [f"{mean([case[k] for case in cases]):.1f}" for k in (2, 3)]
            worst = max(case[0][0][0] / case[2] for case in cases)
            print(f"| {faults} | {title} | {cell(0, 0)} | {cell(0, 1)} | {cell(1, 0)} | {cell(1, 1)} | {lines[0]} | {lines[1]} | {worst:.2f} |", flush=True)


def mean(values):
    """Geometric mean."""
    return float(np.exp(np.mean(np.log(values))))


def turning_points(strain, count):
    """Rows of the first turning points, a tenth of the range apart at least; the first row with them."""
    span = np.nanmax(strain) - np.nanmin(strain)
    turns, rising = [0], None
    for row in range(1, len(strain)):
        if not np.isfinite(strain[row]):
            continue
        change = strain[row] - strain[turns[-1]]
        if rising is None or (change > 0) == rising:
            if abs(change) > 0.1 * span and rising is None:
                rising = change > 0
            if rising is not None:
                turns[-1] = row if len(turns) > 1 else turns[-1]
                if len(turns) == 1:
                    turns.append(row)
        elif abs(change) > 0.1 * span:
            turns.append(row)
            rising = not rising
    return turns[:count]


def recording(path, folder, name, count):
    with tempfile.TemporaryDirectory() as work:
        program = Program(path, work)
        text = (folder / f"{name}.csv").read_text()
        (Path(work) / "trace.csv").write_text(text)
        trace = program.columns("trace.csv")
        time_s = trace["time_s"]
        strain = trace.get("strain", trace.get("angle_deg"))
        reading = trace.get("resistance_ohm", trace.get("resistance_ratio"))
        column = "strain" if "strain" in trace else "angle_deg"
        half_s = time_s[len(time_s) // 2]
        first = time_s < half_s
        span = np.nanmax(strain[~first]) - np.nanmin(strain[~first])
        rows = turning_points(strain[first], count)
        random = np.random.default_rng(1)
        marked = [(time_s[row] + TIME_ERROR_S * random.normal(), strain[row] + STRAIN_ERROR * span * random.normal()) for row in rows]
        marked = [(min(max(t, time_s[0]), time_s[first][-1]), x) for t, x in marked]
        sd = "strain_sd" if column == "strain" else "angle_sd"
        lines = [f"time_s,{column},{sd}"] + [f"{t:.6f},{x:.6f},{STRAIN_ERROR * span:.6f}" for t, x in sorted(marked)]
        (Path(work) / "marks.csv").write_text("\n".join(lines) + "\n")
        until_s = time_s[np.searchsorted(time_s, max(t for t, _ in marked))] + 1e-3
        program("calibrate", "trace.csv", "--until", until_s, "--marks", "marks.csv", "-o", "marks.toml")
        program("calibrate", "trace.csv", "--until", until_s, "-o", "full.toml")
        read = np.array([reading[np.nanargmin(np.abs(time_s - t) + 1e9 * ~np.isfinite(reading))] for t, _ in marked])
        curve = curves(read, np.array([x for _, x in marked]), (reading[~first], strain[~first]), span)
        scores = [program.scores(sensor, "trace.csv", half_s, span) for sensor in ("marks.toml", "full.toml")]
        return len(rows), scores, curve


def recordings(path, folder, names):
    print("| recording | marks | filter | smoother | filter, all of the strain known | `map()` | cubic |")
    print("|---|---|---|---|---|---|---|")

    def rows(name):
        lines, tried = [], set()
        for count in MARKS:
            try:
                marks, scores, curve = recording(path, folder, name, count)
            except RuntimeError as error:
                print(f"{name}, {count} marks: {error}", file=sys.stderr)
                lines.append(f"| {NAMES.get(name, name)} | {count} | refused | | | | |")
                continue
            if marks in tried:
                continue
            tried.add(marks)
            cells = [f"{error:.1f} ({within:.0f})" for error, within in (*scores[0], scores[1][0])]
            lines.append(f"| {NAMES.get(name, name)} | {marks} | {' | '.join(cells)} | {curve[0]:.1f} | {curve[1]:.1f} |")
        return lines

    with ThreadPoolExecutor(2) as pool:
        for lines in pool.map(rows, names):
            print("\n".join(lines), flush=True)


def main():
    path, what, *rest = sys.argv[1:]
    path = str(Path(path).resolve())
    if what == "people":
        people(path, [int(seed) for seed in rest] or SEEDS)
    else:
        recordings(path, Path(rest[0]).resolve(), rest[1:] or RECORDINGS)


if __name__ == "__main__":
    main()
