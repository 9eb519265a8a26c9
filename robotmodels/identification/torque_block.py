"""Equations of the torques: the inverse dynamic model, thinned out with the measured torque."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from ..regressors import torque_regressor_chunks
from .filters import decimation_window
from .signals import Piece, Signals, piece_signals

if TYPE_CHECKING:
    from .equations import Block, Equations


def torque_block(system: Equations, piece: Piece) -> Block:
    """Equations of a piece of the log.

    Parameters
    ----------
    system : Equations
        Robot, parameters, log and choices.
    piece : Piece
        Which rows.

    Returns
    -------
    Block
        Regressor and torque through the same low-pass, one of ``decimation`` samples kept.
    """
    found = piece_signals(system.log, system.processing, piece, system.processing.reach)
    return signals_block(system, piece, found)


def signals_block(system: Equations, piece: Piece, found: Signals) -> Block:
    """Equations of signals that are given, such as simulated ones, at the times of a piece.

    Parameters
    ----------
    system : Equations
        Robot, parameters and choices.
    piece : Piece
        Which rows.
    found : Signals
        Of the piece and the reach of the decimation's window on either side.

    Returns
    -------
    Block
        As `torque_block`.
    """
    from .equations import Block

    b, n = len(system.names), system.model.n
    step = system.processing.decimation
    width = n * b + 2 * n

    def rows() -> Iterator[Array]:
        chunks = torque_regressor_chunks(
            system.model, found.q, found.v, found.a, system.base.drive,
            columns=system.names, friction=system.base.friction,
        )  # fmt: skip
        buffer = np.empty((0, width))
        for part, W in chunks:
            k = len(W)
            if len(buffer) < k:
                buffer = np.empty((k, width))
            out = buffer[:k]
            out[:, : n * b] = W.reshape(k, -1)
            out[:, n * b : n * b + n] = found.tau[part]
            out[:, n * b + n :] = found.v[part]
            yield out

    first = piece.start - max(piece.start - system.processing.reach, piece.low)
    kept = decimated(rows(), step, first, -(-(piece.stop - piece.start) // step), width)
    W = kept[:, : n * b].reshape(-1, n, b)
    v = kept[:, n * b + n :]
    t = found.t[first : first + piece.stop - piece.start : step]
    return Block(t, W, kept[:, n * b : n * b + n], moving(system, v), v)


def decimated(rows: Iterator[Array], step: int, centre: int, count: int, width: int) -> Array:
    """Rows through the decimation's low-pass, one of ``step`` kept.

    Windows that reach over the ends are made of the rows that are there, with weights that add to
    one: equations may be added with any weights.

    Parameters
    ----------
    rows : iterator of ndarray, shapes (k, width)
        Rows, chunk by chunk.
    step : int
        Rows for one that is kept.
    centre : int
        Number of the row that the first window is centred on.
    count : int
        Rows kept.
    width : int
        Of the rows.

    Returns
    -------
    ndarray, shape (count, width)
        The rows kept.
    """
    from ..kernels.decimation import add_rows

    taps = decimation_window(step)
    sums, weights = np.zeros((count, width)), np.zeros(count)
    first = 0
    for chunk in rows:
        add_rows(chunk, taps, step, first, centre, sums, weights)
        first += len(chunk)
    sums /= weights[:, None]
    return sums


def moving(system: Equations, v: Array) -> NDArray[np.bool_]:
    """Where the direction of dry friction is known: the joint and coupled motors turn.

    Parameters
    ----------
    system : Equations
        Robot, parameters and choices.
    v : ndarray, shape (k, n)
        Velocities.

    Returns
    -------
    ndarray of bool, shape (k, n)
        Which equations take part.
    """
    band = system.processing.dead_band
    return ~(np.abs(v) < band)
