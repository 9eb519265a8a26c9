"""Poses that depend on unknowns: products, relative poses and differences, with derivatives.

Each is an `Evaluation`: poses of shape (N, 4, 4) and, of shape (N, 6, C), the ``[v; w]`` that a
unit of each of C unknowns gives them, at their origin and along the axes in which they are given.
"""

from __future__ import annotations

import numpy as np

from ..._arrays import Array
from ...se3 import skew
from .measurement import Evaluation
from .rotation_vectors import inverse_left_jacobians, rotation_errors


def widened(pose: Evaluation, columns: int) -> Evaluation:
    """Append zero columns for unknowns that do not move the poses."""
    T, psi = pose
    return Evaluation(T, np.concatenate([psi, np.zeros((*psi.shape[:2], columns))], axis=-1))


def product(a: Evaluation, b: Evaluation) -> Evaluation:
    """``T_a T_b``."""
    R = a.T[:, :3, :3]
    arm = (R @ b.T[:, :3, 3:])[..., 0]
    psi = np.empty_like(a.psi)
    psi[:, :3] = a.psi[:, :3] - skew(arm) @ a.psi[:, 3:] + R @ b.psi[:, :3]
    psi[:, 3:] = a.psi[:, 3:] + R @ b.psi[:, 3:]
    return Evaluation(a.T @ b.T, psi)


def relative(a: Evaluation, b: Evaluation) -> Evaluation:
    """``T_a^-1 T_b``: pose of b seen in a."""
    Rt = a.T[:, :3, :3].swapaxes(-1, -2)
    apart = b.T[:, :3, 3] - a.T[:, :3, 3]
    T = np.tile(np.eye(4), (len(Rt), 1, 1))
    T[:, :3, :3] = Rt @ b.T[:, :3, :3]
    T[:, :3, 3] = (Rt @ apart[..., None])[..., 0]
    psi = np.empty_like(a.psi)
    psi[:, :3] = Rt @ (b.psi[:, :3] - a.psi[:, :3] + skew(apart) @ a.psi[:, 3:])
    psi[:, 3:] = Rt @ (b.psi[:, 3:] - a.psi[:, 3:])
    return Evaluation(T, psi)


def difference(a: Evaluation, b: Evaluation) -> tuple[Array, Array]:
    """Position of a less that of b, and the rotation vector that turns b to a.

    Shapes: -> residual (N, 6), jacobian (N, 6, C).
    """
    u = rotation_errors(a.T[:, :3, :3], b.T[:, :3, :3])
    residual = np.hstack([a.T[:, :3, 3] - b.T[:, :3, 3], u])
    J = a.psi - b.psi
    # a turn of b is one behind the rotation vector: there the sign of the vector changes
    J[:, 3:] = inverse_left_jacobians(u) @ a.psi[:, 3:] - inverse_left_jacobians(-u) @ b.psi[:, 3:]
    return residual, J


def motionless(T: Array, columns: int) -> Evaluation:
    """Known poses, with zero derivatives. Shapes: T (N, 4, 4)."""
    return Evaluation(T, np.zeros((len(T), 6, columns)))
