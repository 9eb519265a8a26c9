"""Rotations as unit quaternions, scalar first, and as rotation vectors: axis times angle.

Source: S. W. Shepperd, "Quaternion from rotation matrix", J. Guidance and Control 1(3), 1978.
"""

from __future__ import annotations

import numpy as np

from .._arrays import Array

_ROUNDING = 4 * np.finfo(np.float64).eps
"""Components of a unit quaternion up to this are zero where signs are chosen."""


def products_of(R: Array) -> Array:
    """Symmetric matrices ``4 Q Q^T`` of the quaternions of rotations, affine in R."""
    P = linear_products_of(R)
    for k in range(4):
        P[..., k, k] += 1.0
    return P


def linear_products_of(R: Array) -> Array:
    """Linear part of `products_of`, for angular velocities."""
    P = np.empty((*R.shape[:-2], 4, 4))
    x, y, z = R[..., 0, 0], R[..., 1, 1], R[..., 2, 2]
    P[..., 0, 0] = x + y + z
    P[..., 1, 1] = x - y - z
    P[..., 2, 2] = y - x - z
    P[..., 3, 3] = z - x - y
    P[..., 0, 1] = P[..., 1, 0] = R[..., 2, 1] - R[..., 1, 2]
    P[..., 0, 2] = P[..., 2, 0] = R[..., 0, 2] - R[..., 2, 0]
    P[..., 0, 3] = P[..., 3, 0] = R[..., 1, 0] - R[..., 0, 1]
    P[..., 1, 2] = P[..., 2, 1] = R[..., 0, 1] + R[..., 1, 0]
    P[..., 1, 3] = P[..., 3, 1] = R[..., 0, 2] + R[..., 2, 0]
    P[..., 2, 3] = P[..., 3, 2] = R[..., 1, 2] + R[..., 2, 1]
    return P


def quaternions_of(R: Array) -> Array:
    """Unit quaternions of rotations, ``Q1 >= 0``. Shapes: R (..., 3, 3) -> (..., 4)."""
    P = products_of(R)
    largest = np.diagonal(P, axis1=-2, axis2=-1).argmax(axis=-1)
    Q = np.take_along_axis(P, largest[..., None, None], axis=-2)[..., 0, :]
    Q = Q / np.linalg.norm(Q, axis=-1, keepdims=True)
    leading = np.take_along_axis(Q, (abs(Q) > _ROUNDING).argmax(axis=-1)[..., None], axis=-1)
    Q = np.where(leading < 0.0, -Q, Q) + 0.0
    Q[..., 0] = np.maximum(Q[..., 0], 0.0)
    return Q


def axes_and_angles(Q: Array) -> tuple[Array, Array]:
    """Unit axes and angles of unit quaternions with ``Q1 >= 0``.

    Shapes: Q (..., 4) -> axis (..., 3).
    """
    length = np.hypot(np.hypot(Q[..., 1], Q[..., 2]), Q[..., 3])
    angle = 2.0 * np.arctan2(length, Q[..., 0])
    return Q[..., 1:] / np.where(length > 0.0, length, 1.0)[..., None], angle


def rotation_vectors_of(R: Array) -> Array:
    """Rotation vectors, unit axis times angle, of rotations; exact also near 0 and half a turn."""
    axis, angle = axes_and_angles(quaternions_of(R))
    return axis * angle[..., None]
