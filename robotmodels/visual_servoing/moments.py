"""Moments of complex shapes: polygons, by Green's theorem, and sets of points."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import product
from math import comb
from typing import Any

import numpy as np

from .._arrays import Array, as_core, read_only
from ..errors import InvalidValueError, ShapeError
from .features import THIN, Feature, Sight, inner, norm, placed
from .matrices import interaction_moment, point_rows

_COMPONENTS = (
    *("area", "x", "y", "n20", "n02", "n11"),
    *("alpha", "xn", "yn", "an", "c_x", "c_y"),
)
_ORDERS = [(i, j) for i in range(4) for j in range(4 - i)]
_FLAT = 1e-6  # of the size: heights above the plane of a polygon, and areas


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Moments(Feature):
    """Moments of the image of a planar polygon, or of a set of points.

    ``area`` a; centre of gravity ``x``, ``y``; ``n20``, ``n02``, ``n11``: centred moments mu
    divided by the area; ``alpha``: orientation, modulo pi. With the scale c, the root of the
    object's own area: ``an = c / sqrt(a)``, the depth of an object parallel to the image, and
    ``xn = an x``, ``yn = an y``. Skewness in x and y, zero for centrally symmetric images:
    ``c_x = sqrt(a) (mu30 + mu12) / (mu20 + mu02)^(3/2)`` and ``c_y`` with mu03 + mu21; they keep
    their values when the image is shifted or scaled, and turn with it as a vector. Sums over k
    points have the factor sqrt(k) instead of sqrt(a).

    Parameters
    ----------
    polygon : array_like, shape (k, 3), optional
        Corners of a planar region in order, in the frame of the object, m.
    components : sequence of str
        Which, in this order.
    points : array_like, shape (k, 3), optional
        Instead of a polygon: moments are sums over points, which need not be coplanar. Their
        ``area`` is mu20 + mu02, ``c`` the root of the sum of the squared distances from their
        mean, and n20, n02, n11 are divided by their number k.

    Raises
    ------
    ShapeError, InvalidValueError
        A polygon with fewer than three corners, without area, not planar or that crosses or
        touches itself; unknown components; ``alpha`` of an image without
        orientation, such as a square.

    References
    ----------
    Seed book section 6.2.4.3; F. Chaumette, "Image moments", IEEE Trans. Robotics 20(4), 2004;
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
        corners = as_core(getattr(self, name), (3,), name)
        if corners.ndim != 2 or len(corners) < least:
            raise ShapeError(f"{name}: expected shape (k, 3), k from {least}, got {corners.shape}.")
        words: Any = self.components
        words = (
            (words,) if isinstance(words, str) or not isinstance(words, Iterable) else tuple(words)
        )
        known = [name for name in words if isinstance(name, str) and name in _COMPONENTS]
        if not words or len(set(known)) < len(words):
            raise InvalidValueError(
                f"components: expected some of {', '.join(_COMPONENTS)}, each once, got {words}."
            )
        if self.polygon is not None:
            _check_polygon(corners)
        elif not np.ptp(corners, axis=0).any():
            raise InvalidValueError("points: expected points that do not all coincide.")
        object.__setattr__(self, name, read_only(corners))
        object.__setattr__(self, "components", words)

    @property
    def _corners(self) -> Any:
        return self.points if self.polygon is None else self.polygon

    def _periods(self) -> Array:
        return np.array([np.pi if name == "alpha" else 0.0 for name in self.components])

    def _see(self, T: Array) -> Sight:
        X = placed(T, self._corners)
        image, corner, depth = X[..., :2] / X[..., 2:], X[..., 0, :], X[..., 2]
        exists = (X[..., 2] > 0.0).all(axis=-1)
        if self.points is None:
            n = T[..., :3, :3] @ _axes(self._corners)[2]
            exists &= (np.abs(inner(n, corner)) > _FLAT * norm(corner))[..., 0]  # not edge-on
            depth = np.concatenate((n, -inner(n, corner)), axis=-1)
        m, _ = self._raw(image, None)
        if not exists.all():
            return Sight(exists, m[..., 0, 0, None] * np.full(self.size, np.nan), depth, image)
        return Sight(exists, self._of(m, np.zeros((*m.shape[:-2], 4, 4, 6)))[0], depth, image)

    def _parallel(self, Z: float) -> Array:
        return Feature._parallel(self, Z) if self.points is None else np.full(len(self.points), Z)

    def _rows(self, s: Any, depth: Any, image: Any = None) -> Array:
        if image is None:
            raise InvalidValueError(
                "measurement: the interaction matrix of moments needs moments of higher order than "
                'those measured; give the pose of the object, or interaction="desired" to the task.'
            )
        return self._of(*self._raw(image, depth))[1]

    def _raw(self, image: Array, depth: Any) -> tuple[Array, Any]:
        """Raw moments (..., 5, 5) and their rates (..., 4, 4, 6), up to orders 4 and 3."""
        x, y = image[..., 0], image[..., 1]
        if self.points is None:
            m = _polygon_moments(x, y)
            m = m * np.sign(m[..., :1, :1])  # of corners in either sense
            if depth is None:
                return m, None
            rates = np.zeros((*m.shape[:-2], 4, 4, 6))
            for i, j in _ORDERS:
                rates[..., i, j, :] = interaction_moment(m, i, j, depth)[..., 0, :]
            return m, rates
        p, q = (np.stack([z**k for k in range(5)], axis=-1) for z in (x, y))
        m = np.einsum("...ki,...kj->...ij", p, q)
        if depth is None:
            return m, None
        L = point_rows(x, y, 1.0 / depth)
        dp, dq = (
            np.concatenate((0.0 * z[..., :1], z[..., :3]), -1) * np.arange(4.0) for z in (p, q)
        )
        rates = np.einsum("...ki,...kj,...kr->...ijr", dp, q[..., :4], L[..., 0, :])
        return m, rates + np.einsum("...ki,...kj,...kr->...ijr", p[..., :4], dq, L[..., 1, :])

    def _of(self, raw: Array, rates: Array) -> tuple[Array, Array]:
        """Components (..., k) and their interaction matrix (..., k, 6) by the chain rule."""
        m = {(i, j): _Rate(raw[..., i, j], rates[..., i, j, :]) for i, j in _ORDERS}
        whole = m[0, 0]
        x, y = m[1, 0] / whole, m[0, 1] / whole
        mu20, mu02 = m[2, 0] - x * m[1, 0], m[0, 2] - y * m[0, 1]
        mu11 = m[1, 1] - x * m[0, 1]
        mu30 = m[3, 0] - x * m[2, 0] * 3.0 + x * x * m[1, 0] * 2.0
        mu03 = m[0, 3] - y * m[0, 2] * 3.0 + y * y * m[0, 1] * 2.0
        mu21 = m[2, 1] - x * m[1, 1] * 2.0 - y * m[2, 0] + x * x * m[0, 1] * 2.0
        mu12 = m[1, 2] - y * m[1, 1] * 2.0 - x * m[0, 2] + y * y * m[1, 0] * 2.0
        spread = mu20 + mu02
        area = whole if self.points is None else spread
        spread_3d = self._corners - self._corners.mean(axis=0)
        own = (spread_3d**2).sum() if self.points is not None else _area(self._corners)
        an = area**-0.5 * float(np.sqrt(own))
        skewness = whole**0.5 * spread**-1.5
        found = {
            "area": area, "x": x, "y": y, "n20": mu20 / whole, "n02": mu02 / whole,
            "n11": mu11 / whole, "xn": an * x, "yn": an * y, "an": an,
            "c_x": skewness * (mu30 + mu12), "c_y": skewness * (mu03 + mu21),
        }  # fmt: skip
        if "alpha" in self.components:
            found["alpha"] = _half_angle(mu11 * 2.0, mu20 - mu02, spread.value)
        parts = [found[name] for name in self.components]
        return np.stack([p.value for p in parts], -1), np.stack([p.rate for p in parts], -2)


