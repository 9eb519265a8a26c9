"""Time base of a log: time stamps are checked and resampled, with notes on corrections."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .._arrays import LARGEST, Array, as_bounded
from ..errors import InvalidValueError
from .log import RefusedRows

_ROUNDING, _COARSER, _FINER = 0.01, 1.5, 100.0
"""Of a grid, in periods of the file: rounding of stamps, longest period, most rows per row."""
_GAP, _JITTER, _BRIDGED, _MOST = 1.5, 0.25, 10, 1e6
"""In periods: least gap; largest 90 % jitter at which missing samples are counted; longest gap
bridged linearly for the spectrum of the motion; most missing samples."""
_REPEATED = 0.1
"""Share of repeated stamps above which they are coarser than the sampling."""
_SHARE = 0.1
"""Longest interpolated gap relative to the shortest period of the motion."""
_BESIDE = 4
"""Least number of samples on either side of a gap through which its cubic is fitted."""
_LEAST, _SECONDS = 32, 16.0
"""Least number of samples for a spectrum, and length of its windows, s."""


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
    N = len(values)
    known = dt if t is None else None
    stamps = np.asarray(np.arange(N) * (known or 1.0) if t is None else t, np.float64)
    good = np.isfinite(values).all(axis=1) & np.isfinite(stamps)
    for numbers in (stamps[good], values[good]):
        as_bounded(numbers, source, LARGEST)
    kept = np.flatnonzero(good)
    again = np.diff(stamps[kept], prepend=np.nan) == 0.0
    if again.sum() > _REPEATED * len(kept):
        raise InvalidValueError(
            f"{source}: {again.sum()} of {len(kept)} stamps repeat the one before: they are "
            "coarser than the sampling. Give dt=, the sampling period, and time=False."
        )
    refused = {
        "a number is missing or not finite": np.flatnonzero(~good),
        "its time is that of the row before": kept[again],
    }
    kept = kept[~again]
    if not (len(kept) > 1 and (np.diff(stamps[kept]) > 0.0).any()):
        raise InvalidValueError(
            f"{source}: {len(kept)} of its {N} rows have all numbers, and no two of them follow "
            "each other in time; check whether the right columns were given (time=), and whether "
            "they were recorded at the same times."
        )
    notes: list[str] = []
    period, counts, breaks = _split(stamps[kept], values[kept, :joints], known, largest_gap)
    if breaks.any():
        before, after = kept[breaks.argmax() : breaks.argmax() + 2]
        notes.append(
            f"{source}: time goes back or has a gap at {breaks.sum()} rows, first before row "
            f"{after}, from {stamps[before]:.9g} to {stamps[after]:.9g} s; the log is split there."
        )
    if (counts > 1).any():
        notes.append(
            f"{source}: {int((counts - 1).sum())} missing samples were interpolated (gaps up to "
            f"{period * counts.max():.3g} s)."
        )
    pieces = np.split(np.arange(len(kept)), np.flatnonzero(breaks) + 1)
    alone = [piece[0] for piece in pieces if len(piece) == 1]
    pieces = [piece for piece in pieces if len(piece) > 1]
    if not pieces:
        raise InvalidValueError(
            f"{source}: no two rows follow each other in time without a gap; the log is empty."
        )
    refused["it has no neighbour in time"] = kept[alone]
    places = np.concatenate([[0], np.cumsum(counts)])
    whole = [_filled(places[piece], stamps[kept[piece]], values[kept[piece]]) for piece in pieces]
    blocks = [block for _, block in whole]
    if known is None:
        grid = period if dt is None else dt
        blocks = _on_grid(whole, period, grid, source, largest_jitter, notes)
        period = grid
    starts = np.cumsum([0, *(len(block) for block in blocks[:-1])])
    left_out = [
        RefusedRows(source, tuple(rows.tolist()), reason)
        for reason, rows in refused.items()
        if len(rows)
    ]
    notes += [
        f"{source}: {len(r.rows)} of {N} rows were left out, first row {r.rows[0]}: {r.reason}."
        for r in left_out
    ]
    return RegularRows(float(period), np.concatenate(blocks), starts, tuple(left_out), tuple(notes))


def _filled(places: NDArray[np.int64], stamps: Array, rows: Array) -> tuple[Array, Array]:
    """Stamps and rows with interpolated missing samples (cubics fitted to both sides of gaps)."""
    every = np.arange(places[0], places[-1] + 1)
    values = np.empty((len(every), rows.shape[1]))
    values[places - places[0]] = rows
    for k in np.flatnonzero(np.diff(places) > 1).tolist():
        gap = np.arange(places[k] + 1, places[k + 1])
        count = max(_BESIDE, len(gap))
        beside = slice(max(0, k + 1 - count), k + 1 + count)
        middle, size = gap.mean(), float(np.ptp(places[beside]))
        powers = np.arange(min(4, len(places[beside])))
        A, B = (((z - middle)[:, None] / size) ** powers for z in (places[beside], gap))
        values[gap - places[0]] = B @ np.linalg.lstsq(A, rows[beside], rcond=None)[0]
    return np.interp(every, places, stamps), values


def _split(
    t: Array, positions: Array, dt: float | None, largest_gap: float | None
) -> tuple[float, NDArray[np.int64], NDArray[np.bool_]]:
    """Period of the recordings, periods from each row to the next, and their ends."""
    steps = np.diff(t)
    back = steps < 0.0
    median = float(np.median(steps[~back])) if dt is None else dt
    missing = ~back & (steps > _GAP * median)
    counts = np.ones(len(steps), np.int64)
    limit = _GAP if largest_gap is None else largest_gap
    jitter = np.abs(steps[~(back | missing)] - median)
    if missing.any() and jitter.size and np.quantile(jitter, 0.9) <= _JITTER * median:
        counts[missing] = np.round(np.minimum(steps[missing], _MOST * median) / median)
        if largest_gap is None:
            # the longest stretch without a long gap, its missing samples on straight lines
            ends = np.flatnonzero(back | (counts > _BRIDGED)) + 1
            part = max(np.split(np.arange(len(t)), ends), key=len)
            places = np.concatenate([[0], np.cumsum(counts[part[:-1]])])
            every = np.arange(places[-1] + 1)
            lines = [np.interp(every, places, column) for column in positions[part].T]
            limit = max(_GAP, _SHARE * shortest_period(np.column_stack(lines), median) / median)
    breaks = back | (steps > limit * median * (1.0 + 1e-6))
    counts[breaks] = 1
    joined = ~breaks
    period = float(steps[joined].sum() / counts[joined].sum()) if joined.any() else median
    return period, counts, breaks


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
    longest = max(map(len, errors))
    if not period / _FINER <= grid <= _COARSER * period:
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
    if off <= _ROUNDING and abs(grid - period) * longest <= _ROUNDING * period:
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
        resampled.append(splined(times, block, wanted, source))
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

    Zero for too few samples, or if nothing but noise moves. Shapes: q (N, n).
    """
    from scipy.signal import welch

    rate = 1.0 / dt
    if len(q) < _LEAST:
        return 0.0
    v = np.diff(q, axis=0) * rate
    f, density = welch(v, rate, nperseg=min(len(v), max(_LEAST, int(_SECONDS * rate))), axis=0)
    f, density = f[1:], density[1:]
    # white noise of the positions, whose level is that of the upper half of the spectrum
    gain = (2.0 * rate * np.sin(np.pi * f / rate))[:, None] ** 2
    noise = gain * np.median((density / gain)[(f > 0.25 * rate) & (f < 0.45 * rate)], axis=0)
    power = np.cumsum(np.where(density > 10.0 * noise, density - noise, 0.0), axis=0)
    moving = power[-1] > 1e-12 * power[-1].max(initial=0.0)
    if not moving.any():
        return 0.0
    most, bulk = (f[(power >= share * power[-1]).argmax(axis=0)][moving] for share in (0.999, 0.95))
    # power at eight times the frequency of the motion is that of the steps of a coarse encoder
    return float(1.0 / np.where(most > 8.0 * bulk, 3.0 * bulk, most).max())
