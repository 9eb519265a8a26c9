"""Channels of a log: evenly spread samples and stretches, steps, outliers and frozen samples."""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from .log import ARRAYS, Log, RefusedRows, selected
from .time_base import regular_rows

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


_TIMES, _STEPS = 6.0, 4.0
"""Least distance of an outlier: relative to the 90 % and the local 75 % quantile of the roughness
(14 standard deviations of white noise), and in quantisation steps."""
_NEAR, _OF_CUBIC = 25, 0.8
"""Neighbouring samples on either side; least distance from their median relative to the cubic."""
_SHARES = {"q": 0.0, "tau": 0.25}
"""Least distance of an outlier relative to the 98 % range: small for positions (large spikes of
acceleration), larger for torques (friction reversals)."""
_FROZEN, _RARE = 8, 0.01
"""Least number of repeated samples of a frozen channel, and largest share of others that repeat."""
_SLOW, _LEAP, _MOVES = 0.3, 5.0, 0.1
"""Relative to the 90 % quantile of the steps: speed before a stop, jump after it, and speed of a
joint with frozen torque."""
_LEAST, _PART, _PARTS = 9, 20_000, 5
"""Least samples of a recording; length and number of parts for the typical roughness."""
_APART = 1e7  # periods between recordings, above any interpolated gap


class BadSamples(NamedTuple):
    """Outliers or frozen samples of one channel."""

    joint: int
    channel: str
    frozen: bool
    rows: NDArray[np.int64]


def bad_samples(log: Log) -> list[BadSamples]:
    """Outliers and frozen samples, joint by joint."""
    findings: list[BadSamples] = []
    for j, channel in product(range(log.n), ("q", "tau")):
        outliers: list[int] = []
        frozen: list[int] = []
        for rows in log.recordings():
            q, tau = log.q[rows, j], log.tau[rows, j]
            if len(q) >= _LEAST:
                ends = _frozen_positions(q) if channel == "q" else _frozen_torques(tau, q)
                outliers += [
                    rows.start + k for k in _outliers(q if channel == "q" else tau, channel)
                ]
                frozen += [rows.start + k for start, end in ends for k in range(start + 1, end + 1)]
        each = ((False, outliers), (True, frozen))
        findings += [BadSamples(j, channel, stuck, np.array(bad)) for stuck, bad in each if bad]
    return findings


def _outliers(x: Array, channel: str) -> list[int]:
    """Rows far from the cubic and the median of their neighbours; a step is far from the first."""
    some = spread(x)
    # distances from the cubics through two neighbours on either side
    rough = np.abs(x[2:-2] - (4.0 * (x[1:-3] + x[3:-1]) - (x[:-4] + x[4:])) / 6.0)
    low, high = np.quantile(some, [0.01, 0.99])
    span = max(_SHARES[channel] * float(high - low), 1e-9 * float(np.abs(some).max()))
    # roughest part, since a channel may start at rest
    parts = np.linspace(0, max(0, len(x) - _PART), _PARTS).astype(int)
    usual = max(float(np.quantile(rough[k : k + _PART], 0.9)) for k in parts)
    least = max(_TIMES * usual, _STEPS * resolution(some), span)
    outliers = []
    for k in (2 + np.flatnonzero(rough > least)).tolist():
        off = abs(float(x[k] - np.median(x[k - 2 : k + 3])))
        if off > max(least, _OF_CUBIC * float(rough[k - 2])):
            beside = rough[max(0, k - _NEAR) : max(0, k - 4)], rough[k + 1 : k - 3 + _NEAR]
            near = np.concatenate(beside)
            if len(near) and off > _TIMES * float(np.quantile(near, 0.75)):
                outliers.append(k)
    return outliers


def _frozen_positions(x: Array) -> list[tuple[int, int]]:
    """Runs in which the position of a moving joint repeats."""
    long = runs(np.diff(x) == 0.0, _FROZEN)
    steps = moves(x)
    if not long or not steps.any():
        return []
    usual = float(np.quantile(steps[steps > 0.0], 0.9))
    some = spread(x)
    fine = usual > _STEPS * resolution(some[1:][np.diff(some) != 0.0])
    frozen = []
    for start, end in long:
        before = np.abs(np.diff(x[max(0, start - 3) : start + 1]))
        leap = end < len(x) - 1 and abs(x[end + 1] - x[end]) > _LEAP * usual
        # a coarse sensor repeats samples without a jump at speed
        sudden = leap or (fine and before.min(initial=np.inf) > _SLOW * usual)
        if len(before) and before.mean() > _SLOW * usual and sudden:
            frozen.append((start, end))
    return frozen


def _frozen_torques(x: Array, q: Array) -> list[tuple[int, int]]:
    """Runs in which a torque repeats while the joint moves, below the limits of the drive."""
    same = np.diff(x) == 0.0
    long = runs(same, _FROZEN)
    if same.sum() - sum(end - start for start, end in long) > _RARE * len(x) or same.all():
        return []
    speed, extremes = float(np.quantile(moves(q), 0.9)), (float(x.min()), float(x.max()))
    return [
        (start, end)
        for start, end in long
        if x[start] not in extremes
        and np.abs(np.diff(q[start : end + 1])).mean() > _MOVES * speed > 0.0
    ]


def cleaned(log: Log) -> Log:
    """The log without outliers and frozen samples, both counted in its notes.

    Their rows are interpolated or left out like rows with missing numbers.
    """
    findings = bad_samples(log)
    if not findings:
        return log
    arrays = {name: np.array(x) for name in ARRAYS if (x := getattr(log, name)) is not None}
    for some in findings:
        arrays[some.channel][some.rows, some.joint] = np.nan
    bad = np.flatnonzero(np.isnan(arrays["q"] + arrays["tau"]).any(axis=1))
    # recordings are separated in time
    t = np.arange(len(log)) + _APART * np.searchsorted(log.starts, np.arange(len(log)), "right")
    rows = regular_rows(log.dt * t, np.hstack(list(arrays.values())), "log", joints=log.n)
    blocks = np.split(rows.values, len(arrays), axis=1)
    left = len(log) - len(rows.values)
    reason = "outliers or frozen samples, interpolated where the gap is short"
    note = (
        f"Outliers and frozen samples: {max(0, len(bad) - left)} samples interpolated and {left} "
        "rows left out, where the log is split."
    )
    return replace(
        log,
        **dict(zip(arrays, blocks, strict=True)),
        starts=rows.starts,
        refused=[*log.refused, RefusedRows("log", tuple(bad.tolist()), reason)],
        notes=[*log.notes, note],
    )
