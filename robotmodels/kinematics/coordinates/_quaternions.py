"""Orientations as unit quaternions, scalar first, and as rotation vectors by way of them."""

from __future__ import annotations

from math import pi

import numpy as np

from ..._arrays import Array
from ._angles import whole_turns

_ROUNDING = 4 * np.finfo(np.float64).eps
"""Components of a unit quaternion up to this are zero where signs are chosen."""


def products_of(R: Array) -> Array:
    """Symmetric matrices ``4 Q Q^T`` of the quaternions of rotations; affine in the entries of R.

    Parameters
    ----------
    R : ndarray, shape (..., 3, 3)
        Rotations.

    Returns
    -------
    ndarray, shape (..., 4, 4)
        The products of the components of Q, times 4.
    """
    P = linear_products_of(R)
    for k in range(4):
        P[..., k, k] += 1.0
    return P


def linear_products_of(R: Array) -> Array:
    """The part of `products_of` that is linear: what becomes of it for rates of rotations.

    Parameters
    ----------
    R : ndarray, shape (..., 3, 3)
        Rotations or their rates.

    Returns
    -------
    ndarray, shape (..., 4, 4)
        Symmetric.
    """
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
    """Unit quaternions of rotations, ``Q1 >= 0``.

    The largest component is found first and the others from it, so that none loses digits.

    Parameters
    ----------
    R : ndarray, shape (..., 3, 3)
        Rotations.

    Returns
    -------
    ndarray, shape (..., 4)
        Scalar first. At half a turn, where Q1 is 0 or rounding, the first of the others that is
        not is positive: the sign does not hang on the last digits of the rotation.
    """
    P = products_of(R)
    largest = np.diagonal(P, axis1=-2, axis2=-1).argmax(axis=-1)
    Q = np.take_along_axis(P, largest[..., None, None], axis=-2)[..., 0, :]
    Q = Q / np.linalg.norm(Q, axis=-1, keepdims=True)
    leading = np.take_along_axis(Q, (abs(Q) > _ROUNDING).argmax(axis=-1)[..., None], axis=-1)
    Q = np.where(leading < 0.0, -Q, Q) + 0.0
    Q[..., 0] = np.maximum(Q[..., 0], 0.0)
    return Q


def quaternions_near(Q: Array, near: Array) -> Array:
    """Of each quaternion and its opposite, the one nearer to a given one.

    Parameters
    ----------
    Q, near : ndarray, shape (..., 4)
        Quaternions; they broadcast.

    Returns
    -------
    ndarray, shape (..., 4)
        The same rotations.
    """
    opposite = (Q * near).sum(axis=-1, keepdims=True) < 0.0
    return np.where(opposite, -Q, Q + np.zeros_like(near))


def continuous_quaternions(Q: Array, near: Array | None) -> Array:
    """Quaternions of a sequence, each on the side of the one before it.

    Parameters
    ----------
    Q : ndarray, shape (N, 4)
        Quaternions in their order.
    near : ndarray, shape (4,), or None
        What the first is near to.

    Returns
    -------
    ndarray, shape (N, 4)
        The same rotations.
    """
    before = np.concatenate([Q[:1] if near is None else near[None], Q[:-1]])
    signs = np.where((Q * before[: len(Q)]).sum(axis=-1) < 0.0, -1.0, 1.0)
    return Q * np.cumprod(signs)[:, None] + 0.0


def rotation_of_quaternions(Q: Array) -> Array:
    """Rotations of unit quaternions.

    Parameters
    ----------
    Q : ndarray, shape (..., 4)
        Unit length, scalar first.

    Returns
    -------
    ndarray, shape (..., 3, 3)
        Rotations.
    """
    w, x, y, z = (Q[..., k] for k in range(4))
    R = np.empty((*Q.shape[:-1], 3, 3))
    R[..., 0, 0] = 1.0 - 2.0 * (y * y + z * z)
    R[..., 1, 1] = 1.0 - 2.0 * (x * x + z * z)
    R[..., 2, 2] = 1.0 - 2.0 * (x * x + y * y)
    R[..., 0, 1], R[..., 1, 0] = 2.0 * (x * y - w * z), 2.0 * (x * y + w * z)
    R[..., 0, 2], R[..., 2, 0] = 2.0 * (x * z + w * y), 2.0 * (x * z - w * y)
    R[..., 1, 2], R[..., 2, 1] = 2.0 * (y * z - w * x), 2.0 * (y * z + w * x)
    return R


def vectors_of(R: Array) -> Array:
    """Rotation vectors, unit axis times angle, of rotations; exact also near 0 and half a turn.

    Parameters
    ----------
    R : ndarray, shape (..., 3, 3)
        Rotations.

    Returns
    -------
    ndarray, shape (..., 3)
        Rad, length in [0, pi]. At half a turn the first component that is not 0 is positive.
    """
    axis, angle = axes_and_angles(quaternions_of(R))
    return axis * angle[..., None]


def axes_and_angles(Q: Array) -> tuple[Array, Array]:
    """Unit axes and angles of unit quaternions with ``Q1 >= 0``.

    Parameters
    ----------
    Q : ndarray, shape (..., 4)
        Quaternions.

    Returns
    -------
    axis : ndarray, shape (..., 3)
        Unit vectors; zero where nothing turns.
    angle : ndarray, shape (...)
        Rad, in [0, pi].
    """
    length = np.hypot(np.hypot(Q[..., 1], Q[..., 2]), Q[..., 3])
    angle = 2.0 * np.arctan2(length, Q[..., 0])
    return Q[..., 1:] / np.where(length > 0.0, length, 1.0)[..., None], angle


def vectors_near(R: Array, near: Array) -> Array:
    """The rotation vectors of the same rotations that are nearest to given ones.

    Parameters
    ----------
    R : ndarray, shape (..., 3, 3)
        Rotations.
    near : ndarray, shape (..., 3)
        Rad; broadcasts with the rotations.

    Returns
    -------
    ndarray, shape (..., 3)
        Rad: the axis times the angle plus whole turns. Where nothing turns, whole turns about the
        axis of ``near``.
    """
    axis, angle = axes_and_angles(quaternions_of(R))
    length = np.linalg.norm(near, axis=-1)
    direction = near / np.where(length > 0.0, length, 1.0)[..., None]
    still = (angle == 0.0)[..., None]
    axis = np.where(still, direction, axis)
    angle = angle + whole_turns((near * axis).sum(axis=-1) - angle)
    return axis * angle[..., None]


def continuous_vectors(R: Array, near: Array | None) -> Array:
    """Rotation vectors of a sequence, each nearest to the one before it.

    Parameters
    ----------
    R : ndarray, shape (N, 3, 3)
        Rotations in their order.
    near : ndarray, shape (3,), or None
        What the first is near to.

    Returns
    -------
    ndarray, shape (N, 3)
        Rad.
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
    """Unit quaternions of rotation vectors of any length.

    Parameters
    ----------
    vectors : ndarray, shape (..., 3)
        Rad.

    Returns
    -------
    ndarray, shape (..., 4)
        Scalar first; ``Q1 = cos(angle / 2)`` is negative beyond half a turn.
    """
    angle = np.linalg.norm(vectors, axis=-1, keepdims=True)
    # np.sinc(t) is sin(pi t) / (pi t)
    return np.concatenate(
        [np.cos(0.5 * angle), 0.5 * np.sinc(angle / (2.0 * pi)) * vectors], axis=-1
    )
