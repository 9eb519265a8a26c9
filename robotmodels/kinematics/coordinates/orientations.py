"""Orientations as numbers: three angles, quaternions, rotation vectors, columns of the rotation.

Book eq. [1.8], [1.9]. Of three angles one column g of the rotation does not depend on the
third: ``g = s p + c z`` with the horizontal unit vector p, which the first angle turns, and (s, c)
the sine and cosine of the angle between z and g. The second rotation is about ``e = z x p``. All
sequences are this picture with other letters, so that one set of formulas serves them.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from math import pi

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array
from ...errors import InvalidValueError
from ...se3.orientation import axes_and_angles, quaternions_of

LOCKED = 8 * np.finfo(np.float64).eps
"""Sine s at which the first angle is free: the size of the rounding of a product of rotations."""


class OrientationKind(StrEnum):
    """Form of the orientation in a vector of operational coordinates.

    Functions take the member or its word; capitals, ``-``, ``_`` and spaces make no difference.
    The position ``Px Py Pz`` comes first. Angles are in radians.

    **Roll, pitch and yaw have two orders in use.** `ROLL_PITCH_YAW` is Khalil and Dombre's (and
    Paul's): **roll about z, yaw about x**, listed in the order of the factors. URDF, ROS, Pinocchio
    and `robotmodels.se3.from_rpy` take roll about x and yaw about z: `ROLL_PITCH_YAW_URDF`, the
    same three numbers listed backwards.

    W. Khalil, E. Dombre, *Modeling, Identification and Control of Robots*, chapter 3.

    Attributes
    ----------
    EULER
        ``"euler"``, ``"euler_zxz"``: precession phi, nutation theta, spin psi,
        ``R = Rot(z, phi) Rot(x, theta) Rot(z, psi)``, theta in [0, pi].
    EULER_ZYZ
        ``"euler_zyz"``: the same with ``R = Rot(z, phi) Rot(y, theta) Rot(z, psi)``.
    ROLL_PITCH_YAW
        ``"roll_pitch_yaw"``, ``"rpy"``: roll phi about z, pitch theta about y, yaw psi about x,
        ``R = Rot(z, phi) Rot(y, theta) Rot(x, psi)``, theta in [-pi/2, pi/2].
    ROLL_PITCH_YAW_URDF
        ``"roll_pitch_yaw_urdf"``, ``"rpy_urdf"``: roll about x, pitch about y, yaw about z.
    QUATERNION
        ``"quaternion"``: unit quaternion, scalar first, ``Q1 = cos(angle / 2)``, ``Q2 Q3 Q4`` the
        axis times ``sin(angle / 2)``; Q1 >= 0, and where Q1 = 0 the first of the others that is
        not zero is positive.
    DIRECTION_COSINES
        ``"direction_cosines"``: the columns s, n, a of the rotation, eq. [1.8].
    TWO_AXES
        ``"two_axes"``: n and a only, eq. [1.9]; s = n x a.
    ANGLE_AXIS
        ``"angle_axis"``: rotation vector, unit axis times angle, length in [0, pi].

    Examples
    --------
    >>> OrientationKind.QUATERNION.labels
    ('Px', 'Py', 'Pz', 'Q1', 'Q2', 'Q3', 'Q4')
    >>> OrientationKind.TWO_AXES.dimension
    9
    """

    EULER = "euler"
    EULER_ZYZ = "euler_zyz"
    ROLL_PITCH_YAW = "roll_pitch_yaw"
    ROLL_PITCH_YAW_URDF = "roll_pitch_yaw_urdf"
    QUATERNION = "quaternion"
    DIRECTION_COSINES = "direction_cosines"
    TWO_AXES = "two_axes"
    ANGLE_AXIS = "angle_axis"

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of the coordinates, in their order."""
        return ("Px", "Py", "Pz", *_ORIENTATION_LABELS[self.value])

    @property
    def dimension(self) -> int:
        """Number m of coordinates, the three of the position included."""
        return 3 + len(_ORIENTATION_LABELS[self.value])


_ORIENTATION_LABELS = {
    "euler": ("phi", "theta", "psi"),
    "euler_zyz": ("phi", "theta", "psi"),
    "roll_pitch_yaw": ("phi", "theta", "psi"),
    "roll_pitch_yaw_urdf": ("roll", "pitch", "yaw"),
    "quaternion": ("Q1", "Q2", "Q3", "Q4"),
    "direction_cosines": ("sx", "sy", "sz", "nx", "ny", "nz", "ax", "ay", "az"),
    "two_axes": ("nx", "ny", "nz", "ax", "ay", "az"),
    "angle_axis": ("ux", "uy", "uz"),
}

_SHORT_WORDS = {
    "euler_zxz": OrientationKind.EULER,
    "rpy": OrientationKind.ROLL_PITCH_YAW,
    "rpy_urdf": OrientationKind.ROLL_PITCH_YAW_URDF,
}


