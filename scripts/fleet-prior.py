#!/usr/bin/env python3
"""Makes docs/fleet-prior.md: what a prior learned from a fleet is worth, on simulated sensors of one make.

scripts/fleet-prior.py PROGRAM FOLDER [ESTIMATOR:FLEET:TESTED …] > docs/fleet-prior.md

PROGRAM is the command line, FOLDER where recordings and sensors are kept: what is there already is not made again.
"""

import json
import statistics
import subprocess
import sys
from pathlib import Path

SECONDS = [10, 20, 40, 80, 150]
FIRST_TESTED = 1001
SIMULATE = (
    "simulate --material representative --protocol mixed --speed-mm-s 5 --sample-rate-hz 10 --mismatched".split()
)
CALIBRATED_S = 150
TEXT = """# What a fleet is worth to a new sensor

Made by `scripts/fleet-prior.py`. Simulated sensors of one make (`simulate --material representative --mismatched
--individual N`): R₀ differs by 20 %, slope and peak of the quasi-static curve, time constants, breaking of paths, play and memory
by 15 % each (standard deviation of the logarithm), independently. None follows the law that is fitted. Every recording is 400 s
of movements at random speeds up to 5 mm/s between random strains up to 33 %, and holds, at 10 readings per second, of its
own random motion. A fleet was calibrated on the first {calibrated} s each; other sensors were calibrated on their first seconds, and
scored on what follows {calibrated} s: medians over sensors of the root mean square error in percent of the strain's range, filter /
smoother, and of the share of rows, in percent, that the filter's 95 % interval holds.
"""


class Fleet:
    def __init__(self, program, folder, estimator):
        self.program, self.folder, self.estimator = str(Path(program).resolve()), Path(folder), estimator
        self.folder.mkdir(parents=True, exist_ok=True)

    def run(self, *words):
        return subprocess.run([self.program, "-q", *words], cwd=self.folder, capture_output=True, text=True)

    def trace(self, number):
        name = f"{number}.csv"
        if not (self.folder / name).exists():
            done = self.run(*SIMULATE, "--individual", str(number), "--seed", str(100 + number), "-o", name)
            assert done.returncode == 0, done.stderr
        return name

    def sensor(self, number, seconds, prior=None):
        """A calibrated sensor, or None if that fails."""
        name = f"{self.estimator}-{number}-{seconds}{'-' + prior if prior else ''}"
        if not (self.folder / name).exists():
            words = ["calibrate", self.trace(number), "--until", str(seconds), "--estimator", self.estimator, "-o", name]
            done = self.run(*words, *(["--prior", prior] if prior else []))
            if done.returncode:
                print(f"{name}: {done.stderr.strip()}", file=sys.stderr)
                return None
        return name

    def prior(self, count):
        name = f"{self.estimator}-prior-{count}.toml"
        sensors = [self.sensor(number, CALIBRATED_S) for number in range(1, count + 1)]
        done = self.run("fleet", "fit", *filter(None, sensors), "-o", name, "--force")
        assert done.returncode == 0, done.stderr
        return name

    def scores(self, number, sensor):
        """Errors of filter and smoother, %FS, and the filter's coverage, %."""
        done = self.run("evaluate", self.trace(number), "--sensor", sensor, "--from", str(CALIBRATED_S), "--json")
        assert done.returncode == 0, done.stderr
        [filtered] = json.loads(done.stdout)["recordings"]
        return filtered["rmse_percent_fs"], filtered["smoother"]["rmse_percent_fs"], 100 * filtered["coverage_95"]


def table(fleet, count, tested):
    prior = fleet.prior(count)
    lines = [f"\n## Estimator `{fleet.estimator}`, learned from {count} sensors, {tested} others tested\n"]
    lines += ["| calibrated on | without a prior | with it |", "|---|---|---|"]
    for seconds in SECONDS:
        cells = []
        for given in (None, prior):
            made = [(n, fleet.sensor(n, seconds, given)) for n in range(FIRST_TESTED, FIRST_TESTED + tested)]
            scores = [fleet.scores(number, sensor) for number, sensor in made if sensor]
            refused = f", {tested - len(scores)} refused" if len(scores) < tested else ""
            of = [statistics.median(column) for column in zip(*scores)] or [float("nan")] * 3
            cells.append(f"{of[0]:.1f} / {of[1]:.1f} ({of[2]:.0f}){refused}")
        lines.append(f"| {seconds} s | {cells[0]} | {cells[1]} |")
        print(lines[-1], file=sys.stderr, flush=True)
    return "\n".join(lines)


def main():
    program, folder, *cases = sys.argv[1:]
    tables = []
    for case in cases or ["corrected:30:10", "ekf:100:20"]:
        estimator, count, tested = case.split(":")
        tables.append(table(Fleet(program, folder, estimator), int(count), int(tested)))
    print(TEXT.format(calibrated=CALIBRATED_S) + "\n".join(tables))


main()
