"""Energy equations over intervals, without accelerations.

Source: M. Gautier and W. Khalil, "On the identification of the inertial parameters of robots", IEEE
CDC 1988.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..._arrays import Array
from ...regressors import energy_difference_regressor, energy_parameter_names, power_regressor
from ..preparation.signals import Piece, piece_signals

if TYPE_CHECKING:
    from ..equations import Block, Equations

_INTEGRAL = np.array([11.0, -93.0, 802.0, 802.0, -93.0, 11.0]) / 1440.0
"""Integral between the two middle ones of six samples, of the polynomial through them."""
SHORT = 3
"""Samples that a recording's equations stay inside its ends."""


def energy_block(system: Equations, piece: Piece) -> Block:
    """Equations of the energy of a piece of the log (seed book, sections 1.5.1.2 and 1.6.3)."""
    from ..equations import Block

    log, processing, base = system.log, system.processing, system.base
    b, n = len(system.names), system.model.n
    begin = piece.start + SHORT
    end = min(piece.stop + SHORT, piece.high - 1 - SHORT)
    if end <= begin:  # nothing is left of the piece
        return Block(
            np.zeros(0), np.zeros((0, 1, b)), np.zeros((0, 1)), np.zeros((0, 1), dtype=bool),
            np.zeros((0, n)),
        )  # fmt: skip
    around = 2 * SHORT
    found = piece_signals(log, processing, piece, around)
    first = max(piece.start - around, piece.low)
    rows = slice(begin - SHORT + 1 - first, end + SHORT - first)
    q, v, tau = found.q[rows], found.v[rows], found.tau[rows]
    # samples from two before the first knot to two after the last
    ahead = SHORT - 1
    knots = np.append(np.arange(0, end - begin, processing.decimation), end - begin)

    stored = energy_parameter_names(system.model, base.drive)
    of_energy = np.array([name in stored for name in system.names], dtype=bool)
    names = np.array(system.names, dtype=object)
    W = np.zeros((len(knots) - 1, b))
    t = log.dt * np.arange(len(q))
    W[:, of_energy] = energy_difference_regressor(
        system.model, t, q, v, base.drive, columns=names[of_energy].tolist(),
        friction=base.friction, knots=knots + ahead,
    )  # fmt: skip
    power = np.empty((len(q), int((~of_energy).sum()) + 1))
    power[:, :-1] = power_regressor(
        system.model, q, v, np.zeros_like(v), base.drive, columns=names[~of_energy].tolist(),
        friction=base.friction,
    )  # fmt: skip
    power[:, -1] = (tau * v).sum(axis=1)
    work = np.add.reduceat(log.dt * _integrals(power), knots[:-1], axis=0)
    W[:, ~of_energy] = work[:, :-1]

    inner = v[ahead : ahead + end - begin]
    counts = np.diff(knots)[:, None]
    turning = ~(np.abs(inner) < processing.dead_band).all(axis=1)
    use = np.logical_or.reduceat(turning, knots[:-1])[:, None]
    middle = found.t[begin - first] + 0.5 * log.dt * (knots[:-1] + knots[1:])
    means = np.add.reduceat(inner, knots[:-1], axis=0) / counts
    return Block(middle, W[:, None, :], work[:, -1:], use, means)


def _integrals(x: Array) -> Array:
    """Between each two samples, in sampling periods, of those with two more on either side."""
    count = len(x) - len(_INTEGRAL) + 1
    total = np.zeros((count, x.shape[1]))
    for k, weight in enumerate(_INTEGRAL):
        total += weight * x[k : k + count]
    return total
