"""The time base of a log: gaps, jumps back, repeated stamps and jitter, all of them said."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from ..errors import InvalidValueError
from .interpolation import filled, splined
from .log import RefusedRows
from .motion import SHARE, shortest_period

_REGULAR = 0.01
"""Stamps this close to a regular grid, in periods, are the grid: rounding, not sampling."""
_COARSER = 1.5
"""Periods of the file above which a grid leaves out rows."""
_FINER = 100.0
"""Rows of a grid for one of the file, above which nothing is interpolated: nobody measured it."""
_GAP = 1.5
"""Periods between rows above which samples are missing."""
_JITTER = 0.25
"""Periods, for nine of ten stamps, above which it is not told what is missing."""
_STRETCH = 10
"""Periods of the gaps that straight lines bridge where the motion is estimated."""
_UNKNOWN = 1e6
_REPEATED = 0.1
"""Share of repeated stamps above which the stamps are too coarse to tell anything."""


@dataclass(frozen=True, slots=True, eq=False)
class RegularRows:
    """Samples on a regular grid. Shapes: values (N, m)."""

    dt: float
    values: Array
    starts: NDArray[np.int64]
    refused: tuple[RefusedRows, ...]
    notes: tuple[str, ...]


def regular_rows(
    t: Array | None,
    values: Array,
    source: str,
    dt: float | None = None,
    largest_gap: float | None = None,
    largest_jitter: float = 0.5,
    joints: int | None = None,
) -> RegularRows:
    """Bring samples to a regular grid, recording by recording. Shapes: t (N,), values (N, m)."""
    refused: list[RefusedRows] = []
    notes: list[str] = []
    N = len(values)
    good = np.isfinite(values).all(axis=1)
    if t is not None:
        good &= np.isfinite(t)
    bad = np.flatnonzero(~good)
    if len(bad):
        refused.append(
            RefusedRows(source, tuple(bad.tolist()), "a number is missing or not finite")
        )
        notes.append(
            f"{source}: {len(bad)} of {N} rows lack a number and were left out (the first is row "
            f"{bad[0]})."
        )
    if len(bad) == N:
        raise InvalidValueError(
            f"{source}: every one of its {N} rows lacks a number; see whether the right columns "
            "were given, and whether they were recorded at the same times."
        )
    kept = np.flatnonzero(good)
    if t is None:
        if dt is None:
            raise InvalidValueError(
                f"{source}: no column of times was given or found; say dt=, the sampling period in "
                "seconds, or time=, the column."
            )
        stamps: Array = np.asarray(dt * np.arange(N), np.float64)
    else:
        kept = _without_repeated(t, kept, source, refused, notes)
        stamps = t
    period, counts, broken = _split(
        stamps, values[:, :joints], kept, source, None if t is not None else dt, largest_gap, notes
    )
    edges = np.flatnonzero(broken) + 1
    pieces, alone = [], []
    for piece in np.split(kept, edges):
        (pieces if len(piece) > 1 or len(kept) == 1 else alone).append(piece)
    if alone:
        rows = tuple(int(piece[0]) for piece in alone)
        refused.append(RefusedRows(source, rows, "no neighbour in time"))
        notes.append(f"{source}: {len(rows)} rows have no neighbour in time and were left out.")
    if not pieces:
        raise InvalidValueError(
            f"{source}: no two rows follow each other in time without a gap; nothing is left."
        )
    places = np.concatenate([[0], np.cumsum(counts)])
    at = np.searchsorted(kept, [piece[0] for piece in pieces])
    whole = [
        _filled(places[k : k + len(piece)], stamps[piece], values[piece])
        for k, piece in zip(at, pieces, strict=True)
    ]
    blocks = [block for _, block in whole]
    if t is not None:
        grid = period if dt is None else dt
        times = [each for each, _ in whole]
        blocks = _on_grid(times, blocks, period, grid, source, largest_jitter, notes)
        period = grid
    starts = np.concatenate([[0], np.cumsum([len(block) for block in blocks])[:-1]])
    return RegularRows(
        float(period), np.concatenate(blocks), starts.astype(np.int64), tuple(refused),
        tuple(notes),
    )  # fmt: skip


def _filled(places: NDArray[np.int64], stamps: Array, rows: Array) -> tuple[Array, Array]:
    """Stamps and rows with those that are missing between their places."""
    every = np.arange(places[0], places[-1] + 1)
    if len(every) == len(places):
        return stamps, rows
    missing = np.setdiff1d(every, places)
    values = np.empty((len(every), rows.shape[1]))
    values[places - places[0]] = rows
    values[missing - places[0]] = filled(places, rows, missing)
    return np.interp(every, places, stamps), values


def _without_repeated(
    t: Array, kept: NDArray[np.int64], source: str, refused: list[RefusedRows], notes: list[str]
) -> NDArray[np.int64]:
    again = np.zeros(len(kept), bool)
    again[1:] = np.diff(t[kept]) == 0.0
    count = int(again.sum())
    if not count:
        return kept
    if count > _REPEATED * len(kept):
        raise InvalidValueError(
            f"{source}: {count} of {len(kept)} stamps repeat the one before: they are coarser than "
            "the sampling. Say dt=, the sampling period, and time=False to leave them aside."
        )
    rows = kept[again]
    refused.append(RefusedRows(source, tuple(rows.tolist()), "its time is that of the row before"))
    notes.append(
        f"{source}: {count} rows repeat the time of the row before and were left out (the first "
        f"is row {rows[0]}, at {t[rows[0]]:.9g} s)."
    )
    return kept[~again]


def _split(
    t: Array, positions: Array, kept: NDArray[np.int64], source: str, dt: float | None,
    largest_gap: float | None, notes: list[str],
) -> tuple[float, NDArray[np.int64], NDArray[np.bool_]]:  # fmt: skip
    """Period within recordings, periods from each row to the next, and where new ones start."""
    steps = np.diff(t[kept])
    back = steps < 0.0
    beside = steps[(np.diff(kept) == 1) & ~back]
    if not len(beside):
        beside = steps[~back]
    if not len(beside):
        raise InvalidValueError(
            f"{source}: no two rows follow each other in time; see whether time names the right "
            "column."
        )
    median = float(np.median(beside)) if dt is None else dt
    missing = ~back & (steps > _GAP * median)
    counts = np.ones(len(steps), np.int64)
    shortest = 0.0
    if missing.any() and np.quantile(np.abs(beside - median), 0.9) <= _JITTER * median:
        # bounded before it is divided: damaged stamps may be as large as floats go
        missed = np.minimum(steps[missing], _UNKNOWN * median)
        counts[missing] = np.round(missed / median)
        if largest_gap is None:
            shortest = _motion(positions[kept], counts, back | (counts > _STRETCH), median)
    limit = max(_GAP, SHARE * shortest / median) if largest_gap is None else largest_gap
    gap = (steps > limit * median * (1.0 + 1e-6)) & ~back
    for once, often, where in (
        ("goes back once", "goes back {} times", back),
        ("has one gap", "has {} gaps", gap),
    ):
        found = np.flatnonzero(where)
        if len(found):
            first = found[0]
            words = once if len(found) == 1 else often.format(len(found))
            notes.append(
                f"{source}: time {words} ({'' if len(found) == 1 else 'the first '}before row "
                f"{kept[first + 1]}, from {t[kept[first]]:.9g} to {t[kept[first + 1]]:.9g} s); the "
                "log is split there."
            )
    broken = back | gap
    counts[broken] = 1
    if (counts > 1).any():
        why = f"; shortest period of the motion {shortest:.3g} s" if shortest else ""
        count = int((counts - 1).sum())
        notes.append(
            f"{source}: {count} missing sample{'s were' if count > 1 else ' was'} interpolated "
            f"(gaps up to {median * counts.max():.3g} s{why})."
        )
    joined = ~broken
    period = float(steps[joined].sum() / counts[joined].sum()) if joined.any() else median
    return period, counts, broken


def _motion(
    positions: Array, counts: NDArray[np.int64], ends: NDArray[np.bool_], period: float
) -> float:
    """Shortest period of the motion, of the longest stretch without an end."""
    cuts = [0, *(np.flatnonzero(ends) + 1).tolist(), len(positions)]
    k = int(np.diff(cuts).argmax())
    part = positions[cuts[k] : cuts[k + 1]]
    places = np.concatenate([[0], np.cumsum(counts[cuts[k] : cuts[k + 1] - 1])])
    every = np.arange(places[-1] + 1)
    lines = [np.interp(every, places, column) for column in part.T]
    return shortest_period(np.column_stack(lines), period)


def _on_grid(
    stamps: list[Array], blocks: list[Array], period: float, grid: float, source: str,
    largest_jitter: float, notes: list[str],
) -> list[Array]:  # fmt: skip
    off, jitter = 0.0, 0.0
    for times in stamps:
        if len(times) > 1:
            k = np.arange(len(times))
            deviation = times - times[0] - period * k
            off = max(off, float(np.ptp(deviation)) / period)
            jitter = max(jitter, float(np.abs(np.diff(times) - period).max()) / period)
    if grid > _COARSER * period:
        raise InvalidValueError(
            f"{source}: its rows are {period:.4g} s apart, dt={grid:g} would leave out some "
            "without a filter, which folds what is fast into what is slow. Leave dt= out; a fit "
            "filters and then thins out (decimation=)."
        )
    told = f"{source}: stamps are up to {jitter:.2g} periods from regular"
    if jitter > largest_jitter:
        raise InvalidValueError(
            f"{told}, more than the {largest_jitter:g} that may be interpolated over; say "
            "largest_jitter= if that is meant, or largest_gap= to split the log there."
        )
    if off <= _REGULAR and abs(grid - period) * max(map(len, stamps)) <= _REGULAR * period:
        if jitter > 1e-6:
            notes.append(f"{told}; taken as regular at {period:.9g} s.")
        return blocks
    spans = sum(float(times[-1] - times[0]) for times in stamps)
    if not spans <= _FINER * grid * sum(map(len, stamps)):
        raise InvalidValueError(
            f"{source}: rows {grid:.4g} s apart would be more than {_FINER:g} for each row of the "
            f"file, which has them {period:.4g} s apart; say a longer dt=, or leave it out."
        )
    asked = "" if grid == period else f", asked for at {grid:g} s (the file has {period:.9g} s)"
    notes.append(
        f"{told} and up to {off:.2g} from the grid: brought to it by cubic splines{asked}."
    )
    found = []
    for times, block in zip(stamps, blocks, strict=True):
        if len(times) == 1:
            found.append(block)
            continue
        # one more where rounding alone leaves the last sample out
        count = int(np.floor((times[-1] - times[0]) / grid + 1e-6)) + 1
        wanted = np.minimum(times[0] + grid * np.arange(count), times[-1])
        found.append(splined(times, block, wanted, source))
    return found
