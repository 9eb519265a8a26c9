"""Rates of operational coordinates: between the twist of a frame and dX/dt, both ways.

Seed book section 1.3.1.1.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._arrays import Array, as_vector, batch_shape
from ...se3 import as_pose
from ._orientation_rates import (
    angular_velocity,
    orientation_rates,
    orientation_rates_rate,
    singular_coordinates,
)
from .conversion import coordinates_of_poses, near_coordinates
from .kinds import OrientationKind, orientation_kind


def coordinate_rates(T: Any, kind: str | OrientationKind, near: ArrayLike | None = None) -> Array:
    """Matrices E that take the twist of a frame to the rates of its coordinates, ``dX/dt = E V``.

    Parameters
    ----------
    T : array_like, shape (..., 4, 4)
        Poses.
    kind : OrientationKind or str
        How the orientation is written.
    near : array_like, shape (..., m), optional
        The coordinates whose solution is meant, as in `operational_coordinates`: the rates of the
        opposite quaternion, or of the other solution of three angles, are other ones.

    Returns
    -------
    ndarray, shape (..., m, 6)
        For twists ``[v; w]`` in world axes, v that of the point whose position ``Px Py Pz`` is
        (``reference="world_aligned"`` of `jacobian`), in m/s and rad/s. Where the representation
        is singular (`is_representation_singular`) the rates of the orientation do not exist, and
        their rows are NaN.

    Raises
    ------
    InvalidValueError, ShapeError, NotARotationError
        As `operational_coordinates`.

    References
    ----------
    Seed book section 1.3.1.1. W. Khalil, E. Dombre, *Modeling, Identification and Control of
    Robots*, chapter 5 (kinematic model with other coordinates of the task).

    Examples
    --------
    >>> from robotmodels.se3 import rotation
    >>> coordinate_rates(rotation("x", np.pi / 2), "euler")[3:, 3:].round(12) + 0.0
    array([[ 0.,  0.,  1.],
           [ 1.,  0.,  0.],
           [ 0., -1.,  0.]])
    >>> coordinate_rates(np.eye(4), "euler")[3, 3:]
    array([nan, nan, nan])
    """
    kind, x = _checked(T, kind, near)
    return _beside_position(orientation_rates(x[..., 3:], kind))


def twist_from_rates(T: Any, kind: str | OrientationKind, near: ArrayLike | None = None) -> Array:
    """Matrices that take the rates of coordinates to the twist; a left inverse of the others.

    Parameters
    ----------
    T : array_like, shape (..., 4, 4)
        Poses.
    kind : OrientationKind or str
        How the orientation is written.
    near : array_like, shape (..., m), optional
        As in `coordinate_rates`.

    Returns
    -------
    ndarray, shape (..., 6, m)
        To ``[v; w]`` in world axes. ``twist_from_rates @ coordinate_rates`` is the identity. Rates
        of quaternions, direction cosines or two axes that no rotation has are answered by the
        twist whose rates are nearest to them (least squares). At a singularity of three angles the
        matrix exists, for the angles that `operational_coordinates` gives, and loses rank.

    Raises
    ------
    InvalidValueError, ShapeError, NotARotationError
        As `operational_coordinates`.

    References
    ----------
    Seed book section 1.3.1.1. W. Khalil, E. Dombre, chapter 5.

    Examples
    --------
    >>> twist_from_rates(np.eye(4), "quaternion")[3:, 3:]
    array([[0., 2., 0., 0.],
           [0., 0., 2., 0.],
           [0., 0., 0., 2.]])
    """
    kind, x = _checked(T, kind, near)
    return _beside_position(angular_velocity(x[..., 3:], kind))


def coordinate_rates_rate(
    T: Any, twist: ArrayLike, kind: str | OrientationKind, near: ArrayLike | None = None
) -> Array:
    """Time derivatives of `coordinate_rates` along a motion.

    Parameters
    ----------
    T : array_like, shape (..., 4, 4)
        Poses.
    twist : array_like, shape (..., 6)
        ``[v; w]`` in world axes, m/s and rad/s; the leading axes broadcast.
    kind : OrientationKind or str
        How the orientation is written.
    near : array_like, shape (..., m), optional
        As in `coordinate_rates`.

    Returns
    -------
    ndarray, shape (..., m, 6)
        ``dE/dt``, so that ``d2X/dt2 = E dV/dt + dE/dt V`` with the acceleration ``dV/dt`` of the
        same point in world axes. NaN rows as in `coordinate_rates`.

    Raises
    ------
    InvalidValueError, ShapeError, NotARotationError
        As `operational_coordinates`; a twist that has not six components.

    References
    ----------
    Seed book section 1.3.1.1 (differentiated).

    Examples
    --------
    >>> coordinate_rates_rate(np.eye(4), [0, 0, 0, 0, 0, 2], "quaternion")[3]
    array([ 0. ,  0. ,  0. ,  0. ,  0. , -0.5])
    """
    kind, x = _checked(T, kind, near)
    twist = as_vector(twist, 6, "twist")
    batch = batch_shape((x, twist), ("coordinates", "twist"))
    y = np.broadcast_to(x[..., 3:], (*batch, kind.dimension - 3))
    w = np.broadcast_to(twist[..., 3:], (*batch, 3))
    return _beside_position(orientation_rates_rate(y, w, kind), position=0.0)


def is_representation_singular(
    T: Any, kind: str | OrientationKind, near: ArrayLike | None = None
) -> NDArray[np.bool_]:
    """Whether poses are at a singularity of the representation, not of any robot.

    Parameters
    ----------
    T : array_like, shape (..., 4, 4)
        Poses.
    kind : OrientationKind or str
        How the orientation is written.
    near : array_like, shape (..., m), optional
        As in `coordinate_rates`.

    Returns
    -------
    ndarray of bool, shape (...)
        Euler angles: theta = 0 or pi; roll-pitch-yaw: pitch +-90 degrees (gimbal lock), within
        1e-12 rad. A rotation vector only at whole turns other than none, which it reaches with
        ``near`` only. Quaternions, direction cosines and two axes never.

    Raises
    ------
    InvalidValueError, ShapeError, NotARotationError
        As `operational_coordinates`.

    References
    ----------
    W. Khalil, E. Dombre, *Modeling, Identification and Control of Robots*, chapter 3.

    Examples
    --------
    >>> bool(is_representation_singular(np.eye(4), "euler"))
    True
    >>> bool(is_representation_singular(np.eye(4), "rpy"))
    False
    """
    kind, x = _checked(T, kind, near)
    return singular_coordinates(x[..., 3:], kind)


def _beside_position(block: Array, position: float = 1.0) -> Array:
    """The matrices of an orientation, and for the position the identity times a number."""
    rows, columns = block.shape[-2:]
    out = np.zeros((*block.shape[:-2], rows + 3, columns + 3))
    for k in range(3):
        out[..., k, k] = position
    out[..., 3:, 3:] = block
    if np.isnan(block).any():
        # rates that do not exist are whole rows that are not a number
        lost = np.isnan(block).any(axis=-1, keepdims=True)
        out[..., 3:, :3] = np.where(lost, np.nan, 0.0)
    return out


def _checked(
    T: Any, kind: str | OrientationKind, near: ArrayLike | None
) -> tuple[OrientationKind, Array]:
    kind = orientation_kind(kind)
    T = as_pose(T)
    return kind, coordinates_of_poses(T, kind, near_coordinates(near, kind, T.shape[:-2]))
