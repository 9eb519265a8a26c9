"""Forms of the equations: joint torques, filtered momenta, power, and energy between instants.

Source: Seed book section 1.6; J.-J. Slotine and W. Li, "On the adaptive control of robot
manipulators", IJRR 6(3), 1987 (momenta); M. Gautier, "Dynamic identification of robots with power
model", IEEE ICRA 1997; M. Gautier and W. Khalil, IEEE CDC 1988 (energy).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from ..logs import Log
from ..minimal_parameters import BaseParameters
from ..model import RobotModel
from ..regressors import (
    chunked,
    energy_difference_regressor,
    energy_parameter_names,
    momentum_regressor,
    power_regressor,
    torque_regressor,
)
from .signals import Piece, Processing, Signals, decimation_window, piece_signals

_CHUNK = 1024
"""Largest number of samples in a regressor chunk."""
_LEAST_WEIGHT = 0.5
"""Share of the decimation window that must lie outside the dead band."""
_DERIVATIVE = (3 / 4, -3 / 20, 1 / 60)
"""Weights of central differences of order six."""
_INTEGRAL = np.array([11.0, -93.0, 802.0, 802.0, -93.0, 11.0]) / 1440.0
"""Weights of the integral between the two middle ones of six samples (interpolating polynomial)."""
SHORT = 3
"""Samples that momentum and energy equations leave out at each end of a recording."""


class EquationForm(Enum):
    """Quantity that the equations balance."""

    TORQUE = "torques of the joints"
    """The inverse dynamic model: one equation for each joint; needs accelerations."""
    FILTERED = "rates of the momenta of the joints"
    """The momentum form through a low-pass: one for each joint, without accelerations."""
    POWER = "power of all joints together"
    """One equation at each instant; needs accelerations."""
    ENERGY = "energy of the robot between instants"
    """One equation for each interval, without accelerations."""

    @property
    def by_joint(self) -> bool:
        """Whether each joint has equations of its own."""
        return self in (EquationForm.TORQUE, EquationForm.FILTERED)


@dataclass(frozen=True, slots=True, eq=False)
class Block:
    """Equations ``W @ parameters = y`` of m groups (the joints) at k instants.

    Shapes: t (k,) s, of an interval its middle; W (k, m, b); y (k, m) in N m, N, W or J; use (k, m)
    False in a dead band; v (k, n) filtered velocities, of an interval their mean.
    """

    t: Array
    W: Array
    y: Array
    use: NDArray[np.bool_]
    v: Array

    def __len__(self) -> int:
        return len(self.t)


class EquationSource(Protocol):
    """Log, base parameters and processing from which equations are formed."""

    @property
    def base(self) -> BaseParameters:
        """Base parameters of the robot."""
        ...

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters with columns."""
        ...

    @property
    def log(self) -> Log:
        """The log."""
        ...

    @property
    def processing(self) -> Processing:
        """Filters, decimation and dead bands."""
        ...


FormedRows = tuple[Array, Array, NDArray[np.bool_]]
RowForm = Callable[[Array, Array, Array, NDArray[np.bool_]], FormedRows]
"""From W (k, n, b), torques and velocities (k, n) and use (k, n), at the rate of the log: W
(k, m, c), right side (k, m) and use (k, m)."""


def torque_block(source: EquationSource, piece: Piece) -> Block:
    """Torque equations of a piece of the log (seed book, section 1.6.2)."""
    signals = piece_signals(source.log, source.processing, piece, source.processing.reach)
    return signals_block(source, piece, signals)


