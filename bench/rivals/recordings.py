"""Recordings, and the cases in which methods are compared."""

from dataclasses import dataclass

import numpy as np

HALVES = [
    "cbs-slow-sine", "cbs-short-ramps", "cbs-triangles", "cbs-multisine", "cbs-sawtooth", "cbs-four-speeds",
    "nylon-sine", "nylon-triangle", "knee-bend",
]  # fmt: skip
ONE_RIG = ["cbs-multisine", "cbs-sawtooth", "cbs-short-ramps", "cbs-slow-sine", "cbs-triangles"]
PAIRS = [
    ("nylon-sine", "nylon-triangle"),
    ("cbs-multisine", "cbs-sawtooth"),
    ("cbs-slow-sine", "cbs-short-ramps"),
    ("cbs-triangles", "cbs-multisine"),
]


@dataclass
class Recording:
    """Rows with a reading and a reference."""

    name: str
    time_s: np.ndarray
    # Reading over the median of the first twenty.
    ratio: np.ndarray
    # Strain, or an angle in degrees.
    truth: np.ndarray

    @property
    def step_s(self):
        """The median time between rows."""
        return float(np.median(np.diff(self.time_s)))


@dataclass
class Part:
    """Rows of a recording from which a method may learn."""

    recording: Recording
    learns: np.ndarray


@dataclass
class Case:
    """Parts to learn from, and the rows on which a method is scored; it runs from the first row of that recording on."""

    group: str
    name: str
    parts: list
    test: Recording
    scored: np.ndarray
    # The same for `ohmstrain evaluate`.
    arguments: list


def load(folder, name):
    """A trace CSV."""
    rows = np.genfromtxt(folder / f"{name}.csv", delimiter=",", names=True, comments="#")
    reading, truth = (rows[rows.dtype.names[column]] for column in (1, 2))
    known = np.isfinite(reading) & np.isfinite(truth)
    reading, truth, time_s = reading[known], truth[known], rows["time_s"][known]
    return Recording(name, time_s, reading / np.median(reading[:20]), truth)


def cases(folder):
    """All cases of which the folder has the recordings."""
    has = lambda *names: all((folder / f"{name}.csv").exists() for name in names)
    file = lambda name: str(folder / f"{name}.csv")
    found = []
    for name in filter(has, HALVES):
        recording = load(folder, name)
        first = np.arange(len(recording.truth)) < len(recording.truth) // 2
        words = [file(name), "--split", "0.5"]
        found.append(Case("halves", name, [Part(recording, first)], recording, ~first, words))
    across = [("left out", [name for name in ONE_RIG if name != left], left) for left in ONE_RIG if has(*ONE_RIG)]
    across += [("transfers", [train], test) for train, test in PAIRS if has(train, test)]
    for group, train, test in across:
        parts = [Part(recording, np.full(len(recording.truth), True)) for recording in (load(folder, n) for n in train)]
        words = [word for name in train for word in ("--train", file(name))] + ["--test", file(test)]
        recording = load(folder, test)
        everything = np.full(len(recording.truth), True)
        found.append(Case(group, f"{'+'.join(train)} > {test}", parts, recording, everything, words))
    return found


def folds(parts):
    """Parts to learn from and the part left out: each recording in turn, or each quarter of the only one."""
    if len(parts) > 1:
        return [([part for part in parts if part is not left], left) for left in parts]
    (part,) = parts
    quarters = np.array_split(np.flatnonzero(part.learns), 4)
    made = []
    for quarter in quarters:
        left = np.isin(np.arange(len(part.learns)), quarter)
        made.append(([Part(part.recording, part.learns & ~left)], Part(part.recording, left)))
    return made
