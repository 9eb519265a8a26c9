"""Interaction matrices in closed form, for measured features: ``ds/dt = L [v; w]``.

The twist is that of the camera in its own axes, linear then angular; the object stands still.
Coordinates are normalised: x = X / Z, y = Y / Z. Arguments broadcast against each other.

Parameters
----------
x, y : array_like, shape (...)
    Normalised coordinates of a point or a centre of gravity.
Z : array_like, shape (...)
    Depths along the optical axis, m, above 0.
rho, theta : array_like, shape (...)
    Line ``x cos(theta) + y sin(theta) = rho``.
length, alpha : array_like, shape (...)
    Of a segment from its first point to its second, alpha in rad from the x axis.
n20, n02, n11 : array_like, shape (...)
    Centred moments of second order divided by the area; an ellipse with the semi-axis a along x
    has n20 = a^2 / 4.
plane : array_like, shape (..., 4)
    Plane (A, B, C, D) of the object, ``A X + B Y + C Z + D = 0`` in the camera, D not 0, so
    ``1 / Z = -(A x + B y + C) / D``. ``(0, 0, 1, -Z)`` is parallel to the image.
theta_u : array_like, shape (..., 3)
    Rotation vector of the current camera in the axes of the desired one, rad.
point, normal : array_like, shape (..., 3)
    Point and unit normal in the camera, m.

Returns
-------
ndarray, shape (..., k, 6)
    Rows in the order of the arguments.

Raises
------
ShapeError, InvalidValueError
    Arguments that do not fit each other, NaN; a depth that is not positive; a plane through the
    centre of the camera.

References
----------
Seed book sections 6.2.4.1 to 6.2.4.3 and 6.2.5.2 to 6.2.5.4; F. Chaumette, "Image moments: a
general and useful set of features for visual servoing", IEEE Trans. Robotics 20(4), 2004.

Examples
--------
>>> interaction_point(0.1, 0.2, 2.0).round(3)
array([[-0.5 ,  0.  ,  0.05,  0.02, -1.01,  0.2 ],
       [ 0.  , -0.5 ,  0.1 ,  1.04, -0.02, -0.1 ]])
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_core, as_floats
from ..errors import InvalidValueError, ShapeError
from ..se3 import skew


def interaction_point(x: ArrayLike, y: ArrayLike, Z: ArrayLike) -> Array:
    """Interaction matrix of an image point: x, y."""
    x, y, Z = _together(x=x, y=y, Z=Z)
    return point_rows(x, y, 1.0 / _depth(Z))


def interaction_line(rho: ArrayLike, theta: ArrayLike, plane: ArrayLike) -> Array:
    """Interaction matrix of a straight line: rho, theta."""
    a, b, c = _inverse_depth(plane)
    rho, theta, a, b, c = _together(rho=rho, theta=theta, A=a, B=b, C=c)
    return line_rows(rho, theta, a, b, c)


def interaction_segment(
    x: ArrayLike, y: ArrayLike, length: ArrayLike, alpha: ArrayLike, Z: ArrayLike
) -> Array:
    """Interaction matrix of a segment: x, y of its middle, length, alpha; Z (..., 2) of its ends."""
    x, y, length, alpha = _together(x=x, y=y, length=length, alpha=alpha)
    if not (length > 0.0).all():
        raise InvalidValueError(f"length: expected numbers above 0, got {length.min():.4g}.")
    return segment_rows(x, y, length, alpha, 1.0 / _depth(as_core(Z, (2,), "Z")))


def interaction_ellipse(
    x: ArrayLike, y: ArrayLike, n20: ArrayLike, n02: ArrayLike, n11: ArrayLike, plane: ArrayLike
) -> Array:
    """Interaction matrix of an ellipse, the image of a circle or a sphere: x, y, n20, n02, n11."""
    a, b, c = _inverse_depth(plane)
    return ellipse_rows(*_together(x=x, y=y, n20=n20, n02=n02, n11=n11, A=a, B=b, C=c))


def interaction_moment(moments: ArrayLike, i: int, j: int, plane: ArrayLike) -> Array:
    """Interaction matrix (..., 1, 6) of m_ij of a region, of its raw moments (..., K, K).

    Entry [p, q] is the integral of ``x^p y^q``; those up to the order i + j + 1 are used.
    """
    m = as_floats(moments, "moments")
    if min(i, j) < 0 or m.ndim < 2 or min(m.shape[-2:]) < i + j + 2:
        raise ShapeError(
            f"moments: expected shape (..., K, K) with K from i + j + 2 = {i + j + 2} and i, j not "
            f"negative, got {m.shape}."
        )
    return moment_rows(m, i, j, *_inverse_depth(plane))[..., None, :]


def interaction_theta_u(theta_u: ArrayLike) -> Array:
    """Interaction matrix of the rotation vector of the current camera in the desired one."""
    w = as_core(theta_u, (3,), "theta_u")
    L = np.zeros((*w.shape[:-1], 3, 6))
    half = 0.5 * np.linalg.norm(w, axis=-1)[..., None, None]
    small = half < 0.02
    safe = np.where(small, 1.0, half)
    # (1 - h cot h) / (2 h)^2, by its series near 0
    factor = np.where(
        small,
        1.0 / 12.0 + half**2 / 180.0 + half**4 / 1890.0,
        (1.0 - safe / np.tan(safe)) / (4.0 * safe**2),
    )
    S = skew(w)
    L[..., 3:] = np.eye(3) + 0.5 * S + factor * (S @ S)
    return L


def interaction_point_3d(point: ArrayLike) -> Array:
    """Interaction matrix of a point in space: X, Y, Z."""
    X = as_core(point, (3,), "point")
    L = np.zeros((*X.shape[:-1], 3, 6))
    L[..., :3] = -np.eye(3)
    L[..., 3:] = skew(X)
    return L


def interaction_plane_3d(normal: ArrayLike) -> Array:
    """Interaction matrix of a plane in space, ``normal . X = distance``: normal, distance."""
    n = as_core(normal, (3,), "normal")
    L = np.zeros((*n.shape[:-1], 4, 6))
    L[..., :3, 3:] = skew(n)
    L[..., 3, :3] = -n
    return L


# ------------------------------------------------- the formulas; 1 / Z = w = a x + b y + c


def point_rows(x: Array, y: Array, w: Array) -> Array:
    """Rows of points. Shapes: x, y, w (...) -> (..., 2, 6)."""
    L = np.zeros((*x.shape, 2, 6))
    xy = x * y
    L[..., 0, 0] = L[..., 1, 1] = -w
    L[..., 0, 2], L[..., 1, 2] = x * w, y * w
    L[..., 0, 3], L[..., 1, 4] = xy, -xy
    L[..., 0, 4], L[..., 1, 3] = -1.0 - x * x, 1.0 + y * y
    L[..., 0, 5], L[..., 1, 5] = y, -x
    return L


def line_rows(rho: Array, theta: Array, a: Array, b: Array, c: Array) -> Array:
    """Rows of lines. Shapes: all (...) -> (..., 2, 6)."""
    cos, sin = np.cos(theta), np.sin(theta)
    turn, shift = b * cos - a * sin, -(a * rho * cos + b * rho * sin + c)
    L = np.zeros((*rho.shape, 2, 6))
    for row, factor in ((0, shift), (1, turn)):
        L[..., row, 0], L[..., row, 1], L[..., row, 2] = (
            factor * cos,
            factor * sin,
            -factor * rho,
        )
    L[..., 0, 3], L[..., 0, 4] = (1.0 + rho**2) * sin, -(1.0 + rho**2) * cos
    L[..., 1, 3], L[..., 1, 4], L[..., 1, 5] = -rho * cos, -rho * sin, -1.0
    return L


def segment_rows(x: Array, y: Array, length: Array, alpha: Array, w: Array) -> Array:
    """Rows of segments, from those of their ends. Shapes: x ... (...), w (..., 2) -> (..., 4, 6)."""
    cos, sin = np.cos(alpha), np.sin(alpha)
    dx, dy = 0.5 * length * cos, 0.5 * length * sin
    first = point_rows(x - dx, y - dy, w[..., 0])
    last = point_rows(x + dx, y + dy, w[..., 1])
    L = np.empty((*x.shape, 4, 6))
    L[..., :2, :] = 0.5 * (first + last)
    along = last - first
    cos, sin = cos[..., None], sin[..., None]
    L[..., 2, :] = cos * along[..., 0, :] + sin * along[..., 1, :]
    L[..., 3, :] = (cos * along[..., 1, :] - sin * along[..., 0, :]) / length[..., None]
    return L


def ellipse_rows(
    x: Array, y: Array, n20: Array, n02: Array, n11: Array, a: Array, b: Array, c: Array
) -> Array:
    """Rows of ellipses, from the moments of a region of area 1. Shapes: all (...) -> (..., 5, 6)."""
    m = np.zeros((*x.shape, 4, 4))
    m[..., 0, 0] = 1.0
    m[..., 1, 0], m[..., 0, 1] = x, y
    m[..., 2, 0], m[..., 0, 2], m[..., 1, 1] = n20 + x * x, n02 + y * y, n11 + x * y
    m[..., 3, 0], m[..., 0, 3] = x * (x * x + 3.0 * n20), y * (y * y + 3.0 * n02)
    m[..., 2, 1] = y * (x * x + n20) + 2.0 * x * n11
    m[..., 1, 2] = x * (y * y + n02) + 2.0 * y * n11
    area = moment_rows(m, 0, 0, a, b, c)
    rates = {
        (i, j): moment_rows(m, i, j, a, b, c) - m[..., i, j, None] * area
        for i, j in ((1, 0), (0, 1), (2, 0), (0, 2), (1, 1))
    }
    dx, dy = rates[1, 0], rates[0, 1]
    x, y = x[..., None], y[..., None]
    second = (rates[2, 0] - 2.0 * x * dx, rates[0, 2] - 2.0 * y * dy, rates[1, 1] - x * dy - y * dx)
    return np.stack((dx, dy, *second), axis=-2)


def moment_rows(m: Array, i: int, j: int, a: Array, b: Array, c: Array) -> Array:
    """Row of the raw moment m_ij of a region. Shapes: m (..., K, K), a, b, c (...) -> (..., 6)."""
    here, right, up = m[..., i, j], m[..., i + 1, j], m[..., i, j + 1]
    zero, order = np.zeros_like(here), i + j + 3
    left = m[..., i - 1, j] if i else zero
    down = m[..., i, j - 1] if j else zero
    left_up = m[..., i - 1, j + 1] if i else zero
    right_down = m[..., i + 1, j - 1] if j else zero
    L = np.empty((*np.broadcast_shapes(here.shape, np.shape(c)), 6))
    L[..., 0] = -i * (a * here + b * left_up + c * left) - a * here
    L[..., 1] = -j * (a * right_down + b * here + c * down) - b * here
    L[..., 2] = order * (a * right + b * up + c * here) - c * here
    L[..., 3] = order * up + j * down
    L[..., 4] = -order * right - i * left
    L[..., 5] = i * left_up - j * right_down
    return L


def _together(**given: ArrayLike) -> list[Array]:
    """Arguments as float arrays of one shape."""
    arrays = [as_floats(value, name) for name, value in given.items()]
    try:
        return list(np.broadcast_arrays(*arrays))
    except ValueError:
        shapes = ", ".join(f"{k} {v.shape}" for k, v in zip(given, arrays, strict=True))
        raise ShapeError(f"The arguments do not broadcast against each other: {shapes}.") from None


def _depth(Z: Array) -> Array:
    if not (Z > 0.0).all():
        raise InvalidValueError(
            f"Z: expected depths in front of the camera, above 0, got {Z.min():.4g} m."
        )
    return Z


def _inverse_depth(plane: ArrayLike) -> tuple[Array, Array, Array]:
    """Coefficients of 1 / Z = a x + b y + c on a plane."""
    P = as_core(plane, (4,), "plane")
    if not P[..., 3].all() or not P[..., :3].any(axis=-1).all():
        raise InvalidValueError(
            "plane: expected (A, B, C, D) with A X + B Y + C Z + D = 0, a normal and D not zero; "
            "of a plane through the centre of the camera the image has no area."
        )
    a, b, c = np.moveaxis(-P[..., :3] / P[..., 3:], -1, 0)
    return a, b, c
