"""Features of the past, for methods without a memory of their own."""

import numpy as np

TIMES_S = np.array([0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0])


def low_passes(recording, times_s):
    """The ratio's exponential smoothings with these time constants, in columns; they start at the first reading."""
    gains = 1 - np.exp(-np.diff(recording.time_s, prepend=recording.time_s[0])[:, None] / np.asarray(times_s))
    state = np.full(len(times_s), recording.ratio[0])
    rows = np.empty_like(gains)
    for k, (gain, ratio) in enumerate(zip(gains, recording.ratio)):
        state = state + gain * (ratio - state)
        rows[k] = state
    return rows


def reading(recording):
    """The ratio alone."""
    return recording.ratio[:, None]


def bank(recording):
    """The ratio and its low-passes."""
    return np.column_stack([recording.ratio, low_passes(recording, TIMES_S)])


def distances(recording):
    """The ratio and how far it is from three of its low-passes."""
    return np.column_stack([recording.ratio, recording.ratio[:, None] - low_passes(recording, TIMES_S[1::2])])


def lags(recording):
    """The ratio now and 0.5 to 32 s ago."""
    ago = [np.interp(recording.time_s - lag, recording.time_s, recording.ratio) for lag in TIMES_S]
    return np.column_stack([recording.ratio, *ago])
