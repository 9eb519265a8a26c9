"""Singular poses: candidates that a solver may miss, double roots, members of self-motions.

Near a singular posture a closed form loses digits: candidates whose cosine slightly exceeds 1 are
kept and refined by Newton's method on the chain itself. Where two singularities coincide, no
posture was found, or a pose is met only to more than rounding, the solver also runs at perturbed
poses, and `q_ref` itself is refined.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from .chain import canonical_frames
from .check import bits_of, checked
from .constraints import WHOLE, Constraints
from .loop import JointChain
from .motion import jacobians, lever
from .postures import Postures
from .self_motions import SelfMotions
from .solver import Tolerances

PERTURBED = (1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3)
"""Distances of perturbed poses, relative to the length of the arm and in radians."""
DOUBLY_SINGULAR = 1e-3
"""Second smallest singular value below which two singularities coincide."""
MET = 1e-12
"""Error up to which a pose is met to rounding [m, rad]."""
MOST = 64
"""Rows kept for a pose before self-motions are completed."""
NEAR = 1e-4
"""Smallest singular value below which a posture may be singular."""

Candidates = Callable[[Array, Array], tuple[Array, NDArray[np.bool_], NDArray[np.bool_]]]
"""Poses (N, 4, 4), references (N, k) -> candidates (N, C, k), which exist (N, C), free joints."""


def solve_singular(
    chain: JointChain, candidates: Candidates, U: Array, references: Array, tolerances: Tolerances
) -> Postures:
    """All postures of poses that are singular or nearly so, from a solver's candidates.

    Shapes: U (N, 4, 4), references (N, k).
    """
    q, there, free = candidates(U, references)
    first = checked(chain, U, _filled(q, there), there, tolerances, free=free, rough=np.inf)
    met = np.where(first.valid, first.residual, 0.0).max(axis=1, initial=0.0) <= MET
    # without a candidate the pose is out of reach by more than what rounding explains
    rest = np.flatnonzero((doubly_singular(chain, first) | ~met) & there.any(axis=1))
    if rest.size == 0:
        return first
    from scipy.spatial.transform import Rotation

    size, rng = lever(chain), np.random.default_rng(0)
    parts = [(q[rest], there[rest]), (references[rest, None], np.ones((rest.size, 1), np.bool_))]
    for away in PERTURBED:
        # the same change for all poses, so that a batch gives the same as its poses one by one
        directions = rng.normal(size=(2, 3))
        directions *= away / np.linalg.norm(directions, axis=1)[:, None]
        moved = U[rest]
        moved[:, :3, :3] = Rotation.from_rotvec(directions[0]).as_matrix() @ moved[:, :3, :3]
        moved[:, :3, 3] += size * directions[1]
        parts.append(candidates(moved, references[rest])[:2])
    q, there = (np.concatenate([part[i] for part in parts], axis=1) for i in range(2))
    part = checked(
        chain, U[rest], _filled(q, there), there, tolerances, double=np.zeros_like(there),
        most=MOST, rough=np.inf, singular=True,
    )  # fmt: skip
    return first.put(rest, part.pack(part.valid))


def _filled(q: Array, there: NDArray[np.bool_]) -> Array:
    return np.where(there[..., None], q, 0.0)


def doubly_singular(chain: JointChain, found: Postures) -> NDArray[np.bool_]:
    """Whether a pose has a posture with two small singular values, or no posture."""
    n, s = np.nonzero(found.valid)
    out = ~np.any(found.valid, axis=1)
    J = jacobians(chain, found.q[n, s])
    J[:, :3] /= lever(chain)
    if chain.k > 1:
        out[n[np.linalg.svd(J, compute_uv=False)[:, -2] < DOUBLY_SINGULAR]] = True
    return out


def complete(
    chain: JointChain, U: Array, found: Postures, references: Array, tolerances: Tolerances
) -> Postures:
    """Mark double roots; bring every self-motion to the reference.

    Shapes: U (N, 4, 4), references (N, k). ``found.family``: members that the solver knows of; of
    six joints all are found.
    """
    k = chain.k
    scaled, lengths, goals, q = _in_units(chain, U, found)
    wanted = Constraints(scaled, WHOLE, np.zeros((0, k)), np.zeros(0), 1.0)
    double, member, bits = found.double.copy(), found.family & found.valid, bits_of(found.free)
    moving, kept = np.zeros(bits.shape, np.int64), []
    at, motions = np.argwhere(found.valid), {}
    J = jacobians(scaled, q[found.valid])
    near = np.linalg.svd(J, compute_uv=False)[:, -1] < NEAR
    for n, s in at[near | member[found.valid]]:
        motion = motions.setdefault(n, SelfMotions(wanted, goals[n], references[n] / lengths))
        moving[n, s] = motion.moving_joints(q[n, s], int(bits[n, s]))
        member[n, s] |= moving[n, s] != 0
        if moving[n, s] == 0:
            rows, null = motion.directions(q[n, s], 0)
            member[n, s] |= len(rows) > 0
            double[n, s] |= len(rows) == 0 < null and motion.is_double(q[n, s], null)
    out = replace(found, double=double, family=member, moving=_flags(moving, k))
    rows = np.flatnonzero(np.any(member & (moving == 0), axis=1))
    if rows.size == 0:
        return out
    for n in rows:
        kept.append([])
        for r in np.flatnonzero(found.valid[n]):
            ends = [(q[n, r], int(bits[n, r]), int(moving[n, r]), bool(double[n, r]))]
            if member[n, r] and moving[n, r] == 0:
                ends = motions[n].at_reference(q[n, r], max(MET, found.residual[n, r]))
            kept[-1] += ends
    there = np.zeros((rows.size, max(map(len, kept))), np.bool_)
    candidates, marks = np.zeros((*there.shape, k)), np.zeros((3, *there.shape), np.int64)
    for i, ends in enumerate(kept):
        there[i, : len(ends)] = True
        candidates[i, : len(ends)] = [end[0] for end in ends]
        marks[:, i, : len(ends)] = np.transpose([end[1:] for end in ends])
    part = checked(
        chain, U[rows], candidates * lengths, there, tolerances, free=_flags(marks[0], k),
        moving=_flags(marks[1], k), double=marks[2] == 1, singular=True,
    )  # fmt: skip
    return out.put(rows, part)


def _in_units(
    chain: JointChain, U: Array, found: Postures
) -> tuple[JointChain, Array, Array, Array]:
    """Chain, lengths of the joints' units, poses and postures in units of the arm."""
    D, unit = canonical_frames(chain)
    lengths, goals = np.where(chain.sigma == 1, unit, 1.0), np.array(U, order="C")
    goals[:, :3, 3] /= unit
    sigma = np.ascontiguousarray(chain.sigma)
    return replace(chain, sigma=sigma, D=D), lengths, goals, _filled(found.q, found.valid) / lengths


def _flags(bits: NDArray[np.int64], k: int) -> NDArray[np.bool_]:
    """The lowest k bits of each number, one joint each, shape (..., k)."""
    return (bits[..., None] >> np.arange(k)) & 1 == 1
