"""Power equation: all joint torques together at each sample.

Source: M. Gautier, "Dynamic identification of robots with power model", IEEE ICRA 1997.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from ..._arrays import Array
from ...regressors import power_regressor_chunks
from ..preparation.signals import Piece, piece_signals
from .torque import decimated, turning

if TYPE_CHECKING:
    from ..equations import Block, Equations


def power_block(system: Equations, piece: Piece) -> Block:
    """Equations of the power of a piece of the log (seed book, section 1.6.3)."""
    from ..equations import Block

    processing = system.processing
    found = piece_signals(system.log, processing, piece, processing.reach)
    b, n = len(system.names), system.model.n
    width = b + 1 + n

    def rows() -> Iterator[Array]:
        chunks = power_regressor_chunks(
            system.model, found.q, found.v, found.a, system.base.drive,
            columns=system.names, friction=system.base.friction,
        )  # fmt: skip
        for part, d in chunks:
            out = np.empty((len(d), width))
            out[:, :b] = d
            np.einsum("kj,kj->k", found.tau[part], found.v[part], out=out[:, b])
            out[:, b + 1 :] = found.v[part]
            yield out

    step = processing.decimation
    first = piece.start - max(piece.start - processing.reach, piece.low)
    kept = decimated(rows(), step, first, -(-(piece.stop - piece.start) // step), width)
    v = kept[:, b + 1 :]
    moves = turning(system.model, processing.dead_band, v)
    use = np.logical_or.reduce(moves, axis=1)[:, None]
    t = found.t[first : first + piece.stop - piece.start : step]
    return Block(t, kept[:, None, :b], kept[:, b : b + 1], use, v)
