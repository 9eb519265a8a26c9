"""Equations of the momentum form through a low-pass: joint torques without accelerations."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from .._arrays import Array
from ..regressors import momentum_regressor_chunks
from .signals import Piece, Signals, piece_signals
from .torque_block import decimated, moving

if TYPE_CHECKING:
    from .equations import Block, Equations

_WEIGHTS = (3 / 4, -3 / 20, 1 / 60)
SHORT = len(_WEIGHTS)
"""Samples on either side that a derivative is made of."""


def filtered_block(system: Equations, piece: Piece) -> Block:
    """Equations of the momentum form of a piece of the log.

    ``tau = dP/dt - S``, where P and S need positions and velocities alone. Central differences of
    P and the decimation's low-pass are linear and without delay, so that together they are the
    derivative of the low-pass; torques go through the same low-pass. What differences cut off
    goes with the sixth power of the sampling period. A filter that runs on from the start of the
    recording (`filtered_regressor`) would join the pieces and delay the times.

    Parameters
    ----------
    system : Equations
        Robot, parameters, log and choices.
    piece : Piece
        Which rows.

    Returns
    -------
    Block
        As that of the torques; equations begin and end three samples inside a recording.

    References
    ----------
    Seed book section 1.6.2; J.-J. Slotine and W. Li, "On the adaptive control of robot
    manipulators", IJRR 6(3), 1987.
    """
    from .equations import Block

    processing = system.processing
    # the low-pass, differences around its ends, and the shift by which all pieces begin inside
    around = processing.reach + 2 * SHORT
    found = piece_signals(system.log, processing, piece, around)
    b, n, step = len(system.names), system.model.n, processing.decimation
    first = piece.start - max(piece.start - around, piece.low)
    length = max(min(piece.stop + SHORT, piece.high - SHORT) - piece.start - SHORT, 0)
    width = n * b + 2 * n
    # rows begin SHORT inside, and so does the first equation
    kept = decimated(_rows(system, found), step, first, -(-length // step), width)
    v = kept[:, n * b + n :]
    start = first + SHORT
    return Block(
        found.t[start : start + length : step], kept[:, : n * b].reshape(-1, n, b),
        kept[:, n * b : n * b + n], moving(system, v), v,
    )  # fmt: skip


def _rows(system: Equations, found: Signals) -> Iterator[Array]:
    """Regressor, torque and velocity of the samples that have ``SHORT`` others on either side."""
    b, n, dt = len(system.names), system.model.n, system.log.dt
    momenta, others = np.empty((0, n * b)), np.empty((0, n * b + 2 * n))
    chunks = momentum_regressor_chunks(
        system.model, found.q, found.v, system.base.drive,
        columns=system.names, friction=system.base.friction,
    )  # fmt: skip
    for part, (P, S) in chunks:
        k = len(P)
        momenta = np.vstack((momenta, P.reshape(k, -1)))
        others = np.vstack((others, np.hstack((-S.reshape(k, -1), found.tau[part], found.v[part]))))
        inner = len(momenta) - 2 * SHORT
        if inner <= 0:
            continue
        out = others[SHORT : SHORT + inner]
        for away, weight in enumerate(_WEIGHTS, start=1):
            ahead, behind = momenta[SHORT + away :][:inner], momenta[SHORT - away :][:inner]
            out[:, : n * b] += weight / dt * (ahead - behind)
        yield out
        # the first SHORT rows have been used up, and are those that `out` ended with
        momenta, others = momenta[inner:], others[inner:]
