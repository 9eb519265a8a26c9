"""Rates of operational coordinates: between the twist of a frame and dX/dt, both ways.

Seed book section 1.3.1.1. The matrices are written in terms of the coordinates themselves, so
that they belong to the solution that was chosen for these.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_vector, batch_shape
from ..se3 import as_pose, skew
from .coordinate_angles import ANGLE_SEQUENCES, AngleSequence, horizontal, inclination
from .coordinate_kinds import OrientationKind, orientation_kind
from .coordinate_vectors import (
    inverse_left_factor,
    inverse_left_factor_slope,
    left_factors,
)
from .coordinates import coordinates_of_poses, in_order, near_coordinates

SINGULAR = 1e-12
"""Sine of the angle to the singularity of a representation within which its rates do not exist.

Rates grow with its inverse, and so does what becomes of the rounding of the pose. Rotations are
held exact to 4e-15, so that at this distance a rate has two correct digits left, and nearer none
can be promised.
"""


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
    y = x[..., 3:]
    if kind in ANGLE_SEQUENCES:
        B = in_order(kind, _angle_axes(ANGLE_SEQUENCES[kind], in_order(kind, y)))
    elif kind is OrientationKind.QUATERNION:
        B = 4.0 * np.swapaxes(_quaternion_rates(y), -1, -2)
    elif kind is OrientationKind.ANGLE_AXIS:
        first, second = left_factors((y**2).sum(axis=-1))
        S = skew(y)
        B = np.eye(3) + first[..., None, None] * S + second[..., None, None] * (S @ S)
    elif kind is OrientationKind.DIRECTION_COSINES:
        B = 0.5 * np.swapaxes(_column_rates(y), -1, -2)
    else:
        B = np.swapaxes(_column_rates(y), -1, -2)
        s = np.cross(y[..., :3], y[..., 3:])
        B = B - 0.5 * s[..., :, None] * (s[..., None, :] @ B)
    return _beside_position(B)


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
    if kind in ANGLE_SEQUENCES:
        dE = _reordered(kind, _angle_rates_rate(ANGLE_SEQUENCES[kind], in_order(kind, y), w))
    else:
        E = orientation_rates(y, kind)
        dy = (E @ w[..., None])[..., 0]
        if kind is OrientationKind.QUATERNION:
            dE = _quaternion_rates(dy)
        elif kind is OrientationKind.ANGLE_AXIS:
            dE = _vector_rates_rate(y, dy)
        else:
            dE = _column_rates(dy)
    return _beside_position(dE, position=0.0)


def is_representation_singular(
    T: Any, kind: str | OrientationKind, near: ArrayLike | None = None
) -> Array:
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
        `SINGULAR`. A rotation vector only at whole turns other than none, which it reaches with
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
    return np.asarray(singular_coordinates(x[..., 3:], kind))


def singular_coordinates(y: Array, kind: OrientationKind) -> Array:
    """Whether orientations are at a singularity of their representation.

    Parameters
    ----------
    y : ndarray, shape (..., k)
        Orientation part of the coordinates.
    kind : OrientationKind
        How the orientation is written.

    Returns
    -------
    ndarray of bool, shape (...)
        As `is_representation_singular`.
    """
    if kind in ANGLE_SEQUENCES:
        s, _ = inclination(ANGLE_SEQUENCES[kind], y[..., 1])
        return np.abs(s) <= SINGULAR
    if kind is OrientationKind.ANGLE_AXIS:
        angle = np.linalg.norm(y, axis=-1)
        return (np.abs(np.sin(0.5 * angle)) <= SINGULAR) & (angle > 1.0)
    return np.zeros(y.shape[:-1], dtype=bool)


def orientation_rates(y: Array, kind: OrientationKind) -> Array:
    """Matrices from the angular velocity in world axes to the rates of an orientation.

    Parameters
    ----------
    y : ndarray, shape (..., k)
        Orientation part of the coordinates.
    kind : OrientationKind
        How the orientation is written.

    Returns
    -------
    ndarray, shape (..., k, 3)
        NaN where the representation is singular.
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
    E = np.zeros((*px.shape, 3, 3))
    E[..., 0, 0], E[..., 0, 1], E[..., 0, 2] = -c * px / s, -c * py / s, 1.0
    E[..., 1, 0], E[..., 1, 1] = -py, px
    E[..., 2, 0], E[..., 2, 1] = px / s, py / s
    return np.where(lost[..., None, None], np.nan, E)


def _angle_rates_rate(sequence: AngleSequence, angles: Array, w: Array) -> Array:
    """With ``dp = dphi e``, ``de = -dphi p``, ``ds = c dtheta`` and ``dc = -s dtheta``."""
    px, py = horizontal(sequence, angles[..., 0])
    s, c = inclination(sequence, angles[..., 1])
    lost = np.abs(s) <= SINGULAR
    s = np.where(lost, np.nan, s)
    along_p = px * w[..., 0] + py * w[..., 1]
    dtheta = px * w[..., 1] - py * w[..., 0]
    dphi = w[..., 2] - c * along_p / s
    dpx, dpy = -dphi * py, dphi * px
    dc_s, d1_s = -dtheta / s**2, -c * dtheta / s**2  # of c / s and of 1 / s
    dE = np.zeros((*px.shape, 3, 3))
    dE[..., 0, 0] = -(dc_s * px + c / s * dpx)
    dE[..., 0, 1] = -(dc_s * py + c / s * dpy)
    dE[..., 1, 0], dE[..., 1, 1] = -dpy, dpx
    dE[..., 2, 0] = d1_s * px + dpx / s
    dE[..., 2, 1] = d1_s * py + dpy / s
    return np.where(lost[..., None, None], np.nan, dE)


def _reordered(kind: OrientationKind, E: Array) -> Array:
    """Rows of the three angles in the order in which they are listed."""
    sequence = ANGLE_SEQUENCES[kind]
    return E[..., ::-1, :] if sequence.backwards else E


def _quaternion_rates(Q: Array) -> Array:
    """``dQ = (0, w) Q / 2``; linear in Q."""
    E = np.empty((*Q.shape[:-1], 4, 3))
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


def _vector_rates_rate(vector: Array, rate: Array) -> Array:
    """Of ``1 - [v] / 2 + gamma(v.v) [v]^2``."""
    t = (vector**2).sum(axis=-1)
    gamma = inverse_left_factor(t)
    gamma_rate = 2.0 * inverse_left_factor_slope(t) * (vector * rate).sum(axis=-1)
    S, dS = skew(vector), skew(rate)
    return (
        -0.5 * dS
        + gamma_rate[..., None, None] * (S @ S)
        + gamma[..., None, None] * (dS @ S + S @ dS)
    )


def _beside_position(block: Array, position: float = 1.0) -> Array:
    """The matrices of an orientation, and for the position the identity times a number."""
    rows, columns = block.shape[-2:]
    out = np.zeros((*block.shape[:-2], rows + 3, columns + 3))
    for k in range(3):
        out[..., k, k] = position
    out[..., 3:, 3:] = block
    if np.isnan(block).any():
        # rates that do not exist are whole rows that are not a number
        lost = np.isnan(block).any(axis=-1)
        out[..., 3:, :3] = np.where(lost[..., None], np.nan, 0.0)
    return out


def _checked(
    T: Any, kind: str | OrientationKind, near: ArrayLike | None
) -> tuple[OrientationKind, Array]:
    kind = orientation_kind(kind)
    T = as_pose(T)
    return kind, coordinates_of_poses(T, kind, near_coordinates(near, kind, T.shape[:-2]))
