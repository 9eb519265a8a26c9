"""Obstacles: spheres and half spaces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...._arrays import Array, Rebuilt, as_exact, as_reals, read_only
from ....errors import InvalidValueError


@dataclass(frozen=True, slots=True, eq=False)
class Sphere(Rebuilt):
    """A solid sphere.

    Parameters
    ----------
    center : array_like, shape (3,)
        In the world, m.
    radius : float
        Not negative, m; 0 is a point.

    Raises
    ------
    ShapeError, InvalidValueError
        A centre that is no point, a radius below zero or not finite.

    Examples
    --------
    >>> Sphere([0.5, 0.0, 0.3], 0.1).radius
    0.1
    """

    center: Array
    radius: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "center", read_only(as_exact(self.center, (3,), "center")))
        radius = as_reals(self.radius, "radius")
        if radius.ndim or not 0.0 <= radius < np.inf:
            raise InvalidValueError(
                f"radius: expected a number of metres that is not negative, got {self.radius!r}."
            )
        object.__setattr__(self, "radius", float(radius))


@dataclass(frozen=True, slots=True, eq=False)
class Plane(Rebuilt):
    """A half space: everything behind a plane, such as a table or a wall.

    Parameters
    ----------
    point : array_like, shape (3,)
        On the plane, in the world, m.
    normal : array_like, shape (3,)
        Towards the free side; made a unit vector.

    Raises
    ------
    ShapeError, InvalidValueError
        Not vectors, or a normal of no length.

    Examples
    --------
    >>> Plane([0.0, 0.0, 0.1], [0.0, 0.0, 2.0]).normal
    array([0., 0., 1.])
    """

    point: Array
    normal: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "point", read_only(as_exact(self.point, (3,), "point")))
        normal = as_exact(self.normal, (3,), "normal")
        largest = np.abs(normal).max()
        if not largest > 0.0:
            raise InvalidValueError("normal: expected a vector that is not zero.")
        normal = normal / largest
        object.__setattr__(self, "normal", read_only(normal / np.linalg.norm(normal)))
