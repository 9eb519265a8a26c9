"""Rotation vectors of small rotations, and how they change.

Source: T. D. Barfoot, State Estimation for Robotics, Cambridge 2017, eq. (7.76).
"""

from __future__ import annotations

import numpy as np

from ..._arrays import Array
from ...se3 import skew


def rotation_errors(R: Array, R_measured: Array) -> Array:
    """Rotation vectors that turn measured rotations into predicted ones, world axes.

    Shapes: R, R_measured (N, 3, 3) -> (N, 3).
    """
    from scipy.spatial.transform import Rotation

    if not len(R):
        return np.zeros((0, 3))
    # products of rotations are rotations: the check would take longer than the rest
    turned = R @ R_measured.swapaxes(-1, -2)
    return Rotation.from_matrix(turned, assume_valid=True).as_rotvec()


def inverse_left_jacobians(u: Array) -> Array:
    """Inverse left Jacobians of rotation vectors: ``d u = J^-1 w``.

    Shapes: u (N, 3) -> (N, 3, 3).
    """
    angle = np.linalg.norm(u, axis=-1)[:, None, None]
    K = skew(u)
    half = 0.5 * angle
    small = angle < 1e-4
    safe = np.where(small, 1.0, half)
    # (1 - h cot h) / (2 h)^2, whose series begins 1/12
    c = np.where(small, 1.0 / 12.0 + angle**2 / 720.0, (1.0 - safe / np.tan(safe)) / (4 * safe**2))
    return np.eye(3) - 0.5 * K + c * (K @ K)


def left_jacobians(u: Array) -> Array:
    """Left Jacobians of rotation vectors: ``w = J d u``. Shapes: u (N, 3) -> (N, 3, 3)."""
    angle = np.linalg.norm(u, axis=-1)[:, None, None]
    K = skew(u)
    small = angle < 1e-4
    safe = np.where(small, 1.0, angle)
    a = np.where(small, 0.5 - angle**2 / 24.0, (1.0 - np.cos(safe)) / safe**2)
    b = np.where(small, 1.0 / 6.0 - angle**2 / 120.0, (safe - np.sin(safe)) / safe**3)
    return np.eye(3) + a * K + b * (K @ K)


def rotations_of(u: Array) -> Array:
    """Rotation matrices of rotation vectors. Shapes: u (N, 3) -> (N, 3, 3)."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_rotvec(u).as_matrix() if len(u) else np.zeros((0, 3, 3))


def mean_rotation(R: Array) -> Array:
    """Rotation nearest to the mean of rotation matrices. Shapes: R (N, 3, 3) -> (3, 3)."""
    U, _, Vt = np.linalg.svd(R.sum(axis=0))
    U[:, 2] *= np.sign(np.linalg.det(U @ Vt))
    return U @ Vt


def tilt_of(direction: Array) -> Array:
    """Rotation vector without part along z that turns z to a direction."""
    x, y, z = direction
    sine = float(np.hypot(x, y))
    angle = np.arctan2(sine, z)
    return np.array([-y, x]) * (angle / sine if sine > 0.0 else 1.0)


def tilted_axes(tilt: Array) -> tuple[Array, Array]:
    """Axes turned by rotation vectors without part along z, and how they change.

    Shapes: tilt (N, 2) -> R (N, 3, 3), derivative (N, 3, 3, 2).
    """
    u = np.column_stack([tilt, np.zeros(len(tilt))])
    R = rotations_of(u)
    w = left_jacobians(u)[:, :, :2]
    turned = -skew(R.swapaxes(-1, -2)) @ w[:, None]
    return R, turned.swapaxes(1, 2)


def unit_vector(direction: Array) -> Array:
    """Normalise a direction; unit vectors are returned unchanged."""
    length = float(np.linalg.norm(direction))
    return direction if abs(length - 1.0) < 1e-15 else direction / length
