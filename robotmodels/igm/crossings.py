"""Postures of a pose at which relations between joints hold: Newton's method on both together."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import reduce
from math import gcd

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from .loop import JointChain
from .motion import jacobians, tool_poses

__all__ = ["Relations", "pose_errors", "solved_with_relations", "within_reach"]

STEPS = 60
"""Newton steps from one start."""
LONGEST = 0.3
"""Longest step in any joint [rad, m]."""
REACH = 0.4
"""Way along a family within which its first-order estimate must see the relation [rad]."""
_EXACT, _MET = (
    1e-13,
    1e-11,
)  # errors at which a start is left alone, and at which it counts [m, rad]
_SINGULAR = 1e-12  # determinant below which a step of least length is taken


@dataclass(frozen=True, slots=True, eq=False)
class Relations:
    """``A q = b`` for some joints. Shapes: A (m, k), b (m,) or (N, m), period (m,)."""

    A: Array
    b: Array
    period: Array

    def error(self, q: Array, pose: NDArray[np.int64]) -> Array:
        """``A q - b``, the nearest way round, of postures ``(B, k)`` of poses ``(B,)``."""
        wanted = self.b if self.b.ndim == 1 else self.b[pose]
        return self.nearest(q @ self.A.T - wanted)

    def of(self, rows: slice) -> Relations:
        """The relations of some poses."""
        return self if self.b.ndim == 1 else replace(self, b=self.b[rows])

    def nearest(self, r: Array) -> Array:
        """Differences modulo the periods."""
        turn = np.where(self.period > 0.0, self.period, 1.0)
        return np.where(self.period > 0.0, r - turn * np.round(r / turn), r)


def relations(chain: JointChain, A: Array, b: Array) -> Relations:
    """Relations with their periods. Shapes: A (m, k), b (m,) or (N, m)."""
    period = np.zeros(len(A))
    for i, row in enumerate(A[:, chain.sigma == 0]):
        used = row[row != 0.0]
        if used.size and np.array_equal(used, np.round(used)) and np.abs(used).max() < 1e6:
            period[i] = 2.0 * np.pi * reduce(gcd, (int(abs(a)) for a in used))
    return Relations(A, b, period)


def pose_errors(chain: JointChain, U: Array, q: Array) -> Array:
    """Pose errors: translation [m] and rotation vector [rad], axes of R_0.

    Shapes: U (B, 4, 4), q (B, k) -> (B, 6).
    """
    P = tool_poses(chain, q)
    R = U[:, :3, :3] @ np.swapaxes(P[:, :3, :3], 1, 2)
    sine = 0.5 * np.stack(
        (R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]), axis=-1
    )
    size = np.linalg.norm(sine, axis=-1)
    angle = np.arctan2(size, 0.5 * (np.trace(R, axis1=1, axis2=2) - 1.0))
    grow = np.where(size > 1e-12, angle / np.where(size > 1e-12, size, 1.0), 1.0)
    return np.hstack((U[:, :3, 3] - P[:, :3, 3], grow[:, None] * sine))


def within_reach(
    chain: JointChain, wanted: Relations, q: Array, pose: NDArray[np.int64]
) -> NDArray[np.bool_]:
    """Whether a family member is within first-order reach of a relation.

    Shapes: q (B, k), pose (B,) -> (B,).
    """
    J = jacobians(chain, q)
    along = np.linalg.svd(J)[2][:, -1]
    slope = np.abs(along @ wanted.A[0])
    off = np.abs(wanted.error(q, pose)[:, 0])
    # where the relation turns round its change is of second order
    return (off <= REACH * slope) | (off <= REACH**2)


def solved_with_relations(
    chain: JointChain, U: Array, wanted: Relations, q: Array, pose: NDArray[np.int64]
) -> tuple[Array, NDArray[np.bool_]]:
    """Newton's method from postures to postures that meet their pose and the relations.

    Shapes: U (N, 4, 4), q (B, k), pose (B,) -> q (B, k), converged (B,).
    """
    q = q.copy()
    error = np.full(len(q), np.inf)
    active = np.arange(len(q))
    for _ in range(STEPS):
        e = pose_errors(chain, U[pose[active]], q[active])
        r = wanted.error(q[active], pose[active])
        error[active] = np.maximum(np.abs(e).max(axis=1), np.abs(r).max(axis=1))
        going = error[active] > _EXACT
        active, e, r = active[going], e[going], r[going]
        if active.size == 0:
            break
        J = jacobians(chain, q[active])
        G = np.concatenate((J, np.broadcast_to(wanted.A, (len(J), *wanted.A.shape))), axis=1)
        step = _steps(G, np.hstack((e, -r)))
        longest = np.abs(step).max(axis=1, keepdims=True)
        q[active] += step * np.minimum(1.0, LONGEST / np.maximum(longest, LONGEST))
    return q, error < _MET


def _steps(G: Array, e: Array) -> Array:
    """Solutions of ``G x = e``, of least length where G is singular."""
    with np.errstate(all="ignore"):
        singular = ~(np.abs(np.linalg.det(G)) > _SINGULAR)
    x = np.zeros_like(e)
    x[~singular] = np.linalg.solve(G[~singular], e[~singular, :, None])[..., 0]
    x[singular] = (np.linalg.pinv(G[singular], rcond=1e-9) @ e[singular, :, None])[..., 0]
    return x
