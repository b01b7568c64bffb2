#!/usr/bin/env python3
"""The rows of real recordings in the tables of README.md and docs/accuracy.md, measured and put into both files.

scripts/accuracy-tables.py PROGRAM FOLDER

PROGRAM is the command line, FOLDER holds the public recordings that docs/accuracy.md names. What there is no recording of stays
as it is. Takes some minutes.
"""

import json
import re
import statistics
import subprocess
import sys
from pathlib import Path

HALF = ("--split", "0.5")
# How a row begins after the maker's name in both tables, and what `evaluate` is given.
CASES = {
    "sine 0 to 30 %": ("cbs-slow-sine", HALF),
    "short ramps to 30 %": ("cbs-short-ramps", HALF),
    "triangles at several speeds": ("cbs-triangles", HALF),
    "random six-sine": ("cbs-multisine", HALF),
    "sawtooth of random size and rate": ("cbs-sawtooth", HALF),
    "0 to 20 %, 300 s holds": ("cbs-four-speeds", HALF),
    "sine 0 to 96 %": ("nylon-sine", HALF),
    "triangle 0 to 96 %": ("nylon-triangle", HALF),
    "bends to 90°": ("knee-bend", HALF),
    "calibrated on the sine, tested on the triangle": ("nylon-sine", "nylon-triangle"),
    "calibrated on the six-sine, tested on the sawtooth": ("cbs-multisine", "cbs-sawtooth"),
    "calibrated on the sine, tested on the short ramps": ("cbs-slow-sine", "cbs-short-ramps"),
    "calibrated on the triangles, tested on the six-sine": ("cbs-triangles", "cbs-multisine"),
    "step-holds, 7.5 wt-%, every level": ("cbs-step-hold-7wt", ("--split", "0.71")),
    "step-holds of minutes, every level": ("cbs-step-hold-7wt", ("--split", "0.71")),
    "step-holds, 10 wt-%, every level": ("cbs-step-hold-10wt", ("--split", "0.73")),
    "step-holds, calibrated up to 20 % strain": ("cbs-step-hold-7wt", ("--split", "0.5614")),
    "step-holds, calibrated on a sensor of 7.5": ("cbs-step-hold-7wt", "cbs-step-hold-10wt"),
    "calibrated on one sensor, tested on another": ("cbs-step-hold-7wt", "cbs-step-hold-10wt"),
}


def evaluated(program, folder, name, how):
    """What `evaluate` scores, or None if a recording is missing."""
    trace = lambda name: folder / f"{name}.csv"
    files = [trace(name)] + ([trace(how)] if isinstance(how, str) else [])
    if not all(file.exists() for file in files):
        return None
    words = ["--train", files[0], "--test", files[1]] if isinstance(how, str) else [files[0], *how]
    done = subprocess.run([program, "-q", "evaluate", *map(str, words), "--json"], capture_output=True, text=True)
    if done.returncode:
        sys.exit(done.stderr)
    return json.loads(done.stdout)["recordings"][0]


def row(line, scores):
    """A row of a table with these scores: static cubic, perhaps the leaky bank, filter and smoother."""
    error = lambda of: f"{of['rmse_percent_fs']:.1f}"
    covered = lambda of: f"{error(of)} ({100 * of['coverage_95']:.0f})"
    known = scores["baselines"]
    cells = line.strip().strip("|").split("|")
    banks = [error(known["leaky_bank"])] if len(cells) == 5 else []
    new = [error(known["static_cubic"]), *banks, covered(scores), covered(scores["smoother"])]
    return " | ".join(["|" + cells[0].rstrip(), *new]) + " |"


def main(program, folder):
    scored, ratios = {}, {"filter": [], "smoother": []}
    for case in dict.fromkeys(CASES.values()):
        scored[case] = evaluated(program, Path(folder), *case)
        if scored[case] and case[1] == HALF:
            static = scored[case]["baselines"]["static_cubic"]["rmse_percent_fs"]
            for way, of in (("filter", scored[case]), ("smoother", scored[case]["smoother"])):
                ratios[way].append((of["rmse_percent_fs"] / static, 100 * of["coverage_95"]))
    root = Path(__file__).resolve().parent.parent
    for file in (root / "README.md", root / "docs" / "accuracy.md"):
        lines = file.read_text().split("\n")
        for k, line in enumerate(lines):
            found = [begin for begin in CASES if re.match(rf"\| [^|]*?[:,] {re.escape(begin)}", line)]
            if found and scored[CASES[max(found, key=len)]]:
                lines[k] = row(line, scored[CASES[max(found, key=len)]])
        file.write_text("\n".join(lines))
    for way, of in ratios.items():
        found, coverage = zip(*of)
        mean = statistics.geometric_mean(found)
        covered = f"{sum(coverage) / len(coverage):.0f} % ({min(coverage):.0f} % at least)"
        print(f"{way}: {mean:.3f} of the static cubic, geometric mean of {len(of)} halves; intervals cover {covered}")


if len(sys.argv) != 3:
    sys.exit(__doc__)
main(*sys.argv[1:])
