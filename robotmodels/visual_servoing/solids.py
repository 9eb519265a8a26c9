"""Features of solids: circles, spheres and cylinders."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from .._arrays import Array
from ..errors import InvalidValueError
from .features import (
    THIN,
    Feature,
    Lines,
    Sight,
    inner,
    lines_of,
    norm,
    placed,
    plane_at,
    set_fields,
)
from .matrices import interaction_ellipse


class _Ellipse(Feature):
    """An object whose image is an ellipse: x, y, n20, n02, n11."""

    __slots__ = ()
    _period = (0.0,) * 5

    def _rows(self, s: Array, depth: Array, image: Any = None) -> Array:
        x, y, n20, n02, n11 = np.moveaxis(s, -1, 0)
        return interaction_ellipse(x, y, n20, n02, n11, depth)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Circle(_Ellipse):
    """A circle: x, y, n20, n02, n11 of the ellipse of its image, of moments divided by the area."""

    centre: Array
    normal: Array
    radius: float

    def __post_init__(self) -> None:
        set_fields(self, centre=self.centre, normal=self.normal, radius=self.radius)

    def _see(self, T: Array) -> Sight:
        c, n = placed(T, self.centre[None])[..., 0, :], T[..., :3, :3] @ self.normal
        lowest = c[..., 2] - self.radius * np.sqrt(np.maximum(1.0 - n[..., 2] ** 2, 0.0))
        d, excess = inner(c, n), (inner(c, c) - self.radius**2)[..., None]
        mixed = _outer(c, n) + _outer(n, c)
        Q = d[..., None] ** 2 * np.eye(3) - d[..., None] * mixed + excess * _outer(n, n)
        exists = (lowest > 0.0) & (np.abs(d) > THIN * norm(c))[..., 0]
        return _ellipse_of(Q, exists, np.concatenate((n, -d), axis=-1))


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Sphere(_Ellipse):
    """A sphere: x, y, n20, n02, n11 of the ellipse of its outline."""

    centre: Array
    radius: float

    def __post_init__(self) -> None:
        set_fields(self, centre=self.centre, radius=self.radius)

    def _see(self, T: Array) -> Sight:
        return self._outline(placed(T, self.centre[None])[..., 0, :])

    def _outline(self, p: Array) -> Sight:
        """Sight of the sphere with its centre at p (..., 3)."""
        excess = inner(p, p) - self.radius**2
        Q = _outer(p, p) - excess[..., None] * np.eye(3)
        return _ellipse_of(Q, p[..., 2] > self.radius, p[..., 2])

    def _parallel(self, Z: float) -> float:
        if not self.radius < Z:
            raise InvalidValueError(
                f"depth: expected the depth of the centre of the sphere, above its radius "
                f"{self.radius:g} m, got {Z:g} m."
            )
        return Z

    def _rows(self, s: Array, depth: Array, image: Any = None) -> Array:
        Z = np.broadcast_to(depth, s.shape[:-1])[..., None]
        p = np.concatenate((s[..., :2] * (Z - self.radius**2 / Z), Z), axis=-1)
        excess = inner(p, p) - self.radius**2
        polar = np.concatenate((p, -excess), axis=-1)  # the plane of the outline
        return _Ellipse._rows(self, self._outline(p).s, polar)  # of rank 3 at any depth


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Cylinder(Feature):
    """An infinite cylinder: rho, theta of the two lines of its outline."""

    centre: Array
    axis: Array
    radius: float
    _period = (0.0, 2.0 * np.pi, 0.0, 2.0 * np.pi)

    def __post_init__(self) -> None:
        set_fields(self, centre=self.centre, axis=self.axis, radius=self.radius)

    def _see(self, T: Array) -> Sight:
        p, u = placed(T, self.centre[None])[..., 0, :], T[..., :3, :3] @ self.axis
        nearest = p - inner(p, u) * u
        sine = np.minimum(self.radius / norm(nearest), 1.0)
        towards = nearest / norm(nearest)
        beside = np.sqrt(1.0 - sine**2) * np.cross(u, towards)
        n = np.stack((sine * towards + beside, sine * towards - beside), axis=-2)
        outside = (sine < 1.0 - THIN)[..., 0]
        contact = nearest[..., None, :] - self.radius * n
        ahead = (p[..., 2] > 0.0) | (contact[..., 2] > 0.0).all(axis=-1)
        exists = ahead & outside & (np.hypot(n[..., 0], n[..., 1]) > THIN).all(axis=-1)
        return Sight(exists, *lines_of(n, plane_at(contact)))

    _in_image = Lines._in_image
    _rows = Lines._rows


def _outer(a: Array, b: Array) -> Array:
    """Outer products of vectors in the last axis."""
    return a[..., :, None] * b[..., None, :]


def _ellipse_of(Q: Array, exists: Any, plane: Array) -> Sight:
    """Sight of the ellipse ``[x y 1] Q [x y 1]^T = 0``. Shapes: Q (..., 3, 3)."""
    determinant = Q[..., 0, 0] * Q[..., 1, 1] - Q[..., 0, 1] ** 2
    x = (Q[..., 0, 1] * Q[..., 1, 2] - Q[..., 1, 1] * Q[..., 0, 2]) / determinant
    y = (Q[..., 0, 1] * Q[..., 0, 2] - Q[..., 0, 0] * Q[..., 1, 2]) / determinant
    scale = -(Q[..., 0, 2] * x + Q[..., 1, 2] * y + Q[..., 2, 2]) / (4.0 * determinant)
    s = np.stack((x, y, scale * Q[..., 1, 1], scale * Q[..., 0, 0], -scale * Q[..., 0, 1]), axis=-1)
    reach = 2.0 * np.sqrt(s[..., 2:4])
    return Sight(exists, s, plane, np.stack((s[..., :2] - reach, s[..., :2] + reach), axis=-2))
