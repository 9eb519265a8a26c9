"""Description of a parallel robot: a platform on legs; base of the results of its models."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import se3
from .._arrays import (
    Array,
    Value,
    as_core,
    as_each,
    as_exact,
    as_floats,
    as_number,
    read_only,
)
from .._outcomes import Result
from ..errors import InvalidValueError, ShapeError
from ..se3.orientation import rotation_vectors_of

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
    """Masses, see `ParallelRobot.with_masses`.

    Shapes: com (3,), inertia (3, 3) about it, first and second part of the legs (m, 3).
    """

    mass: float
    com: Array
    inertia: Array
    first: Array
    second: Array


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ParallelRobot(Value):
    """A parallel robot with m legs and as many freedoms of its platform. Read-only.

    Legs of Gough platforms and 3-RPR robots have an actuated length q. The others have an actuated
    crank, angle q, and a rod: ``knee = base + crank (cos(q) outward + sin(q) downward)``.

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
    home, gravity : ndarray, shape (4, 4) and (3,)
        Reference pose of the platform; acceleration, m/s^2.
    masses : Masses or None
        See `with_masses`.
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
        for field in fields(self)[1:-1]:
            object.__setattr__(self, field.name, read_only(getattr(self, field.name)))

    @property
    def m(self) -> int:
        """Number of legs."""
        return len(self.base)

    @property
    def columns(self) -> tuple[int, ...]:
        """Components of the twist [v; w] that the platform has, from 0."""
        columns: tuple[int, ...] = self.family.value[1]
        return columns

    @property
    def freedoms(self) -> tuple[str, ...]:
        """Names of the components of the twist that the platform has."""
        return tuple(_AXES[k] for k in self.columns)

    @property
    def has_cranks(self) -> bool:
        """Whether angles are actuated, else lengths."""
        return self.family not in (Family.GOUGH, Family.PLANAR_3RPR)

    @property
    def length(self) -> float:
        """Characteristic length, m: root mean square distance of the platform's anchors."""
        return float(np.sqrt((self.platform**2).sum(axis=1).mean())) or 1.0

    @property
    def size(self) -> float:
        """Diameter of the base, or the longest part of a leg or of the platform, m."""
        spread = np.linalg.norm(self.base - self.base.mean(axis=0), axis=1).max()
        return float(max(2.0 * spread, np.abs(self.platform).max(), *self.crank, *self.rod))

    def coordinates(self, T: ArrayLike) -> Array:
        """Coordinates (..., m) of poses: position and rotation vector, (x, y, phi), (x, y, z)."""
        T = self.checked(T)
        full = np.concatenate((T[..., :3, 3], rotation_vectors_of(T[..., :3, :3])), axis=-1)
        return full[..., list(self.columns)]

    def pose(self, coordinates: ArrayLike) -> Array:
        """Poses (..., 4, 4) of coordinates (..., m), the inverse of `coordinates`."""
        X = as_core(coordinates, (self.m,), "coordinates")
        full = np.zeros((*X.shape[:-1], 6))
        full[..., :3] = self.home[:3, 3]
        full[..., list(self.columns)] = X
        return pose_at(full)

    def checked(self, T: Any, name: str = "T") -> Array:
        """Poses (..., 4, 4), checked that the platform can have them."""
        T = se3.as_pose(T, name)
        if self.family is Family.GOUGH or not T.size:
            return T
        if 2 in self.columns:
            off, motion = np.abs(T[..., :3, :3] - np.eye(3)).max(), "translates only"
        else:
            height = np.abs(T[..., 2, 3] - self.home[2, 3]).max() / self.size
            off, motion = max(height, np.abs(T[..., 2, :3] - [0, 0, 1]).max()), "stays in its plane"
        if off > _OFF:
            raise InvalidValueError(
                f"{name}: the platform of a {self.family.value[0]} {motion}, got a pose that is "
                f"{off:.2g} off; build poses with robot.pose(coordinates)."
            )
        return T

    def with_masses(
        self, platform: Any, legs: Any = None, gravity: ArrayLike | None = None
    ) -> ParallelRobot:
        """The robot with masses of its platform and legs, for the dynamic models.

        A leg has two slender parts that do not turn about their own axes. Of variable length: the
        first part starts at the base, the second at the platform. With a crank: the first part is
        the crank, the second the rod (of a Delta the pair of rods) from the knee.

        Parameters
        ----------
        platform : tuple (mass, com, inertia)
            kg; centre of mass (3,) in the platform's frame, m; inertia (3, 3) about it, kg m^2.
        legs : tuple of two, each (mass, position, inertia), optional
            kg; distance of the centre of mass from the part's start, m; inertia about it across the
            part, kg m^2; numbers or one for each leg. Default massless.
        gravity : array_like, shape (3,), optional
            Acceleration in the world, m/s^2; default unchanged.
        """
        parts = ((0.0, 0.0, 0.0),) * 2 if legs is None else legs
        try:
            sizes = (len(platform), *map(len, parts))
        except TypeError:
            sizes = ()
        if sizes != (3, 3, 3):
            raise ShapeError(
                "platform, legs: expected (mass, com, inertia), two parts (mass, place, inertia)."
            )
        mass, com = as_number(platform[0], "mass", least=0.0), as_exact(platform[1], (3,), "com")
        inertia = as_exact(platform[2], (3, 3), "inertia")
        size = np.abs(inertia).max()
        least = np.linalg.eigvalsh(inertia).min()
        if np.abs(inertia - inertia.T).max() > 1e-9 * size or least < -1e-12 * size:
            raise InvalidValueError(
                f"inertia: expected a symmetric, positive matrix, got {inertia.tolist()}."
            )
        least = (0.0, -np.inf, 0.0)
        both = [
            as_floats([as_each(part[k], self.m, "legs", least[k]) for k in range(3)], "legs").T
            for part in parts
        ]
        g = self.gravity if gravity is None else as_exact(gravity, (3,), "gravity")
        masses = Masses(mass, *map(read_only, (com, inertia, *both)))
        return replace(self, masses=masses, gravity=g)

    def __repr__(self) -> str:
        q = "angle" if self.has_cranks else "length"
        none = (-np.inf if self.has_cranks else 0.0, np.inf)
        limits = f"{q} {self.lower.min():.4g} to {self.upper.max():.4g}"
        limits = "no limits" if (self.lower.min(), self.upper.max()) == none else limits
        words = "with" if self.masses is not None else "without"
        return f"<{self.family.value[0]}: {self.m} legs of actuated {q}, {limits}, {words} masses>"


def only_freedoms(robot: ParallelRobot, V: Array) -> Array:
    """Twists or rows without the components that the platform does not have."""
    return V if robot.m == 6 else V * [k in robot.columns for k in range(6)]


def pose_at(twist: Array) -> Array:
    """Poses of position and rotation vector. Shapes: (..., 6) -> (..., 4, 4)."""
    from scipy.spatial.transform import Rotation

    T = np.tile(np.eye(4), (*twist.shape[:-1], 1, 1))
    T[..., :3, 3] = twist[..., :3]
    R = Rotation.from_rotvec(twist[..., 3:].reshape(-1, 3)).as_matrix()
    T[..., :3, :3] = R.reshape(T[..., :3, :3].shape)
    return T


class PlatformResult(Result):
    """Base of results of batches."""

    __slots__ = ()

    @property
    def count(self) -> NDArray[np.int64]:
        """Number of solutions of each row, shape (...)."""
        return self.valid.sum(axis=-1)  # type: ignore[attr-defined]
