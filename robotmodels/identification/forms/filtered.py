"""Equations of the momentum form through a low-pass: joint torques without accelerations.

Source: J.-J. Slotine and W. Li, "On the adaptive control of robot manipulators", IJRR 6(3), 1987.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from ..._arrays import Array
from ...regressors import momentum_regressor_chunks
from ..preparation.signals import Piece, Signals, piece_signals
from .torque import _LEAST as LEAST
from .torque import _Thinned as Thinned
from .torque import decimated, moving

if TYPE_CHECKING:
    from ..equations import Block, Equations

_WEIGHTS = (3 / 4, -3 / 20, 1 / 60)
SHORT = len(_WEIGHTS)
"""Samples on either side that a derivative is made of."""


def filtered_block(system: Equations, piece: Piece) -> Block:
    """Equations of the momentum form of a piece of the log (seed book, section 1.6.2)."""
    from ..equations import Block

    processing = system.processing
    # the low-pass, differences around its ends, and the shift by which all pieces begin inside
    around = processing.reach + 2 * SHORT
    found = piece_signals(system.log, processing, piece, around)
    n, step = system.model.n, processing.decimation
    first = piece.start - max(piece.start - around, piece.low)
    length = max(min(piece.stop + SHORT, piece.high - SHORT) - piece.start - SHORT, 0)
    count = -(-length // step)
    # samples begin SHORT inside, and so does the first equation
    inner = slice(SHORT, max(len(found) - SHORT, SHORT))
    sliding, tau, v = moving(system, found)[inner], found.tau[inner], found.v[inner]
    regressors = Thinned(count, (n, len(system.names)), step, first)
    for part, W in _regressors(system, found):
        regressors.add(W, sliding[part])
    torques = Thinned(count, (n, 1), step, first)
    torques.add(np.ascontiguousarray(tau[:, :, None]), sliding)
    use = regressors.weights > LEAST
    start = first + SHORT
    return Block(
        found.t[start : start + length : step], regressors.means(use),
        torques.means(use)[:, :, 0], use, decimated(iter((v,)), step, first, count, n),
    )  # fmt: skip


def _regressors(system: Equations, found: Signals) -> Iterator[tuple[slice, Array]]:
    """Regressors of the samples that have ``SHORT`` others on either side."""
    shape = (0, system.model.n, len(system.names))
    momenta, forces = np.empty(shape), np.empty(shape)
    done = 0
    chunks = momentum_regressor_chunks(
        system.model, found.q, found.v, system.base.drive,
        columns=system.names, friction=system.base.friction,
    )  # fmt: skip
    for _, (P, S) in chunks:
        momenta, forces = np.concatenate((momenta, P)), np.concatenate((forces, S))
        inner = len(momenta) - 2 * SHORT
        if inner <= 0:
            continue
        out = -forces[SHORT : SHORT + inner]
        for away, weight in enumerate(_WEIGHTS, start=1):
            ahead, behind = momenta[SHORT + away :][:inner], momenta[SHORT - away :][:inner]
            out += weight / system.log.dt * (ahead - behind)
        yield slice(done, done + inner), out
        done += inner
        momenta, forces = momenta[inner:], forces[inner:]
