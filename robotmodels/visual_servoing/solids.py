"""Features of solids: circles, spheres and cylinders."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from .._arrays import Array
from .features import (
    THIN,
    Feature,
    Flags,
    Lines,
    inner,
    line_of,
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

    def _rows(self, s: Array, depth: Array, G: Any = None) -> Array:
        x, y, n20, n02, n11 = np.moveaxis(s, -1, 0)
        return interaction_ellipse(x, y, n20, n02, n11, depth)

    def _outline(self, s: Array, G: Any) -> Array:
        reach = 2.0 * np.sqrt(np.maximum(s[..., 2:4], 0.0))
        return np.stack((s[..., :2] - reach, s[..., :2] + reach), axis=-2)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Circle(_Ellipse):
    """A circle: x, y, n20, n02, n11 of the ellipse of its image, of moments divided by the area."""

    centre: Array
    normal: Array
    radius: float

    def __post_init__(self) -> None:
        set_fields(self, centre=self.centre, normal=self.normal, radius=self.radius)

    def _placed(self, T: Array) -> tuple[Array, Array]:
        return placed(T, self.centre[None])[..., 0, :], T[..., :3, :3] @ self.normal

    def _visible(self, G: Any) -> Flags:
        c, n = G
        lowest = c[..., 2] - self.radius * np.sqrt(np.maximum(1.0 - n[..., 2] ** 2, 0.0))
        return (lowest > 0.0) & (np.abs(inner(c, n)) > THIN * norm(c))[..., 0]

    def _measure(self, G: Any) -> Array:
        c, n = G
        d, excess = inner(c, n)[..., None], inner(c, c)[..., None] - self.radius**2
        mixed = _outer(c, n) + _outer(n, c)
        return _ellipse_of(d**2 * np.eye(3) - d * mixed + excess * _outer(n, n))

    def _depth(self, G: Any) -> Array:
        c, n = G
        return np.concatenate((n, -inner(c, n)), axis=-1)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Sphere(_Ellipse):
    """A sphere: x, y, n20, n02, n11 of the ellipse of its outline."""

    centre: Array
    radius: float

    def __post_init__(self) -> None:
        set_fields(self, centre=self.centre, radius=self.radius)

    def _placed(self, T: Array) -> Array:
        return placed(T, self.centre[None])[..., 0, :]

    def _visible(self, G: Array) -> Flags:
        return G[..., 2] > self.radius

    def _measure(self, G: Array) -> Array:
        return _ellipse_of(_outer(G, G) - (inner(G, G)[..., None] - self.radius**2) * np.eye(3))

    def _depth(self, G: Array) -> Array:  # the outline is in the polar plane
        return np.concatenate((G, self.radius**2 - inner(G, G)), axis=-1)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Cylinder(Feature):
    """An infinite cylinder: rho, theta of the two lines of its outline."""

    centre: Array
    axis: Array
    radius: float
    _period = (0.0, 2.0 * np.pi, 0.0, 2.0 * np.pi)

    def __post_init__(self) -> None:
        set_fields(self, centre=self.centre, axis=self.axis, radius=self.radius)

    def _placed(self, T: Array) -> tuple[Array, Array, Array]:
        """Centre, nearest point of the axis, normals of the planes of both outlines (..., 2, 3)."""
        p, u = placed(T, self.centre[None])[..., 0, :], T[..., :3, :3] @ self.axis
        nearest = p - inner(p, u) * u
        d = np.maximum(norm(nearest), 1e-300)
        sine = np.minimum(self.radius / d, 1.0)
        towards, beside = sine * nearest / d, np.sqrt(1.0 - sine**2) * np.cross(u, nearest / d)
        return p, nearest, np.stack((towards + beside, towards - beside), axis=-2)

    def _visible(self, G: Any) -> Flags:
        p, nearest, n = G
        outside = norm(nearest)[..., 0] > self.radius * (1.0 + THIN)
        return (p[..., 2] > 0.0) & outside & (np.hypot(n[..., 0], n[..., 1]) > THIN).all(axis=-1)

    def _measure(self, G: Any) -> Array:
        return line_of(G[2])

    def _depth(self, G: Any) -> Array:
        return plane_at(G[1][..., None, :] - self.radius * G[2])  # lines of contact

    _rows, _outline = Lines._rows, Lines._outline


def _outer(a: Array, b: Array) -> Array:
    """Outer products of vectors in the last axis."""
    return a[..., :, None] * b[..., None, :]


def _ellipse_of(Q: Array) -> Array:
    """Ellipse ``[x y 1] Q [x y 1]^T = 0``. Shapes: (..., 3, 3) -> (..., 5)."""
    determinant = Q[..., 0, 0] * Q[..., 1, 1] - Q[..., 0, 1] ** 2
    x = (Q[..., 0, 1] * Q[..., 1, 2] - Q[..., 1, 1] * Q[..., 0, 2]) / determinant
    y = (Q[..., 0, 1] * Q[..., 0, 2] - Q[..., 0, 0] * Q[..., 1, 2]) / determinant
    scale = -(Q[..., 0, 2] * x + Q[..., 1, 2] * y + Q[..., 2, 2]) / (4.0 * determinant)
    moments = scale * Q[..., 1, 1], scale * Q[..., 0, 0], -scale * Q[..., 0, 1]
    return np.stack((x, y, *moments), axis=-1)
