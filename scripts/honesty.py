#!/usr/bin/env python3
"""The table of docs/honesty.md: how often simulated strains lie within the intervals that are stated.

scripts/honesty.py PROGRAM [--only PART] [--check] [--jobs N]

PROGRAM is the command line. Each case is simulated, calibrated on a file of its first half, and scored on its second half, which the
calibration knows nothing of. PART chooses cases whose name contains it; then the page is left as it is. With --check the rows are
compared with the page's: exit code 1 where they differ. Needs gcc. Takes half an hour of processor time.
"""

import argparse
import csv
import math
import re
import statistics
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

PAGE = Path(__file__).resolve().parent.parent / "docs/honesty.md"
#: Standard deviations of a Gaussian interval that holds these shares, %.
DEVIATIONS = {50: 0.6745, 90: 1.6449, 95: 1.96}
HEAD = [
    "| case | estimates | recordings | error, %FS | 50 % holds | 90 % | 95 % | 95 % at least | flagged, % | silent far misses in 1000 |",
    "|---|---|--:|--:|--:|--:|--:|--:|--:|--:|",
]
#: Seed of the recording that is scored where calibration was tested on the first.
ANOTHER_SEED = 101
#: A miss is far where the truth is so much of full scale beyond the 95 % interval.
FAR = 0.1
#: Flags of rows that say themselves that they are doubtful. The others are named in the page.
DOUBTS = ("missing", "saturated", "implausible", "stuck", "rejected", "start_up", "recovering", "extrapolated", "rest_moved")


@dataclass
class Case:
    """A simulated recording, and what is done with it."""

    name: str
    simulate: list
    #: Seconds without a row in the middle of the second half.
    pause_s: float = 0.0
    #: True if the filter begins with the second half, in mid-motion.
    is_started_late: bool = False
    #: True if calibration is told the second half too, with --until, and another recording of the sensor is scored.
    is_tested: bool = False


#: Names of the rows of a case, and the words of the command line that estimate.
WAYS = {"filter": ["filter"], "exported C": ["export"], "smoother": ["smooth"], "`ekf`": ["filter", "--estimator", "ekf"]}


def cases():
    """Named before any was run; the page says what was chosen on them."""

    def of(name, *words, **more):
        return Case(name, list(words), **more)

    mixed = ("--protocol", "mixed", "--speed-mm-s", "5")
    found = []
    protocols = {
        "extend-retract": ("--speed-mm-s", "1"),
        "extend-hold": ("--speed-mm-s", "1"),
        "load-steps": ("--speed-mm-s", "2"),
        "mixed": ("--speed-mm-s", "5"),
    }
    for protocol, speed in protocols.items():
        for material in ("ecoflex-00-30", "ecoflex-00-50", "vytaflex-10"):
            for seed in (1, 2):
                words = ("--protocol", protocol, *speed, "--material", material, "--seed", seed, "--sample-rate-hz", 10)
                found.append(of(f"protocol {protocol}", *words))
                found.append(of(f"protocol {protocol}, another law", *words, "--mismatched"))
    for protocol in ("extend-retract", "extend-hold", "load-steps"):
        for material in ("ecoflex-00-30", "vytaflex-10"):
            words = ("--protocol", protocol, *protocols[protocol], "--material", material, "--seed", 1, "--sample-rate-hz", 10)
            found.append(of(f"protocol {protocol}, tested with `--until`", *words, is_tested=True))
    for material in ("ecoflex-00-30", "ecoflex-00-50", "vytaflex-10"):
        for rate in (2, 20, 100):
            for seed in (3, 4):
                found.append(of(f"rate {rate} Hz", *mixed, "--material", material, "--seed", seed, "--sample-rate-hz", rate))
        for seed in (5, 6):
            words = (*mixed, "--material", material, "--seed", seed, "--sample-rate-hz", 10)
            found.append(of("start in mid-motion", *words, is_started_late=True))
            for pause in (5, 60):
                found.append(of(f"pause of {pause} s", *words, pause_s=pause))
    return found


