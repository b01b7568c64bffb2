#!/usr/bin/env python3
"""Other methods on the recordings and splits of docs/accuracy.md, and the table there that compares them.

compare.py PROGRAM FOLDER RESULTS

PROGRAM is the command line, FOLDER holds the public recordings, RESULTS is a JSON file: what it holds already is not computed
again. One processor, about an hour. `--table` alone writes the table from RESULTS.
"""

import argparse
import json
import os
import resource
import subprocess
import tempfile
import time
from pathlib import Path

for threads in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "RAYON_NUM_THREADS"):
    os.environ.setdefault(threads, "1")
os.environ.setdefault("KERAS_BACKEND", "jax")
os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false")

import features
import keras
import numpy as np
import regressions
import sequences
from recordings import cases
from regressions import Regression
from scipy.stats import norm

METHODS = {
    "static cubic": lambda: Regression(features.reading, regressions.cubic),
    "ridge on products of low-passes": lambda: Regression(features.bank, regressions.products),
    "ridge on products of lags (NARX)": lambda: Regression(features.lags, regressions.products),
    "LightGBM on low-passes": lambda: Regression(features.bank, regressions.boosted, regressions.SEEDS),
    "Gaussian process, 900 rows": lambda: Regression(features.distances, regressions.process, rows=900),
    "low-passes and a small net": lambda: Regression(features.bank, regressions.small_net, regressions.SEEDS),
    "echo state network": sequences.EchoState,
    "GRU of 32 units": lambda: sequences.Recurrent(keras.layers.GRU),
    "LSTM of 32 units": lambda: sequences.Recurrent(keras.layers.LSTM),
}
GROUPS = {"halves": "second half", "left out": "fifth recording, four known", "transfers": "another motion"}


def scores(predicted, deviation, truth):
    """Error and CRPS of normal distributions in percent of full scale, and the share within their 95 % interval."""
    error, full_scale = predicted - truth, float(np.ptp(truth))
    z = error / deviation
    crps = deviation * (z * (2 * norm.cdf(z) - 1) + 2 * norm.pdf(z) - 1 / np.sqrt(np.pi))
    return {
        "error": 100 * float(np.sqrt(np.mean(error**2))) / full_scale,
        "crps": 100 * float(np.mean(crps)) / full_scale,
        "covered": 100 * float(np.mean(np.abs(z) < norm.ppf(0.975))),
    }


def rival(made, case):
    """Scores of a method, with the seconds that it learned and the microseconds that a row took."""
    method, begun = made(), time.process_time()
    deviation = method.fit_with_deviation(case.parts)
    seconds = time.process_time() - begun
    # The first time it is compiled, too.
    predicted = method.predict(case.test)
    begun = time.process_time()
    method.predict(case.test)
    row_us = 1e6 * (time.process_time() - begun) / len(case.test.truth)
    scored = scores(predicted[case.scored], deviation, case.test.truth[case.scored])
    return {**scored, "seconds": seconds, "row_us": row_us}


def run(program, *words):
    """Returns the output of a command, and the processor time that it took, s."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run([program, "-q", *words], capture_output=True, text=True, check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return done.stdout, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def ours(program, case):
    """Scores of filter and smoother."""
    printed, _ = run(program, "evaluate", *case.arguments, "--json")
    # The first is the default.
    recording = json.loads(printed)["recordings"][0]
    found = {}
    for name, of in (("filter", recording), ("smoother", recording["smoother"])):
        found[name] = {
            "error": of["rmse_percent_fs"],
            "crps": of["crps_percent_fs"],
            "covered": 100 * of["coverage_95"],
        }
    if case.group == "halves":
        with tempfile.TemporaryDirectory() as folder:
            sensor = f"{folder}/sensor.toml"
            until = str(case.test.time_s[case.scored][0])
            _, seconds = run(program, "calibrate", case.arguments[0], "--until", until, "-o", sensor)
            for name, command in (("filter", "filter"), ("smoother", "smooth")):
                _, row_s = run(program, command, case.arguments[0], "--sensor", sensor)
                found[name] |= {"seconds": seconds, "row_us": 1e6 * row_s / len(case.test.truth)}
    return found


def computed(program, folder, file):
    """Adds to the results what is missing there."""
    results = json.loads(file.read_text()) if file.exists() else {}
    for case in cases(folder):
        known = results.setdefault(case.group, {}).setdefault(case.name, {})
        if "filter" not in known:
            known |= ours(program, case)
        for name, made in METHODS.items():
            if name not in known:
                known[name] = rival(made, case)
                print(f"{case.group}, {case.name}, {name}: {known[name]}", flush=True)
                keras.backend.clear_session()
                file.write_text(json.dumps(results, indent=1))
        file.write_text(json.dumps(results, indent=1))
    return results


def geometric(values):
    return float(np.exp(np.mean(np.log(values))))


def cells(results, name):
    """A method's row: in each group error, CRPS, mean and least coverage; seconds and microseconds in halves."""
    row = [name]
    for group in GROUPS:
        of = [case[name] for case in results[group].values()]
        error, crps = (geometric([scored[what] for scored in of]) for what in ("error", "crps"))
        covered = [scored["covered"] for scored in of]
        row.append(f"{error:.1f}, {crps:.2f} ({np.mean(covered):.0f}; {min(covered):.0f})")
    halves = results["halves"].values()
    row += [f"{np.median([case[name][what] for case in halves]):.2g}" for what in ("seconds", "row_us")]
    return f"| {' | '.join(row)} |"


def table(results):
    """The table of docs/accuracy.md."""
    head = [f"{words} ({len(results[group])})" for group, words in GROUPS.items()]
    lines = [
        f"| method | {' | '.join(head)} | s to learn | µs a row |",
        "|---|---|---|---|---|---|",
        *(cells(results, name) for name in (*METHODS, "filter", "smoother")),
    ]
    return "\n".join(lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program")
    parser.add_argument("folder", type=Path)
    parser.add_argument("results", type=Path)
    parser.add_argument("--table", action="store_true")
    arguments = parser.parse_args()
    if arguments.table:
        results = json.loads(arguments.results.read_text())
    else:
        results = computed(arguments.program, arguments.folder, arguments.results)
    page = Path(__file__).resolve().parents[2] / "docs" / "accuracy.md"
    before, rest = page.read_text().split("<!-- rivals -->\n", 1)
    _, after = rest.split("<!-- end of rivals -->\n", 1)
    page.write_text(f"{before}<!-- rivals -->\n{table(results)}\n<!-- end of rivals -->\n{after}")


if __name__ == "__main__":
    main()
