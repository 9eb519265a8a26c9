"""Time base of a log: time stamps are checked and resampled, with notes on corrections."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from ..errors import InvalidValueError
from .log import RefusedRows

_REGULAR, _COARSER, _FINER = 0.01, 1.5, 100.0
"""Of a grid, in periods of the file: rounding tolerance of stamps, longest period, and largest
number of rows per row."""
_GAP, _JITTER, _STRETCH, _MOST = 1.5, 0.25, 10, 1e6
"""In periods: least gap, largest 90 % jitter for counting missing samples, longest gap bridged
linearly for the estimate of the motion, and most missing samples."""
_REPEATED = 0.1
"""Share of repeated stamps above which their resolution is coarser than the sampling."""
_SHARE = 0.1
"""Longest interpolated gap relative to the shortest period of the motion."""
_BESIDE = 4
"""Least number of samples on either side of a gap through which its cubic is fitted."""
_POWER, _BULK, _FAR, _WIDER = 0.999, 0.95, 8.0, 3.0
"""The motion has 99.9 % of the power of the velocities; where that frequency is more than 8 times
that of 95 %, it includes the steps of a coarse encoder, and 3 times the latter is taken."""
_ABOVE = 10.0
"""Noise threshold of a spectrum, relative to the noise density."""
_SECONDS = 16.0
"""Length of the windows of the spectrum, s."""
_LEAST = 32
"""Least number of samples for a spectrum."""


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
    """Resample to a regular grid, recording by recording; positions come first.

    Shapes: t (N,), values (N, m).
    """
    refused: list[RefusedRows] = []
    notes: list[str] = []
    N = len(values)

    def refuse(rows: NDArray[np.int64], reason: str) -> None:
        if len(rows):
            refused.append(RefusedRows(source, tuple(rows.tolist()), reason))
            notes.append(
                f"{source}: {len(rows)} of {N} rows were left out, the first is row {rows[0]}: "
                f"{reason}."
            )

    if t is None and dt is None:
        raise InvalidValueError(
            f"{source}: no column of times was given or found; give dt=, the sampling period in "
            "seconds, or time=, the column."
        )
    stamps = np.asarray(dt * np.arange(N) if t is None else t, np.float64)  # type: ignore[operator]
    good = np.isfinite(values).all(axis=1) & np.isfinite(stamps)
    refuse(np.flatnonzero(~good), "a number is missing or not finite")
    kept = np.flatnonzero(good)
    again = np.diff(stamps[kept], prepend=np.nan) == 0.0
    if again.sum() > _REPEATED * len(kept):
        raise InvalidValueError(
            f"{source}: {again.sum()} of {len(kept)} stamps repeat the one before: they are "
            "coarser than the sampling. Give dt=, the sampling period, and time=False."
        )
    refuse(kept[again], "its time is that of the row before")
    kept = kept[~again]
    if len(kept) == 0:
        raise InvalidValueError(
            f"{source}: every one of its {N} rows lacks a number; check whether the right columns "
            "were given, and whether they were recorded at the same times."
        )
    known = dt if t is None else None
    period, counts, breaks = _split(
        stamps[kept], values[kept, :joints], kept, source, known, largest_gap, notes
    )
    pieces = np.split(np.arange(len(kept)), np.flatnonzero(breaks) + 1)
    alone = [piece for piece in pieces if len(piece) == 1]
    pieces = [piece for piece in pieces if len(piece) > 1]
    if not pieces:
        raise InvalidValueError(
            f"{source}: no two rows follow each other in time without a gap; the log is empty."
        )
    if alone:
        refuse(kept[np.concatenate(alone)], "it has no neighbour in time")
    places = np.concatenate([[0], np.cumsum(counts)])
    whole = [_filled(places[piece], stamps[kept[piece]], values[kept[piece]]) for piece in pieces]
    blocks = [block for _, block in whole]
    if t is not None:
        grid = period if dt is None else dt
        blocks = _on_grid(whole, period, grid, source, largest_jitter, notes)
        period = grid
    starts = np.cumsum([0, *(len(block) for block in blocks[:-1])])
    return RegularRows(float(period), np.concatenate(blocks), starts, tuple(refused), tuple(notes))


def _filled(places: NDArray[np.int64], stamps: Array, rows: Array) -> tuple[Array, Array]:
    """Stamps and rows with interpolated missing samples (cubics fitted to both sides of gaps)."""
    gaps = np.flatnonzero(np.diff(places) > 1).tolist()
    if not gaps:
        return stamps, rows
    every = np.arange(places[0], places[-1] + 1)
    values = np.empty((len(every), rows.shape[1]))
    values[places - places[0]] = rows
    for k in gaps:
        gap = np.arange(places[k] + 1, places[k + 1])
        count = max(_BESIDE, len(gap))
        beside = slice(max(0, k + 1 - count), k + 1 + count)
        middle, size = gap.mean(), float(np.ptp(places[beside]))
        powers = np.arange(min(4, len(places[beside])))
        A, B = (((z - middle)[:, None] / size) ** powers for z in (places[beside], gap))
        values[gap - places[0]] = B @ np.linalg.lstsq(A, rows[beside], rcond=None)[0]
    return np.interp(every, places, stamps), values


def _split(
    t: Array,
    positions: Array,
    kept: NDArray[np.int64],
    source: str,
    dt: float | None,
    largest_gap: float | None,
    notes: list[str],
) -> tuple[float, NDArray[np.int64], NDArray[np.bool_]]:
    """Period of the recordings, periods from each row to the next, and their ends."""
    steps = np.diff(t)
    back = steps < 0.0
    forward = steps[(np.diff(kept) == 1) & ~back]
    forward = forward if len(forward) else steps[~back]
    if not len(forward):
        raise InvalidValueError(
            f"{source}: no two rows follow each other in time; check whether time names the right "
            "column."
        )
    median = float(np.median(forward)) if dt is None else dt
    missing = ~back & (steps > _GAP * median)
    counts = np.ones(len(steps), np.int64)
    shortest = 0.0
    if missing.any() and np.quantile(np.abs(forward - median), 0.9) <= _JITTER * median:
        counts[missing] = np.round(np.minimum(steps[missing], _MOST * median) / median)
        if largest_gap is None:
            shortest = _motion(positions, counts, back | (counts > _STRETCH), median)
    limit = max(_GAP, _SHARE * shortest / median) if largest_gap is None else largest_gap
    breaks = back | (steps > limit * median * (1.0 + 1e-6))
    counts[breaks] = 1
    if breaks.any():
        k = int(breaks.argmax())
        notes.append(
            f"{source}: time goes back or has a gap at {breaks.sum()} rows, first before row "
            f"{kept[k + 1]}, from {t[k]:.9g} to {t[k + 1]:.9g} s; the log is split there."
        )
    if (counts > 1).any():
        why = f"; shortest period of the motion {shortest:.3g} s" if shortest else ""
        notes.append(
            f"{source}: {int((counts - 1).sum())} missing samples were interpolated (gaps up to "
            f"{median * counts.max():.3g} s{why})."
        )
    joined = ~breaks
    period = float(steps[joined].sum() / counts[joined].sum()) if joined.any() else median
    return period, counts, breaks


def _motion(
    positions: Array, counts: NDArray[np.int64], ends: NDArray[np.bool_], period: float
) -> float:
    """Shortest period of the motion in the longest stretch without an end."""
    cuts = [0, *(np.flatnonzero(ends) + 1).tolist(), len(positions)]
    k = int(np.diff(cuts).argmax())
    part = positions[cuts[k] : cuts[k + 1]]
    places = np.concatenate([[0], np.cumsum(counts[cuts[k] : cuts[k + 1] - 1])])
    every = np.arange(places[-1] + 1)
    lines = [np.interp(every, places, column) for column in part.T]
    return shortest_period(np.column_stack(lines), period)


def _on_grid(
    recordings: list[tuple[Array, Array]],
    period: float,
    grid: float,
    source: str,
    largest_jitter: float,
    notes: list[str],
) -> list[Array]:
    """Recordings on a regular grid: unchanged if regular, otherwise resampled by splines."""
    errors = [x - x[0] - period * np.arange(len(x)) for x, _ in recordings]
    off = max(float(np.ptp(each)) for each in errors) / period
    jitter = max(float(np.abs(np.diff(each)).max(initial=0.0)) for each in errors) / period
    spans = sum(float(x[-1] - x[0]) for x, _ in recordings)
    if grid > _COARSER * period or not spans <= _FINER * grid * sum(map(len, errors)):
        raise InvalidValueError(
            f"{source}: its rows are {period:.4g} s apart, dt={grid:g} would leave out some "
            f"without a filter, or make more than {_FINER:g} of one. Leave dt= out; a fit filters "
            "and then decimates (processing=)."
        )
    deviation = f"{source}: stamps are up to {jitter:.2g} periods from regular"
    if jitter > largest_jitter:
        raise InvalidValueError(
            f"{deviation}, more than the {largest_jitter:g} that may be interpolated over; give "
            "largest_jitter= if that is intended, or largest_gap= to split the log there."
        )
    if off <= _REGULAR and abs(grid - period) * max(map(len, errors)) <= _REGULAR * period:
        if jitter > 1e-6:
            notes.append(f"{deviation}; taken as regular at {period:.9g} s.")
        return [block for _, block in recordings]
    notes.append(
        f"{deviation} and up to {off:.2g} from a grid of {grid:.9g} s (the file has {period:.9g} "
        "s): resampled by cubic splines."
    )
    resampled = []
    for times, block in recordings:
        # one more where rounding alone leaves the last sample out
        count = int(np.floor((times[-1] - times[0]) / grid + 1e-6)) + 1
        wanted = np.minimum(times[0] + grid * np.arange(count), times[-1])
        resampled.append(splined(times, block, wanted, source) if len(times) > 1 else block)
    return resampled


def splined(stamps: Array, values: Array, wanted: Array, source: str) -> Array:
    """Cubic spline through samples, at other times.

    Shapes: stamps (N,), values (N, m), wanted (M,) -> (M, m).
    """
    from scipy.interpolate import CubicSpline

    try:
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            interpolated = CubicSpline(stamps, values)(wanted)
    except ValueError:  # infinite slopes
        interpolated = np.full(1, np.nan)
    if not np.isfinite(interpolated).all():
        raise InvalidValueError(
            f"{source}: its numbers, up to {np.abs(values).max():.3g}, change too much within "
            f"{np.diff(stamps).min():.3g} s for an interpolation between its rows."
        )
    return interpolated


def shortest_period(q: Array, dt: float) -> float:
    """Shortest period of the motion: 99.9 % of the velocity power is below its frequency.

    Shapes: q (N, n).
    """
    from scipy.signal import welch

    if len(q) < _LEAST:
        return 0.0
    rate = 1.0 / dt
    v = np.diff(q, axis=0) * rate
    f, density = welch(v, rate, nperseg=min(len(v), max(_LEAST, int(_SECONDS * rate))), axis=0)
    f, density = f[1:], density[1:]
    # of a difference of white noise
    gain = (2.0 * rate * np.sin(np.pi * f / rate))[:, None] ** 2
    floor = np.median((density / gain)[(f > 0.25 * rate) & (f < 0.45 * rate)], axis=0)
    noise = gain * floor
    power = np.cumsum(np.where(density / _ABOVE > noise, density - noise, 0.0), axis=0)
    moving = power[-1] > 1e-12 * power[-1].max(initial=0.0)
    if not moving.any():
        return 0.0
    most, bulk = (
        f[(power >= share * power[-1]).argmax(axis=0)][moving] for share in (_POWER, _BULK)
    )
    return float(1.0 / np.where(most > _FAR * bulk, _WIDER * bulk, most).max())