class _Rate:
    """A number (...) and its row (..., 6) of the interaction matrix, with its rules."""

    def __init__(self, value: Array, rate: Array) -> None:
        self.value, self.rate = value, rate

    def __add__(self, other: _Rate) -> _Rate:
        return _Rate(self.value + other.value, self.rate + other.rate)

    def __sub__(self, other: _Rate) -> _Rate:
        return self + other * -1.0

    def __mul__(self, other: _Rate | float) -> _Rate:
        if not isinstance(other, _Rate):
            return _Rate(self.value * other, self.rate * other)
        rate = self.value[..., None] * other.rate + other.value[..., None] * self.rate
        return _Rate(self.value * other.value, rate)

    def __pow__(self, power: float) -> _Rate:
        slope = power * self.value ** (power - 1.0)
        return _Rate(self.value**power, slope[..., None] * self.rate)

    def __truediv__(self, other: _Rate) -> _Rate:
        return self * other**-1.0


def _half_angle(sine: _Rate, cosine: _Rate, spread: Array) -> _Rate:
    """Half the angle of a vector."""
    square = sine.value**2 + cosine.value**2
    if not (square > (_FLAT * spread) ** 2).all():
        raise InvalidValueError(
            "components: alpha does not exist for an image whose n20 and n02 are equal and n11 is "
            "0, such as a square; leave alpha out."
        )
    rate = cosine.value[..., None] * sine.rate - sine.value[..., None] * cosine.rate
    return _Rate(0.5 * np.arctan2(sine.value, cosine.value), 0.5 * rate / square[..., None])


