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
_SHARE = 0.1  # longest interpolated gap relative to the shortest period of the motion
_LEAST, _SECONDS = 32, 16.0  # least number of samples for a spectrum, and length of its windows, s


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
    refused = {
        "a number is missing or not finite": np.flatnonzero(~good),
        "its time is that of the row before": kept[again],
    }
    kept = kept[~again]
    if not (np.diff(stamps[kept]) > 0.0).any():
        raise InvalidValueError(
            f"{source}: {len(kept)} of its {N} rows have all numbers, and no two of them follow "
            "each other in time; check whether the right columns were given (time=)."
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
    refused["it has no neighbour in time"] = kept[[p[0] for p in pieces if len(p) == 1]]
    pieces = [piece for piece in pieces if len(piece) > 1]
    if not pieces:
        raise InvalidValueError(
            f"{source}: no two rows follow each other in time without a gap; the log is empty."
        )
    places = np.concatenate([[0], np.cumsum(counts)])
    whole = []
    for piece in pieces:
        at, times, rows = places[piece], stamps[kept[piece]], values[kept[piece]]
        every = np.arange(at[0], at[-1] + 1)
        if len(every) > len(at):  # missing samples
            rows = splined(at.astype(np.float64), rows, every.astype(np.float64), source)
        whole.append((np.interp(every, at, times), rows))
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
    jitter = max(float(np.abs(np.diff(each)).max()) for each in errors) / period
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
    longest = max(map(len, errors))
    if off <= _ROUNDING and abs(grid - period) * longest <= _ROUNDING * period:
        return [block for _, block in recordings]
    notes.append(f"{deviation}; resampled from {period:.9g} s to {grid:.9g} s by cubic splines.")
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

    if len(q) < _LEAST:
        return 0.0
    window = min(len(q) - 1, max(_LEAST, int(_SECONDS / dt)))
    f, density = welch(np.diff(q, axis=0), nperseg=window, axis=0)
    f, density = f[1:], density[1:]
    # white noise of the positions, whose level is that of the upper half of the spectrum
    gain = np.sin(np.pi * f)[:, None] ** 2
    noise = gain * np.median((density / gain)[(f > 0.25) & (f < 0.45)], axis=0)
    power = np.cumsum(np.where(density > 10.0 * noise, density - noise, 0.0), axis=0)
    moving = power[-1] > 1e-12 * power[-1].max(initial=0.0)
    most = f[(power >= 0.999 * power[-1]).argmax(axis=0)][moving]
    return float(dt / most.max()) if moving.any() else 0.0