def orientation_kind(kind: str) -> OrientationKind:
    """Kind of orientation coordinates from its name."""
    if isinstance(kind, OrientationKind):
        return kind
    if isinstance(kind, str):
        word = "_".join(kind.lower().replace("-", " ").replace("_", " ").split())
        if word in _SHORT_WORDS:
            return _SHORT_WORDS[word]
        if word in _ORIENTATION_LABELS:
            return OrientationKind(word)
    words = ", ".join(repr(word) for word in (*_ORIENTATION_LABELS, *_SHORT_WORDS))
    raise InvalidValueError(f"kind: expected one of {words}, got {kind!r}.")


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


def in_order(kind: OrientationKind, orientation: Array) -> Array:
    """Three angles from the order in which they are listed to that of the rotations, or back.

    Shapes: orientation (..., k) -> (..., k).
    """
    sequence = ANGLE_SEQUENCES.get(kind)
    return orientation[..., ::-1] if sequence and sequence.backwards else orientation


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


def quaternions_near(Q: Array, near: Array) -> Array:
    """The nearer to a given quaternion of each quaternion and its opposite.

    Shapes: Q, near (..., 4) -> (..., 4).
    """
    opposite = (Q * near).sum(axis=-1, keepdims=True) < 0.0
    return np.where(opposite, -Q, Q + np.zeros_like(near))


def continuous_quaternions(Q: Array, near: Array | None) -> Array:
    """Quaternions of a sequence, each on the side of the one before it.

    Shapes: Q (N, 4), near (4,) -> (N, 4).
    """
    before = np.concatenate([Q[:1] if near is None else near[None], Q[:-1]])
    signs = np.where((Q * before[: len(Q)]).sum(axis=-1) < 0.0, -1.0, 1.0)
    return Q * np.cumprod(signs)[:, None] + 0.0


def rotation_of_quaternions(Q: Array) -> Array:
    """Rotations of unit quaternions. Shapes: Q (..., 4) -> (..., 3, 3)."""
    w, x, y, z = (Q[..., k] for k in range(4))
    R = np.empty((*Q.shape[:-1], 3, 3))
    R[..., 0, 0] = 1.0 - 2.0 * (y * y + z * z)
    R[..., 1, 1] = 1.0 - 2.0 * (x * x + z * z)
    R[..., 2, 2] = 1.0 - 2.0 * (x * x + y * y)
    R[..., 0, 1], R[..., 1, 0] = 2.0 * (x * y - w * z), 2.0 * (x * y + w * z)
    R[..., 0, 2], R[..., 2, 0] = 2.0 * (x * z + w * y), 2.0 * (x * z - w * y)
    R[..., 1, 2], R[..., 2, 1] = 2.0 * (y * z - w * x), 2.0 * (y * z + w * x)
    return R


def vectors_near(R: Array, near: Array) -> Array:
    """The rotation vectors of the same rotations that are nearest to given ones."""
    axis, angle = axes_and_angles(quaternions_of(R))
    length = np.linalg.norm(near, axis=-1)
    direction = near / np.where(length > 0.0, length, 1.0)[..., None]
    still = (angle == 0.0)[..., None]
    axis = np.where(still, direction, axis)
    angle = angle + whole_turns((near * axis).sum(axis=-1) - angle)
    return axis * angle[..., None]


def continuous_vectors(R: Array, near: Array | None) -> Array:
    """Rotation vectors of a sequence, each nearest to the one before it.

    Shapes: R (N, 3, 3), near (3,) -> (N, 3).
    """
    axis, angle = axes_and_angles(quaternions_of(R))
    before, turned = np.zeros(3), 0.0
    if near is not None and near.any():
        turned = float(np.linalg.norm(near))
        before = near / turned
    # where nothing turns the axis stays what it was
    last = np.maximum.accumulate(np.where(angle > 0.0, np.arange(len(angle)), -1))
    axis = np.where((last < 0)[:, None], before, axis[last])
    cosines = (axis * np.concatenate([before[None], axis[:-1]])[: len(axis)]).sum(axis=-1)
    angles = angle.tolist()
    for i, (a, cosine) in enumerate(zip(angles, cosines.tolist(), strict=True)):
        turned = angles[i] = a + 2.0 * pi * round((turned * cosine - a) / (2.0 * pi))
    return axis * np.array(angles).reshape(-1, 1)


def quaternions_of_vectors(vectors: Array) -> Array:
    """Unit quaternions of rotation vectors of any length. Shapes: vectors (..., 3) -> (..., 4)."""
    angle = np.linalg.norm(vectors, axis=-1, keepdims=True)
    # np.sinc(t) is sin(pi t) / (pi t)
    return np.concatenate(
        [np.cos(0.5 * angle), 0.5 * np.sinc(angle / (2.0 * pi)) * vectors], axis=-1
    )
