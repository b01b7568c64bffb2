#!/usr/bin/env python3
"""What known strains bring, as the Markdown table of docs/another-day.md.

scripts/known-strains.py PROGRAM FOLDER [SECONDS] > table.md

PROGRAM is the command line, FOLDER holds the public recordings that docs/accuracy.md names. Cases that there are no recordings
of are left out.
"""

import json
import statistics
import subprocess
import sys
from pathlib import Path

CHOSEN_HALVES = ["cbs-multisine", "nylon-sine", "cbs-triangles", "cbs-slow-sine"]
OTHER_HALVES = ["cbs-sawtooth", "cbs-short-ramps", "knee-bend", "nylon-triangle", "cbs-four-speeds"]
SAME_RANGE = [
    ("cbs-slow-sine", "cbs-short-ramps"),
    ("cbs-short-ramps", "cbs-slow-sine"),
    ("cbs-multisine", "cbs-sawtooth"),
    ("cbs-sawtooth", "cbs-multisine"),
]
OTHER_R0 = [
    ("cbs-sawtooth", "cbs-triangles"),
    ("cbs-triangles", "cbs-multisine"),
    ("cbs-multisine", "cbs-four-speeds"),
    ("cbs-short-ramps", "cbs-four-speeds"),
]
RIG = ["cbs-multisine", "cbs-sawtooth", "cbs-short-ramps", "cbs-slow-sine", "cbs-triangles", "cbs-four-speeds"]
MORE = [(a, b) for a in RIG for b in RIG if a != b and (a, b) not in SAME_RANGE + OTHER_R0]
OTHERS = [
    ("nylon-sine", "nylon-triangle"),
    ("nylon-triangle", "nylon-sine"),
    ("cbs-step-hold-7wt", "cbs-step-hold-10wt"),
    ("cbs-step-hold-10wt", "cbs-step-hold-7wt"),
]
GROUPS = {
    "four halves": CHOSEN_HALVES,
    "five more halves": OTHER_HALVES,
    "four pairs": SAME_RANGE,
    "four pairs of another R₀": OTHER_R0,
    f"{len(MORE)} more pairs": MORE,
    "nylon's two, two sensors' step-holds": OTHERS,
}


class Cases:
    def __init__(self, program, folder, every):
        self.program, self.folder, self.every = program, Path(folder), every
        self.scores = {}

    def trace(self, name):
        return self.folder / f"{name}.csv"

    def evaluate(self, *words):
        command = [self.program, "-q", "evaluate", *map(str, words), "--json"]
        done = subprocess.run([*command, "--known-every", str(self.every)], capture_output=True, text=True)
        if done.returncode:
            sys.exit(done.stderr)
        return json.loads(done.stdout)["recordings"]

    def run(self):
        """Every calibration once, tested on all that it is wanted for."""
        for name in CHOSEN_HALVES + OTHER_HALVES:
            if self.trace(name).exists():
                self.keep(name, None, self.evaluate(self.trace(name), "--split", "0.5"))
        pairs = SAME_RANGE + OTHER_R0 + MORE + OTHERS
        for train in dict.fromkeys(train for train, _ in pairs):
            tests = [test for of, test in pairs if of == train and self.trace(test).exists()]
            if self.trace(train).exists() and tests:
                flags = [word for test in tests for word in ("--test", self.trace(test))]
                self.keep(None, train, self.evaluate("--train", self.trace(train), *flags))

    def keep(self, half, train, scored):
        for scores in scored:
            if scores["estimator"] == "corrected":
                case = half or (train, Path(scores["file"]).stem)
                for way, of in (("filter", scores), ("smoother", scores["smoother"])):
                    self.scores[case, way, scores.get("known", "")] = of


def cell(all_of):
    """Geometric mean of errors and of CRPS, mean coverage and the least."""
    mean = lambda name: statistics.geometric_mean(of[name] for of in all_of)
    coverage = [100 * of["coverage_95"] for of in all_of]
    covered = f"{sum(coverage) / len(coverage):.0f}; {min(coverage):.0f}"
    return f"{mean('rmse_percent_fs'):.3g}, {mean('crps_percent_fs'):.3g} ({covered})"


def main(program, folder, every="60"):
    cases = Cases(program, folder, every)
    cases.run()
    known = ["", f"known every {every} s", "rest and stretch known"]
    head = ["as it is", *known[1:]]
    print(f"| cases | | {' | '.join(head)} |\n|---|---|{'---|' * len(head)}")
    for name, group in GROUPS.items():
        for way in ("filter", "smoother"):
            there = [case for case in group if (case, way, "") in cases.scores]
            cells = [cell([cases.scores[case, way, known_name] for case in there]) for known_name in known] if there else []
            print(f"| {name} | {way} | {' | '.join(cells)} |", flush=True)


main(*sys.argv[1:])
