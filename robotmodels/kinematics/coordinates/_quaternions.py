"""Quaternions and rotation vectors beside given ones, of sequences, and back to rotations."""

from __future__ import annotations

from math import pi

import numpy as np

from ..._arrays import Array
from ...se3.orientation import axes_and_angles, quaternions_of
from ._angles import whole_turns


def quaternions_near(Q: Array, near: Array) -> Array:
    """Of each quaternion and its opposite, the one nearer to a given one.

    Shapes: Q, near (..., 4) -> (..., 4).
    """
    opposite = (Q * near).sum(axis=-1, keepdims=True) < 0.0
    return np.where(opposite, -Q, Q + np.zeros_like(near))


def continuous_quaternions(Q: Array, near: Array | None) -> Array:
    """Quaternions of a sequence, each on the side of the one before it.

    Shapes: Q (N, 4), near (4,) -> (N, 4).
    """
    before = np.concatenate([Q[:1] if near is None else near[None], Q[:-1]])
    signs = np.where((Q * before[: len(Q)]).sum(axis=-1) < 0.0, -1.0, 1.0)
    return Q * np.cumprod(signs)[:, None] + 0.0


def rotation_of_quaternions(Q: Array) -> Array:
    """Rotations of unit quaternions. Shapes: Q (..., 4) -> (..., 3, 3)."""
    w, x, y, z = (Q[..., k] for k in range(4))
    R = np.empty((*Q.shape[:-1], 3, 3))
    R[..., 0, 0] = 1.0 - 2.0 * (y * y + z * z)
    R[..., 1, 1] = 1.0 - 2.0 * (x * x + z * z)
    R[..., 2, 2] = 1.0 - 2.0 * (x * x + y * y)
    R[..., 0, 1], R[..., 1, 0] = 2.0 * (x * y - w * z), 2.0 * (x * y + w * z)
    R[..., 0, 2], R[..., 2, 0] = 2.0 * (x * z + w * y), 2.0 * (x * z - w * y)
    R[..., 1, 2], R[..., 2, 1] = 2.0 * (y * z - w * x), 2.0 * (y * z + w * x)
    return R


def vectors_near(R: Array, near: Array) -> Array:
    """The rotation vectors of the same rotations that are nearest to given ones."""
    axis, angle = axes_and_angles(quaternions_of(R))
    length = np.linalg.norm(near, axis=-1)
    direction = near / np.where(length > 0.0, length, 1.0)[..., None]
    still = (angle == 0.0)[..., None]
    axis = np.where(still, direction, axis)
    angle = angle + whole_turns((near * axis).sum(axis=-1) - angle)
    return axis * angle[..., None]


def continuous_vectors(R: Array, near: Array | None) -> Array:
    """Rotation vectors of a sequence, each nearest to the one before it.

    Shapes: R (N, 3, 3), near (3,) -> (N, 3).
    """
    axis, angle = axes_and_angles(quaternions_of(R))
    before, turned = np.zeros(3), 0.0
    if near is not None and near.any():
        turned = float(np.linalg.norm(near))
        before = near / turned
    # where nothing turns the axis stays what it was
    last = np.maximum.accumulate(np.where(angle > 0.0, np.arange(len(angle)), -1))
    axis = np.where((last < 0)[:, None], before, axis[last])
    cosines = (axis * np.concatenate([before[None], axis[:-1]])[: len(axis)]).sum(axis=-1)
    angles = angle.tolist()
    for i, (a, cosine) in enumerate(zip(angles, cosines.tolist(), strict=True)):
        turned = angles[i] = a + 2.0 * pi * round((turned * cosine - a) / (2.0 * pi))
    return axis * np.array(angles).reshape(-1, 1)


def quaternions_of_vectors(vectors: Array) -> Array:
    """Unit quaternions of rotation vectors of any length. Shapes: vectors (..., 3) -> (..., 4)."""
    angle = np.linalg.norm(vectors, axis=-1, keepdims=True)
    # np.sinc(t) is sin(pi t) / (pi t)
    return np.concatenate(
        [np.cos(0.5 * angle), 0.5 * np.sinc(angle / (2.0 * pi)) * vectors], axis=-1
    )
