"""Elementary motions, their inverse, roll, pitch and yaw, and the matrix of the vector product.

Book section 1.1, eq. [1.1]: the columns of a pose are s, n, a (the axes) and P.

Parameters
----------
axis : {"x", "y", "z"}
    A coordinate axis.
angle, x, y, z : float
    Radians; metres.
T, R, p : ndarray, shapes (..., 4, 4), (3, 3), (..., 3)
    Poses, a rotation, vectors.
rpy, xyz : array_like, shape (3,)
    Roll, pitch and yaw in radians, as a URDF has them; metres.

Returns
-------
ndarray
    A pose of shape (4, 4), if no other shape is named.
"""

from __future__ import annotations

from math import atan2, cos, hypot, pi, sin

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array


def rotation(axis: str, angle: float) -> Array:
    """Pose of a rotation about one coordinate axis, ``Rot(axis, angle)``."""
    c, s = _cos_sin(angle)
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    T = np.eye(4)
    T[i, i] = T[j, j] = c
    T[i, j], T[j, i] = -s, s
    return T


def translation(x: float, y: float, z: float) -> Array:
    """Pose of a pure translation."""
    T = np.eye(4)
    T[:3, 3] = x, y, z
    return T


def inverse(T: Array) -> Array:
    """Inverse of rigid poses by transposition, shape (..., 4, 4)."""
    Ti = np.zeros(T.shape)
    Rt = np.swapaxes(T[..., :3, :3], -1, -2)
    Ti[..., :3, :3] = Rt
    Ti[..., :3, 3] = -np.einsum("...ij,...j->...i", Rt, T[..., :3, 3])
    Ti[..., 3, 3] = 1.0
    return Ti


def from_rpy(rpy: ArrayLike, xyz: ArrayLike = (0.0, 0.0, 0.0)) -> Array:
    """Pose of a URDF ``<origin>``: ``Trans(xyz) Rot(z, yaw) Rot(y, pitch) Rot(x, roll)``.

    Examples
    --------
    >>> from_rpy([0, 0, 0], [1, 2, 3])[:3, 3]
    array([1., 2., 3.])
    """
    roll, pitch, yaw = (float(v) for v in np.asarray(rpy))
    T = rotation("z", yaw) @ rotation("y", pitch) @ rotation("x", roll)
    T[:3, 3] = xyz
    return T


def to_rpy(R: Array) -> tuple[float, float, float]:
    """Roll, pitch in [-pi/2, pi/2] and yaw of a rotation, rad, exact also at gimbal lock.

    Roll is found by back-substitution of yaw, not from its own quotient: where pitch is +-90
    degrees yaw is arbitrary, and any value of it then still gives back the same matrix.

    Examples
    --------
    >>> [round(v, 12) for v in to_rpy(from_rpy([0.1, 0.2, 0.3])[:3, :3])]
    [0.1, 0.2, 0.3]
    """
    yaw = atan2(R[1, 0], R[0, 0])
    pitch = atan2(-R[2, 0], hypot(R[0, 0], R[1, 0]))
    c, s = cos(yaw), sin(yaw)
    roll = atan2(s * R[0, 2] - c * R[1, 2], c * R[1, 1] - s * R[0, 1])
    return roll + 0.0, pitch + 0.0, yaw + 0.0


def skew(p: Array) -> Array:
    """Matrices of the vector product, ``skew(p) @ u = p x u``, shape (..., 3, 3)."""
    S = np.zeros((*p.shape[:-1], 3, 3), np.result_type(p, float))
    S[..., 0, 1], S[..., 0, 2], S[..., 1, 2] = -p[..., 2], p[..., 1], -p[..., 0]
    S[..., 1, 0], S[..., 2, 0], S[..., 2, 1] = p[..., 2], -p[..., 1], p[..., 0]
    return S


def _cos_sin(angle: float) -> tuple[float, float]:
    """Cosine and sine, exact at the multiples of a right angle that tables are full of."""
    quarter = angle / (pi / 2)
    if quarter == round(quarter) and abs(quarter) <= 8:
        k = int(quarter) % 4
        return (1.0, 0.0, -1.0, 0.0)[k], (0.0, 1.0, 0.0, -1.0)[k]
    return cos(angle), sin(angle)
