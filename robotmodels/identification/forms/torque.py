"""Equations of the torques: the inverse dynamic model, thinned out with the measured torque."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array
from ...model import RobotModel
from ...regressors import torque_regressor, torque_regressor_chunks
from ..preparation.filters import decimation_window
from ..preparation.signals import Piece, Signals, piece_signals

if TYPE_CHECKING:
    from ..equations import Block, Equations

_CHUNK = 1024
"""Samples whose regressor is made at a time."""
_LEAST = 0.5
"""Part of a window's weights that must be outside the dead band."""


def torque_block(system: Equations, piece: Piece) -> Block:
    """Equations of a piece of the log."""
    found = piece_signals(system.log, system.processing, piece, system.processing.reach)
    return signals_block(system, piece, found)


def signals_block(system: Equations, piece: Piece, found: Signals) -> Block:
    """Equations of signals that are given, such as simulated ones, at the times of a piece."""
    from ..equations import Block

    step = system.processing.decimation
    first = piece.start - max(piece.start - system.processing.reach, piece.low)
    kept = slice(first, first + piece.stop - piece.start, step)
    count = -(-(piece.stop - piece.start) // step)
    options = {"columns": system.names, "friction": system.base.friction}
    sliding = moving(system, found)
    if step == 1:
        q, v, a = found.q[kept], found.v[kept], found.a[kept]
        W = torque_regressor(system.model, q, v, a, system.base.drive, **options)
        return Block(found.t[kept], W, found.tau[kept], sliding[kept], v)
    chunks = torque_regressor_chunks(
        system.model, found.q, found.v, found.a, system.base.drive, _CHUNK, **options
    )
    thinned = _Thinned(count, (system.model.n, len(system.names)), step, first)
    for part, W in chunks:
        thinned.add(W, sliding[part])
    torques = _Thinned(count, (system.model.n, 1), step, first)
    torques.add(np.ascontiguousarray(found.tau[:, :, None]), sliding)
    use = thinned.weights > _LEAST
    v = decimated(iter((found.v,)), step, first, count, found.v.shape[1])
    return Block(found.t[kept], thinned.means(use), torques.means(use)[:, :, 0], use, v)


class _Thinned:
    """Rows on their way through the low-pass, each kind with the samples that it may use.

    Whatever weights they are added with, equations stay equations. So a joint's samples in its dead
    band are left out of the sums, on both sides alike, and the others count more.
    """

    def __init__(self, count: int, core: tuple[int, int], step: int, centre: int) -> None:
        self.sums, self.weights = np.zeros((count, *core)), np.zeros((count, core[0]))
        self.step, self.centre, self.first = step, centre, 0
        self.taps = decimation_window(step)

    def add(self, rows: Array, use: NDArray[np.bool_]) -> None:
        """Add rows ``(k, m, c)`` that follow those before; ``use (k, m)``."""
        from ...kernels.decimation import add_rows

        seen = np.any(rows, axis=0, keepdims=True)[0]
        # columns of links and drives before the joint are zero
        start = np.where(seen.any(axis=1), seen.argmax(axis=1), rows.shape[2]).astype(np.int64)
        add_rows(
            rows, use.astype(np.int64).reshape(-1), start, self.taps, self.step, self.first,
            self.centre, self.sums, self.weights,
        )  # fmt: skip
        self.first += len(rows)

    def means(self, use: NDArray[np.bool_]) -> Array:
        """Weighted means ``(count, m, c)``, zero where too few samples take part."""
        return np.where(use, 1.0 / np.where(use, self.weights, 1.0), 0.0)[:, :, None] * self.sums


def decimated(rows: Iterator[Array], step: int, centre: int, count: int, width: int) -> Array:
    """Decimation: low-pass filter, then one of ``step`` rows.

    Shapes: rows (k, width) -> (count, width).
    """
    thinned = _Thinned(count, (1, width), step, centre)
    for chunk in rows:
        thinned.add(np.ascontiguousarray(chunk)[:, None], np.ones((len(chunk), 1), dtype=bool))
    return thinned.means(np.ones((count, 1), dtype=bool))[:, 0]


def moving(system: Equations, found: Signals) -> NDArray[np.bool_]:
    """Samples (k, n) at which the direction of dry friction is known.

    Where the sign of a velocity changes, the acceleration steps; the filter of the positions smears
    that over a time, so that samples of this time beside the dead band are left out as well.
    """
    from scipy.ndimage import maximum_filter1d

    v = np.concatenate([x for x in (found.before, found.v, found.after) if x is not None])
    start = 0 if found.before is None else len(found.before)
    slow = ~turning(system.model, system.processing.dead_band, v)
    if system.processing.guard and slow.any():
        size = 2 * system.processing.guard + 1
        slow = maximum_filter1d(slow.astype(np.uint8), size, axis=0, mode="nearest") > 0
    return ~slow[start : start + len(found)]


def turning(model: RobotModel, band: Array, v: Array) -> NDArray[np.bool_]:
    """Where joints, and the coupled motors that turn them, are outside their dead bands (k, n)."""
    found = ~(np.abs(v) < band)
    transmission = model.transmission
    if transmission is not None:
        for m in transmission.coupled_motors:
            w = transmission.weights[m - 1]
            turns = ~(np.abs(v @ w) < band[m - 1])
            found[:, w != 0.0] &= turns[:, None]
    return found
