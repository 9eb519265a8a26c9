"""Forms of the equations: joint torques, filtered momenta, power, and energy between instants.

Book section 1.6; J.-J. Slotine and W. Li, "On the adaptive control of robot
manipulators", IJRR 6(3), 1987 (momenta); M. Gautier, "Dynamic identification of robots with power
model", IEEE ICRA 1997; M. Gautier and W. Khalil, IEEE CDC 1988 (energy).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any

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

Mask = NDArray[np.bool_]
Grid = tuple[int, int, int]
"""Decimation, first of the decimated samples, and their number."""
_CHUNK, _MOMENTUM_CHUNK = 1024, 128  # largest number of samples in a regressor chunk
_LEAST_WEIGHT = 0.5  # share of the decimation window that must lie outside the dead band
_DERIVATIVE = (3 / 4, -3 / 20, 1 / 60)  # weights of central differences of order six
_INTEGRAL = np.array([11.0, -93.0, 802.0, 802.0, -93.0, 11.0]) / 1440.0
"""Weights of the integral between the two middle ones of six samples (interpolating polynomial)."""
SHORT = 3
"""Samples that momentum and energy equations leave out at each end of a recording."""


class EquationForm(Enum):
    """Quantity that the equations balance: of each joint (torque, filtered) or of the robot.

    Torque and power need accelerations.
    """

    TORQUE = "torques of the joints"
    FILTERED = "rates of the momenta of the joints"
    POWER = "power of all joints together"
    ENERGY = "energy of the robot between instants"

    @property
    def by_joint(self) -> bool:
        """Whether each joint has separate equations."""
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
    use: Mask
    v: Array

    def __len__(self) -> int:
        return len(self.t)


@dataclass(frozen=True, slots=True, eq=False)
class EquationSource:
    """A log, its processing, and the base parameters that have columns, by their names."""

    base: BaseParameters
    names: tuple[str, ...]
    log: Log
    processing: Processing

    def signals(self, piece: Piece, reach: int | None = None) -> Signals:
        """Filtered signals of a piece and beside it, by default as the decimation needs them."""
        reach = self.processing.reach if reach is None else reach
        return piece_signals(self.log, self.processing, piece, reach)

    def chunks(
        self, regressor: Callable[..., Any], *samples: Array, size: int = _CHUNK
    ) -> Iterator[Any]:
        """Regressor of samples (N, n), chunk by chunk in one reused buffer."""
        base, columns = self.base, {"columns": self.names, "friction": self.base.friction}
        parts = chunked(regressor, base.model, *samples, size=size, drive=base.drive, **columns)
        return (W for _, W in parts)


FormedRows = tuple[Array, Array, Mask]
RowForm = Callable[[Array, Array, Array, Mask], FormedRows]
"""From W (k, n, b), torques and velocities (k, n) and use (k, n), at the rate of the log: W
(k, m, c), right side (k, m) and use (k, m)."""


def torque_block(source: EquationSource, piece: Piece, form: RowForm | None = None) -> Block:
    """Torque equations of a piece (book section 1.6.2), combined or extended by a form."""
    return signals_block(source, piece, source.signals(piece), form)


def signals_block(
    source: EquationSource, piece: Piece, x: Signals, form: RowForm | None = None
) -> Block:
    """Torque equations of given signals, such as simulated ones, at the instants of a piece."""
    chunks = source.chunks(torque_regressor, x.q, x.v, x.a)
    rows = _rows(chunks, x.tau, x.v, outside_dead_band(source, x), form)
    return _decimated_block(rows, x.t, x.v, decimated_samples(source, piece))


def filtered_block(source: EquationSource, piece: Piece) -> Block:
    """Filtered momentum equations of a piece of the log (book section 1.6.2)."""
    # low-pass, differences at its ends, and the offset of the first sample
    around = source.processing.reach + 2 * SHORT
    count = min(piece.stop, piece.high - 2 * SHORT) - piece.start
    if count <= 0:
        return _no_equations(source, source.base.model.n)
    x = source.signals(piece, around)
    # samples and the first equation start SHORT rows inside
    inner = slice(SHORT, len(x) - SHORT)
    use = outside_dead_band(source, x)[inner]
    momenta = source.chunks(momentum_regressor, x.q, x.v, size=_MOMENTUM_CHUNK)
    rows = _rows(_momentum_rates(momenta, source.log.dt), x.tau[inner], x.v[inner], use)
    step, first = source.processing.decimation, piece.start - max(piece.start - around, piece.low)
    return _decimated_block(rows, x.t[inner], x.v[inner], (step, first, -(-count // step)))


def _momentum_rates(chunks: Iterable[tuple[Array, Array]], dt: float) -> Iterator[Array]:
    """Regressors of the samples that have ``SHORT`` others on either side."""
    left = None
    for chunk in chunks:
        both = chunk if left is None else map(np.concatenate, zip(left, chunk, strict=True))
        momenta, forces = both
        inner = max(len(momenta) - 2 * SHORT, 0)
        out = -forces[SHORT : SHORT + inner]
        for away, weight in enumerate(_DERIVATIVE, start=1):
            ahead, behind = momenta[SHORT + away :][:inner], momenta[SHORT - away :][:inner]
            out += weight / dt * (ahead - behind)
        yield out
        left = momenta[inner:].copy(), forces[inner:].copy()


def power_block(source: EquationSource, piece: Piece) -> Block:
    """Power equations of a piece of the log (book section 1.6.3)."""
    x = source.signals(piece)
    power = (x.tau * x.v).sum(axis=1, keepdims=True)
    chunks = (d[:, None] for d in source.chunks(power_regressor, x.q, x.v, x.a))
    rows = _rows(chunks, power, x.v, np.ones(power.shape, dtype=bool))
    block = _decimated_block(rows, x.t, x.v, decimated_samples(source, piece), 0.0)
    moving = moving_joints(source.base.model, source.processing.dead_band, block.v)
    return replace(block, use=moving.any(axis=1, keepdims=True))


def energy_block(source: EquationSource, piece: Piece) -> Block:
    """Energy equations over intervals of a piece (book sections 1.5.1.2 and 1.6.3)."""
    dt, base, around = source.log.dt, source.base, 2 * SHORT
    begin, end = piece.start + SHORT, min(piece.stop + SHORT, piece.high - 1 - SHORT)
    if end <= begin:
        return _no_equations(source, 1)
    x = source.signals(piece, around)
    first = max(piece.start - around, piece.low)
    # samples from two before the first knot to two after the last
    ahead = SHORT - 1
    rows = slice(begin - ahead - first, end + SHORT - first)
    q, v, tau = x.q[rows], x.v[rows], x.tau[rows]
    knots = np.append(np.arange(0, end - begin, source.processing.decimation), end - begin)
    stored = energy_parameter_names(base.model, base.drive)
    of_energy = np.array([name in stored for name in source.names], dtype=bool)
    energies, losses = (np.array(source.names)[k].tolist() for k in (of_energy, ~of_energy))
    options = {"drive": base.drive, "friction": base.friction}
    dissipated = power_regressor(base.model, q, v, np.zeros_like(v), columns=losses, **options)
    power = np.column_stack((dissipated, (tau * v).sum(axis=1)))
    count = len(power) - len(_INTEGRAL) + 1
    between = sum(weight * power[k : k + count] for k, weight in enumerate(_INTEGRAL))
    work = np.add.reduceat(dt * between, knots[:-1], axis=0)
    W = np.empty((len(work), len(source.names)))
    W[:, ~of_energy] = work[:, :-1]
    W[:, of_energy] = energy_difference_regressor(
        base.model, dt * np.arange(len(q)), q, v, columns=energies, knots=knots + ahead, **options
    )
    inner = v[ahead : ahead + end - begin]
    moves = ~(np.abs(inner) < source.processing.dead_band).all(axis=1)
    use = np.logical_or.reduceat(moves, knots[:-1])[:, None]
    middle = x.t[begin - first] + 0.5 * dt * (knots[:-1] + knots[1:])
    means = np.add.reduceat(inner, knots[:-1], axis=0) / np.diff(knots)[:, None]
    return Block(middle, W[:, None, :], work[:, -1:], use, means)


FORMS: dict[EquationForm, Callable[[EquationSource, Piece], Block]] = {
    EquationForm.TORQUE: torque_block,
    EquationForm.FILTERED: filtered_block,
    EquationForm.POWER: power_block,
    EquationForm.ENERGY: energy_block,
}


def outside_dead_band(source: EquationSource, signals: Signals) -> Mask:
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


def moving_joints(model: RobotModel, band: Array, v: Array) -> Mask:
    """Mask (k, n) of joints that are, with their coupled motors, outside their dead bands."""
    mask = ~(np.abs(v) < band)
    if (transmission := model.transmission) is not None:
        for m in transmission.coupled_motors:
            w = transmission.weights[m - 1]
            mask[:, w != 0.0] &= ~(np.abs(v @ w) < band[m - 1])[:, None]
    return mask


def decimated(chunks: Iterable[Array], step: int, centre: int, count: int) -> Array:
    """Decimated signals (count, c) of chunks (k, c), without excluded samples."""
    rows = ((x[:, None], np.ones((len(x), 1), dtype=bool)) for x in chunks)
    return _decimated_rows(rows, (step, centre, count), 0.0)[0][:, 0]


def _no_equations(source: EquationSource, groups: int) -> Block:
    """Equations of a piece that is too short for one."""
    y, v = np.zeros((0, groups)), np.zeros((0, source.base.model.n))
    return Block(np.zeros(0), np.zeros((*y.shape, len(source.names))), y, y > 0.0, v)


def decimated_samples(source: EquationSource, piece: Piece) -> Grid:
    """Decimation of a piece, first of the decimated samples, and their number."""
    step = source.processing.decimation
    first = piece.start - max(piece.start - source.processing.reach, piece.low)
    return step, first, -(-(piece.stop - piece.start) // step)


def _rows(
    chunks: Iterable[Array], y: Array, v: Array, use: Mask, form: RowForm | None = None
) -> Iterator[tuple[Array, Mask]]:
    """Rows [W, y] (k, m, b + 1) of successive samples, and their use (k, m)."""
    first = 0
    for W in chunks:
        part = slice(first, first + len(W))
        first = part.stop
        formed = (W, y[part], use[part]) if form is None else form(W, y[part], v[part], use[part])
        yield np.concatenate((formed[0], formed[1][:, :, None]), axis=2), formed[2]


def _decimated_block(
    rows: Iterable[tuple[Array, Mask]], t: Array, v: Array, grid: Grid, least: float = _LEAST_WEIGHT
) -> Block:
    """Equations of rows [W, y] at the rate of the log."""
    means, use = _decimated_rows(rows, grid, least)
    step, first, count = grid
    t, v = t[first::step][:count], decimated([v], *grid)
    return Block(t, means[:, :, :-1], means[:, :, -1], use, v)


def _decimated_rows(
    chunks: Iterable[tuple[Array, Mask]], grid: Grid, least: float
) -> tuple[Array, Mask]:
    """Low-pass and decimate equations; a joint's samples in its dead band have no weight.

    Chunks are rows (k, m, c) in order and their use (k, m), for both sides of the equations.
    Returns means (count, m, c) and use (count, m).
    """
    from ..kernels.decimation import add_rows

    step, centre, count = grid
    if step == 1:
        rows, use = map(np.concatenate, zip(*chunks, strict=True))
        return rows[centre:][:count], use[centre:][:count]
    taps, done = decimation_window(step), 0
    sums, weights = np.zeros((count, 0, 0)), np.zeros((count, 0))
    for rows, use in chunks:
        if not sums.size:
            sums = np.zeros((count, *rows.shape[1:]))
            weights = np.zeros(sums.shape[:2])
        nonzero = np.asarray(rows.any(axis=0))
        # columns of earlier links and drives are zero
        start = np.where(nonzero.any(axis=1), nonzero.argmax(axis=1), rows.shape[2])
        flags = use.astype(np.int64).reshape(-1)
        add_rows(np.ascontiguousarray(rows), flags, start, taps, step, done, centre, sums, weights)
        done += len(rows)
    taking_part = weights > least
    factors = np.where(taking_part, 1.0 / np.where(taking_part, weights, 1.0), 0.0)
    return factors[:, :, None] * sums, taking_part
