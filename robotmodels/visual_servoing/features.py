"""Features of an image: points, lines, segments, circles, spheres and cylinders."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import LARGEST, Array, as_floats
from ..errors import InvalidValueError, ShapeError
from ..se3 import as_pose
from .camera import Camera
from .matrices import interaction_ellipse, interaction_line, interaction_segment, point_rows
from .results import THIN, Checked

_TURN = 2.0 * np.pi


class Sight(NamedTuple):
    """Measurement of an object by a camera, and the data of its interaction matrix."""

    exists: Any  # whether the feature exists, bool (...)
    s: Array  # measurement (..., k)
    depth: Any = None  # depths, or planes (A, B, C, D), that the rows need
    image: Any = None  # points (..., m, 2) that have to be inside the image, None without any


class Feature(Checked):
    """A feature of an object: its measurement, and its interaction matrix.

    Objects are given in their own frame, metres. Errors of angles are taken modulo their period.

    Parameters
    ----------
    T_camera_object : array_like, shape (..., 4, 4)
        Of ``measure`` and ``interaction``: poses of the object in the camera.

    Returns
    -------
    ndarray, shape (..., k) or (..., k, 6)
        Measurement; interaction matrix for the twist [v; w] of the camera in its own axes. Objects
        without extent, or seen so that the feature does not exist, are refused.

    References
    ----------
    Book sections 6.2.4.1, 6.2.4.2 and 6.2.5.2; B. Espiau, F. Chaumette and P. Rives, "A new
    approach to visual servoing in robotics", IEEE Trans. Robotics and Automation 8(3), 1992.

    Examples
    --------
    >>> from robotmodels.se3 import translation
    >>> edge = Points([[-0.1, -0.1, 0], [0.1, -0.1, 0]])
    >>> edge.measure(translation(0, 0, 1.0)), edge.interaction(translation(0, 0, 1.0)).shape
    (array([-0.1, -0.1,  0.1, -0.1]), (4, 6))
    """

    __slots__ = ()
    depends_on_depth: ClassVar[bool] = True
    _period: ClassVar[tuple[float, ...]]  # of the components of one element, 0 for none
    _see: ClassVar[Callable[..., Sight]]  # sight at poses T, NaN where it does not exist
    _matrix: ClassVar[Callable[..., Array]]  # interaction matrix of one element

    def measure(self, T_camera_object: ArrayLike) -> Array:
        """Measurement s (..., k) of the object at poses."""
        return self._seen(T_camera_object).s

    def interaction(self, T_camera_object: ArrayLike) -> Array:
        """Interaction matrix L (..., k, 6) at poses, ``ds/dt = L [v; w]``."""
        return self._rows(*self._seen(T_camera_object)[1:])

    @property
    def size(self) -> int:
        """Number k of components."""
        return len(self._periods())

    def _periods(self) -> Array:
        elements = getattr(self, "object_points", getattr(self, "points", (0,)))
        return np.tile(self._period, len(elements))

    def _rows(self, s: Array, depth: Any, image: Any = None) -> Array:
        elements = s.reshape(*s.shape[:-1], s.shape[-1] // len(self._period), len(self._period))
        return type(self)._matrix(*np.moveaxis(elements, -1, 0), depth).reshape(*s.shape, 6)

    def _parallel(self, Z: float) -> float:
        return Z

    def _seen(self, T: Any) -> Sight:
        """Sight at checked poses, where the feature exists."""
        poses = as_pose(T, "T_camera_object")
        sight = sight_of(self, poses)
        exists = sight.exists & (np.abs(sight.s) < LARGEST).all(axis=-1)
        if not np.all(exists):
            row = f" (row {np.argwhere(~exists)[0].tolist()})" if poses.ndim > 2 else ""
            raise InvalidValueError(
                f"T_camera_object: the feature of {type(self).__name__} does not exist there{row}: "
                "expected the object in front of the plane of the camera, not seen edge-on, the "
                "camera not inside it; move the camera."
            )
        return sight

    def _in_image(self, camera: Camera, s: Array, image: Any) -> bool:
        return image is None or bool(camera.sees(image))


def sight_of(feature: Feature, T: Array) -> Sight:
    """Sight of an object that may be behind the camera."""
    with np.errstate(all="ignore"):
        return feature._see(T)


def placed(T: Array, points: Array) -> Array:
    """Points of the object in the camera. Shapes: points (m, 3) or (3,)."""
    X = points @ np.swapaxes(T[..., :3, :3], -1, -2)
    return X + (T[..., :3, 3] if points.ndim == 1 else T[..., None, :3, 3])


def projected(T: Array, points: Array) -> tuple[Array, Array, Any]:
    """Image (..., m, 2) of points, their depths, and whether all are in front of the camera."""
    X = placed(T, points)
    Z = X[..., 2]
    return X[..., :2] / Z[..., None], Z, (Z > 0.0).all(axis=-1)


def inner(a: Array, b: Array) -> Array:
    """Scalar products of vectors in the last axis, which is kept."""
    return (a * b).sum(axis=-1, keepdims=True)


def norm(a: Array) -> Array:
    """Lengths of vectors in the last axis, which is kept."""
    return np.sqrt(inner(a, a))


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Points(Feature):
    """Image points: x, y of each of ``object_points (k, 3)``."""

    object_points: Array
    _period = (0.0, 0.0)

    def _see(self, T: Array) -> Sight:
        image, Z, exists = projected(T, self.object_points)
        return Sight(exists, _flat(image), Z, image)

    def _in_image(self, camera: Camera, s: Array, image: Any) -> bool:
        return bool(camera.sees(s.reshape(-1, 2)))

    def _rows(self, s: Array, depth: Any, image: Any = None) -> Array:
        return point_rows(s[..., 0::2], s[..., 1::2], 1.0 / depth).reshape(*s.shape, 6)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Lines(Feature):
    """Straight lines through pairs of ``points (k, 2, 3)``: rho, theta of each.

    The normal at theta follows the direction from the first point to the second, so that
    (rho, theta) and (-rho, theta + pi) are two lines; theta itself jumps at pi, errors do not.
    """

    points: Array
    _period = (0.0, _TURN)
    _matrix = interaction_line

    def _see(self, T: Array) -> Sight:
        X = placed(T, self.points.reshape(-1, 3))
        sight = _sight_of_lines(X[..., 0::2, :], X[..., 1::2, :] - X[..., 0::2, :])
        return sight._replace(exists=sight.exists & (X[..., 2] > 0.0).all(axis=-1))

    def _in_image(self, camera: Camera, s: Array, image: Any) -> bool:
        ends = camera.normalise((0.0 * camera.size, camera.size))
        x, y = np.repeat(ends[:, 0], 2), np.tile(ends[:, 1], 2)
        rho, theta = s[0::2, None], s[1::2, None]
        side = x * np.cos(theta) + y * np.sin(theta) - rho  # of the corners of the image
        return bool(((side.min(axis=1) <= 0.0) & (side.max(axis=1) >= 0.0)).all())


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Segments(Feature):
    """Segments between pairs of ``points (k, 2, 3)``: middle x, y, length, alpha of each."""

    points: Array
    _period = (0.0, 0.0, 0.0, _TURN)
    _matrix = interaction_segment

    def _see(self, T: Array) -> Sight:
        image, Z, exists = projected(T, self.points.reshape(-1, 3))
        p, q = image[..., 0::2, :], image[..., 1::2, :]
        dx, dy = np.moveaxis(q - p, -1, 0)
        polar = np.stack((np.hypot(dx, dy), np.arctan2(dy, dx)), axis=-1)
        s = _flat(np.concatenate((0.5 * (p + q), polar), axis=-1))
        return Sight(exists, s, Z.reshape(*Z.shape[:-1], len(self.points), 2), image)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Circle(Feature):
    """A circle: x, y, n20, n02, n11 of the ellipse of its image, of moments divided by the area."""

    centre: Array
    normal: Array
    radius: float
    _period = (0.0,) * 5
    _matrix = interaction_ellipse

    def _see(self, T: Array) -> Sight:
        return _sight_of_circle(placed(T, self.centre), T[..., :3, :3] @ self.normal, self.radius)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Sphere(Feature):
    """A sphere: x, y, n20, n02, n11 of the ellipse of its outline."""

    centre: Array
    radius: float
    _period = (0.0,) * 5
    _matrix = interaction_ellipse

    def _see(self, T: Array) -> Sight:
        centre = placed(T, self.centre)
        return self._outline(centre)._replace(depth=centre[..., 2])

    def _outline(self, centre: Array) -> Sight:
        """Sight of the circle that is the outline of the sphere with this centre."""
        part = 1.0 - self.radius**2 / inner(centre, centre)
        return _sight_of_circle(part * centre, centre / norm(centre), self.radius * np.sqrt(part))

    def _parallel(self, Z: float) -> float:
        if not self.radius < Z:
            raise InvalidValueError(
                f"depth: expected more than the sphere's radius, {self.radius:g} m, got {Z:g} m."
            )
        return Z

    def _rows(self, s: Array, depth: Any, image: Any = None) -> Array:
        Z = np.broadcast_to(depth, s.shape[:-1])[..., None]
        centre = np.concatenate((s[..., :2] * (Z - self.radius**2 / Z), Z), axis=-1)
        seen = self._outline(centre)  # so that the matrix has rank 3 at any depth
        return Feature._rows(self, seen.s, seen.depth)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Cylinder(Feature):
    """An infinite cylinder: rho, theta of the two lines of its outline."""

    centre: Array
    axis: Array
    radius: float
    _period = (0.0, _TURN)
    _matrix = interaction_line

    def _see(self, T: Array) -> Sight:
        p, u = placed(T, self.centre), T[..., :3, :3] @ self.axis
        nearest = p - inner(p, u) * u
        sine = np.minimum(self.radius / norm(nearest), 1.0)
        towards = nearest / norm(nearest)
        beside = np.sqrt(1.0 - sine**2) * np.cross(u, towards)
        n = np.stack((sine * towards + beside, sine * towards - beside), axis=-2)
        contact = nearest[..., None, :] - self.radius * n
        sight = _sight_of_lines(contact, np.stack((-u, u), axis=-2))
        ahead = (p[..., 2] > 0.0) | (contact[..., 2] > 0.0).all(axis=-1)
        return sight._replace(exists=sight.exists & ahead & (sine < 1.0 - THIN)[..., 0])

    def _periods(self) -> Array:
        return np.tile(self._period, 2)

    _in_image = Lines._in_image


def _flat(image: Array) -> Array:
    """Last two axes as one."""
    return image.reshape(*image.shape[:-2], image.shape[-2] * image.shape[-1])


def _sight_of_lines(p: Array, along: Array) -> Sight:
    """Sight of the image lines of lines in space through points p. Shapes: (..., n, 3)."""
    normal = np.cross(p, along)
    x, y, z = np.moveaxis(normal, -1, 0)
    size = np.hypot(x, y)
    s = _flat(np.stack((-z / size, np.arctan2(y, x)), axis=-1))
    foot = p - inner(p, along) / inner(along, along) * along
    plane = np.concatenate((foot, -inner(foot, foot)), axis=-1)
    return Sight((size > THIN * (norm(p) * norm(along))[..., 0]).all(axis=-1), s, plane)


def _sight_of_circle(c: Array, n: Array, radius: Any) -> Sight:
    """Sight of the ellipse that is the image of a circle, from its dual conic.

    The conic is ``radius^2 N - c c^T`` with ``N = I - n n^T``.
    """
    N, square = np.eye(3) - n[..., :, None] * n[..., None, :], radius**2 * np.ones_like(c[..., :1])
    x, z, w, tilt = c[..., :2], c[..., 2:], N[..., :2, 2], N[..., 2, 2:]
    size = z * z - square * tilt
    i, j = (0, 1, 0), (0, 1, 1)  # n20, n02, n11
    flat = z * z * N[..., i, j] + tilt * x[..., i] * x[..., j]
    flat -= z * (w[..., i] * x[..., j] + w[..., j] * x[..., i])
    spread = square * (w[..., i] * w[..., j] - tilt * N[..., i, j]) + flat
    spread *= 0.25 * square / size**2
    s = np.concatenate(((z * x - square * w) / size, spread), axis=-1)
    d = inner(c, n)
    exists = ((z > 0.0) & (size > 0.0) & (np.abs(d) > THIN * norm(c)))[..., 0]
    reach, plane = 2.0 * np.sqrt(s[..., 2:4]), np.concatenate((n, -d), axis=-1)[..., None, :]
    return Sight(exists, s, plane, np.stack((s[..., :2] - reach, s[..., :2] + reach), axis=-2))


def as_sensed(given: Any, feature: Feature, name: str) -> tuple[Array, bool]:
    """Checked measurements (..., k) or poses (..., 4, 4), and whether they are poses."""
    array = as_floats(getattr(given, "homogeneous", given), name)
    if array.shape == (4, 4) and _is_exact(array):
        return array, True
    if array.shape[-2:] == (4, 4):
        four = array.ndim == 2 and feature.size == 4  # may be four measurements
        if not four or np.array_equal(array[3], (0.0, 0.0, 0.0, 1.0)):
            return as_pose(array, name), True
    if array.ndim == 0 or array.shape[-1] != feature.size:
        raise ShapeError(
            f"{name}: expected {feature.size} numbers of {type(feature).__name__}, or a pose "
            f"(4, 4) of the object in the camera, got shape {array.shape}."
        )
    return array, False


def _is_exact(T: Array) -> bool:
    """Whether a matrix is a pose to rounding: a quick answer for control loops."""
    (a, b, c, _), (d, e, f, _), (g, h, i, _), last = T.tolist()
    off = (
        *(a * a + b * b + c * c - 1.0, d * d + e * e + f * f - 1.0, a * d + b * e + c * f),
        *(b * f - c * e - g, c * d - a * f - h, a * e - b * d - i),
    )
    return max(off) < 1e-12 and min(off) > -1e-12 and last == [0.0, 0.0, 0.0, 1.0]
