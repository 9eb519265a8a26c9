"""Rotation about a fixed axis: from one orientation to another by the shortest turn.

Seed book section 4.3 and eq. [1.9]: the orientation of a straight-line motion turns about one
axis, fixed in space, from the first orientation to the last.
"""

from __future__ import annotations

import numpy as np

from .._arrays import Array
from ..se3 import skew


def rotation_vector(R: Array) -> Array:
    """Rotation vectors, axis times angle, of rotation matrices.

    Goes through the quaternion, whose largest component is found first, so that the result is
    as exact beside 0 and half a turn as elsewhere.

    Parameters
    ----------
    R : ndarray, shape (..., 3, 3)
        Rotations.

    Returns
    -------
    ndarray, shape (..., 3)
        Radians, length in [0, pi]. At exactly half a turn either axis is right; the first of its
        components that is not zero is then positive.

    Examples
    --------
    >>> rotation_vector(np.diag([1.0, -1.0, -1.0])).round(4)
    array([3.1416, 0.    , 0.    ])
    """
    x, y, z = R[..., 0, 0], R[..., 1, 1], R[..., 2, 2]
    # the symmetric 4x4 matrix 4 p p^T of the quaternion p = (w, x, y, z)
    P = np.empty((*R.shape[:-2], 4, 4))
    P[..., 0, 0] = 1.0 + x + y + z
    P[..., 1, 1] = 1.0 + x - y - z
    P[..., 2, 2] = 1.0 - x + y - z
    P[..., 3, 3] = 1.0 - x - y + z
    for k, (i, j) in enumerate(((2, 1), (0, 2), (1, 0)), start=1):
        P[..., 0, k] = P[..., k, 0] = R[..., i, j] - R[..., j, i]
    for k, (i, j) in enumerate(((0, 1), (0, 2), (1, 2))):
        a, b = ((1, 2), (1, 3), (2, 3))[k]
        P[..., a, b] = P[..., b, a] = R[..., i, j] + R[..., j, i]
    largest = P[..., range(4), range(4)].argmax(axis=-1)
    p = np.take_along_axis(P, largest[..., None, None], axis=-2)[..., 0, :]
    p = p / np.linalg.norm(p, axis=-1, keepdims=True)
    w, u = p[..., :1], p[..., 1:]
    u = np.where(w < 0.0, -u, u)
    half_turn = w[..., 0] == 0.0
    if half_turn.any():
        first = np.take_along_axis(u, (u != 0.0).argmax(axis=-1)[..., None], axis=-1)
        u = np.where(half_turn[..., None] & (first < 0.0), -u, u)
    length = np.linalg.norm(u, axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(length, np.abs(w))
    return u * np.where(length > 0.0, angle / np.where(length > 0.0, length, 1.0), 2.0)


def rotation_about(axis: Array, angle: Array) -> Array:
    """Rotations by an angle about a unit axis (Rodrigues' formula, seed eq. [1.9]).

    Parameters
    ----------
    axis : ndarray, shape (..., 3)
        Unit vectors.
    angle : ndarray, shape (...)
        Radians; broadcasts with the axes.

    Returns
    -------
    ndarray, shape (..., 3, 3)
        Rotations.

    Examples
    --------
    >>> rotation_about(np.array([0.0, 0.0, 1.0]), np.array(np.pi / 2)).round(12)
    array([[ 0., -1.,  0.],
           [ 1.,  0.,  0.],
           [ 0.,  0.,  1.]])
    """
    K = skew(axis)
    angle = np.asarray(angle, dtype=np.float64)[..., None, None]
    # 1 - cos by the half angle, which keeps its digits at small angles
    return np.eye(3) + np.sin(angle) * K + (2.0 * np.sin(0.5 * angle) ** 2) * (K @ K)


def axis_and_angle(vector: Array) -> tuple[Array, Array]:
    """Unit axis and angle of rotation vectors; the axis of no rotation is z.

    Parameters
    ----------
    vector : ndarray, shape (..., 3)
        Rotation vectors, rad.

    Returns
    -------
    axis : ndarray, shape (..., 3)
        Unit vectors.
    angle : ndarray, shape (...)
        Radians.

    Examples
    --------
    >>> axis_and_angle(np.zeros(3))
    (array([0., 0., 1.]), np.float64(0.0))
    """
    angle = np.linalg.norm(vector, axis=-1)
    turns = (angle > 0.0)[..., None]
    axis = np.where(turns, vector / np.where(turns, angle[..., None], 1.0), (0.0, 0.0, 1.0))
    return axis, angle
