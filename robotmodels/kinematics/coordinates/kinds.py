"""The ways to write an orientation as numbers, seed book eq. [1.8], [1.9] and what follows them."""

from __future__ import annotations

from enum import StrEnum

from ...errors import InvalidValueError


class OrientationKind(StrEnum):
    """How the orientation is written in a vector of operational coordinates.

    Functions take the member or its word; capitals, ``-``, ``_`` and spaces make no difference.
    The position ``Px Py Pz`` always comes first. Angles are in radians.

    **Roll, pitch and yaw have two orders in use.** `ROLL_PITCH_YAW` is Khalil and Dombre's (and
    Paul's): **roll turns about z, yaw about x**, listed in the order of the factors. URDF, ROS,
    Pinocchio and `robotmodels.se3.from_rpy` say it the other way round, roll about x and yaw about
    z: that is `ROLL_PITCH_YAW_URDF`. The three angles are the same three numbers, listed backwards.

    Attributes
    ----------
    EULER
        ``"euler"`` (or ``"euler_zxz"``): precession phi, nutation theta, spin psi,
        ``R = Rot(z, phi) Rot(x, theta) Rot(z, psi)``, theta in [0, pi].
    EULER_ZYZ
        ``"euler_zyz"``: the same with ``R = Rot(z, phi) Rot(y, theta) Rot(z, psi)``.
    ROLL_PITCH_YAW
        ``"roll_pitch_yaw"`` (or ``"rpy"``): roll phi about z, pitch theta about y, yaw psi about x,
        ``R = Rot(z, phi) Rot(y, theta) Rot(x, psi)``, theta in [-pi/2, pi/2].
    ROLL_PITCH_YAW_URDF
        ``"roll_pitch_yaw_urdf"`` (or ``"rpy_urdf"``): roll about x, pitch about y, yaw about z,
        ``R = Rot(z, yaw) Rot(y, pitch) Rot(x, roll)``.
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

    References
    ----------
    Seed book section 1.2.2. W. Khalil, E. Dombre, *Modeling, Identification and Control of
    Robots*, chapter 3 (Euler angles, roll-pitch-yaw angles, quaternions).

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
