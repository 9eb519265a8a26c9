"""Roll, pitch and yaw, as a URDF has them."""

from __future__ import annotations

from math import atan2, cos, hypot, sin

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array
from .motions import rotation


def from_rpy(rpy: ArrayLike, xyz: ArrayLike = (0.0, 0.0, 0.0)) -> Array:
    """Pose of a URDF ``<origin>``: ``Trans(xyz) Rot(z, yaw) Rot(y, pitch) Rot(x, roll)``.

    Parameters
    ----------
    rpy : array_like, shape (3,)
        Roll, pitch, yaw in radians.
    xyz : array_like, shape (3,)
        Metres.

    Returns
    -------
    ndarray, shape (4, 4)
        The pose.

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
    """Roll, pitch and yaw of a rotation, exact also at gimbal lock.

    Roll is found by back-substitution of yaw, not from its own quotient: where pitch is +-90
    degrees yaw is arbitrary, and any value of it then still gives back the same matrix.

    Parameters
    ----------
    R : ndarray, shape (3, 3)
        Rotation.

    Returns
    -------
    roll, pitch, yaw : float
        Radians, pitch in [-pi/2, pi/2].

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
