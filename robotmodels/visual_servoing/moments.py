"""Moments of complex shapes: of polygons and of sets of points."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from .._arrays import Array
from ..errors import InvalidValueError
from .features import Feature, Sight, inner, norm, placed, projected
from .matrices import point_rows
from .results import THIN, as_points

_COMPONENTS = (*("area", "x", "y", "n20", "n02", "n11"), *("alpha", "xn", "yn", "an", "c_x", "c_y"))
_FLAT = 1e-6  # of the size: heights above the plane of a polygon, and areas
_STEP = 1e-30  # of the complex step, so small that its square vanishes
_NODES = np.array(((1.0, 1.0, 1.0), (1.8, 0.6, 0.6), (0.6, 1.8, 0.6), (0.6, 0.6, 1.8))) / 3.0
_WEIGHTS = np.array((-27.0, 25.0, 25.0, 25.0)) / 48.0  # exact integrals of cubics on a triangle


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Moments(Feature):
    """Moments of the image of a planar polygon, or of a set of points.

    ``area`` a; centre of gravity ``x``, ``y``; ``n20``, ``n02``, ``n11``: centred moments mu
    divided by the area; ``alpha``: orientation, modulo pi. With the scale c, the root of the
    object's own area: ``an = c / sqrt(a)``, the depth of an object parallel to the image, and
    ``xn = an x``, ``yn = an y``. Skewness in x and y, zero for centrally symmetric images:
    ``c_x = sqrt(a) (mu30 + mu12) / (mu20 + mu02)^(3/2)`` and ``c_y`` with mu03 + mu21; they keep
    their values when the image is shifted or scaled, and turn with it as a vector. Sums over k
    points have the factor sqrt(k) instead of sqrt(a). Interaction matrices follow from those of
    the corners or points by the chain rule.

    Parameters
    ----------
    polygon : array_like, shape (k, 3), optional
        Corners of a planar region in order, in the frame of the object, m; its outline does not
        touch itself.
    components : sequence of str
        Which, in this order. ``alpha`` does not exist without orientation, as of a square.
    points : array_like, shape (k, 3), optional
        Instead of a polygon: moments are sums over points, which need not be coplanar. Their
        ``area`` is mu20 + mu02, ``c`` the root of the sum of the squared distances from their
        mean, and n20, n02, n11 are divided by their number k.

    References
    ----------
    Book section 6.2.4.3; F. Chaumette, "Image moments", IEEE Trans. Robotics 20(4), 2004;
    O. Tahri and F. Chaumette, "Point-based and region-based image moments for visual servoing of
    planar objects", IEEE Trans. Robotics 21(6), 2005.

    Examples
    --------
    >>> from robotmodels.se3 import translation
    >>> plate = [[-0.2, -0.1, 0], [0.2, -0.1, 0], [0.2, 0.1, 0], [-0.2, 0.1, 0]]
    >>> Moments(plate, components=("x", "n20", "an")).measure(translation(0.1, 0.0, 2.0)).round(4)
    array([0.05  , 0.0033, 2.    ])
    """

    polygon: Array | None = None
    components: tuple[str, ...] = _COMPONENTS
    points: Array | None = None

    def __post_init__(self) -> None:
        if (self.polygon is None) == (self.points is None):
            raise InvalidValueError("Moments: expected a polygon or points=, one of the two.")
        name, least = ("points", 2) if self.polygon is None else ("polygon", 3)
        corners = as_points(getattr(self, name), name, least)
        given: Any = self.components
        one = isinstance(given, str) or not isinstance(given, Iterable)
        words = (given,) if one else tuple(given)
        if not words or sum(name in words for name in _COMPONENTS) < len(words):
            raise InvalidValueError(
                f"components: expected some of {', '.join(_COMPONENTS)}, each once, got {words}."
            )
        if self.polygon is not None:
            _check_polygon(corners)
        elif not np.ptp(corners, axis=0).any():
            raise InvalidValueError("points: expected points that do not all coincide.")
        self._set(name, corners)
        self._set("components", words)

    @property
    def _corners(self) -> Any:
        return self.points if self.polygon is None else self.polygon

    def _periods(self) -> Array:
        return np.array([np.pi if name == "alpha" else 0.0 for name in self.components])

    def _see(self, T: Array) -> Sight:
        image, Z, exists = projected(T, self._corners)
        if self.points is None:
            n, corner = T[..., :3, :3] @ _axes(self._corners)[2], placed(T, self._corners[0])
            exists &= (np.abs(inner(n, corner)) > _FLAT * norm(corner))[..., 0]  # not edge-on
        return Sight(exists, self._of(image[..., 0], image[..., 1]).real, Z, image)

    def _rows(self, s: Any, depth: Any, image: Any = None) -> Array:
        if image is None:
            raise InvalidValueError(
                "measurement: the interaction matrix of moments needs moments of higher order than "
                'those measured; give the pose of the object, or interaction="desired" to the task.'
            )
        x, y = image[..., 0], image[..., 1]
        dx, dy = 1j * _STEP * np.moveaxis(point_rows(x, y, 1.0 / depth), (-2, -1), (0, 1))
        return np.moveaxis(self._of(x + dx, y + dy).imag / _STEP, 0, -1)

    def _of(self, x: Array, y: Array) -> Array:
        """Components of points or corners, complex ones for derivatives. Shapes: -> (..., k)."""
        weight, own = np.ones(x.shape), ((self._corners - self._corners.mean(axis=0)) ** 2).sum()
        if self.points is None:  # triangles of two corners and the mean, with cubic quadratures
            own = _area(self._corners)
            corners = [np.stack((z, np.roll(z, -1, axis=-1))) for z in (x, y)]
            (x0, u), (y0, v) = (
                (z.mean(axis=-1, keepdims=True), pair - z.mean(axis=-1, keepdims=True))
                for z, pair in zip((x, y), corners, strict=True)
            )
            areas = 0.5 * (u[0] * v[1] - u[1] * v[0])
            areas = areas * np.sign(areas.sum(axis=-1).real)[..., None]  # corners in either sense
            x, y = (
                np.concatenate([z0 + b * d[0] + c * d[1] for _, b, c in _NODES], axis=-1)
                for z0, d in ((x0, u), (y0, v))
            )
            weight = np.concatenate([w * areas for w in _WEIGHTS], axis=-1)
        whole = weight.sum(axis=-1)
        x0, y0 = (weight * x).sum(axis=-1) / whole, (weight * y).sum(axis=-1) / whole
        dx, dy = x - x0[..., None], y - y0[..., None]
        mu20, mu02, mu11 = (
            (weight * a * b).sum(axis=-1) for a, b in ((dx, dx), (dy, dy), (dx, dy))
        )
        spread, squared = mu20 + mu02, weight * (dx * dx + dy * dy)
        area = whole if self.points is None else spread
        an, skewness = np.sqrt(own / area), np.sqrt(whole) * spread**-1.5
        found = {
            "area": area, "x": x0, "y": y0, "n20": mu20 / whole, "n02": mu02 / whole,
            "n11": mu11 / whole, "xn": an * x0, "yn": an * y0, "an": an,
            "c_x": skewness * (squared * dx).sum(axis=-1),
            "c_y": skewness * (squared * dy).sum(axis=-1),
        }  # fmt: skip
        if "alpha" in self.components:
            sine, cosine = 2.0 * mu11, mu20 - mu02
            square = sine.real**2 + cosine.real**2
            if (square <= (_FLAT * spread.real) ** 2).any():
                raise InvalidValueError(
                    "components: alpha does not exist for an image whose n20 and n02 are equal and "
                    "n11 is 0, such as a square; leave alpha out."
                )
            slope = (sine * np.conj(cosine)).imag / square
            found["alpha"] = 0.5 * (np.arctan2(sine.real, cosine.real) + 1j * slope)
        return np.stack([found[name] for name in self.components], axis=-1)


def _axes(corners: Array) -> Array:
    """Principal axes of points; of a planar polygon the last is normal. Shapes: -> (3, 3)."""
    return np.linalg.svd(corners - corners.mean(axis=0))[2]


def _area(corners: Array) -> float:
    shifted = corners - corners[0]
    return 0.5 * float(np.linalg.norm(np.cross(shifted, np.roll(shifted, -1, axis=0)).sum(axis=0)))


def _check_polygon(corners: Array) -> None:
    """Raise for polygons without area, that are not planar, or cross or touch themselves."""
    p = (corners - corners.mean(axis=0)) @ _axes(corners).T
    size = float(np.abs(p).max())
    if not _area(corners) > _FLAT * size**2:
        raise InvalidValueError("polygon: expected corners that enclose an area, which is zero.")
    if np.abs(p[:, 2]).max() > _FLAT * size:
        raise InvalidValueError("polygon: expected corners in one plane; points= need not be.")
    p = p[(np.abs(p - np.roll(p, -1, axis=0)) > THIN * size).any(axis=1), :2]  # repeated corners
    along, n = np.roll(p, -1, axis=0) - p, np.arange(len(p))
    lever = p - p[:, None]  # [e, j]: from the start of edge e to corner j
    side = along[:, None, 0] * lever[..., 1] - along[:, None, 1] * lever[..., 0]
    apart = side * np.roll(side, -1, axis=1) < -((_FLAT * size) ** 4)
    part = np.einsum("ejk,ek->ej", lever, along) / (along**2).sum(axis=1)[:, None]
    gap = np.linalg.norm(lever - np.clip(part, 0.0, 1.0)[..., None] * along[:, None], axis=2)
    gap[n, n] = gap[n, (n + 1) % len(p)] = np.inf
    if ((apart & apart.T) | (gap <= THIN * size)).any():
        raise InvalidValueError(
            "polygon: edges cross or touch each other; expected an outline that does not touch "
            "itself, its corners in order."
        )
