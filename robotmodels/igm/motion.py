"""Poses, axes and Jacobians of a chain at many postures, for the choice of its solver.

Plain array code: it runs when an arm is prepared and on the few postures that are singular.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from .loop import JointChain


def tool_poses(chain: JointChain, q: Array) -> Array:
    """Poses of the tool in R_0. Shapes: q (N, k) -> (N, 4, 4)."""
    return _joint_frames(chain, q)[0]


def jacobians(chain: JointChain, q: Array) -> Array:
    """Jacobians at the tool in the axes of R_0, rows ``[v; w]``. Shapes: q (N, k) -> (N, 6, k)."""
    U, axes, origins = _joint_frames(chain, q)
    turning = (chain.sigma == 0)[:, None, None]
    columns = np.where(turning, cross(axes, U[:, :3, 3] - origins), axes), axes * turning
    return np.ascontiguousarray(np.concatenate(columns, axis=2).transpose(1, 2, 0))


def axes_of(chain: JointChain, q: Array) -> tuple[Array, Array]:
    """Directions and origins of the axes in R_0. Shapes: q (N, k) -> (k, N, 3) each."""
    return _joint_frames(chain, q)[1:]


def cross(a: Array, b: Array) -> Array:
    """Vector products (..., 3): for small arrays several times as fast as `numpy.cross`."""
    out = np.empty(np.broadcast_shapes(a.shape, b.shape))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        out[..., i] = a[..., j] * b[..., k] - a[..., k] * b[..., j]
    return out


def random_postures(chain: JointChain, count: int, rng: np.random.Generator) -> Array:
    """Random postures for tests of an arm (count, k): any angle, lengths of the arm's size."""
    length = lever(chain)
    return np.where(
        chain.sigma == 0,
        rng.uniform(-np.pi, np.pi, (count, chain.k)),
        length * rng.uniform(-1.0, 1.0, (count, chain.k)),
    )


@lru_cache(maxsize=256)
def lever(chain: JointChain) -> float:
    """A length of the arm [m]: the lever of its revolute joints about the tool, 1 without any."""
    turning = chain.sigma == 0
    rng = np.random.default_rng(0)
    q = np.where(turning, rng.uniform(-np.pi, np.pi, (32, chain.k)), 0.0)
    squares = np.sum(jacobians(chain, q)[:, :3, turning] ** 2, axis=1)
    length = float(np.sqrt(squares.mean())) if squares.size else 0.0
    return length if length > 1e-9 else 1.0


def scaled(J: Array, length: float) -> Array:
    """Jacobians with lengths in units of the arm."""
    J = J.copy()
    J[:, :3] /= length
    return J


def singular_rows(J: Array, relative: float) -> tuple[NDArray[np.int64], Array]:
    """Jacobians that are singular to a relative tolerance, with their null directions.

    Shapes: J (N, a, k) -> rows (m,), directions (m, k).
    """
    k = J.shape[2]
    G = np.swapaxes(J, 1, 2) @ J
    trace = np.maximum(np.trace(G, axis1=1, axis2=2), 1e-300)
    # the smallest eigenvalue is no less than what is left of the product where the others are
    # equal: few matrices are decomposed
    least = np.linalg.det(G / trace[:, None, None]) * max(k - 1, 1) ** (k - 1)
    doubtful = np.flatnonzero(least <= 4.0 * relative**2)
    _, values, rows = np.linalg.svd(J[doubtful], full_matrices=False)
    small = values[:, -1] <= relative * np.maximum(values[:, 0], 1e-300)
    return doubtful[small], rows[small, -1]


def _joint_frames(chain: JointChain, q: Array) -> tuple[Array, Array, Array]:
    """Poses of the tool (N, 4, 4), and directions and origins of the axes, each (k, N, 3)."""
    N, k = q.shape
    c, s = np.cos(q.T), np.sin(q.T)
    motions, joints, turns = np.zeros((k, N, 4, 4)), np.empty((k, N, 4, 4)), chain.sigma == 0
    motions[:, :, range(4), range(4)] = 1.0
    motions[turns, :, 0, 0] = motions[turns, :, 1, 1] = c[turns]
    motions[turns, :, 0, 1], motions[turns, :, 1, 0] = -s[turns], s[turns]
    motions[~turns, :, 2, 3] = q.T[~turns]
    motions = motions @ chain.D[1:, None]
    T = np.broadcast_to(chain.D[0], (N, 4, 4))
    for m in range(k):
        joints[m] = T
        T = T @ motions[m]
    return np.ascontiguousarray(T), joints[..., :3, 2], joints[..., :3, 3]
