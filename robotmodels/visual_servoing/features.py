"""Features of an image: what all of them have, and points, lines and segments."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, Value, as_core, as_exact, as_floats, as_number, read_only
from ..errors import InvalidValueError, ShapeError
from ..se3 import as_pose
from .camera import Camera
from .matrices import interaction_line, interaction_segment, point_rows
from .results import brief

THIN = 1e-9  # relative: lengths, areas and angles below are zero
_TURN = 2.0 * np.pi


class Sight(NamedTuple):
    """An object as a camera sees it."""

    exists: Any
    """Whether the feature exists, bool (...)."""
    s: Array
    """Measurement (..., k)."""
    depth: Any
    """Depths, or planes (A, B, C, D), that the rows need."""
    image: Any = None
    """Points (..., m, 2) that have to be inside the image, None where there are none."""


class Feature(Value):
    """A feature of an object: its measurement, and its interaction matrix.

    Objects are given in their own frame, metres; image coordinates are normalised. Errors of
    angles are taken modulo their period.

    Parameters
    ----------
    T : array_like, shape (..., 4, 4)
        Of ``measure`` and ``interaction``: poses of the object in the camera.

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
    Seed book sections 6.2.4.1, 6.2.4.2 and 6.2.5.2 to 6.2.5.4; B. Espiau, F. Chaumette and
    P. Rives, "A new approach to visual servoing in robotics", IEEE Trans. Robotics and Automation
    8(3), 1992.

    Examples
    --------
    >>> from robotmodels.se3 import translation
    >>> square = Points([[-0.1, -0.1, 0], [0.1, -0.1, 0], [0.1, 0.1, 0], [-0.1, 0.1, 0]])
    >>> square.measure(translation(0, 0, 1.0))
    array([-0.1, -0.1,  0.1, -0.1,  0.1,  0.1, -0.1,  0.1])
    >>> square.interaction(translation(0, 0, 1.0)).shape
    (8, 6)
    """

    __slots__ = ()
    depends_on_depth: ClassVar[bool] = True
    _period: ClassVar[tuple[float, ...]] = (0.0,)
    """Periods of the components of one element, 0 where there is none."""

    _see: ClassVar[Callable[..., Sight]]  # (T): what is seen of the object
    _rows: ClassVar[Callable[..., Array]]  # (s, depth, image): interaction matrix (..., k, 6)

    def measure(self, T: ArrayLike) -> Array:
        """Measurement s (..., k) of the object at poses T."""
        return self._seen(T).s

    def interaction(self, T: ArrayLike) -> Array:
        """Interaction matrix L (..., k, 6) at poses T, ``ds/dt = L [v; w]``."""
        return self._rows(*self._seen(T)[1:])

    @property
    def size(self) -> int:
        """Number k of components."""
        return len(self._periods())

    def _periods(self) -> Array:
        """Period of each component. Shapes: -> (k,)."""
        objects = getattr(self, "object_points", getattr(self, "points", (0,)))
        return np.tile(self._period, len(objects))

    def _parallel(self, Z: float) -> Any:
        """Depth of an object parallel to the image."""
        return np.array((0.0, 0.0, 1.0, -Z))

    def _seen(self, T: Any) -> Sight:
        """Sight at checked poses, where the feature exists."""
        poses = as_pose(T)
        with np.errstate(all="ignore"):
            sight = self._see(poses)
        if not np.all(sight.exists):
            row = f" (row {np.argwhere(~sight.exists)[0].tolist()})" if poses.ndim > 2 else ""
            raise InvalidValueError(
                f"T: the feature of {type(self).__name__} does not exist there{row}: expected the "
                "object in front of the plane of the camera, not seen edge-on and without the "
                "camera inside; move the camera."
            )
        return sight

    def _in_image(self, camera: Camera, s: Array, image: Any) -> bool:
        """Whether a camera has a measurement (k,), of points (m, 2), inside its image."""
        return image is None or bool(camera.sees(image))

    def __repr__(self) -> str:
        return brief(self)


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
    # unit vectors stay as they are, so that copies are equal
    return read_only(array if abs(length - 1.0) < 4e-16 else array / length)


def _pairs(points: Any) -> Array:
    """Distinct pairs of points. Shapes: -> (n, 2, 3)."""
    pairs = as_core(points, (2, 3), "points")
    pairs = pairs[None] if pairs.ndim == 2 else pairs
    if pairs.ndim != 3 or not len(pairs):
        raise ShapeError(f"points: expected shape (k, 2, 3), k from 1, got {pairs.shape}.")
    lengths = np.linalg.norm(pairs[:, 1] - pairs[:, 0], axis=-1)
    if not (lengths > THIN * np.abs(pairs).max()).all():
        raise InvalidValueError("points: expected two different points on each line or segment.")
    return read_only(pairs)


def set_fields(feature: Any, **fields: Any) -> None:
    """Checked centre, directions and radius of a solid, or other fields."""
    for name, value in fields.items():
        if name in ("normal", "axis"):
            value = unit(value, name)
        elif name == "centre":
            value = read_only(as_exact(value, (3,), name))
        elif name == "radius":
            value = as_number(value, name, above=0.0)
        object.__setattr__(feature, name, value)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Points(Feature):
    """Image points: x, y of each of ``object_points (k, 3)``."""

    object_points: Array
    _period = (0.0, 0.0)

    def __post_init__(self) -> None:
        points = as_core(self.object_points, (3,), "object_points")
        points = points[None] if points.ndim == 1 else points
        if points.ndim != 2 or not len(points):
            raise ShapeError(f"object_points: expected (k, 3), k from 1, got {points.shape}.")
        set_fields(self, object_points=read_only(points))

    def _see(self, T: Array) -> Sight:
        X = placed(T, self.object_points)
        image = X[..., :2] / X[..., 2:]
        return Sight((X[..., 2] > 0.0).all(axis=-1), _flat(image), X[..., 2], image)

    def _parallel(self, Z: float) -> Array:
        return np.full(len(self.object_points), Z)

    def _in_image(self, camera: Camera, s: Array, image: Any) -> bool:
        return bool(camera.sees(s.reshape(-1, 2)))

    def _rows(self, s: Array, depth: Array, image: Any = None) -> Array:
        return point_rows(s[..., 0::2], s[..., 1::2], 1.0 / depth).reshape(*s.shape, 6)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Lines(Feature):
    """Straight lines through pairs of ``points (k, 2, 3)``: rho, theta of each.

    The normal at theta follows the direction from the first point to the second, so that
    (rho, theta) and (-rho, theta + pi) are two lines; theta itself jumps at pi, errors do not.
    """

    points: Array
    _period = (0.0, _TURN)

    def __post_init__(self) -> None:
        set_fields(self, points=_pairs(self.points))

    def _see(self, T: Array) -> Sight:
        X = placed(T, self.points.reshape(-1, 3))
        p, along = X[..., 0::2, :], X[..., 1::2, :] - X[..., 0::2, :]
        normal = np.cross(p, along)
        size = np.hypot(normal[..., 0], normal[..., 1])
        exists = (X[..., 2] > 0.0).all(axis=-1) & (
            size > THIN * (norm(p) * norm(along))[..., 0]
        ).all(axis=-1)
        plane = plane_at(p - inner(p, along) / inner(along, along) * along)
        return Sight(exists, *lines_of(normal, plane))

    def _in_image(self, camera: Camera, s: Array, image: Any) -> bool:
        ends = camera.normalise((0.0 * camera.size, camera.size))
        x, y = np.repeat(ends[:, 0], 2), np.tile(ends[:, 1], 2)
        rho, theta = s[0::2, None], s[1::2, None]
        side = x * np.cos(theta) + y * np.sin(theta) - rho  # of the corners of the image
        return bool(((side.min(axis=1) <= 0.0) & (side.max(axis=1) >= 0.0)).all())

    def _rows(self, s: Array, depth: Array, image: Any = None) -> Array:
        return _flat_rows(interaction_line(s[..., 0::2], s[..., 1::2], depth))


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Segments(Feature):
    """Segments between pairs of ``points (k, 2, 3)``: middle x, y, length, alpha of each."""

    points: Array
    _period = (0.0, 0.0, 0.0, _TURN)

    def __post_init__(self) -> None:
        set_fields(self, points=_pairs(self.points))

    def _see(self, T: Array) -> Sight:
        X = placed(T, self.points.reshape(-1, 3))
        image, depth = (
            X[..., :2] / X[..., 2:],
            np.stack((X[..., 0::2, 2], X[..., 1::2, 2]), axis=-1),
        )
        p, q = image[..., 0::2, :], image[..., 1::2, :]
        (x, y), (dx, dy) = np.moveaxis(0.5 * (p + q), -1, 0), np.moveaxis(q - p, -1, 0)
        s = _flat(np.stack((x, y, np.hypot(dx, dy), np.arctan2(dy, dx)), axis=-1))
        return Sight((X[..., 2] > 0.0).all(axis=-1), s, depth, image)

    def _parallel(self, Z: float) -> Array:
        return np.full((len(self.points), 2), Z)

    def _rows(self, s: Array, depth: Array, image: Any = None) -> Array:
        x, y, length, alpha = (s[..., k::4] for k in range(4))
        return _flat_rows(interaction_segment(x, y, length, alpha, depth))


def norm(a: Array) -> Array:
    """Lengths of vectors in the last axis, which is kept."""
    return np.sqrt(inner(a, a))


def plane_at(point: Array) -> Array:
    """Planes through points, normal to their vectors. Shapes: (..., 3) -> (..., 4)."""
    return np.concatenate((point, -inner(point, point)), axis=-1)


def _flat(image: Array) -> Array:
    """Last two axes as one."""
    return image.reshape(*image.shape[:-2], image.shape[-2] * image.shape[-1])


def _flat_rows(L: Array) -> Array:
    """Rows of all elements below each other. Shapes: (..., n, m, 6) -> (..., n m, 6)."""
    return L.reshape(*L.shape[:-3], L.shape[-3] * L.shape[-2], 6)


def lines_of(normal: Array, plane: Array) -> tuple[Array, Array]:
    """Image lines (..., 2 n) of planes through the camera, and their depths."""
    x, y, z = np.moveaxis(normal, -1, 0)
    rho, theta = -z / np.hypot(x, y), np.arctan2(y, x)
    return _flat(np.stack((rho, theta), axis=-1)), plane


def wrapped(error: Array, periods: Array) -> Array:
    """Differences of features with angles in their period. Shapes: (..., k), (k,) -> (..., k)."""
    whole = np.where(periods > 0.0, periods, 1.0)
    return np.where(periods > 0.0, error - whole * np.round(error / whole), error)


def as_measurement(s: Any, feature: Feature, name: str) -> Array:
    """A measurement (..., k) of a feature."""
    array = as_floats(s, name)
    if array.ndim == 0 or array.shape[-1] != feature.size:
        raise ShapeError(
            f"{name}: expected {feature.size} numbers of {type(feature).__name__}, or a pose "
            f"(4, 4) of the object in the camera, got shape {array.shape}."
        )
    return array