def run(program, *words, cwd):
    done = subprocess.run([program, "-q", *map(str, words)], cwd=cwd, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(done.stderr.strip().split("\n")[0])
    return done.stdout


def rows_of(path):
    """The rows of a CSV as dictionaries, and its lines before them."""
    lines = Path(path).read_text(encoding="utf-8").split("\n")
    head = [line for line in lines if line.startswith("#")]
    return head, list(csv.DictReader(line for line in lines if line and not line.startswith("#")))


def write(path, head, rows, columns):
    """A recording of these columns."""
    with open(path, "w", encoding="utf-8") as file:
        file.writelines(f"{line}\n" for line in [*head, ",".join(columns)])
        file.writelines(",".join(row[column] for column in columns) + "\n" for row in rows)


def scored(case, program):
    """Errors of each way in the rows that are scored, or what was refused."""
    with tempfile.TemporaryDirectory() as folder:
        run(program, "simulate", *case.simulate, "-o", "whole.csv", cwd=folder)
        head, rows = rows_of(f"{folder}/whole.csv")
        times = [float(row["time_s"]) for row in rows]
        half = times[-1] / 2
        seen = [row for row, t in zip(rows, times) if t < half]
        write(f"{folder}/first.csv", head, seen, ["time_s", "resistance_ohm", "strain"])
        words = ["whole.csv", "--until", half] if case.is_tested else ["first.csv"]
        try:
            run(program, "calibrate", *words, "-o", "sensor.toml", cwd=folder)
        except RuntimeError as refused:
            return case, str(refused)
        if case.is_tested:
            seed = case.simulate.index("--seed") + 1
            another = [*case.simulate[:seed], ANOTHER_SEED, *case.simulate[seed + 1 :]]
            run(program, "simulate", *another, "-o", "another.csv", cwd=folder)
            head, rows = rows_of(f"{folder}/another.csv")
            times = [float(row["time_s"]) for row in rows]
        begin, end = half if case.is_started_late else 0.0, 1.5 * half
        used = [k for k, t in enumerate(times) if t >= begin and not end - case.pause_s < t <= end]
        write(f"{folder}/used.csv", head, (rows[k] for k in used), ["time_s", "resistance_ohm"])
        truth = {rows[k]["time_s"]: float(rows[k]["strain"]) for k in used if times[k] >= half}
        strains = [float(row["strain"]) for row in seen]
        span = max(strains) - min(strains)
        results = {}
        for name, words in WAYS.items():
            estimates = in_c(program, folder) if words == ["export"] else on_this_computer(program, words, folder)
            pairs = zip((rows[k]["time_s"] for k in used), estimates, strict=True)
            results[name] = [row_score(row, truth[time], span) for time, row in pairs if time in truth]
        return case, results


def on_this_computer(program, words, folder):
    run(program, *words, "--sensor", "sensor.toml", "used.csv", "-o", "out.csv", "--force", cwd=folder)
    return rows_of(f"{folder}/out.csv")[1]


def in_c(program, folder):
    """What the exported code estimates."""
    run(program, "export", "--sensor", "sensor.toml", "--target", "c", "-o", "c", cwd=folder)
    sources = [f"c/{name}" for name in ("src/ohmstrain.c", "selftest/replay.c")]
    subprocess.run(["gcc", "-O2", "-Ic/src", *sources, "-lm", "-o", "replay"], cwd=folder, check=True)
    with open(f"{folder}/used.csv", encoding="utf-8") as trace:
        out = subprocess.run(["./replay"], cwd=folder, stdin=trace, capture_output=True, text=True, check=True).stdout
    header = Path(folder, "c/src/ohmstrain.h").read_text(encoding="utf-8")
    flags = re.search(r"enum ohmstrain_flag \{(.*?)\};", header, re.DOTALL)[1]
    bits = {int(bit): name.lower() for name, bit in re.findall(r"OHMSTRAIN_(\w+) = (\d+)", flags)}
    rows = list(csv.DictReader(out.splitlines()))
    return [row | {"flags": "|".join(name for bit, name in bits.items() if int(row["flags"]) & bit)} for row in rows]


def row_score(row, truth, span):
    """Error in shares of full scale, error in deviations, whether it is flagged, whether it is far outside of its interval."""
    error, sd = abs(float(row["strain"]) - truth), float(row["strain_sd"])
    is_flagged = any(flag in DOUBTS for flag in row["flags"].split("|"))
    return error / span, error / sd, is_flagged, (error - DEVIATIONS[95] * sd) / span > FAR


def line(name, way, all_rows):
    """A row of the table, over recordings: each counts alike."""

    def mean(of):
        return statistics.fmean(statistics.fmean(of(row) for row in rows) for rows in all_rows)

    error = 100 * math.exp(statistics.fmean(math.log(math.sqrt(statistics.fmean(row[0] ** 2 for row in rows))) for rows in all_rows))
    shares = [f"{100 * mean(lambda row: row[1] <= times):.0f}" for times in DEVIATIONS.values()]
    least = min(statistics.fmean(row[1] <= DEVIATIONS[95] for row in rows) for rows in all_rows)
    silent = 1000 * mean(lambda row: row[3] and not row[2])
    flagged = 100 * mean(lambda row: row[2])
    cells = [name, way, str(len(all_rows)), f"{error:.1f}", *shares, f"{100 * least:.0f}", f"{flagged:.0f}", f"{silent:.1f}"]
    return "| " + " | ".join(cells) + " |"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("--only", default="")
    parser.add_argument("--check", action="store_true")
    parser.add_argument("--jobs", type=int, default=1)
    given = parser.parse_args()
    chosen = [case for case in cases() if given.only in case.name]
    with ThreadPoolExecutor(given.jobs) as pool:
        done = list(pool.map(lambda case: scored(case, str(Path(given.program).resolve())), chosen))
    refused = [f"- {case.name} (`{' '.join(map(str, case.simulate))}`): {text}" for case, text in done if isinstance(text, str)]
    table = []
    for name in dict.fromkeys(case.name for case, _ in done):
        of_name = [results for case, results in done if case.name == name and not isinstance(results, str)]
        table += [line(name, way, [results[way] for results in of_name]) for way in WAYS if of_name]
    print("\n".join(table + refused))
    page = PAGE.read_text(encoding="utf-8")
    if given.check:
        missing = [line for line in table + refused if line not in page.split("\n")]
        sys.exit("\n".join([f"{PAGE.name} has other rows than:", *missing]) if missing else 0)
    if not given.only:
        begin, end = "<!-- made by scripts/honesty.py -->\n", "<!-- end -->\n"
        before, after = page.split(begin)[0], page.split(end)[1]
        PAGE.write_text("".join([before, begin, "\n".join([*HEAD, *table, "", *refused]).rstrip(), "\n", end, after]), encoding="utf-8")


main()