def _polygon_moments(x: Array, y: Array) -> Array:
    """Raw moments up to order 4 of polygons. Shapes: x, y (..., k) -> (..., 5, 5)."""
    X, Y = np.roll(x, -1, axis=-1), np.roll(y, -1, axis=-1)
    (p0, p1), (q0, q1) = (
        [np.stack([z**k for k in range(5)]) for z in ends] for ends in ((x, X), (y, Y))
    )
    m = np.zeros((*x.shape[:-1], 5, 5))
    for p, q in product(range(5), range(5)):
        if p + q < 5:
            terms = sum(
                comb(k + n, n) * comb(p + q - k - n, q - n) * p1[k] * p0[p - k] * q1[n] * q0[q - n]
                for k, n in product(range(p + 1), range(q + 1))
            )
            factor = (p + q + 2) * (p + q + 1) * comb(p + q, p)
            m[..., p, q] = ((x * Y - X * y) * terms).sum(axis=-1) / factor
    return m


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
    x, y = p[:, 0], p[:, 1]
    X, Y = np.roll(x, -1), np.roll(y, -1)

    def side(u: Array, v: Array) -> Array:  # on which of each edge points (u, v) are
        return (X - x)[:, None] * (v - y[:, None]) - (Y - y)[:, None] * (u - x[:, None])

    apart = side(x, y) * side(X, Y) < -((_FLAT * size) ** 4)
    if (apart & apart.T).any():
        i, j = np.argwhere(apart & apart.T)[0]
        raise InvalidValueError(
            f"polygon: its edges {i} and {j} cross; expected the corners in order."
        )
    along, n = np.roll(p, -1, axis=0) - p, np.arange(len(p))
    part = np.einsum("ejk,ek->ej", p - p[:, None], along) / (along**2).sum(axis=1)[:, None]
    foot = p[:, None] + np.clip(part, 0.0, 1.0)[..., None] * along[:, None]
    gap = np.linalg.norm(p - foot, axis=2)  # of each edge and corner
    gap[n, n] = gap[n, (n + 1) % len(p)] = np.inf
    if gap.min() <= THIN * size:
        edge, corner = np.argwhere(gap <= THIN * size)[0]
        raise InvalidValueError(
            f"polygon: corner {corner} is on edge {edge}; expected an outline that does not touch "
            "itself."
        )
