"""Rates of operational coordinates: between the twist of a frame and dX/dt, both ways.

Book section 1.3.1.1; W. Khalil, E. Dombre, *Modeling, Identification and Control of Robots*,
chapter 5. Rates are written in terms of the coordinates themselves, so that they belong to the
solution that was chosen for these. For a rotation vector v with ``R = exp([v])``:
``w = (1 + a [v] + b [v]^2) dv/dt``, with functions of ``angle^2`` that are summed as series near 0.

Where the representation is singular (`is_representation_singular`) the rates of the orientation do
not exist, and their rows are NaN, whatever the robot.

Parameters
----------
T : array_like, shape (..., 4, 4)
    Poses.
kind : OrientationKind or str
    Form of the orientation.
near : array_like, shape (..., m), optional
    Reference coordinates: of the equivalent representations (the opposite quaternion, the other
    solution of three angles), which have other rates, the nearest is used.
twist : array_like, shape (..., 6)
    Twist ``[v; w]`` in world axes, m/s and rad/s, v that of the point at ``Px Py Pz``
    (``reference="world_aligned"`` of `jacobian`).

Returns
-------
ndarray
    Each function states its shape and unit; m is the number of coordinates.

Examples
--------
>>> from robotmodels.robots import load
>>> from robotmodels.se3 import rotation
>>> coordinate_rates(rotation("x", np.pi / 2), "euler")[3:, 3:].round(12) + 0.0
array([[ 0.,  0.,  1.],
       [ 1.,  0.,  0.],
       [ 0., -1.,  0.]])
>>> coordinate_rates(np.eye(4), "euler")[3, 3:], bool(is_representation_singular(np.eye(4), "rpy"))
(array([nan, nan, nan]), False)
>>> coordinate_rates_rate(np.eye(4), [0, 0, 0, 0, 0, 2], "quaternion")[3]
array([ 0. ,  0. ,  0. ,  0. ,  0. , -0.5])
>>> coordinate_jacobian(load("planar_2r"), [0.0, 0.5], "rpy")[3]
array([1., 1.])
"""

from __future__ import annotations

from math import factorial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._arrays import Array, as_vector, batch_shape
from ...model import RobotModel, check_model
from ...se3 import as_pose, skew
from ..jacobians import jacobian, jacobian_rate
from ..poses import dgm
from .conversion import coordinates_of_poses, near_coordinates
from .orientations import (
    ANGLE_SEQUENCES,
    OrientationKind,
    horizontal,
    in_order,
    inclination,
    orientation_kind,
)

SINGULAR = 1e-12
"""Sine of the angle to the singularity of a representation within which its rates do not exist.

Rates grow with its inverse, and so does the effect of rounding errors in the pose. Rotations are
held exact to 4e-15, so that at this distance a rate has two correct digits left.
"""
_SERIES_BELOW = 4.0
_SERIES = [(-1) ** k / factorial(2 * k + 3) for k in range(13)]
_STEP = 1e-100


def coordinate_rates(T: Any, kind: str | OrientationKind, near: ArrayLike | None = None) -> Array:
    """Matrices E (..., m, 6) that take a twist to the rates of coordinates, ``dX/dt = E V``."""
    kind, x = _checked(T, kind, near)
    return _beside_position(orientation_rates(x[..., 3:], kind))


def twist_from_rates(T: Any, kind: str | OrientationKind, near: ArrayLike | None = None) -> Array:
    """Matrices (..., 6, m) from rates of coordinates to the twist, a left inverse of E.

    Rates of quaternions, direction cosines or two axes that no rotation has give the twist with
    the nearest rates (least squares). At a singularity of three angles the matrix exists, for the
    angles that `operational_coordinates` gives, and loses rank.
    """
    kind, x = _checked(T, kind, near)
    return _beside_position(angular_velocity(x[..., 3:], kind))


