"""Rotations as unit quaternions, scalar first, and as rotation vectors: axis times angle."""

from __future__ import annotations

import numpy as np

from .._arrays import Array

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

    Examples
    --------
    >>> np.diag(products_of(np.eye(3)))
    array([4., 0., 0., 0.])
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

    Examples
    --------
    >>> np.diag(linear_products_of(np.eye(3)))
    array([ 3., -1., -1., -1.])
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

    References
    ----------
    S. W. Shepperd, "Quaternion from rotation matrix", J. Guidance and Control 1(3), 1978.

    Examples
    --------
    >>> quaternions_of(np.diag([1.0, -1.0, -1.0]))
    array([0., 1., 0., 0.])
    """
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

    Examples
    --------
    >>> axes_and_angles(np.array([0.0, 0.0, 0.0, 1.0]))
    (array([0., 0., 1.]), np.float64(3.141592653589793))
    """
    length = np.hypot(np.hypot(Q[..., 1], Q[..., 2]), Q[..., 3])
    angle = 2.0 * np.arctan2(length, Q[..., 0])
    return Q[..., 1:] / np.where(length > 0.0, length, 1.0)[..., None], angle


def rotation_vectors_of(R: Array) -> Array:
    """Rotation vectors, unit axis times angle, of rotations; exact also near 0 and half a turn.

    Parameters
    ----------
    R : ndarray, shape (..., 3, 3)
        Rotations.

    Returns
    -------
    ndarray, shape (..., 3)
        Rad, length in [0, pi]. At half a turn the first component that is not 0 is positive.

    Examples
    --------
    >>> rotation_vectors_of(np.diag([1.0, -1.0, -1.0])).round(4)
    array([3.1416, 0.    , 0.    ])
    """
    axis, angle = axes_and_angles(quaternions_of(R))
    return axis * angle[..., None]
