"""The choice of an arm's best representations, and their test on random postures."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array, read_only
from ..chain import canonical_frames
from ..loop import JointChain
from .gathered import Gathered
from .representation import Representation, all_representations
from .search import one_way, solve
from .solver import GeneralSolver

WAYS = 12  # representations kept


def prepare_general(
    chain: JointChain, tests: int = 48, rng: np.random.Generator | int | None = 0
) -> GeneralSolver | None:
    """Choose the best representations of a six-joint arm and test them on random postures."""
    if chain.k != 6 or int(np.sum(chain.sigma == 1)) > 1:
        return None
    rng = np.random.default_rng(rng)
    D, unit = canonical_frames(chain)
    sigma = read_only(chain.sigma, np.int64)
    candidates = all_representations(sigma, D)
    few, many = _random_goals(sigma, D, 8, rng), _random_goals(sigma, D, tests, rng)
    ranked = _ranked(sigma, D, unit, candidates, few[1])
    if not ranked:
        return None
    solver = GeneralSolver(sigma, read_only(D), unit, ranked, np.inf, 0, 0, 0, 0)
    q, goals = many
    doubt, moved = one_way(solver, solver.representations[0], goals, Gathered(tests))
    found = solve(solver, goals)
    lost = _nearest(sigma, q, found) > 1e-5
    odd = (found.count + np.sum(found.double, axis=1)) % 2 == 1
    return GeneralSolver(
        sigma=sigma,
        D=read_only(D),
        unit=unit,
        representations=ranked,
        conditioning=float(np.sort(moved)[(9 * tests) // 10]),
        tested=tests,
        doubts=int(np.sum(doubt)),
        misses=int(np.sum(lost)),
        odd=int(np.sum(odd)),
    )


def _random_goals(
    sigma: NDArray[np.int64], D: Array, N: int, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Random postures ``(N, 6)`` and their poses ``(N, 4, 4)``, in units of the arm."""
    q = np.where(sigma == 1, rng.uniform(-1.0, 1.0, (N, 6)), rng.uniform(-np.pi, np.pi, (N, 6)))
    T = np.broadcast_to(D[0], (N, 4, 4))
    for k in range(6):
        M = np.broadcast_to(np.eye(4), (N, 4, 4)).copy()
        if sigma[k] == 1:
            M[:, 2, 3] = q[:, k]
        else:
            c, s = np.cos(q[:, k]), np.sin(q[:, k])
            M[:, 0, 0], M[:, 0, 1], M[:, 1, 0], M[:, 1, 1] = c, -s, s, c
        T = T @ M @ D[k + 1]
    return q, np.ascontiguousarray(T)


def _nearest(sigma: NDArray[np.int64], q: Array, found: Gathered) -> Array:
    """Distance from ``q (N, 6)`` to the nearest posture found, shape (N,); inf without any."""
    d = np.abs(found.q - q[:, None, :])
    d = np.where(sigma == 0, np.abs(d - 2 * np.pi * np.round(d / (2 * np.pi))), d).max(axis=2)
    return np.min(np.where(found.there, d, np.inf), axis=1)


def _ranked(
    sigma: NDArray[np.int64],
    D: Array,
    unit: float,
    candidates: list[Representation],
    goals: Array,
) -> tuple[Representation, ...]:
    """The best representations first, by postures missed and by the errors before polishing.

    What each finds at a few poses is compared with what all of them find together.
    """
    N = goals.shape[0]
    solver = GeneralSolver(sigma, D, unit, tuple(candidates), np.inf, 0, 0, 0, 0)
    union, counts, errors = Gathered(N), [], []
    for way in candidates:
        alone = Gathered(N)
        _, moved = one_way(solver, way, goals, alone)
        one_way(solver, way, goals, union)
        counts.append(int(alone.count.sum()))
        errors.append(np.sort(np.minimum(moved, 10.0)))
    most = int(union.count.sum())
    if most == 0:
        return ()
    # a posture missed weighs more than any error; 1e-16 keeps the logarithm finite
    score = np.array(
        [
            100.0 * (most - count) + float(np.mean(np.log10(error + 1e-16)))
            for count, error in zip(counts, errors, strict=True)
        ]
    )
    first = int(np.argmin(score))
    # a second opinion from another joint's eigenvalues doubts other poses: worth two digits
    same = np.array([way.joints[2] == candidates[first].joints[2] for way in candidates])
    score += 2.0 * same
    score[first] = -np.inf
    return tuple(candidates[i] for i in np.argsort(score, kind="stable")[:WAYS])
