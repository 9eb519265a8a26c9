"""Poses at and beside singular positions, where a closed form alone may lose postures.

There, steps of the closed form lose digits: a double root is good to half of them, and what is
computed from it is worse. So overshoots are allowed for, and candidates are brought home to the
pose itself. Where two singular positions come together, poses nearby are asked as well: they are
not singular, and their postures, brought home, are those of the pose. Where the pose has an
infinite family they are members of it.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from .loop import JointChain
from .motion import jacobians, lever
from .solver import Found, Tolerances, nothing_found

ASIDE = (1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3)
"""How far poses nearby are away, beside the length of the arm, and in radians."""
OVERSHOOT = 1e-5
"""Overshoot tried as a double root, beside the length of the arm."""
TWICE = 1e-3
"""Second smallest singular value below which two singular positions come together."""
MET = 1e-12
"""Error up to which postures are met to rounding [m, rad]."""
MOST = 64
"""Rows kept for a pose before families are settled."""

Candidates = Callable[[Array, Array, float], tuple[Array, NDArray[np.bool_]]]
"""Poses (N, 4, 4), references (N, k), overshoot -> candidates (N, C, k), which there are (N, C)."""


def thorough_postures(
    chain: JointChain,
    candidates: Candidates,
    U: Array,
    references: Array,
    tolerances: Tolerances,
) -> Found:
    """All postures of poses that are singular or nearly so.

    Shapes: U (N, 4, 4), references (N, k).
    """
    first = _home(chain, [candidates(U, references, OVERSHOOT)], U, tolerances)
    twice = np.flatnonzero(two_singularities(chain, first))
    if twice.size == 0:
        return first
    from scipy.spatial.transform import Rotation

    goals, wanted = U[twice], references[twice]
    size, rng = lever(chain), np.random.default_rng(0)
    parts = [(first.q[twice], first.valid[twice])]
    for away in ASIDE:
        moved = goals.copy()
        # the same way for all poses, so that a batch gives what its poses give
        turn = Rotation.from_rotvec(away * _direction(rng)).as_matrix()
        moved[:, :3, :3] = turn @ goals[:, :3, :3]
        moved[:, :3, 3] += away * size * _direction(rng)
        parts.append(candidates(moved, wanted, OVERSHOOT))
    second = _home(chain, parts, goals, tolerances)
    return first.put(twice, second)


def _home(
    chain: JointChain,
    parts: list[tuple[Array, NDArray[np.bool_]]],
    U: Array,
    tolerances: Tolerances,
) -> Found:
    """Candidates brought home."""
    from ._thorough import home_postures

    q = np.concatenate([part[0] for part in parts], axis=1)
    there = np.concatenate([part[1] for part in parts], axis=1)
    found = nothing_found(len(U), min(MOST, q.shape[1]), chain.k)
    accepted = np.array([MET, min(tolerances)])
    home_postures(
        np.ascontiguousarray(U), np.ascontiguousarray(chain.sigma), chain.D,
        np.where(there[..., None], q, 0.0), there, accepted, found.q, found.valid, found.residual,
    )  # fmt: skip
    return found.pack(found.valid)


def two_singularities(chain: JointChain, found: Found) -> NDArray[np.bool_]:
    """Whether a pose has a posture with two small singular values, or no posture."""
    n, s = np.nonzero(found.valid)
    out = np.logical_not(np.any(found.valid, axis=1)).reshape(-1)
    J = jacobians(chain, found.q[n, s])
    J[:, :3] /= lever(chain)
    values = np.linalg.svd(J, compute_uv=False)
    out[n[values[:, -2] < TWICE]] = True
    return out


def _direction(rng: np.random.Generator) -> Array:
    direction = rng.normal(size=3)
    return direction / np.linalg.norm(direction)
