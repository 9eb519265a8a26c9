"""Outliers, and frozen samples of channels that stop while the joint moves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from .interpolation import filled
from .log import Log, RefusedRows
from .long_channels import Runs, chunks, moves, resolution, spread
from .motion import SHARE, shortest_period

_TIMES = 6.0
"""Times the usual roughness, of nine of ten samples and of three of four nearby, that a sample must
be off: 14 standard deviations of white noise."""
_STEPS = 4.0
"""Steps of a coarse sensor that it must be off."""
_NEAR = 25
"""Samples on either side that tell the roughness nearby."""
_ALIKE = 0.8
_SHARES = {"q": 0.0, "tau": 0.25}
"""Of the range of 98 % of the samples: small spikes of a position are large ones of acceleration,
those of a torque are small beside it, and may be friction that reverses."""
_ROUNDING = 1e-9
_STUCK = 8
"""Repeated samples of a channel that has stopped."""
_SLOW, _LEAP = 0.3, 5.0
"""Speed before a stop, and leap after it, in moves that nine of ten samples do not exceed."""
_MOVES = 0.1
"""Speed of a joint, in these, above which it moves while its torque stops."""
_RARE = 0.01
"""Share of repeated samples elsewhere, above which repeating says nothing."""
_LEAST = 9
"""Samples of a recording that is looked at."""
_WINDOW = 100_000
_PART, _PARTS = 20_000, 5
"""Samples of parts, spread over a channel, that its usual roughness is judged by."""


@dataclass(frozen=True, slots=True, eq=False)
class BadSamples:
    """Outliers or frozen samples of one channel."""

    joint: int
    channel: str
    repeats: bool
    rows: NDArray[np.int64]


def _spikes(x: Array, share: float) -> NDArray[np.int64]:
    """Outliers among the samples beside them, by a share of the range of the channel."""
    some = spread(x)
    low, high = np.quantile(some, [0.01, 0.99])
    span = max(share * float(high - low), _ROUNDING * float(np.abs(some).max()))
    # over the whole channel, which may begin at rest
    starts = np.linspace(0, max(0, len(x) - _PART), _PARTS).astype(int)
    usual = max(float(np.quantile(_roughness(x[k : k + _PART]), 0.9)) for k in starts)
    least = max(_TIMES * usual, _STEPS * resolution(some), span)
    found: set[int] = set()
    for rows in chunks(len(x)):
        start = max(0, rows.start - 2)
        found.update(start + 2 + np.flatnonzero(_roughness(x[start : rows.stop + 2]) > least))
    return np.array([k for k in sorted(found) if _stands_out(x, k, least)], np.int64)


def _roughness(x: Array) -> Array:
    """Distances of samples from the cubic through two on either side, shape (N - 4,)."""
    found: Array = np.abs(x[2:-2] - (4.0 * (x[1:-3] + x[3:-1]) - (x[:-4] + x[4:])) / 6.0)
    return found


def _stands_out(x: Array, k: int, least: float) -> bool:
    """Whether a sample is off what is beside it by as much as it is off what is further away.

    A step is on the level of what follows, and what is beside a spike is on that of the others.
    """
    off = abs(float(x[k] - np.median(x[k - 2 : k + 3])))
    start = max(0, k - _NEAR)
    rough = _roughness(x[start : k + _NEAR + 1])
    at = k - start - 2
    if not off > max(least, _ALIKE * float(rough[at])):
        return False
    near = np.delete(rough, slice(max(0, at - 2), at + 3))
    return len(near) > 0 and off > _TIMES * float(np.quantile(near, 0.75))


def _stops(x: Array, other: Array, torque: bool) -> list[tuple[int, int]]:
    """First and last row of runs in which a channel repeats while the joint moves.

    A frozen position stops at once and then jumps; a torque is frozen where the position moves on,
    below its extreme values, at which a drive may saturate.
    """
    runs, repeated = Runs(_STUCK), 0
    for rows in chunks(len(x) - 1):
        same = np.diff(x[rows.start : rows.stop + 1]) == 0.0
        runs.add(same)
        repeated += int(same.sum())
    long = runs.ended()
    if not long or repeated == len(x) - 1:
        return []
    steps = moves(x)
    usual = float(np.quantile(steps[steps > 0.0], 0.9)) if steps.any() else 0.0
    if not torque:
        some = spread(x)
        fine = usual > _STEPS * resolution(some[1:][np.diff(some) != 0.0])
        return [run for run in long if _stops_at_once(x, run, usual, fine)]
    if repeated - sum(end - start for start, end in long) > _RARE * len(x):
        return []
    speed = float(np.quantile(moves(other), 0.9))
    extremes = (float(x.min()), float(x.max()))
    return [
        (start, end)
        for start, end in long
        if x[start] not in extremes
        and np.abs(np.diff(other[start : end + 1])).mean() > _MOVES * speed > 0.0
    ]


def _stops_at_once(x: Array, run: tuple[int, int], usual: float, fine: bool) -> bool:
    """Whether a position at speed repeats from one sample to the next; a coarse one leaps after."""
    start, end = run
    before = np.abs(np.diff(x[max(0, start - 3) : start + 1]))
    if not len(before) or not before.mean() > _SLOW * usual > 0.0:
        return False
    leap = end < len(x) - 1 and abs(float(x[end + 1] - x[end])) > _LEAP * usual
    return leap or (fine and float(before.min()) > _SLOW * usual)


def bad_samples(log: Log) -> list[BadSamples]:
    """Outliers and frozen samples, joint by joint."""
    found: list[BadSamples] = []
    for j in range(log.n):
        for channel, other in (("q", "tau"), ("tau", "q")):
            single: list[int] = []
            repeated: list[int] = []
            for rows in log.recordings():
                x, beside = (getattr(log, name)[rows, j] for name in (channel, other))
                if len(x) < _LEAST:
                    continue
                single += (rows.start + _spikes(x, _SHARES[channel])).tolist()
                for start, end in _stops(x, beside, channel == "tau"):
                    repeated += range(rows.start + start + 1, rows.start + end + 1)
            for repeats, bad in ((False, single), (True, repeated)):
                if bad:
                    found.append(BadSamples(j, channel, repeats, np.array(bad)))
    return found


def cleaned(log: Log) -> Log:
    """The log without outliers and frozen samples, both counted in its notes.

    Runs shorter than a tenth of the motion's shortest period are interpolated; at longer ones the
    log is split, the samples within reach of filters left out.
    """
    found = bad_samples(log)
    bad = {"q": np.zeros(log.q.shape, bool), "tau": np.zeros(log.q.shape, bool)}
    for some in found:
        bad[some.channel][some.rows, some.joint] = True
    if not found:
        return log
    counts = [
        (sum(len(some.rows) for some in found if some.repeats == repeats), what)
        for repeats, what in ((False, "outlier"), (True, "frozen sample"))
    ]
    return _without(log, bad, " and ".join(_counted(k, what) for k, what in counts if k))


def _counted(count: int, what: str) -> str:
    return f"{count} {what}{'s' * (count != 1)}"


def _without(log: Log, bad: dict[str, NDArray[np.bool_]], found: str) -> Log:
    limit = max(1.0, SHARE * _shortest(log, bad["q"]) / log.dt - 1.0)
    arrays: dict[str, Any] = {"q": np.array(log.q), "tau": np.array(log.tau)}
    drop = np.zeros(len(log), bool)
    filled_in = 0
    for rows in log.recordings():
        for name, mask in bad.items():
            for j in np.flatnonzero(mask[rows].any(axis=0)).tolist():
                x, wrong = arrays[name][rows, j], mask[rows, j]
                runs = Runs(1)
                runs.add(wrong)
                for start, end in runs.ended():
                    if end - start > limit or start == 0 or end == len(x):
                        drop[rows.start + start : rows.start + end] = True
                places, wanted = np.flatnonzero(~wrong), np.flatnonzero(wrong & ~drop[rows])
                x[wanted] = filled(places, x[places, None], wanted)[:, 0]
                filled_in += len(wanted)
    kept = np.flatnonzero(~drop)
    first = np.zeros(len(log), bool)
    first[log.starts] = True
    # a row after one that was left out, or after the end of a recording
    begins = np.diff(np.cumsum(first)[kept], prepend=0) + (np.diff(kept, prepend=-1) > 1) > 0
    dropped = int(drop.sum())
    done = [f"{_counted(filled_in, 'sample')} interpolated"] if filled_in else []
    if dropped:
        done.append(f"{_counted(dropped, 'row')} left out, where the log is split")
    notes = [*log.notes, f"{found}: {' and '.join(done)}."]
    refused = list(log.refused)
    if dropped:
        lost = tuple(np.flatnonzero(drop).tolist())
        refused.append(
            RefusedRows("log", lost, "outliers or frozen samples that are not interpolated")
        )
    more = {
        name: None if (x := getattr(log, name)) is None else x[kept]
        for name in ("v", "a", "q_ref", "v_ref")
    }
    return Log(
        log.dt, arrays["q"][kept], arrays["tau"][kept], **more, starts=np.flatnonzero(begins),
        names=log.names, delay=log.delay, sources=log.sources, refused=refused, notes=notes,
    )  # fmt: skip


def _shortest(log: Log, bad: NDArray[np.bool_]) -> float:
    """Shortest period of the motion in the longest recording, straight lines over bad samples."""
    rows = max(log.recordings(), key=lambda rows: rows.stop - rows.start)
    rows = slice(rows.start, min(rows.stop, rows.start + _WINDOW))
    q, every = np.array(log.q[rows]), np.arange(rows.stop - rows.start)
    for j in np.flatnonzero(bad[rows].any(axis=0)).tolist():
        good = ~bad[rows, j]
        q[:, j] = np.interp(every, every[good], q[good, j])
    return shortest_period(q, log.dt)
