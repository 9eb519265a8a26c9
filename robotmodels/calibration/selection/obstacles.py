"""Bodies that a robot shall not touch, against the straight lines between its frames."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._arrays import Array, Rebuilt, as_exact, as_vector, read_only
from ...errors import InvalidValueError
from ...kinematics import dgm, link_poses
from ...model import RobotModel
from ..extended_table.skeleton import Frame


class Obstacle(Rebuilt, ABC):
    """A body in the world; frozen dataclasses."""

    __slots__ = ()

    @abstractmethod
    def distance(self, start: Array, end: Array) -> Array:
        """Distance of straight segments from the body, metres, at most 0 where they meet.

        Parameters
        ----------
        start, end : ndarray, shape (..., 3)
            Ends of the segments in the world, metres.

        Returns
        -------
        ndarray, shape (...)
            Distances.
        """


@dataclass(frozen=True, slots=True, init=False, eq=False)
class Sphere(Obstacle):
    """A ball.

    Parameters
    ----------
    center : array_like, shape (3,)
        In the world, metres.
    radius : float
        Metres.

    Raises
    ------
    ShapeError, InvalidValueError
        Not three finite numbers; a radius below 0.

    Examples
    --------
    >>> float(Sphere([0, 0, 1], 0.25).distance(np.zeros(3), np.array([1.0, 0, 0])))
    0.75
    """

    center: Array
    radius: float

    def __init__(self, center: ArrayLike, radius: float) -> None:
        object.__setattr__(self, "center", read_only(as_exact(center, (3,), "center")))
        size = float(as_exact(radius, (), "radius"))
        if size < 0.0:
            raise InvalidValueError(f"radius: expected metres from 0, got {size:g}.")
        object.__setattr__(self, "radius", size)

    def distance(self, start: Array, end: Array) -> Array:
        """As `Obstacle.distance`."""
        along = end - start
        length = (along**2).sum(axis=-1)
        t = ((self.center - start) * along).sum(axis=-1) / np.where(length > 0.0, length, 1.0)
        nearest = start + np.clip(t, 0.0, 1.0)[..., None] * along
        return np.linalg.norm(nearest - self.center, axis=-1) - self.radius


@dataclass(frozen=True, slots=True, init=False, eq=False)
class HalfSpace(Obstacle):
    """All points beyond a plane: a floor, a wall, a ceiling.

    Parameters
    ----------
    normal : array_like, shape (3,)
        Out of the body, towards the free side; any length but 0.
    offset : float
        The body is where ``normal . p <= offset``, for the normal as a unit vector; metres.

    Raises
    ------
    ShapeError, InvalidValueError
        Not three finite numbers; a normal of length 0.

    Examples
    --------
    >>> float(HalfSpace([0, 0, 2], 0.0).distance(np.array([0, 0, 0.5]), np.array([0, 0, 0.3])))
    0.3
    """

    normal: Array
    offset: float

    def __init__(self, normal: ArrayLike, offset: float) -> None:
        n = as_exact(normal, (3,), "normal")
        length = float(np.linalg.norm(n))
        if length == 0.0:
            raise InvalidValueError("normal: expected a vector that is not 0.")
        object.__setattr__(self, "normal", read_only(n / length))
        object.__setattr__(self, "offset", float(as_exact(offset, (), "offset")))

    def distance(self, start: Array, end: Array) -> Array:
        """As `Obstacle.distance`."""
        return np.minimum(start @ self.normal, end @ self.normal) - self.offset


@dataclass(frozen=True, slots=True, init=False, eq=False)
class Box(Obstacle):
    """A box whose edges are parallel to the axes of the world.

    Parameters
    ----------
    lower, upper : array_like, shape (3,)
        Opposite corners in the world, metres.

    Raises
    ------
    ShapeError, InvalidValueError
        Not three finite numbers; an upper below its lower.

    Examples
    --------
    >>> float(Box([-1, -1, -1], [1, 1, 1]).distance(np.array([3.0, 0, 0]), np.array([2.0, 0, 0])))
    1.0
    """

    lower: Array
    upper: Array

    def __init__(self, lower: ArrayLike, upper: ArrayLike) -> None:
        low, high = as_exact(lower, (3,), "lower"), as_exact(upper, (3,), "upper")
        if (high < low).any():
            raise InvalidValueError(f"upper: expected at least lower {low}, got {high}.")
        object.__setattr__(self, "lower", read_only(low))
        object.__setattr__(self, "upper", read_only(high))

    def distance(self, start: Array, end: Array) -> Array:
        """As `Obstacle.distance`."""
        along = end - start
        moving = np.where(along != 0.0, along, 1.0)
        # the squared distance is a parabola between the places where a face is crossed
        crossed = [
            np.where(along != 0.0, (face - start) / moving, 0.0)
            for face in (self.lower, self.upper)
        ]
        ends = np.broadcast_to([0.0, 1.0], (*along.shape[:-1], 2))
        t = np.sort(np.concatenate([*(np.clip(c, 0.0, 1.0) for c in crossed), ends], -1), -1)
        outside = self._outside(start[..., None, :] + t[..., None] * along[..., None, :])
        slope = (outside * along[..., None, :]).sum(axis=-1)
        s0, s1 = slope[..., :-1], slope[..., 1:]
        rise = s1 - s0
        share = np.clip(np.where(rise > 0.0, -s0 / np.where(rise > 0.0, rise, 1.0), 0.0), 0.0, 1.0)
        lowest = t[..., :-1] + share * (t[..., 1:] - t[..., :-1])
        every = np.concatenate([t, lowest], axis=-1)
        points = start[..., None, :] + every[..., None] * along[..., None, :]
        return np.linalg.norm(self._outside(points), axis=-1).min(axis=-1)

    def _outside(self, points: Array) -> Array:
        """Vector from the nearest point of the box."""
        return points - np.clip(points, self.lower, self.upper)


def clearance(
    model: RobotModel,
    q: ArrayLike,
    obstacles: Iterable[Obstacle],
    radius: float = 0.0,
    frame: Frame = None,
) -> Array:
    """Distance of a robot from obstacles, its links taken as rods.

    A link is the straight segment between the origins of a frame and its antecedent, with a radius
    all around; the last one ends at the measured end. The first segment, from R_0, does not count
    if R_0 itself lies in the obstacle: robots stand on something. Where the bodies of a robot are
    not near these segments, give a radius that covers them. The robot's own links and its cables
    are not looked at.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    q : array_like, shape (..., n)
        Configurations, rad or m.
    obstacles : iterable of Obstacle
        Sphere, Box, HalfSpace.
    radius : float
        Of the rods, metres.
    frame : str, int or None
        The measured end; None is the tool.

    Returns
    -------
    ndarray, shape (...)
        Metres, at most 0 where the robot touches; infinite without obstacles.

    Raises
    ------
    ShapeError, InvalidValueError, FrameNotFoundError
        Configurations of another robot, something that is no obstacle, a radius below 0.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> clearance(load("rx90"), np.zeros((2, 6)), [HalfSpace([0, 0, 1], -1.0)], 0.1).round(3)
    array([0.9, 0.9])
    """
    q = as_vector(q, model.n, "q")
    bodies = tuple(obstacles)
    for k, body in enumerate(bodies):
        if not isinstance(body, Obstacle):
            raise InvalidValueError(
                f"obstacles[{k}]: expected Sphere, Box or HalfSpace, got {type(body).__name__}."
            )
    size = float(as_exact(radius, (), "radius"))
    if size < 0.0:
        raise InvalidValueError(f"radius: expected metres from 0, got {size:g}.")
    start, end, rooted = _segments(model, q.reshape(-1, model.n), frame)
    least = np.full(len(start), np.inf)
    for body in bodies:
        far = body.distance(start, end)
        origin = model.base[:3, 3]
        if body.distance(origin, origin) - size <= 0.0:
            far = np.where(rooted, np.inf, far)
        least = np.minimum(least, far.min(axis=1, initial=np.inf) - size)
    return least.reshape(q.shape[:-1])


def _segments(model: RobotModel, q: Array, frame: Frame) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Ends of the rods, shapes (N, S, 3), and which begin where the robot stands."""
    origins = link_poses(model, q)[..., :3, 3]
    base = np.broadcast_to(model.base[:3, 3], (len(q), 1, 3))
    places = np.concatenate([base, origins], axis=1)
    tip = dgm(model, q, frame)[..., None, :3, 3]
    parent = model.twin.frame(frame).parent
    starts = [*(int(a) for a in model.table.antecedent), parent]
    rooted = np.array([_still(places, a) for a in starts])
    return places[:, starts], np.concatenate([origins, tip], axis=1), rooted


def _still(places: Array, row: int) -> bool:
    """Whether a rod starts at the origin of R_0, as frames that share it do."""
    return row == 0 or bool(np.abs(places[:, row] - places[:, 0]).max(initial=0.0) < 1e-12)
