"""Small rotations, and poses that depend on unknowns: values with derivatives.

A pose that depends on C unknowns is an `Evaluation`: T (N, 4, 4) and psi (N, 6, C), the twist
``[v; w]`` of the pose's origin by each unknown, in the axes in which the pose is given.

Source: T. D. Barfoot, State Estimation for Robotics, Cambridge 2017, eq. (7.76); W. Kabsch, Acta
Crystallographica A32, 1976 (motion between points).
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from ..._arrays import Array
from ...se3 import skew
from .base import Evaluation


def rotation_errors(R: Array, R_measured: Array) -> Array:
    """Rotation vectors from measured to predicted rotations, world axes: (N, 3, 3) -> (N, 3)."""
    # products of rotations are rotations: the check would take longer than the rest
    turned = R @ R_measured.swapaxes(-1, -2)
    return Rotation.from_matrix(turned, assume_valid=True).as_rotvec()


def inverse_left_jacobians(u: Array) -> Array:
    """Inverse left Jacobians of rotation vectors, ``d u = J^-1 w``: (N, 3) -> (N, 3, 3)."""
    angle = np.linalg.norm(u, axis=-1)[:, None, None]
    K = skew(u)
    small = angle < 1e-4
    half = np.where(small, 1.0, 0.5 * angle)
    # (1 - h cot h) / (2 h)^2, whose series begins 1/12
    c = np.where(small, 1.0 / 12.0 + angle**2 / 720.0, (1.0 - half / np.tan(half)) / (4 * half**2))
    return np.eye(3) - 0.5 * K + c * (K @ K)


def left_jacobians(u: Array) -> Array:
    """Left Jacobians of rotation vectors, ``w = J d u``: (N, 3) -> (N, 3, 3)."""
    return np.linalg.inv(inverse_left_jacobians(u)).astype(np.float64)


def tilt_of(direction: Array) -> Array:
    """Rotation vector without part along z that turns z to a direction."""
    x, y, z = direction
    sine = float(np.hypot(x, y))
    angle = np.arctan2(sine, z)
    return np.array([-y, x]) * (angle / sine if sine > 0.0 else 1.0)


def tilted_axes(tilt: Array) -> tuple[Array, Array]:
    """Axes rotated by vectors (x, y, 0): tilt (N, 2) -> R (N, 3, 3), derivative (N, 3, 3, 2)."""
    u = np.column_stack([tilt, np.zeros(len(tilt))])
    R = Rotation.from_rotvec(u).as_matrix()
    w = left_jacobians(u)[:, :, :2]
    turned = -skew(R.swapaxes(-1, -2)) @ w[:, None]
    return R, turned.swapaxes(1, 2)


def unit_vector(direction: Array) -> Array:
    """Normalise a direction; unit vectors are returned unchanged."""
    length = float(np.linalg.norm(direction))
    return direction if abs(length - 1.0) < 1e-15 else direction / length


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
    """``T_a^-1 T_b``, the pose of b in a."""
    Rt = a.T[:, :3, :3].swapaxes(-1, -2)
    apart = b.T[:, :3, 3] - a.T[:, :3, 3]
    T = np.tile(np.eye(4), (len(Rt), 1, 1))
    T[:, :3, :3] = Rt @ b.T[:, :3, :3]
    T[:, :3, 3] = (Rt @ apart[..., None])[..., 0]
    psi = np.empty_like(a.psi)
    psi[:, :3] = Rt @ (b.psi[:, :3] - a.psi[:, :3] + skew(apart) @ a.psi[:, 3:])
    psi[:, 3:] = Rt @ (b.psi[:, 3:] - a.psi[:, 3:])
    return Evaluation(T, psi)


def difference(a: Evaluation, T: Array, psi: Array | None = None) -> tuple[Array, Array]:
    """Position of a less that of T, and the rotation vector from T to a; psi is that of T.

    Shapes: T (N, 4, 4), psi (N, 6, C) -> residual (N, 6), jacobian (N, 6, C).
    """
    u = rotation_errors(a.T[:, :3, :3], T[:, :3, :3])
    J = a.psi.copy()
    J[:, 3:] = inverse_left_jacobians(u) @ a.psi[:, 3:]
    if psi is not None:
        J[:, :3] -= psi[:, :3]
        # a rotation of T is applied before the rotation vector, which changes the sign of u
        J[:, 3:] -= inverse_left_jacobians(-u) @ psi[:, 3:]
    return np.hstack([a.T[:, :3, 3] - T[:, :3, 3], u]), J


def best_motion(points: Array, targets: Array) -> Array:
    """Least-squares rigid motion from points to targets (Kabsch).

    Shapes: points, targets (N, 3) -> (4, 4).
    """
    a, b = points.mean(axis=0), targets.mean(axis=0)
    T = np.eye(4)
    T[:3, :3] = nearest_rotation((targets - b).T @ (points - a))
    T[:3, 3] = b - T[:3, :3] @ a
    return T


def nearest_rotation(M: Array) -> Array:
    """Rotation nearest to a matrix, (3, 3)."""
    U, _, Vt = np.linalg.svd(M)
    return U @ np.diag([1.0, 1.0, float(np.sign(np.linalg.det(U @ Vt)))]) @ Vt
