"""Stretches of a long log, of which enough can be told."""

from __future__ import annotations

import numpy as np

from .log import Log

SAMPLES = 100_000
"""Of a log that are looked at together."""


def stretches(log: Log, length: int, samples: int = SAMPLES) -> Log:
    """Bounded part of a long log: evenly spread stretches."""
    if len(log) <= samples:
        return log
    length = max(1, min(length, samples))
    every = [
        slice(start, min(start + length, rows.stop))
        for rows in log.recordings()
        for start in range(rows.start, rows.stop, length)
    ]
    whole = [rows for rows in every if 2 * (rows.stop - rows.start) >= length] or every
    count = min(len(whole), max(1, samples // max(r.stop - r.start for r in whole)))
    places = np.unique(np.linspace(0, len(whole) - 1, count).round().astype(int))
    taken = [whole[k] for k in places]
    starts = np.cumsum([0, *(rows.stop - rows.start for rows in taken)])[:-1]
    q, tau = (np.concatenate([x[rows] for rows in taken]) for x in (log.q, log.tau))
    v, a = (
        None if x is None else np.concatenate([x[rows] for rows in taken]) for x in (log.v, log.a)
    )
    return Log(log.dt, q, tau, v, a, starts=starts, names=log.names, delay=log.delay)
