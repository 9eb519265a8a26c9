"""The search: one representation, others where doubts are left, then poses aside and valleys.

Lengths are in units of the arm.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array
from .gathered import Gathered
from .representation import Representation, closing_links
from .solver import GeneralSolver

MOST = 16  # postures a six-joint arm can have at one pose
TOLERANCE = 1e-13  # residual of a posture [m, or the arm's length if that is more; rad]
POOR = 1e-9  # quality of the elimination below which another representation is asked as well
ASIDE = 16  # poses nearby that are solved where doubts are left
FALLS = 100  # starts from anywhere where doubts are left
ROUGH = 1e-4  # way that polishing moved a posture above which it is asked as well [rad]


def met_within(unit: float) -> Array:
    """Residuals up to which a pose is met: in units of the arm, and rad."""
    return np.array([TOLERANCE / min(unit, 1.0), TOLERANCE])


def one_way(
    solver: GeneralSolver, way: Representation, goals: Array, found: Gathered
) -> tuple[NDArray[np.bool_], Array]:
    """Add the postures one representation finds; whether doubts remain, and its errors (N,)."""
    from ._eigenproblem import assemble
    from ._folds import partners
    from ._roots import postures

    N = goals.shape[0]
    M, P, Q = np.empty((N, 16, 16)), np.empty((N, 14, 27)), np.empty((N, 8, 8))
    order, angle, quality = np.empty((N, 8), np.int64), np.empty(N), np.empty(N)
    report = np.empty((N, 2))
    closings = closing_links(solver.D, way.direction, goals)
    how = (way.closing, closings, int(way.swapped))
    assemble(way.kinds, way.links, *how, M, P, Q, order, angle, quality)
    failed = ~np.all(np.isfinite(M), axis=(1, 2))
    M[failed] = 0.0
    eigenvalues = np.linalg.eigvals(M).astype(np.complex128)
    eigenvalues[failed] = 1j
    postures(
        solver.sigma,
        solver.D,
        goals,
        met_within(solver.unit),
        way.kinds,
        way.joints,
        float(way.direction),
        way.links,
        *how,
        eigenvalues,
        P,
        Q,
        order,
        angle,
        found.q,
        found.count,
        report,
    )
    partners(
        solver.sigma, solver.D, goals, met_within(solver.unit), found.q, found.count, found.double
    )
    total = found.count + np.sum(found.double & found.there, axis=1)
    doubt = (total % 2 == 1) | (total != report[:, 0]) | (quality < POOR) | (report[:, 1] > ROUGH)
    return doubt | failed, report[:, 1]


def _nearby(goals: Array, k: int) -> Array:
    """The poses a little aside: k = 0, 1 one way and back, k = 2, 3 another, and so on."""
    rng = np.random.default_rng(k // 2)
    size = (3e-3, 3e-4, 1e-3)[(k // 2) % 3] * (1 if k % 2 == 0 else -1)
    half = 0.5 * size * rng.normal(size=3)
    # Cayley's formula gives a rotation exactly
    S = np.array([[0, -half[2], half[1]], [half[2], 0, -half[0]], [-half[1], half[0], 0]])
    aside = goals.copy()
    aside[:, :3, :3] = np.linalg.solve(np.eye(3) - S, np.eye(3) + S) @ goals[:, :3, :3]
    aside[:, :3, 3] += size * rng.normal(size=3)
    return aside


def solve(solver: GeneralSolver, goals: Array) -> Gathered:
    """Postures of poses in units of the arm."""
    found = Gathered(goals.shape[0])
    doubt, _ = one_way(solver, solver.representations[0], goals, found)
    for way in solver.representations[1:]:
        chosen = np.flatnonzero(doubt)
        if chosen.size == 0:
            break
        part = found.rows(chosen)
        doubt[chosen] = one_way(solver, way, goals[chosen], part)[0]
        found.put(chosen, part)
    chosen = np.flatnonzero(doubt & (found.count != MOST))
    if chosen.size:
        part = found.rows(chosen)
        _look_beside(solver, goals[chosen], part)
        found.put(chosen, part)
    found.double &= found.there
    return found


def _look_beside(solver: GeneralSolver, goals: Array, found: Gathered) -> None:
    """Add postures found from neighbouring poses, nearly singular curves and random starts.

    Elimination loses digits where roots merge, not at poses beside: both sides of a fold are tried.
    """
    from ._folds import partners
    from ._roots import bring_home
    from ._valleys import fall_into_valleys, follow_valleys

    N = goals.shape[0]
    arm = (solver.sigma, solver.D, goals, met_within(solver.unit))
    for k in range(ASIDE):
        aside = Gathered(N)
        one_way(solver, solver.representations[0], _nearby(goals, k), aside)
        bring_home(*arm, aside.q, aside.count, found.q, found.count)
        follow_valleys(*arm, aside.q, aside.count, found.q, found.count)
    follow_valleys(*arm, found.q.copy(), found.count.copy(), found.q, found.count)
    starts = np.random.default_rng(0).uniform(-np.pi, np.pi, (FALLS, 6))
    starts[:, solver.sigma == 1] /= np.pi
    valleys, number = np.empty((N, FALLS, 6)), np.zeros(N, np.int64)
    fall_into_valleys(*arm[:3], starts, valleys, number)
    follow_valleys(*arm, valleys, number, found.q, found.count)
    partners(*arm, found.q, found.count, found.double)
