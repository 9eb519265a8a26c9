"""Orientations as three angles: Euler z-x-z and z-y-z, roll-pitch-yaw z-y-x.

One column g of the rotation does not depend on the third angle: ``g = s p + c z`` with the
horizontal unit vector p, which the first angle turns, and (s, c) the sine and cosine of the angle
between z and g. The second rotation is about ``e = z x p``. All three sequences are this one
picture with other letters, which is why one set of formulas serves them.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array
from .kinds import OrientationKind

LOCKED = 8 * np.finfo(np.float64).eps
"""Sine s at which the first angle is free: the size of the rounding of a product of rotations."""


@dataclass(frozen=True, slots=True)
class AngleSequence:
    """Three successive rotations, the first about z."""

    fixed: int
    about_x: bool
    level: bool
    sine: int
    cosine: int
    sign: float
    backwards: bool = False


ANGLE_SEQUENCES = {
    OrientationKind.EULER: AngleSequence(2, True, False, 1, 0, -1.0),
    OrientationKind.EULER_ZYZ: AngleSequence(2, False, False, 0, 1, 1.0),
    OrientationKind.ROLL_PITCH_YAW: AngleSequence(0, False, True, 2, 1, -1.0),
    OrientationKind.ROLL_PITCH_YAW_URDF: AngleSequence(0, False, True, 2, 1, -1.0, True),
}


def horizontal(sequence: AngleSequence, phi: Array) -> tuple[Array, Array]:
    """Components x and y of the unit vector p; those of e = z x p are (-py, px)."""
    if sequence.about_x:
        return np.sin(phi), -np.cos(phi)
    return np.cos(phi), np.sin(phi)


def inclination(sequence: AngleSequence, theta: Array) -> tuple[Array, Array]:
    """Sine s and cosine c of the angle from z to g; ds/dtheta = c and dc/dtheta = -s."""
    if sequence.level:
        return np.cos(theta), -np.sin(theta)
    return np.sin(theta), np.cos(theta)


def angles_of(sequence: AngleSequence, R: Array) -> tuple[Array, NDArray[np.bool_]]:
    """The three angles of rotations, and where the first is free."""
    gx, gy, gz = (R[..., row, sequence.fixed] for row in range(3))
    s = np.hypot(gx, gy)
    locked = s <= LOCKED
    angles = np.empty((*R.shape[:-2], 3))
    phi = np.arctan2(gx, -gy) if sequence.about_x else np.arctan2(gy, gx)
    phi = np.where(locked, 0.0, phi)
    s = np.where(locked, 0.0, s)
    angles[..., 0] = _half_open(phi)
    angles[..., 1] = np.arctan2(-gz, s) if sequence.level else np.arctan2(s, gz)
    angles[..., 2] = third_angle(sequence, R, phi)
    return angles + 0.0, locked  # no negative zeros


def third_angle(sequence: AngleSequence, R: Array, phi: Array) -> Array:
    """Third angle that belongs to a first one, in (-pi, pi]."""
    px, py = horizontal(sequence, phi)
    sine, cosine = (px * R[..., 1, k] - py * R[..., 0, k] for k in (sequence.sine, sequence.cosine))
    return _half_open(np.arctan2(sequence.sign * sine, cosine))


def rotation_of_angles(sequence: AngleSequence, angles: Array) -> Array:
    """Rotations that three angles give."""
    px, py = horizontal(sequence, angles[..., 0])
    s, c = inclination(sequence, angles[..., 1])
    sine, cosine = sequence.sign * np.sin(angles[..., 2]), np.cos(angles[..., 2])
    g = np.stack([s * px, s * py, c], axis=-1)
    e = np.stack([-py, px, np.zeros_like(px)], axis=-1)
    # g, e and h = g x e are an orthonormal frame; the other two columns turn in the plane (e, h)
    h = np.stack([-c * px, -c * py, s], axis=-1)
    right_handed = 1.0 if sequence.cosine == (sequence.fixed + 1) % 3 else -1.0
    R = np.empty((*angles.shape[:-1], 3, 3))
    R[..., sequence.fixed] = g
    R[..., sequence.cosine] = cosine[..., None] * e - (right_handed * sine)[..., None] * h
    R[..., sequence.sine] = sine[..., None] * e + (right_handed * cosine)[..., None] * h
    return R


def angles_near(
    sequence: AngleSequence, R: Array, angles: Array, locked: NDArray[np.bool_], near: Array
) -> Array:
    """The angles of the same rotations that are nearest to given ones."""
    first = at_lock(sequence, R, angles, locked, near[..., 0])
    second = first + other_solution(sequence, first)
    first = first + whole_turns(near - first)
    second = second + whole_turns(near - second)
    worse = ((second - near) ** 2).sum(axis=-1) < ((first - near) ** 2).sum(axis=-1)
    return np.where((worse & ~locked)[..., None], second, first)


def at_lock(
    sequence: AngleSequence, R: Array, angles: Array, locked: NDArray[np.bool_], phi: Array
) -> Array:
    """Angles with a given first angle at gimbal lock."""
    if not locked.any():
        return angles
    chosen = np.stack(
        np.broadcast_arrays(phi, angles[..., 1], third_angle(sequence, R, phi)), axis=-1
    )
    return np.where(locked[..., None], chosen, angles)


def other_solution(sequence: AngleSequence, angles: Array) -> Array:
    """Difference of the two angle triples of the same rotation."""
    step = np.full(angles.shape, pi)
    step[..., 1] = (pi if sequence.level else 0.0) - 2.0 * angles[..., 1]
    return step


def whole_turns(angle: Array) -> Array:
    """The multiples of 2 pi nearest to angles."""
    return 2.0 * pi * np.rint(angle / (2.0 * pi))


def continuous_angles(sequence: AngleSequence, R: Array, near: Array | None) -> Array:
    """Angles of a sequence of rotations, each nearest to those before it.

    Shapes: R (N, 3, 3), near (3,) -> (N, 3).
    """
    angles, locked = angles_of(sequence, R)
    if not len(angles):
        return angles
    if locked.any():
        # the free first angle keeps the value it had, or where it had none the one it will have
        free = np.flatnonzero(~locked)
        last = np.maximum.accumulate(np.where(locked, -1, np.arange(len(angles))))
        start = near[0] if near is not None else (angles[free[0], 0] if len(free) else 0.0)
        phi = np.where(last < 0, start, angles[last, 0])
        angles = at_lock(sequence, R, angles, locked, phi)
    # the other solutions are as far apart as the solutions themselves, so whether to change at a
    # step does not depend on which of the two it was: the parity of the changes decides
    other = angles + other_solution(sequence, angles)
    before = np.concatenate([angles[:1] if near is None else near[None], angles[:-1]])
    changes = _turned_distance(other - before) < _turned_distance(angles - before)
    mirrored = np.cumsum(changes & ~locked) % 2 == 1
    angles = np.where(mirrored[:, None], other, angles)
    if near is not None:
        angles[0] += whole_turns(near - angles[0])
    return np.unwrap(angles, axis=0)


def _turned_distance(difference: Array) -> Array:
    """Squared distance of angles that are equal modulo whole turns."""
    return ((difference - whole_turns(difference)) ** 2).sum(axis=-1)


def _half_open(angle: Array) -> Array:
    """Angles of arctan2, which has -pi for a negative zero, in (-pi, pi]."""
    return np.where(angle <= -pi, pi, angle)
