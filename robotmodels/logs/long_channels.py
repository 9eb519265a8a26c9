"""Long channels, looked at piece by piece: samples spread over them, and runs in them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array

_CHUNK = 100_000
"""Samples that are looked at together; statistics of a longer channel are of so many of it."""


def spread(x: Array) -> Array:
    """Samples spread evenly over a long channel, all of a short one."""
    return x[:: -(-len(x) // _CHUNK)] if len(x) else x


def chunks(N: int) -> Iterator[slice]:
    """Pieces of ``N`` samples, one after the other."""
    for start in range(0, N, _CHUNK):
        yield slice(start, min(start + _CHUNK, N))


def moves(q: Array) -> Array:
    """Sizes of the moves from a sample to the next, of a long channel some."""
    return np.abs(spread(q[1:]) - spread(q[:-1]))


def resolution(values: Array) -> float:
    """Quantisation step of a channel; 0 if none shows. Shapes: values (N,)."""
    levels = np.unique(values)
    if len(levels) < 2 or len(levels) > 0.5 * len(values):
        return 0.0
    steps = np.diff(levels)
    steps = steps[steps > 1e-9 * float(np.ptp(levels))]
    return float(np.median(steps)) if len(steps) else 0.0


class Runs:
    """Runs of True of a row that is told piece by piece, those that are long enough."""

    def __init__(self, least: int) -> None:
        self.least, self.begun, self.seen = least, -1, 0
        self.found: list[tuple[int, int]] = []

    def add(self, same: NDArray[np.bool_]) -> None:
        """Values that follow those before."""
        if not len(same):
            return
        edges = (np.flatnonzero(same[1:] != same[:-1]) + 1 + self.seen).tolist()
        if bool(same[0]) == (self.begun < 0):  # it changes between the pieces
            edges.insert(0, self.seen)
        self.seen += len(same)
        if self.begun >= 0:
            edges.insert(0, self.begun)
        self.begun = edges.pop() if len(edges) % 2 else -1
        pairs = zip(edges[::2], edges[1::2], strict=True)
        self.found += [pair for pair in pairs if pair[1] - pair[0] >= self.least]

    def ended(self) -> list[tuple[int, int]]:
        """First index of each run, and the one after its last."""
        if self.begun >= 0 and self.seen - self.begun >= self.least:
            self.found.append((self.begun, self.seen))
        self.begun = -1
        return self.found
