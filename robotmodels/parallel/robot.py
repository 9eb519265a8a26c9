"""Description of a parallel robot: a platform on legs, with what moves and what limits it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from .. import se3
from .._arrays import Array, Value, as_core, as_exact, as_floats, read_only
from ..errors import InvalidValueError, ShapeError

_OFF = 1e-6  # of a pose from the freedoms of the platform, rad, and of the size of the robot
_AXES = ("vx", "vy", "vz", "wx", "wy", "wz")


class Family(Enum):
    """Families of parallel robots: name, and components of the platform's twist.

    Examples
    --------
    >>> Family.DELTA.value
    ('Delta robot', (0, 1, 2))
    """

    GOUGH = "Gough-Stewart platform", (0, 1, 2, 3, 4, 5)
    PLANAR_3RPR = "planar 3-RPR robot", (0, 1, 5)
    PLANAR_3RRR = "planar 3-RRR robot", (0, 1, 5)
    FIVE_BAR = "five-bar robot", (0, 1)
    DELTA = "Delta robot", (0, 1, 2)


@dataclass(frozen=True, slots=True, eq=False)
class Masses(Value):
    """Masses of a parallel robot, see `ParallelRobot.with_masses`.

    Shapes: com (3,), inertia (3, 3) about it, first and second (m, 3) of each leg's parts.
    """

    mass: float
    com: Array
    inertia: Array
    first: Array
    second: Array


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ParallelRobot(Value):
    """A parallel robot with m legs and as many freedoms of its platform. Read-only.

    Legs of Gough platforms and 3-RPR robots have an actuated length; q is the lengths. The others
    have an actuated crank, angle q, and a rod of constant length:
    ``knee = base + crank (cos(q) outward + sin(q) downward)``. Made by `gough`, `planar_3rpr` and
    the other functions of the family.

    Parameters
    ----------
    family : Family
        Which kind of robot.
    base, platform : ndarray, shape (m, 3)
        Anchors of the legs, m: on the base in world coordinates, on the platform in its own frame.
    crank, rod : ndarray, shape (m,)
        Lengths of cranks and rods, m; zero for legs of variable length.
    outward, downward : ndarray, shape (m, 3)
        Directions of the cranks at q = 0 and q = pi/2.
    elbow : ndarray, shape (m,)
        Signs of the elbows in working mode 0; working mode k changes the signs where the bits of
        k are set, the lowest bit that of the first leg.
    lower, upper : ndarray, shape (m,)
        Limits of q, m or rad; infinite where there are none.
    home : ndarray, shape (4, 4)
        Reference pose of the platform.
    gravity : ndarray, shape (3,)
        Acceleration, m/s^2.
    masses : Masses or None
        See `with_masses`.

    Examples
    --------
    >>> from robotmodels.parallel import gough_symmetric
    >>> robot = gough_symmetric(1.0, lower=0.8, upper=1.6)
    >>> robot.m, robot.freedoms
    (6, ('vx', 'vy', 'vz', 'wx', 'wy', 'wz'))
    """

    family: Family
    base: Array
    platform: Array
    crank: Array
    rod: Array
    outward: Array
    downward: Array
    elbow: Array
    lower: Array
    upper: Array
    home: Array
    gravity: Array = (0.0, 0.0, -9.81)  # type: ignore[assignment]
    masses: Masses | None = None

    def __post_init__(self) -> None:
        for name in self.__slots__[1:-1]:
            object.__setattr__(self, name, read_only(getattr(self, name)))

    @property
    def m(self) -> int:
        """Number of legs."""
        return len(self.base)

    @property
    def columns(self) -> tuple[int, ...]:
        """Components of the twist [v; w] that the platform has, from 0."""
        return self.family.value[1]

    @property
    def freedoms(self) -> tuple[str, ...]:
        """Names of the components of the twist that the platform has."""
        return tuple(_AXES[k] for k in self.columns)

    @property
    def has_cranks(self) -> bool:
        """Whether angles are actuated, else lengths."""
        return bool((self.crank > 0.0).any())

    @property
    def length(self) -> float:
        """Characteristic length, m: root mean square distance of the platform's anchors."""
        size = float(np.sqrt((self.platform**2).sum(axis=1).mean()))
        return size if size > 0.0 else 1.0

    @property
    def size(self) -> float:
        """Largest distance between anchors of the base, or length of a leg's part, m."""
        spread = np.linalg.norm(self.base - self.base.mean(axis=0), axis=1).max()
        return float(max(2.0 * spread, self.length, self.crank.max(), self.rod.max()))

    def coordinates(self, T: ArrayLike) -> Array:
        """Coordinates of poses: position, and angle or rotation vector.

        Parameters
        ----------
        T : array_like, shape (..., 4, 4)
            Poses of the platform.

        Returns
        -------
        ndarray, shape (..., m)
            (x, y, phi) planar, (x, y) five-bar, (x, y, z) Delta; else position and rotation
            vector, m and rad.
        """
        T = self.checked(T)
        turn = rotation_vector(T) if 3 in self.columns else np.zeros_like(T[..., :3, 3])
        turn[..., 2] = turn[..., 2] if 3 in self.columns else np.arctan2(T[..., 1, 0], T[..., 0, 0])
        return np.concatenate((T[..., :3, 3], turn), axis=-1)[..., list(self.columns)]

    def pose(self, coordinates: ArrayLike) -> Array:
        """Poses of coordinates, the inverse of `coordinates`.

        Parameters
        ----------
        coordinates : array_like, shape (..., m)
            As from `coordinates`.

        Returns
        -------
        ndarray, shape (..., 4, 4)
            Poses of the platform; the other components are those of `home`.
        """
        X = as_core(coordinates, (len(self.columns),), "coordinates")
        full = np.zeros((*X.shape[:-1], 6))
        full[..., :3] = self.home[:3, 3]
        full[..., list(self.columns)] = X
        return pose_of(full)

    def checked(self, T: Any, name: str = "T") -> Array:
        """Poses that the platform can have.

        Parameters
        ----------
        T : array_like, shape (..., 4, 4)
            Poses.
        name : str
            Used in error messages.

        Returns
        -------
        ndarray, shape (..., 4, 4)
            Checked poses.

        Raises
        ------
        ShapeError, InvalidValueError, NotARotationError
            No poses; out of the plane, or rotated, where the platform cannot be.
        """
        T = se3.as_pose(T, name)
        if len(self.columns) == 6 or not T.size:
            return T
        off = 0.0
        if 2 not in self.columns:
            out = np.abs(T[..., 2, 3] - self.home[2, 3]).max() / self.size
            off = max(out, np.abs(T[..., 2, 2] - 1.0).max(), np.abs(T[..., :2, 2]).max())
        elif 5 not in self.columns:
            off = float(np.abs(T[..., :3, :3] - np.eye(3)).max())
        if off > _OFF:
            motion = "translates only" if 2 in self.columns else "stays in its plane z = 0"
            raise InvalidValueError(
                f"{name}: the platform of a {self.family.value[0]} {motion}, got a pose that is "
                f"{off:.2g} off; build poses with robot.pose(coordinates)."
            )
        return T

    def with_masses(
        self,
        platform: tuple[Any, Any, Any],
        legs: tuple[Any, Any] | None = None,
        gravity: ArrayLike | None = None,
    ) -> ParallelRobot:
        """The robot with masses of its platform and legs, for the dynamic models.

        A leg has two slender parts that do not turn about their own axes. Of variable length: the
        first part starts at the base, the second at the platform. With a crank: the first part is
        the crank, the second the rod, whose positions count from the knee. A Delta's rods are
        pairs: give the sum of both.

        Parameters
        ----------
        platform : tuple (mass, com, inertia)
            Mass, kg; centre of mass in the platform's frame, shape (3,), m; inertia about it in
            the same axes, shape (3, 3), kg m^2.
        legs : tuple of two, each (mass, position, inertia), optional
            Mass, kg; distance of the centre of mass from the part's own start along it, m;
            inertia about the centre of mass across the part (of a crank: about its axis), kg m^2;
            numbers or one for each leg. Default massless.
        gravity : array_like, shape (3,), optional
            Acceleration of gravity in the world, m/s^2; default unchanged.

        Returns
        -------
        ParallelRobot
            A new robot.

        Raises
        ------
        ShapeError, InvalidValueError
            Wrong shapes, negative masses, an inertia that is not symmetric and positive.
        """
        parts = cast("Any", platform)
        if not isinstance(parts, tuple | list) or len(parts) != 3:
            raise ShapeError("platform: expected (mass, com, inertia).")
        mass, com = float(as_exact(parts[0], (), "mass")), as_exact(parts[1], (3,), "com")
        inertia = as_exact(parts[2], (3, 3), "inertia")
        size = np.abs(inertia).max(initial=0.0)
        if np.abs(inertia - inertia.T).max() > 1e-9 * size or (
            np.linalg.eigvalsh(inertia).min() < -1e-12 * size
        ):
            raise InvalidValueError(
                "inertia: expected a symmetric matrix about the centre of mass with positive "
                f"principal moments, got {inertia.tolist()}."
            )
        both = [((0.0, 0.0, 0.0)), ((0.0, 0.0, 0.0))] if legs is None else list(legs)
        if len(both) != 2 or any(len(part) != 3 for part in both):
            raise ShapeError("legs: expected two parts, each (mass, position, inertia).")
        rows = []
        for name, part in zip(("first", "second"), both, strict=True):
            values = [as_floats(value, f"legs, {name} part") for value in part]
            if any(value.shape not in ((), (self.m,)) for value in values):
                raise ShapeError(f"legs: expected numbers or shape ({self.m},) in the {name} part.")
            rows.append(np.stack([np.broadcast_to(v, (self.m,)) for v in values], axis=1))
        if mass < 0.0 or any((part[:, [0, 2]] < 0.0).any() for part in rows):
            raise InvalidValueError("platform, legs: masses and inertias must not be negative.")
        g = self.gravity if gravity is None else as_exact(gravity, (3,), "gravity")
        return replace(self, masses=Masses(mass, com, inertia, *rows), gravity=g)

    def __repr__(self) -> str:
        name = self.family.value[0]
        q = "angle" if self.has_cranks else "length"
        limited = np.isfinite(self.lower).any() or np.isfinite(self.upper).any()
        words = "with" if self.masses is not None else "without"
        limits = f"{q} {self.lower.min():.4g} to {self.upper.max():.4g}" if limited else "no limits"
        return f"<{name}: {self.m} legs of actuated {q}, {limits}, {words} masses>"


def pose_of(twist: Array) -> Array:
    """Poses of position and rotation vector. Shapes: (..., 6) -> (..., 4, 4)."""
    T = np.zeros((*twist.shape[:-1], 4, 4))
    w = twist[..., 3:]
    angle = np.linalg.norm(w, axis=-1)[..., None, None]
    S = np.zeros((*w.shape, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        S[..., k, j], S[..., j, k] = w[..., i], -w[..., i]
    half = np.sinc(angle / (2.0 * np.pi))
    T[..., :3, :3] = np.eye(3) + np.sinc(angle / np.pi) * S + 0.5 * half**2 * (S @ S)
    T[..., :3, 3] = twist[..., :3]
    T[..., 3, 3] = 1.0
    return T


def rotation_vector(T: Array) -> Array:
    """Rotation vectors of poses. Shapes: (..., 4, 4) -> (..., 3)."""
    from scipy.spatial.transform import Rotation

    R = np.ascontiguousarray(T[..., :3, :3]).reshape(-1, 3, 3)
    vectors = Rotation.from_matrix(R).as_rotvec() if len(R) else np.empty((0, 3))
    return vectors.reshape(*T.shape[:-2], 3)
