"""Rates of orientations: between the angular velocity in world axes and dy/dt, kind by kind.

Written in terms of the coordinates themselves, so that they belong to the solution that was chosen
for these. They are blocks of the matrices of `coordinate_rates`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array
from ...se3 import skew
from ._angles import ANGLE_SEQUENCES, AngleSequence, horizontal, inclination
from ._vectors import (
    inverse_left_factor,
    inverse_left_factor_slope,
    left_factors,
)
from .conversion import in_order
from .kinds import OrientationKind

SINGULAR = 1e-12
"""Sine of the angle to the singularity of a representation within which its rates do not exist.

Rates grow with its inverse, and so does what becomes of the rounding of the pose. Rotations are
held exact to 4e-15, so that at this distance a rate has two correct digits left, and nearer none
can be promised.
"""


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
    """Time derivatives of `orientation_rates` along a motion.

    Shapes: y (..., k), w (..., 3) -> (..., k, 3).
    """
    if kind in ANGLE_SEQUENCES:
        return _reordered(kind, _angle_rates_rate(ANGLE_SEQUENCES[kind], in_order(kind, y), w))
    dy = (orientation_rates(y, kind) @ w[..., None])[..., 0]
    if kind is OrientationKind.QUATERNION:
        return _quaternion_rates(dy)
    if kind is OrientationKind.ANGLE_AXIS:
        return _vector_rates_rate(y, dy)
    return _column_rates(dy)


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
