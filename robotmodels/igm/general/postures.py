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

    Parameters
    ----------
    solver : GeneralSolver
        From `prepare_general`.
    U : array_like, shape (N, 4, 4)
        Poses of the tool in the base, ``U = D_0 M_1 D_1 ... M_6 D_6`` [m].

    Returns
    -------
    q : ndarray, shape (N, 16, 6)
        Postures, packed, angles in (-pi, pi] [rad or m]; NaN in the rows without one.
    valid : ndarray of bool, shape (N, 16)
        Rows that hold a posture. Each meets its pose to 1e-13 m and rad, beside infinite families
        to 1e-12.
    double : ndarray of bool, shape (N, 16)
        Rows that hold two merged postures: less than 1e-6 apart, or so near that the pose is met
        everywhere between them and only one is found.

    Examples
    --------
    >>> from robotmodels.igm.general import prepare_general
    >>> from robotmodels.igm.loop import joint_chain
    >>> from robotmodels.kinematics import dgm
    >>> from robotmodels.robots import load
    >>> model = load("crx10ia")
    >>> solver = prepare_general(joint_chain(model))
    >>> T = dgm(model, [[0.3, -0.2, 0.5, 1.0, -0.7, 0.4]])
    >>> q, valid, double = general_postures(solver, T)
    >>> int(valid.sum()) % 2, bool(double.any())
    (0, False)
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

    There `general_postures` returns some members of the family, as many as it came upon.

    Parameters
    ----------
    solver : GeneralSolver
        From `prepare_general`.
    q : ndarray, shape (N, 16, 6)
        Postures from `general_postures` [rad or m].
    valid : ndarray of bool, shape (N, 16)
        Rows that hold one.

    Returns
    -------
    ndarray of bool, shape (N, 16)
        Rows at which the Jacobian is singular and, to first order, stays so along its null
        direction.

    Examples
    --------
    Joint 3 of the CRX at -90 degrees brings four of its axes together.

    >>> from robotmodels.igm.general import prepare_general
    >>> from robotmodels.igm.loop import joint_chain
    >>> from robotmodels.kinematics import dgm
    >>> from robotmodels.robots import load
    >>> model = load("crx10ia")
    >>> solver = prepare_general(joint_chain(model))
    >>> T = dgm(model, [[0.3, -0.2, -np.pi / 2, 1.0, -0.7, 0.4]])
    >>> q, valid, _ = general_postures(solver, T)
    >>> bool(on_infinite_family(solver, q, valid).any())
    True
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
