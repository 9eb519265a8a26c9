"""Torque equations that are changed before they are thinned out: combined, or with more columns."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array
from ...regressors import torque_regressor_chunks
from ..equations import Block, EquationForm, Equations
from ..preparation.signals import Piece, piece_signals
from .torque import (
    _LEAST,  # pyright: ignore[reportPrivateUsage]
    _Thinned,  # pyright: ignore[reportPrivateUsage]
    decimated,
    moving,
)

_CHUNK = 1024

Rows = tuple[Array, Array, NDArray[np.bool_]]
RowForm = Callable[[Array, Array, Array, NDArray[np.bool_]], Rows]
"""From W ``(k, n, b)``, torques, velocities ``(k, n)`` and which of them slide, at the rate of the
log: new W ``(k, m, c)``, measured side ``(k, m)`` and which take part ``(k, m)``."""


def formed_block(system: Equations, piece: Piece, form: RowForm) -> Block:
    """Equations of a piece whose rows are formed at the rate of the log."""
    assert system.form is EquationForm.TORQUE
    processing = system.processing
    found = piece_signals(system.log, processing, piece, processing.reach)
    step = processing.decimation
    first = piece.start - max(piece.start - processing.reach, piece.low)
    kept = slice(first, first + piece.stop - piece.start, step)
    count = -(-(piece.stop - piece.start) // step)
    sliding = moving(system, found)
    chunks = torque_regressor_chunks(
        system.model, found.q, found.v, found.a, system.base.drive, _CHUNK,
        columns=system.names, friction=system.base.friction,
    )  # fmt: skip
    thinned: _Thinned | None = None
    for part, W in chunks:
        rows, y, use = form(W, found.tau[part], found.v[part], sliding[part])
        both = np.concatenate((rows, y[:, :, None]), axis=2)
        if thinned is None:
            thinned = _Thinned(count, both.shape[1:], step, first)
        thinned.add(both, use)
    assert thinned is not None
    use = thinned.weights > _LEAST
    means = thinned.means(use)
    v = decimated(iter((found.v,)), step, first, count, found.v.shape[1])
    return Block(found.t[kept], np.ascontiguousarray(means[:, :, :-1]), means[:, :, -1], use, v)


def combined(side: Array) -> RowForm:
    """The form of combinations of joints, such as the motors. Shapes: side (m, n)."""
    needed = (side != 0.0).astype(np.int64)

    def form(W: Array, tau: Array, v: Array, use: NDArray[np.bool_]) -> Rows:
        rest = (~use).astype(np.int64) @ needed.T
        return np.einsum("mj,kjb->kmb", side, W), tau @ side.T, rest == 0

    return form
