"""Rates of operational coordinates: between the twist of a frame and dX/dt, both ways.

Seed book section 1.3.1.1; W. Khalil, E. Dombre, *Modeling, Identification and Control of Robots*,
chapter 5. Rates are written in terms of the coordinates themselves, so that they belong to the
solution that was chosen for these. For a rotation vector v with ``R = exp([v])``:
``w = (1 + a [v] + b [v]^2) dv/dt`` and ``dv/dt = (1 - [v] / 2 + gamma [v]^2) w`` with functions of
``t = angle^2``, summed as series near 0.

Parameters
----------
T : array_like, shape (..., 4, 4)
    Poses.
kind : OrientationKind or str
    Form of the orientation.
near : array_like, shape (..., m), optional
    Reference coordinates: of the equivalent representations (the opposite quaternion, the other
    solution of three angles), which have other rates, the nearest is used.
model, q, v, frame
    See `robotmodels.kinematics`.

Raises
------
InvalidValueError, ShapeError, NotARotationError
    As `operational_coordinates`.
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
    AngleSequence,
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
_STEP = 1e-100


def coordinate_rates(T: Any, kind: str | OrientationKind, near: ArrayLike | None = None) -> Array:
    """Matrices E that take the twist of a frame to the rates of its coordinates, ``dX/dt = E V``.

    Returns
    -------
    ndarray, shape (..., m, 6)
        For twists ``[v; w]`` in world axes, v that of the point whose position ``Px Py Pz`` is
        (``reference="world_aligned"`` of `jacobian`), in m/s and rad/s. Where the representation
        is singular (`is_representation_singular`) the rates of the orientation do not exist, and
        their rows are NaN.

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

    Returns
    -------
    ndarray, shape (..., 6, m)
        To ``[v; w]`` in world axes. ``twist_from_rates @ coordinate_rates`` is the identity. Rates
        of quaternions, direction cosines or two axes that no rotation has give the twist with the
        nearest rates (least squares). At a singularity of three angles the matrix exists, for the
        angles that `operational_coordinates` gives, and loses rank.

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
    """Time derivatives of `coordinate_rates` along a motion with ``twist (..., 6)``, m/s and rad/s.

    Returns
    -------
    ndarray, shape (..., m, 6)
        ``dE/dt``, so that ``d2X/dt2 = E dV/dt + dE/dt V`` with the acceleration ``dV/dt`` of the
        same point in world axes. NaN rows as in `coordinate_rates`.

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

    Returns
    -------
    ndarray of bool, shape (...)
        Euler angles: theta = 0 or pi; roll-pitch-yaw: pitch +-90 degrees (gimbal lock), within
        1e-12 rad. A rotation vector only at whole turns other than none, which it reaches with
        ``near`` only. Quaternions, direction cosines and two axes never.

    Examples
    --------
    >>> bool(is_representation_singular(np.eye(4), "euler"))
    True
    >>> bool(is_representation_singular(np.eye(4), "rpy"))
    False
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
    """Jacobian of the operational coordinates, ``dX/dt = J(q) dq/dt``; the analytic Jacobian.

    Seed book eq. [1.5] and section 1.3.1.1.

    Parameters
    ----------
    kind : OrientationKind or str
        Form of the orientation.
    near : array_like, shape (..., m), optional
        Reference coordinates: of the equivalent representations the nearest is used.

    Returns
    -------
    ndarray, shape (..., m, n)
        Derivatives of the m coordinates (m and rad) with respect to the joints, in table order.
        NaN rows as in `coordinate_rates`, whatever the robot.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> arm = RobotModel.from_table(DHTable(antecedent=[0, 1], sigma=[0, 0], d=[0, 0.3]))
    >>> coordinate_jacobian(arm, [0.0, 0.5], "rpy")[[0, 1, 3]]
    array([[0. , 0. ],
           [0.3, 0. ],
           [1. , 1. ]])
    """
    check_model(model)
    kind = orientation_kind(kind)
    T, near = _broadcast(dgm(model, q, frame), near, kind)
    return coordinate_rates(T, kind, near) @ jacobian(model, q, frame)


def coordinate_jacobian_rate(
    model: RobotModel,
    q: ArrayLike,
    v: ArrayLike,
    kind: str | OrientationKind,
    frame: str | int | None = None,
    near: ArrayLike | None = None,
) -> Array:
    """Time derivative of `coordinate_jacobian` along a motion.

    Returns
    -------
    ndarray, shape (..., m, n)
        ``dJ/dt``, so that ``d2X/dt2 = J a + dJ/dt v``; NaN rows as in `coordinate_rates`.

    Examples
    --------
    >>> from robotmodels.geometry import DHTable
    >>> arm = RobotModel.from_table(DHTable(antecedent=[0, 1], sigma=[0, 0], d=[0, 0.3]))
    >>> coordinate_jacobian_rate(arm, [0.0, 0.5], [1.0, 0.0], "rpy")[0]
    array([-0.3,  0. ])
    """
    check_model(model)
    kind = orientation_kind(kind)
    q, v = as_vector(q, model.n, "q"), as_vector(v, model.n, "v")
    batch_shape((q, v), ("q", "v"))
    T, near = _broadcast(dgm(model, q, frame), near, kind)
    J = jacobian(model, q, frame)
    twist = (J @ v[..., None])[..., 0]
    E, dE = coordinate_rates(T, kind, near), coordinate_rates_rate(T, twist, kind, near)
    return E @ jacobian_rate(model, q, v, frame) + dE @ J


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


def _broadcast(
    T: Array, near: ArrayLike | None, kind: OrientationKind
) -> tuple[Array, Array | None]:
    """Poses with the leading axes of the coordinates to be near to, which are checked."""
    close = near_coordinates(near, kind, T.shape[:-2])
    if close is not None:
        batch = np.broadcast_shapes(T.shape[:-2], close.shape[:-1])
        T = np.broadcast_to(T, (*batch, 4, 4))
    return T, close


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
    if kind in ANGLE_SEQUENCES:
        return _reordered(kind, _angle_rates(ANGLE_SEQUENCES[kind], in_order(kind, y)))
    if kind is OrientationKind.QUATERNION:
        return _quaternion_rates(y)
    if kind is OrientationKind.ANGLE_AXIS:
        gamma = inverse_left_factor((y**2).sum(axis=-1))
        gamma = np.where(singular_coordinates(y, kind), np.nan, gamma)
        S = skew(y)
        return np.eye(3) - 0.5 * S + gamma[..., None, None] * (S @ S)
    return _column_rates(y)


def orientation_rates_rate(y: Array, w: Array, kind: OrientationKind) -> Array:
    """Time derivatives of `orientation_rates` along a motion, by a complex step: to rounding.

    Shapes: y (..., k), w (..., 3) -> (..., k, 3).
    """
    E = orientation_rates(y, kind)
    with np.errstate(invalid="ignore"):  # NaN where rates do not exist
        beside: Any = y + _STEP * 1j * (E @ w[..., None])[..., 0]  # complex, unlike all else
        ahead = orientation_rates(beside, kind)
    return np.where(np.isnan(E), np.nan, ahead.imag / _STEP)


def angular_velocity(y: Array, kind: OrientationKind) -> Array:
    """Matrices from the rates of an orientation to the angular velocity in world axes.

    Shapes: y (..., k) -> (..., 3, k).
    """
    if kind in ANGLE_SEQUENCES:
        return in_order(kind, _angle_axes(ANGLE_SEQUENCES[kind], in_order(kind, y)))
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


def _angle_axes(sequence: AngleSequence, angles: Array) -> Array:
    """Axes of the three rotations, as columns: z, e = z x p and g = s p + c z."""
    px, py = horizontal(sequence, angles[..., 0])
    s, c = inclination(sequence, angles[..., 1])
    B = np.zeros((*px.shape, 3, 3))
    B[..., 2, 0] = 1.0
    B[..., 0, 1], B[..., 1, 1] = -py, px
    B[..., 0, 2], B[..., 1, 2], B[..., 2, 2] = s * px, s * py, c
    return B


def _angle_rates(sequence: AngleSequence, angles: Array) -> Array:
    """The inverse: ``dpsi = p.w / s``, ``dtheta = e.w``, ``dphi = z.w - c p.w / s``."""
    px, py = horizontal(sequence, angles[..., 0])
    s, c = inclination(sequence, angles[..., 1])
    lost = np.abs(s) <= SINGULAR
    s = np.where(lost, np.nan, s)
    E = np.zeros((*px.shape, 3, 3), px.dtype)
    E[..., 0, 0], E[..., 0, 1], E[..., 0, 2] = -c * px / s, -c * py / s, 1.0
    E[..., 1, 0], E[..., 1, 1] = -py, px
    E[..., 2, 0], E[..., 2, 1] = px / s, py / s
    return np.where(lost[..., None, None], np.nan, E)


def _reordered(kind: OrientationKind, E: Array) -> Array:
    """Rows of the three angles in the order in which they are listed."""
    sequence = ANGLE_SEQUENCES[kind]
    return E[..., ::-1, :] if sequence.backwards else E


def _quaternion_rates(Q: Array) -> Array:
    """``dQ = (0, w) Q / 2``; linear in Q."""
    E = np.empty((*Q.shape[:-1], 4, 3), Q.dtype)
    half = 0.5 * Q
    E[..., 0, :] = -half[..., 1:]
    E[..., 1:, :] = -skew(half[..., 1:])
    for k in range(3):
        E[..., k + 1, k] = half[..., 0]
    return E


def _column_rates(columns: Array) -> Array:
    """``du = w x u`` for unit vectors one behind the other; linear in them."""
    vectors = columns.reshape(*columns.shape[:-1], columns.shape[-1] // 3, 3)
    return -skew(vectors).reshape(*columns.shape, 3)


def _gamma_coefficients(count: int) -> list[float]:
    """Coefficients ``|B_2k| / (2k)!`` of gamma, by the recurrence ``(2k + 1) c_k = sum c_j c_k-j``.

    It is Riccati's equation of the cotangent; every term is positive, so no digit is lost.
    """
    c = [1.0 / 12.0]
    for k in range(2, count + 1):
        c.append(sum(x * y for x, y in zip(c, reversed(c), strict=True)) / (2 * k + 1))
    return c


_GAMMA = _gamma_coefficients(20)
_SECOND = [(-1) ** k / factorial(2 * k + 3) for k in range(13)]


def left_factors(t: Array) -> tuple[Array, Array]:
    """Factors ``a = (1 - cos) / angle^2`` and ``b = (angle - sin) / angle^3``."""
    angle = np.sqrt(t)
    a = 0.5 * np.sinc(angle / (2.0 * np.pi)) ** 2
    small, safe = _split(t)
    b = np.where(small, _sum(_SECOND, t), (np.sqrt(safe) - np.sin(np.sqrt(safe))) / safe**1.5)
    return a, b


def inverse_left_factor(t: Array) -> Array:
    """Factor ``gamma = (1 - (angle / 2) cot(angle / 2)) / angle^2``."""
    small, safe = _split(t)
    half = 0.5 * np.sqrt(safe)
    with np.errstate(divide="ignore"):
        far = (1.0 - half / np.tan(half)) / safe
    return np.where(small, _sum(_GAMMA, t), far)


def _split(t: Array) -> tuple[NDArray[np.bool_], Array]:
    """Where the series serves, and values that are safe to divide by."""
    small = t.real < _SERIES_BELOW
    return small, np.where(small, _SERIES_BELOW, t)


def _sum(coefficients: list[float], t: Array) -> Array:
    """Power series at values that are small enough for it; elsewhere of no meaning."""
    x = np.minimum(t, _SERIES_BELOW)
    total = np.zeros_like(x)
    for coefficient in reversed(coefficients):
        total = total * x + coefficient
    return total