def coordinate_rates_rate(
    T: Any, twist: ArrayLike, kind: str | OrientationKind, near: ArrayLike | None = None
) -> Array:
    """Time derivatives dE/dt (..., m, 6) of `coordinate_rates` along a motion with a twist.

    ``d2X/dt2 = E dV/dt + dE/dt V`` with the acceleration ``dV/dt`` of the same point in world axes.
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
    """Whether poses (...) are at a singularity of the representation, not of any robot.

    Euler angles: theta = 0 or pi; roll-pitch-yaw: pitch +-90 degrees (gimbal lock), within 1e-12
    rad. A rotation vector only at whole turns other than none, which it reaches with ``near``
    only. Quaternions, direction cosines and two axes never.
    """
    kind, x = _checked(T, kind, near)
    return singular_coordinates(x[..., 3:], kind)


def coordinate_jacobian(
    model: RobotModel,
    q: ArrayLike,
    kind: str | OrientationKind,
    frame: str | int | None = None,
    near: ArrayLike | None = None,
) -> Array:
    """Jacobian of the operational coordinates, the analytic Jacobian: ``dX/dt = J(q) dq/dt``.

    Shape (..., m, n), in m and rad per unit of the joints, in table order. Book eq. [1.5] and
    section 1.3.1.1.
    """
    check_model(model)
    return coordinate_rates(dgm(model, q, frame), kind, near) @ jacobian(model, q, frame)


def coordinate_jacobian_rate(
    model: RobotModel,
    q: ArrayLike,
    v: ArrayLike,
    kind: str | OrientationKind,
    frame: str | int | None = None,
    near: ArrayLike | None = None,
) -> Array:
    """Time derivative (..., m, n) of `coordinate_jacobian`: ``d2X/dt2 = J a + dJ/dt v``."""
    check_model(model)
    q, v = as_vector(q, model.n, "q"), as_vector(v, model.n, "v")
    batch_shape((q, v), ("q", "v"))
    T, J = dgm(model, q, frame), jacobian(model, q, frame)
    twist = (J @ v[..., None])[..., 0]
    E, dE = coordinate_rates(T, kind, near), coordinate_rates_rate(T, twist, kind, near)
    return E @ jacobian_rate(model, q, v, frame) + dE @ J


def _beside_position(block: Array, position: float = 1.0) -> Array:
    """The matrices of an orientation, and for the position the identity times a number."""
    rows, columns = block.shape[-2:]
    out = np.zeros((*block.shape[:-2], rows + 3, columns + 3))
    out[..., range(3), range(3)] = position
    out[..., 3:, 3:] = block
    out[..., 3:, :3] = np.where(np.isnan(block).any(axis=-1, keepdims=True), np.nan, 0.0)
    return out


def _checked(
    T: Any, kind: str | OrientationKind, near: ArrayLike | None
) -> tuple[OrientationKind, Array]:
    kind, T = orientation_kind(kind), as_pose(T)
    return kind, coordinates_of_poses(T, kind, near_coordinates(near, kind, T.shape[:-2]))


def singular_coordinates(y: Array, kind: OrientationKind) -> NDArray[np.bool_]:
    """Whether orientations are at a singularity of their representation. Shapes: y (..., k)."""
    if kind in ANGLE_SEQUENCES:
        s, _ = inclination(ANGLE_SEQUENCES[kind], y[..., 1])
        return np.asarray(np.abs(s) <= SINGULAR)
    if kind is OrientationKind.ANGLE_AXIS:
        angle = np.linalg.norm(y, axis=-1)
        return np.asarray((np.abs(np.sin(0.5 * angle)) <= SINGULAR) & (angle > 1.0))
    return np.zeros(y.shape[:-1], dtype=bool)


def orientation_rates(y: Array, kind: OrientationKind) -> Array:
    """Matrices from the angular velocity in world axes to the rates of an orientation.

    Shapes: y (..., k) -> (..., k, 3).
    """
    if kind is OrientationKind.QUATERNION:
        return _quaternion_rates(y)
    if y.shape[-1] > 3:
        return _column_rates(y)
    lost = singular_coordinates(y.real, kind)[..., None, None]
    E = np.linalg.inv(np.where(lost, np.eye(3), angular_velocity(y, kind)))
    return np.where(lost, np.nan, E)


def orientation_rates_rate(y: Array, w: Array, kind: OrientationKind) -> Array:
    """Time derivatives of `orientation_rates` along a motion, by a complex step: to rounding.

    Shapes: y (..., k), w (..., 3) -> (..., k, 3).
    """
    E = orientation_rates(y, kind)
    rates = np.nan_to_num(E @ w[..., None])[..., 0]
    beside: Any = y + _STEP * 1j * rates  # complex, unlike all else
    return np.where(np.isnan(E), np.nan, orientation_rates(beside, kind).imag / _STEP)


def angular_velocity(y: Array, kind: OrientationKind) -> Array:
    """Matrices from the rates of an orientation to the angular velocity in world axes.

    Shapes: y (..., k) -> (..., 3, k).
    """
    if kind in ANGLE_SEQUENCES:  # axes of the three rotations: z, e = z x p and g = s p + c z
        sequence, angles = ANGLE_SEQUENCES[kind], in_order(kind, y)
        px, py = horizontal(sequence, angles[..., 0])
        s, c = inclination(sequence, angles[..., 1])
        zero = np.zeros_like(px)
        columns = [[zero, zero, zero + 1.0], [-py, px, zero], [s * px, s * py, c]]
        axes = np.stack([np.stack(column, axis=-1) for column in columns], axis=-1)
        return in_order(kind, axes)
    if kind is OrientationKind.QUATERNION:
        return 4.0 * np.swapaxes(_quaternion_rates(y), -1, -2)
    if kind is OrientationKind.ANGLE_AXIS:
        first, second = left_factors((y**2).sum(axis=-1))
        S = skew(y)
        return np.eye(3) + first[..., None, None] * S + second[..., None, None] * (S @ S)
    B = np.swapaxes(_column_rates(y), -1, -2)
    if kind is OrientationKind.DIRECTION_COSINES:
        return 0.5 * B
    s = np.cross(y[..., :3], y[..., 3:])
    return B - 0.5 * s[..., :, None] * (s[..., None, :] @ B)


def _quaternion_rates(Q: Array) -> Array:
    """``dQ = (0, w) Q / 2``; linear in Q."""
    half = 0.5 * Q
    lower = half[..., :1, None] * np.eye(3) - skew(half[..., 1:])
    return np.concatenate([-half[..., None, 1:], lower], axis=-2)


def _column_rates(columns: Array) -> Array:
    """``du = w x u`` for unit vectors one behind the other; linear in them."""
    vectors = columns.reshape(*columns.shape[:-1], columns.shape[-1] // 3, 3)
    return -skew(vectors).reshape(*columns.shape, 3)


def left_factors(t: Array) -> tuple[Array, Array]:
    """Factors ``a = (1 - cos) / angle^2`` and ``b = (angle - sin) / angle^3`` of t = angle^2."""
    a = 0.5 * np.sinc(np.sqrt(t) / (2.0 * np.pi)) ** 2
    small = t.real < _SERIES_BELOW
    near, angle = np.where(small, t, 0.0), np.sqrt(np.where(small, _SERIES_BELOW, t))
    series = np.zeros_like(near)
    for coefficient in reversed(_SERIES):
        series = series * near + coefficient
    return a, np.where(small, series, (angle - np.sin(angle)) / angle**3)
