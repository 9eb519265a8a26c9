"""Long logs: evenly spread samples and stretches, steps between samples, and runs of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from .log import Log, selected

SAMPLES = 100_000
"""Largest number of samples of a representative part."""


def stretches(log: Log, length: int, samples: int = SAMPLES) -> Log:
    """Bounded part of a long log: evenly spread stretches."""
    if len(log) <= samples:
        return log
    length = max(1, min(length, samples))
    every = [
        np.arange(start, min(start + length, rows.stop))
        for rows in log.recordings()
        for start in range(rows.start, rows.stop, length)
    ]
    whole = [rows for rows in every if 2 * len(rows) >= length] or every
    count = min(len(whole), max(1, samples // max(map(len, whole))))
    places = np.unique(np.linspace(0, len(whole) - 1, count).round().astype(int))
    taken = [whole[k] for k in places]
    return selected(log, np.concatenate(taken), np.cumsum([0, *map(len, taken)])[:-1])


def spread(x: Array) -> Array:
    """Samples spread evenly over a long channel, all of a short one."""
    return x[:: max(1, -(-len(x) // SAMPLES))]


def moves(q: Array) -> Array:
    """Steps between samples; of a long channel, a spread subset."""
    return np.abs(spread(q[1:]) - spread(q[:-1]))


def resolution(values: Array) -> float:
    """Quantisation step of a channel; 0 if there is none. Shapes: values (N,)."""
    levels = np.unique(values)
    if len(levels) < 2 or len(levels) > 0.5 * len(values):
        return 0.0
    steps = np.diff(levels)
    steps = steps[steps > 1e-9 * float(np.ptp(levels))]
    return float(np.median(steps)) if len(steps) else 0.0


def runs(mask: NDArray[np.bool_], least: int) -> list[tuple[int, int]]:
    """First index, and the one after the last, of runs of True of at least a length."""
    edges = np.flatnonzero(np.diff(mask, prepend=False, append=False)).reshape(-1, 2)
    return [(a, b) for a, b in edges.tolist() if b - a >= least]
