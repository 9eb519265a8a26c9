"""Convex obstacles and their signed distance from straight segments.

The members of the family have one method, ``nearest(start, end)``: of segments (..., 3) it returns
the signed distance (...), negative inside, the parameter t (...) of the nearest point
``start + t (end - start)``, and the gradient (..., 3) of the distance by that point.

Parameters
----------
center, start, end, point : array_like, shape (3,)
    Centre of a sphere, ends of the axis of a capsule, a point on a plane, in the world, m.
radius : float
    Radius, m, not negative; 0 is a point or a line.
normal : array_like, shape (3,)
    Towards the free side; made a unit vector.
lower, upper : array_like, shape (3,)
    Opposite corners in the world, m; infinite where there is no face.

Raises
------
ShapeError, InvalidValueError
    Arrays of another shape, NaN, a negative radius, a normal of length zero, an empty box.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from .._arrays import Array, Value, as_exact, as_number, as_reals, read_only
from ..errors import InvalidValueError, ShapeError

Nearest = tuple[Array, Array, Array]
_NORMALS = np.vstack((-np.eye(3), np.eye(3)))  # of the six faces of a box
_HALVINGS = 40


@runtime_checkable
class Obstacle(Protocol):
    """A convex body in the world."""

    def nearest(self, start: Array, end: Array) -> Nearest:
        """Signed distance of segments, parameter of the nearest point, and gradient."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Sphere(Value):
    """A solid sphere."""

    center: Array
    radius: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "center", read_only(as_exact(self.center, (3,), "center")))
        object.__setattr__(self, "radius", as_number(self.radius, "radius", least=0.0))

    def nearest(self, start: Array, end: Array) -> Nearest:
        """Distance from the centre, less the radius."""
        return _from_axis(start, end, self.center, self.center, self.radius)


@dataclass(frozen=True, slots=True, eq=False)
class Capsule(Value):
    """A solid cylinder with round ends: the points near a segment, such as a post or a pipe."""

    start: Array
    end: Array
    radius: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "start", read_only(as_exact(self.start, (3,), "start")))
        object.__setattr__(self, "end", read_only(as_exact(self.end, (3,), "end")))
        object.__setattr__(self, "radius", as_number(self.radius, "radius", least=0.0))

    def nearest(self, start: Array, end: Array) -> Nearest:
        """Distance from the axis, less the radius."""
        return _from_axis(start, end, self.start, self.end, self.radius)


@dataclass(frozen=True, slots=True, eq=False)
class Plane(Value):
    """A half space bounded by a plane, such as a floor, a table or a wall."""

    point: Array
    normal: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "point", read_only(as_exact(self.point, (3,), "point")))
        normal = as_exact(self.normal, (3,), "normal")
        if not normal.any():
            raise InvalidValueError("normal: expected a vector that is not zero.")
        normal = normal / np.abs(normal).max()  # scaled against underflow of squares
        object.__setattr__(self, "normal", read_only(normal / np.linalg.norm(normal)))

    def nearest(self, start: Array, end: Array) -> Nearest:
        """Height of the lower end."""
        first, last = (start - self.point) @ self.normal, (end - self.point) @ self.normal
        t = (last < first).astype(float)
        return np.minimum(first, last), t, np.broadcast_to(self.normal, (*t.shape, 3))


@dataclass(frozen=True, slots=True, eq=False)
class Box(Value):
    """A box whose edges are parallel to the axes of the world."""

    lower: Array
    upper: Array

    def __post_init__(self) -> None:
        for name in ("lower", "upper"):
            corner = as_reals(getattr(self, name), name)
            if corner.shape != (3,):
                raise ShapeError(f"{name}: expected shape (3,), metres, got {corner.shape}.")
            object.__setattr__(self, name, read_only(corner))
        if not (self.lower <= self.upper).all() or np.isinf([self.lower, self.upper]).all():
            raise InvalidValueError(
                "lower, upper: expected lower below upper on each axis and at least one finite "
                f"face, got {self.lower} and {self.upper}."
            )

    def signed(self, points: Array) -> tuple[Array, Array]:
        """Signed distance of points and its unit gradient. Shapes: (..., 3) -> (...), (..., 3)."""
        outside = points - np.clip(points, self.lower, self.upper)
        distance = np.sqrt((outside * outside).sum(axis=-1))
        far = distance > 0.0
        if far.all():
            return distance, outside / distance[..., None]
        depth = np.concatenate((self.lower - points, points - self.upper), axis=-1)
        away = outside / np.where(far, distance, 1.0)[..., None]
        inward = _NORMALS[depth.argmax(axis=-1)]
        return np.where(far, distance, depth.max(axis=-1)), np.where(far[..., None], away, inward)

    def nearest(self, start: Array, end: Array) -> Nearest:
        """Least signed distance, a convex function on the segment, by bisection of its slope."""
        along = end - start
        low, high = np.zeros(along.shape[:-1]), np.ones(along.shape[:-1])
        for _ in range(_HALVINGS if along.any() else 0):
            t = 0.5 * (low + high)
            _, gradient = self.signed(start + t[..., None] * along)
            falls = (gradient * along).sum(axis=-1) < 0.0
            low, high = np.where(falls, t, low), np.where(falls, high, t)
        # inside, at an edge of two faces: the share with zero slope along the segment
        _, before = self.signed(start + low[..., None] * along)
        distance, after = self.signed(start + high[..., None] * along)
        falls, rises = -(before * along).sum(axis=-1), (after * along).sum(axis=-1)
        share = _share(falls, falls + rises)[..., None]
        return distance, high, share * after + (1.0 - share) * before


def nearest_points(a: Array, b: Array, c: Array, d: Array) -> tuple[Array, Array]:
    """Parameters of the nearest points of segments a-b and c-d. Shapes: (..., 3) -> (...)."""
    u, w, r = b - a, d - c, a - c
    uu, ww, uw = (u * u).sum(-1), (w * w).sum(-1), (u * w).sum(-1)
    ur, wr = (u * r).sum(-1), (w * r).sum(-1)
    across = uu * ww - uw**2  # zero for parallel segments, which any s serves
    s = _share(uw * wr - ur * ww, np.where(across > 1e-14 * uu * ww, across, 0.0))
    t = _share(uw * s + wr, ww)
    return _share(uw * t - ur, uu), t


def _share(part: Array, whole: Array) -> Array:
    """A ratio within 0 and 1; 0 where the whole is 0."""
    return np.clip(part / np.where(whole > 0.0, whole, np.inf), 0.0, 1.0)


def unit_between(point: Array, other: Array, along: Array) -> tuple[Array, Array]:
    """Distance of points and unit vector from the other; across a line where they coincide."""
    apart = point - other
    distance = np.linalg.norm(apart, axis=-1)
    across = np.cross(along, np.eye(3)[np.abs(along).argmin(axis=-1)])
    across = np.where(across.any(axis=-1, keepdims=True), across, [0.0, 0.0, 1.0])
    apart = np.where(distance[..., None] > 0.0, apart, across)
    return distance, apart / np.linalg.norm(apart, axis=-1, keepdims=True)


def _from_axis(start: Array, end: Array, a: Array, b: Array, radius: float) -> Nearest:
    """Distance of segments from the segment a-b, less a radius."""
    s, t = nearest_points(start, end, a, b)
    along = end - start
    point = start + s[..., None] * along
    distance, unit = unit_between(point, a + t[..., None] * (b - a), along)
    return distance - radius, s, unit
