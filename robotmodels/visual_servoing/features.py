"""Features of an image: points, lines, segments, circles, spheres, cylinders.

Every feature has ``measure(T)`` and ``interaction(T)``. Coordinates of objects are in the frame of
the object, metres; image coordinates are normalised. Angles of errors are taken modulo a turn.

Parameters
----------
T : array_like, shape (..., 4, 4)
    Pose of the object in the camera, ``T_camera_object``.

Returns
-------
ndarray, shape (..., k) or (..., k, 6)
    Measurement; interaction matrix for the twist [v; w] of the camera in its own axes.

Raises
------
ShapeError, InvalidValueError, NotARotationError
    An object of another shape or without extent; a matrix that is not a pose; an object at or
    behind the plane of the camera, or seen so that the feature does not exist.

References
----------
Seed book sections 6.2.4.1 and 6.2.4.2; B. Espiau, F. Chaumette and P. Rives, "A new approach to
visual servoing in robotics", IEEE Trans. Robotics and Automation 8(3), 1992.

Examples
--------
>>> import numpy as np
>>> from robotmodels.se3 import translation
>>> square = Points([[-0.1, -0.1, 0], [0.1, -0.1, 0], [0.1, 0.1, 0], [-0.1, 0.1, 0]])
>>> square.measure(translation(0, 0, 1.0))
array([-0.1, -0.1,  0.1, -0.1,  0.1,  0.1, -0.1,  0.1])
>>> square.interaction(translation(0, 0, 1.0)).shape
(8, 6)
>>> Sphere([0, 0, 0], 0.6).measure(translation(0, 0, 1.0))  # x, y, n20, n02, n11
array([0.      , 0.      , 0.140625, 0.140625, 0.      ])
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, Value, as_core, as_exact, as_floats, as_number, read_only
from ..errors import InvalidValueError, ShapeError
from ..se3 import as_pose
from .matrices import ellipse_rows, line_rows, point_rows, segment_rows

_THIN = 1e-9  # relative: lengths, areas and angles below are zero
_SHOWN = 6
_TURN = 2.0 * np.pi
Flags = NDArray[np.bool_]


class Feature(Value):
    """Shared parts of all features; ``G`` is the geometry of the object in the camera."""

    __slots__ = ()
    depends_on_depth = True

    def measure(self, T: ArrayLike) -> Array:
        """Measurement s (..., k) of the object at poses T."""
        return self._measure(self._seen(T))

    def interaction(self, T: ArrayLike) -> Array:
        """Interaction matrix L (..., k, 6) at poses T, ``ds/dt = L [v; w]``."""
        G = self._seen(T)
        return self._rows(self._measure(G), self._depth(G), G)

    def _seen(self, T: Any) -> Any:
        """Geometry at checked poses, where the feature exists."""
        G = self._placed(as_pose(T))
        seen = self._visible(G)
        if not np.all(seen):
            row = "" if seen.ndim == 0 else f" (row {np.argwhere(~seen)[0].tolist()})"
            raise InvalidValueError(
                f"T: the feature of {type(self).__name__} does not exist there{row}: expected the "
                "object in front of the plane of the camera, not seen edge-on and without the "
                "camera inside; move the camera."
            )
        return G

    def __repr__(self) -> str:
        return brief(self)

    @property
    def size(self) -> int:
        """Number k of components."""
        return len(self._periods())

    def _periods(self) -> Array:
        """Period of each component, 0 where it has none. Shapes: -> (k,)."""
        raise NotImplementedError

    def _placed(self, T: Array) -> Any:
        """Geometry of the object in the camera. Shapes: T (..., 4, 4)."""
        raise NotImplementedError

    def _visible(self, G: Any) -> Flags:
        """Whether the feature exists. Shapes: -> (...)."""
        raise NotImplementedError

    def _measure(self, G: Any) -> Array:
        """Measurement. Shapes: -> (..., k)."""
        raise NotImplementedError

    def _depth(self, G: Any) -> Any:
        """Inverse depths that the rows need, as numbers or as planes (a, b, c)."""
        raise NotImplementedError

    def _parallel(self, w: float) -> Any:
        """The same for an object parallel to the image at the inverse depth w."""
        raise NotImplementedError

    def _rows(self, s: Array, depth: Any, G: Any = None) -> Array:
        """Interaction matrix of a measurement. Shapes: s (..., k) -> (..., k, 6)."""
        raise NotImplementedError

    def _outline(self, s: Array, G: Any) -> Array | None:
        """Points of the image that the camera has to see. Shapes: -> (..., m, 2)."""
        raise NotImplementedError


def placed(T: Array, points: Array) -> Array:
    """Points of the object in the camera. Shapes: T (..., 4, 4), (m, 3) -> (..., m, 3)."""
    return points @ np.swapaxes(T[..., :3, :3], -1, -2) + T[..., None, :3, 3]


def inner(a: Array, b: Array) -> Array:
    """Scalar products of vectors in the last axis, which is kept."""
    return (a * b).sum(axis=-1, keepdims=True)


def unit(vector: Any, name: str) -> Array:
    """A direction as a unit vector."""
    array = as_exact(vector, (3,), name)
    length = float(np.linalg.norm(array))
    if not length > 0.0:
        raise InvalidValueError(f"{name}: expected a vector that is not zero.")
    return read_only(array / length)


def _pairs(points: Any) -> Array:
    """Distinct pairs of points. Shapes: -> (n, 2, 3)."""
    pairs = as_core(points, (2, 3), "points")
    pairs = pairs[None] if pairs.ndim == 2 else pairs
    if pairs.ndim != 3 or not len(pairs):
        raise ShapeError(f"points: expected shape (k, 2, 3), k from 1, got {pairs.shape}.")
    lengths = np.linalg.norm(pairs[:, 1] - pairs[:, 0], axis=-1)
    if not (lengths > _THIN * np.abs(pairs).max()).all():
        raise InvalidValueError("points: expected two different points on each line or segment.")
    return read_only(pairs)


def _set(feature: Any, **fields: Any) -> None:
    for name, value in fields.items():
        object.__setattr__(feature, name, value)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Points(Feature):
    """Image points: x, y of each of ``object_points (k, 3)``."""

    object_points: Array

    def __post_init__(self) -> None:
        points = as_core(self.object_points, (3,), "object_points")
        points = points[None] if points.ndim == 1 else points
        if points.ndim != 2 or not len(points):
            raise ShapeError(f"object_points: expected (k, 3), k from 1, got {points.shape}.")
        _set(self, object_points=read_only(points))

    def _periods(self) -> Array:
        return np.zeros(2 * len(self.object_points))

    def _placed(self, T: Array) -> Array:
        return placed(T, self.object_points)

    def _visible(self, G: Array) -> Flags:
        return (G[..., 2] > 0.0).all(axis=-1)

    def _measure(self, G: Array) -> Array:
        return _flat(G[..., :2] / G[..., 2:])

    def _depth(self, G: Array) -> Array:
        return 1.0 / G[..., 2]

    def _parallel(self, w: float) -> Array:
        return np.full(len(self.object_points), w)

    def _rows(self, s: Array, depth: Array, G: Any = None) -> Array:
        return point_rows(s[..., 0::2], s[..., 1::2], depth).reshape(*s.shape, 6)

    def _outline(self, s: Array, G: Any) -> Array:
        return s.reshape(*s.shape[:-1], len(self.object_points), 2)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Lines(Feature):
    """Straight lines through pairs of ``points (k, 2, 3)``: rho, theta of each.

    Seen from the first point to the second, theta is the direction of the normal on the right
    (the image has y downwards), so that (rho, theta) and (-rho, theta + pi) are two lines.
    """

    points: Array

    def __post_init__(self) -> None:
        _set(self, points=_pairs(self.points))

    def _periods(self) -> Array:
        return np.tile([0.0, _TURN], len(self.points))

    def _placed(self, T: Array) -> tuple[Array, Array]:
        X = placed(T, self.points.reshape(-1, 3))
        return X[..., 0::2, :], X[..., 1::2, :]

    def _visible(self, G: Any) -> Flags:
        p, q = G
        normal, along = np.cross(p, q), np.linalg.norm(q - p, axis=-1)
        size = np.linalg.norm(p, axis=-1) * along
        exists = np.hypot(normal[..., 0], normal[..., 1]) > _THIN * size
        return ((p[..., 2] > 0.0) & (q[..., 2] > 0.0) & exists).all(axis=-1)

    def _measure(self, G: Any) -> Array:
        return _line_of(np.cross(*G))

    def _depth(self, G: Any) -> Array:
        p, q = G
        along = q - p
        nearest = p - inner(p, along) / inner(along, along) * along
        return nearest / inner(nearest, nearest)

    def _parallel(self, w: float) -> Array:
        return np.array([0.0, 0.0, w])

    def _rows(self, s: Array, depth: Array, G: Any = None) -> Array:
        rows = line_rows(s[..., 0::2], s[..., 1::2], depth[..., 0], depth[..., 1], depth[..., 2])
        return rows.reshape(*s.shape, 6)

    def _outline(self, s: Array, G: Any) -> Array:
        rho, theta = s[..., 0::2], s[..., 1::2]  # the point nearest to the optical axis
        return np.stack((rho * np.cos(theta), rho * np.sin(theta)), axis=-1)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Segments(Feature):
    """Segments between pairs of ``points (k, 2, 3)``: middle x, y, length, alpha of each."""

    points: Array

    def __post_init__(self) -> None:
        _set(self, points=_pairs(self.points))

    def _periods(self) -> Array:
        return np.tile([0.0, 0.0, 0.0, _TURN], len(self.points))

    def _placed(self, T: Array) -> Array:
        return placed(T, self.points.reshape(-1, 3))

    def _visible(self, G: Array) -> Flags:
        across = np.linalg.norm(np.cross(G[..., 0::2, :], G[..., 1::2, :]), axis=-1)
        size = np.linalg.norm(G, axis=-1).max(axis=-1, keepdims=True)
        return (G[..., 2] > 0.0).all(axis=-1) & (across > _THIN * size**2).all(axis=-1)

    def _measure(self, G: Array) -> Array:
        p, q = ((G[..., :2] / G[..., 2:])[..., k::2, :] for k in (0, 1))
        (x, y), (dx, dy) = np.moveaxis(0.5 * (p + q), -1, 0), np.moveaxis(q - p, -1, 0)
        return _flat(np.stack((x, y, np.hypot(dx, dy), np.arctan2(dy, dx)), axis=-1))

    def _depth(self, G: Array) -> Array:
        return 1.0 / np.stack((G[..., 0::2, 2], G[..., 1::2, 2]), axis=-1)

    def _parallel(self, w: float) -> Array:
        return np.full((len(self.points), 2), w)

    def _rows(self, s: Array, depth: Array, G: Any = None) -> Array:
        rows = segment_rows(s[..., 0::4], s[..., 1::4], s[..., 2::4], s[..., 3::4], depth)
        return rows.reshape(*s.shape, 6)

    def _outline(self, s: Array, G: Any) -> Array:
        middle, alpha = np.stack((s[..., 0::4], s[..., 1::4]), axis=-1), s[..., 3::4]
        reach = 0.5 * s[..., 2::4, None] * np.stack((np.cos(alpha), np.sin(alpha)), axis=-1)
        return np.concatenate((middle - reach, middle + reach), axis=-2)


class _Ellipse(Feature):
    """An object whose image is an ellipse: x, y, n20, n02, n11."""

    __slots__ = ()

    def _periods(self) -> Array:
        return np.zeros(5)

    def _parallel(self, w: float) -> Array:
        return np.array([0.0, 0.0, w])

    def _rows(self, s: Array, depth: Array, G: Any = None) -> Array:
        a, b, c = (np.broadcast_to(depth[..., i], s.shape[:-1]) for i in range(3))
        return ellipse_rows(*np.moveaxis(s, -1, 0), a, b, c)

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
        centre = read_only(as_exact(self.centre, (3,), "centre"))
        _set(self, centre=centre, normal=unit(self.normal, "normal"))
        _set(self, radius=as_number(self.radius, "radius", above=0.0))

    def _placed(self, T: Array) -> tuple[Array, Array]:
        return placed(T, self.centre[None])[..., 0, :], T[..., :3, :3] @ self.normal

    def _visible(self, G: Any) -> Flags:
        c, n = G
        lowest = c[..., 2] - self.radius * np.sqrt(np.maximum(1.0 - n[..., 2] ** 2, 0.0))
        return (lowest > 0.0) & (np.abs(inner(c, n)) > _THIN * np.sqrt(inner(c, c)))[..., 0]

    def _measure(self, G: Any) -> Array:
        c, n = G
        d, excess = inner(c, n)[..., None], inner(c, c)[..., None] - self.radius**2
        mixed = _outer(c, n) + _outer(n, c)
        return _ellipse_of(d**2 * np.eye(3) - d * mixed + excess * _outer(n, n))

    def _depth(self, G: Any) -> Array:
        c, n = G
        return n / inner(c, n)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Sphere(_Ellipse):
    """A sphere: x, y, n20, n02, n11 of the ellipse of its outline."""

    centre: Array
    radius: float

    def __post_init__(self) -> None:
        _set(self, centre=read_only(as_exact(self.centre, (3,), "centre")))
        _set(self, radius=as_number(self.radius, "radius", above=0.0))

    def _placed(self, T: Array) -> Array:
        return placed(T, self.centre[None])[..., 0, :]

    def _visible(self, G: Array) -> Flags:
        return G[..., 2] > self.radius

    def _measure(self, G: Array) -> Array:
        square = inner(G, G)[..., None] - self.radius**2
        return _ellipse_of(_outer(G, G) - square * np.eye(3))

    def _depth(self, G: Array) -> Array:
        return G / (inner(G, G) - self.radius**2)  # the outline is in the polar plane


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Cylinder(Feature):
    """An infinite cylinder: rho, theta of the two lines of its outline."""

    centre: Array
    axis: Array
    radius: float

    def __post_init__(self) -> None:
        centre = read_only(as_exact(self.centre, (3,), "centre"))
        _set(self, centre=centre, axis=unit(self.axis, "axis"))
        _set(self, radius=as_number(self.radius, "radius", above=0.0))

    def _periods(self) -> Array:
        return np.array([0.0, _TURN, 0.0, _TURN])

    def _placed(self, T: Array) -> tuple[Array, Array, Array]:
        """Centre, nearest point of the axis, normals of the planes of both outlines (..., 2, 3)."""
        p, u = placed(T, self.centre[None])[..., 0, :], T[..., :3, :3] @ self.axis
        nearest = p - inner(p, u) * u
        d = np.maximum(np.sqrt(inner(nearest, nearest)), 1e-300)
        sine = np.minimum(self.radius / d, 1.0)
        towards, beside = sine * nearest / d, np.sqrt(1.0 - sine**2) * np.cross(u, nearest / d)
        return p, nearest, np.stack((towards + beside, towards - beside), axis=-2)

    def _visible(self, G: Any) -> Flags:
        p, nearest, n = G
        outside = np.linalg.norm(nearest, axis=-1) > self.radius * (1.0 + _THIN)
        return (p[..., 2] > 0.0) & outside & (np.hypot(n[..., 0], n[..., 1]) > _THIN).all(axis=-1)

    def _measure(self, G: Any) -> Array:
        return _line_of(G[2])

    def _depth(self, G: Any) -> Array:
        _, nearest, n = G
        contact = nearest[..., None, :] - self.radius * n
        return contact / inner(contact, contact)

    _parallel, _rows, _outline = Lines._parallel, Lines._rows, Lines._outline


def _outer(a: Array, b: Array) -> Array:
    """Outer products of vectors in the last axis."""
    return a[..., :, None] * b[..., None, :]


def _flat(image: Array) -> Array:
    """Last two axes as one."""
    return image.reshape(*image.shape[:-2], image.shape[-2] * image.shape[-1])


def _line_of(normal: Array) -> Array:
    """Image lines of planes through the camera. Shapes: normal (..., n, 3) -> (..., 2 n)."""
    length = np.hypot(normal[..., 0], normal[..., 1])
    s = np.stack((-normal[..., 2] / length, np.arctan2(normal[..., 1], normal[..., 0])), axis=-1)
    return _flat(s)


def _ellipse_of(Q: Array) -> Array:
    """Centre and moments of the ellipse ``[x y 1] Q [x y 1]^T = 0``. Shapes: (..., 3, 3) -> (..., 5)."""
    determinant = Q[..., 0, 0] * Q[..., 1, 1] - Q[..., 0, 1] ** 2
    x = (Q[..., 0, 1] * Q[..., 1, 2] - Q[..., 1, 1] * Q[..., 0, 2]) / determinant
    y = (Q[..., 0, 1] * Q[..., 0, 2] - Q[..., 0, 0] * Q[..., 1, 2]) / determinant
    scale = -(Q[..., 0, 2] * x + Q[..., 1, 2] * y + Q[..., 2, 2]) / (4.0 * determinant)
    moments = scale * Q[..., 1, 1], scale * Q[..., 0, 0], -scale * Q[..., 0, 1]
    return np.stack((x, y, *moments), axis=-1)


def wrapped(error: Array, periods: Array) -> Array:
    """Differences of features with angles in their period. Shapes: (..., k), (k,) -> (..., k)."""
    whole = np.where(periods > 0.0, periods, 1.0)
    return np.where(periods > 0.0, error - whole * np.round(error / whole), error)


def brief(value: Any) -> str:
    """One line for a value with arrays: those of more than six numbers by their shapes."""
    parts = []
    for f in fields(value):
        if f.init:
            entry = getattr(value, f.name)
            long = isinstance(entry, np.ndarray) and entry.size > _SHOWN
            text = f"<{entry.shape} array>" if long else f"{entry!r}"
            parts.append(f"{f.name}={' '.join(text.split())}")
    return f"{type(value).__name__}({', '.join(parts)})"


def as_measurement(s: Any, feature: Feature, name: str) -> Array:
    """A measurement (..., k) of a feature."""
    array = as_floats(s, name)
    if array.ndim == 0 or array.shape[-1] != feature.size:
        raise ShapeError(
            f"{name}: expected {feature.size} numbers of {type(feature).__name__}, or a pose "
            f"(4, 4) of the object in the camera, got shape {array.shape}."
        )
    return array