def signals_block(source: EquationSource, piece: Piece, signals: Signals) -> Block:
    """Torque equations of given signals, such as simulated ones, at the instants of a piece."""
    step, base = source.processing.decimation, source.base
    kept, grid = _instants(source, piece)
    use = outside_dead_band(source, signals)
    options = {"drive": base.drive, "columns": source.names, "friction": base.friction}
    if step == 1:
        q, v, a = signals.q[kept], signals.v[kept], signals.a[kept]
        W = torque_regressor(base.model, q, v, a, **options)
        return Block(signals.t[kept], W, signals.tau[kept], use[kept], v)
    motion = signals.q, signals.v, signals.a
    chunks = chunked(torque_regressor, base.model, *motion, size=_CHUNK, **options)
    W, taking_part = _decimated_rows(chunks, use, grid, len(source.names))
    y, _ = _decimated_rows([(slice(None), signals.tau[:, :, None])], use, grid, 1)
    return Block(signals.t[kept], W, y[:, :, 0], taking_part, decimated([signals.v], *grid))


def formed_block(source: EquationSource, piece: Piece, form: RowForm) -> Block:
    """Torque equations of a piece, combined or extended at the rate of the log."""
    base = source.base
    signals = piece_signals(source.log, source.processing, piece, source.processing.reach)
    kept, grid = _instants(source, piece)
    use = outside_dead_band(source, signals)
    chunks = chunked(
        torque_regressor,
        base.model,
        signals.q,
        signals.v,
        signals.a,
        size=_CHUNK,
        drive=base.drive,
        columns=source.names,
        friction=base.friction,
    )
    rows, uses = [], []
    for part, W in chunks:
        new, y, new_use = form(W, signals.tau[part], signals.v[part], use[part])
        rows.append((part, np.concatenate((new, y[:, :, None]), axis=2)))
        uses.append(new_use)
    columns = rows[0][1].shape[2]
    both, taking_part = _decimated_rows(rows, np.concatenate(uses), grid, columns)
    W = np.ascontiguousarray(both[:, :, :-1])
    return Block(signals.t[kept], W, both[:, :, -1], taking_part, decimated([signals.v], *grid))


