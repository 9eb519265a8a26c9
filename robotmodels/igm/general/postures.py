"""Every posture of a general six-joint arm at given poses, and those of infinite families."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._arrays import Array
from .gathered import ROOM, Gathered
from .search import MOST, solve
from .solver import GeneralSolver

CHUNK = 256  # poses worked on at a time: 2 MB of equations


def general_postures(
    solver: GeneralSolver, U: ArrayLike
) -> tuple[Array, NDArray[np.bool_], NDArray[np.bool_]]:
    """All real postures of a six-joint arm.

    Shapes: U (N, 4, 4) -> q (N, 16, 6); valid, double (N, 16).
    """
    goals = np.array(U, dtype=np.float64, order="C")
    goals[:, :3, 3] /= solver.unit
    N = goals.shape[0]
    q = np.full((N, MOST, 6), np.nan)
    valid = np.zeros((N, MOST), np.bool_)
    double = np.zeros((N, MOST), np.bool_)
    for first in range(0, N, CHUNK):
        rows = slice(first, first + CHUNK)
        found = solve(solver, goals[rows])
        _shorten(solver, found)
        there = found.there[:, :MOST]
        valid[rows], double[rows] = there, found.double[:, :MOST] & there
        q[rows][there] = found.q[:, :MOST][there]
    q[:, :, solver.sigma == 1] *= solver.unit
    return q, valid, double


def on_infinite_family(
    solver: GeneralSolver, q: Array, valid: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Whether postures belong to an infinite family: the arm moves and the tool does not.

    Shapes: q (N, 16, 6), valid (N, 16) -> (N, 16).
    """
    from ._folds import flat_singularities

    found = np.where(valid[..., None], q, 0.0)
    found[:, :, solver.sigma == 1] /= solver.unit
    flat = np.zeros(valid.shape, np.bool_)
    flat_singularities(solver.sigma, solver.D, found, np.sum(valid, axis=1), flat)
    return flat


def _shorten(solver: GeneralSolver, found: Gathered) -> None:
    """Where there are more rows than postures can be, members of infinite families go first."""
    from ._folds import flat_singularities

    chosen = np.flatnonzero(found.count > MOST)
    if chosen.size == 0:
        return
    part = found.rows(chosen)
    flat = np.zeros((chosen.size, ROOM), np.bool_)
    flat_singularities(solver.sigma, solver.D, part.q, part.count, flat)
    order = np.argsort(np.where(part.there, flat, 2), axis=1, kind="stable")
    part.q = np.take_along_axis(part.q, order[..., None], axis=1)
    part.double = np.take_along_axis(part.double, order, axis=1)
    part.count = np.minimum(part.count, MOST)
    found.put(chosen, part)