def filtered_block(source: EquationSource, piece: Piece) -> Block:
    """Filtered momentum equations of a piece of the log (seed book, section 1.6.2)."""
    processing, base = source.processing, source.base
    # low-pass, differences at its ends, and the offset of the first sample
    around = processing.reach + 2 * SHORT
    signals = piece_signals(source.log, processing, piece, around)
    first = piece.start - max(piece.start - around, piece.low)
    length = max(min(piece.stop + SHORT, piece.high - SHORT) - piece.start - SHORT, 0)
    grid = (processing.decimation, first, -(-length // processing.decimation))
    # samples and the first equation start SHORT rows inside
    inner = slice(SHORT, max(len(signals) - SHORT, SHORT))
    use, tau, v = outside_dead_band(source, signals)[inner], signals.tau[inner], signals.v[inner]
    chunks = chunked(
        momentum_regressor,
        base.model,
        signals.q,
        signals.v,
        size=128,
        drive=base.drive,
        columns=source.names,
        friction=base.friction,
    )
    shape = (base.model.n, len(source.names))
    rates = _momentum_rates(chunks, source.log.dt, shape)
    W, taking_part = _decimated_rows(rates, use, grid, shape[1])
    y, _ = _decimated_rows([(slice(None), tau[:, :, None])], use, grid, 1)
    start = first + SHORT
    t = signals.t[start : start + length : processing.decimation]
    return Block(t, W, y[:, :, 0], taking_part, decimated([v], *grid))


def _momentum_rates(
    chunks: Iterable[tuple[slice, tuple[Array, Array]]], dt: float, shape: tuple[int, int]
) -> Iterator[tuple[slice, Array]]:
    """Regressors of the samples that have ``SHORT`` others on either side."""
    momenta, forces = np.empty((2, 0, *shape))
    done = 0
    for _, (P, S) in chunks:
        momenta, forces = np.concatenate((momenta, P)), np.concatenate((forces, S))
        inner = len(momenta) - 2 * SHORT
        if inner <= 0:
            continue
        out = -forces[SHORT : SHORT + inner]
        for away, weight in enumerate(_DERIVATIVE, start=1):
            ahead, behind = momenta[SHORT + away :][:inner], momenta[SHORT - away :][:inner]
            out += weight / dt * (ahead - behind)
        yield slice(done, done + inner), out
        done += inner
        momenta, forces = momenta[inner:], forces[inner:]


def power_block(source: EquationSource, piece: Piece) -> Block:
    """Power equations of a piece of the log (seed book, section 1.6.3)."""
    processing, base = source.processing, source.base
    signals = piece_signals(source.log, processing, piece, processing.reach)
    kept, grid = _instants(source, piece)
    b = len(source.names)
    chunks = chunked(
        power_regressor,
        base.model,
        signals.q,
        signals.v,
        signals.a,
        size=_CHUNK,
        drive=base.drive,
        columns=source.names,
        friction=base.friction,
    )

    def rows() -> Iterator[Array]:
        for part, d in chunks:
            power = np.einsum("kj,kj->k", signals.tau[part], signals.v[part])
            yield np.column_stack((d, power, signals.v[part]))

    means = decimated(rows(), *grid)
    v = means[:, b + 1 :]
    use = np.logical_or.reduce(moving_joints(base.model, processing.dead_band, v), axis=1)[:, None]
    return Block(signals.t[kept], means[:, None, :b], means[:, b : b + 1], use, v)


def energy_block(source: EquationSource, piece: Piece) -> Block:
    """Energy equations over intervals of a piece (seed book, sections 1.5.1.2 and 1.6.3)."""
    log, processing, base = source.log, source.processing, source.base
    b, n = len(source.names), base.model.n
    begin = piece.start + SHORT
    end = min(piece.stop + SHORT, piece.high - 1 - SHORT)
    if end <= begin:
        empty = np.zeros((0, 1))
        use = np.zeros((0, 1), dtype=bool)
        return Block(np.zeros(0), np.zeros((0, 1, b)), empty, use, np.zeros((0, n)))
    around = 2 * SHORT
    signals = piece_signals(log, processing, piece, around)
    first = max(piece.start - around, piece.low)
    rows = slice(begin - SHORT + 1 - first, end + SHORT - first)
    q, v, tau = signals.q[rows], signals.v[rows], signals.tau[rows]
    # samples from two before the first knot to two after the last
    ahead = SHORT - 1
    knots = np.append(np.arange(0, end - begin, processing.decimation), end - begin)
    stored = energy_parameter_names(base.model, base.drive)
    of_energy = np.array([name in stored for name in source.names], dtype=bool)
    names = np.array(source.names, dtype=object)
    W = np.zeros((len(knots) - 1, b))
    W[:, of_energy] = energy_difference_regressor(
        base.model,
        log.dt * np.arange(len(q)),
        q,
        v,
        base.drive,
        columns=names[of_energy].tolist(),
        friction=base.friction,
        knots=knots + ahead,
    )
    lost = power_regressor(
        base.model,
        q,
        v,
        np.zeros_like(v),
        base.drive,
        columns=names[~of_energy].tolist(),
        friction=base.friction,
    )
    power = np.column_stack((lost, (tau * v).sum(axis=1)))
    count = len(power) - len(_INTEGRAL) + 1
    between = sum(weight * power[k : k + count] for k, weight in enumerate(_INTEGRAL))
    work = np.add.reduceat(log.dt * between, knots[:-1], axis=0)
    W[:, ~of_energy] = work[:, :-1]
    inner = v[ahead : ahead + end - begin]
    moves = ~(np.abs(inner) < processing.dead_band).all(axis=1)
    use = np.logical_or.reduceat(moves, knots[:-1])[:, None]
    middle = signals.t[begin - first] + 0.5 * log.dt * (knots[:-1] + knots[1:])
    means = np.add.reduceat(inner, knots[:-1], axis=0) / np.diff(knots)[:, None]
    return Block(middle, W[:, None, :], work[:, -1:], use, means)


FORMS: dict[EquationForm, Callable[[EquationSource, Piece], Block]] = {
    EquationForm.TORQUE: torque_block,
    EquationForm.FILTERED: filtered_block,
    EquationForm.POWER: power_block,
    EquationForm.ENERGY: energy_block,
}


def decimated(chunks: Iterable[Array], step: int, centre: int, count: int) -> Array:
    """Decimated signals (count, c) of chunks (k, c), without excluded samples."""
    parts = [np.ascontiguousarray(chunk)[:, None] for chunk in chunks]
    rows = ((slice(None), part) for part in parts)
    use = np.ones((sum(map(len, parts)), 1), dtype=bool)
    return _decimated_rows(rows, use, (step, centre, count), parts[0].shape[2], 0.0)[0][:, 0]


def outside_dead_band(source: EquationSource, signals: Signals) -> NDArray[np.bool_]:
    """Mask (k, n) of samples outside the dead bands, where the sign of dry friction is known.

    Where the sign of a velocity changes, the acceleration has a step, which the filter of the
    positions spreads over a time; samples within this time of the dead band are left out too.
    """
    from scipy.ndimage import maximum_filter1d

    v = np.concatenate([x for x in (signals.before, signals.v, signals.after) if x is not None])
    start = 0 if signals.before is None else len(signals.before)
    slow = ~moving_joints(source.base.model, source.processing.dead_band, v)
    if source.processing.guard and slow.any():
        size = 2 * source.processing.guard + 1
        slow = maximum_filter1d(slow.astype(np.uint8), size, axis=0, mode="nearest") > 0
    return ~slow[start : start + len(signals)]


def moving_joints(model: RobotModel, band: Array, v: Array) -> NDArray[np.bool_]:
    """Mask (k, n) of joints that are, with their coupled motors, outside their dead bands."""
    mask = ~(np.abs(v) < band)
    transmission = model.transmission
    if transmission is not None:
        for m in transmission.coupled_motors:
            w = transmission.weights[m - 1]
            turns = ~(np.abs(v @ w) < band[m - 1])
            mask[:, w != 0.0] &= turns[:, None]
    return mask


def _instants(source: EquationSource, piece: Piece) -> tuple[slice, tuple[int, int, int]]:
    """Samples of the decimated instants of a piece; decimation, first of them, their number."""
    step = source.processing.decimation
    first = piece.start - max(piece.start - source.processing.reach, piece.low)
    length = piece.stop - piece.start
    return slice(first, first + length, step), (step, first, -(-length // step))


def _decimated_rows(
    chunks: Iterable[tuple[slice, Array]],
    use: NDArray[np.bool_],
    grid: tuple[int, int, int],
    columns: int,
    least: float = _LEAST_WEIGHT,
) -> tuple[Array, NDArray[np.bool_]]:
    """Low-pass and decimate equations; a joint's samples in its dead band have no weight.

    Chunks are rows (k, m, columns) in order, use (N, m); both sides exclude the same samples.
    Returns means (count, m, columns) and use (count, m).
    """
    from ..kernels.decimation import add_rows

    step, centre, count = grid
    taps = decimation_window(step)
    weights = np.zeros((count, use.shape[1]))
    sums = np.zeros((*weights.shape, columns))
    first = 0
    for _, rows in chunks:
        part = use[first : first + len(rows)]
        nonzero = np.asarray(rows.any(axis=0))
        # columns of earlier links and drives are zero
        start = np.where(np.any(nonzero, axis=1), nonzero.argmax(axis=1), rows.shape[2])
        add_rows(
            np.ascontiguousarray(rows),
            part.astype(np.int64).reshape(-1),
            start.astype(np.int64),
            taps,
            step,
            first,
            centre,
            sums,
            weights,
        )
        first += len(rows)
    taking_part = weights > least
    factors = np.where(taking_part, 1.0 / np.where(taking_part, weights, 1.0), 0.0)
    return factors[:, :, None] * sums, taking_part
