"""Interaction matrices ``ds/dt = L [v; w]``: closed forms, and estimates from motions.

The object stands still. Arguments broadcast against each other.

Parameters
----------
x, y, Z : array_like, shape (...)
    Normalised coordinates of a point or a centre of gravity; depths, m, above 0.
rho, theta : array_like, shape (...)
    Line ``x cos(theta) + y sin(theta) = rho``.
length, alpha : array_like, shape (...)
    Of a segment from its first point to its second, alpha in rad from the x axis.
n20, n02, n11 : array_like, shape (...)
    Centred moments of second order divided by the area; an ellipse with the semi-axis a along x
    has n20 = a^2 / 4.
plane : array_like, shape (..., 4) or ()
    Plane (A, B, C, D) of the object, ``A X + B Y + C Z + D = 0`` in the camera, D not 0, so
    ``1 / Z = -(A x + B y + C) / D``; or the depth of a plane parallel to the image.
theta_u, point, normal : array_like, shape (..., 3)
    Rotation vector of the current camera in the axes of the desired one, rad; point, m, and unit
    normal in the camera.
moments, i, j : array_like, shape (..., K, K), and int
    Raw moments of a region, [p, q] the integral of ``x^p y^q``; order, K at least i + j + 2.
dS, dX : array_like, shapes (N, k) and (N, 6)
    Changes of a measurement, and the small displacements [v; w] of the camera that caused them.
L, ds, dx, factor : array_like, shapes (k, 6), (k,), (6,) and float
    Estimate so far; the last change and its displacement; part of the correction, in (0, 1].

Returns
-------
ndarray, shape (..., k, 6)
    Rows in the order of the arguments; of ``m_ij`` one.

References
----------
Book sections 6.2.4.1 to 6.2.4.4 and 6.2.5.2 to 6.2.5.4; F. Chaumette, "Image moments: a
general and useful set of features for visual servoing", IEEE Trans. Robotics 20(4), 2004;
M. Jagersand, O. Fuentes and R. Nelson, "Experimental evaluation of uncalibrated visual servoing",
ICRA 1997.

Examples
--------
>>> interaction_point(0.1, 0.2, 2.0).round(3)
array([[-0.5 ,  0.  ,  0.05,  0.02, -1.01,  0.2 ],
       [ 0.  , -0.5 ,  0.1 ,  1.04, -0.02, -0.1 ]])
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_core, as_floats, as_number, as_vector
from ..errors import InvalidValueError, ShapeError
from ..se3 import skew


def interaction_point(x: ArrayLike, y: ArrayLike, Z: ArrayLike) -> Array:
    """Interaction matrix of an image point: x, y."""
    x, y, Z = _together(x=x, y=y, Z=Z)
    return point_rows(x, y, 1.0 / _in_front(Z))


def point_rows(x: Array, y: Array, w: Array) -> Array:
    """The same with inverse depths w, without checks. Shapes: (...) -> (..., 2, 6)."""
    L = np.zeros((*x.shape, 2, 6))
    xy = x * y
    L[..., 0, 0] = L[..., 1, 1] = -w
    L[..., 0, 2], L[..., 1, 2] = x * w, y * w
    L[..., 0, 3], L[..., 1, 4] = xy, -xy
    L[..., 0, 4], L[..., 1, 3] = -1.0 - x * x, 1.0 + y * y
    L[..., 0, 5], L[..., 1, 5] = y, -x
    return L


def interaction_line(rho: ArrayLike, theta: ArrayLike, plane: ArrayLike) -> Array:
    """Interaction matrix of a straight line: rho, theta."""
    rho, theta, a, b, c = _together(rho=rho, theta=theta, **_inverse_depth(plane))
    cos, sin = np.cos(theta), np.sin(theta)
    turn, shift = b * cos - a * sin, -(a * rho * cos + b * rho * sin + c)
    still, square = np.zeros_like(rho), 1.0 + rho**2
    first = shift * cos, shift * sin, -shift * rho, square * sin, -square * cos, still
    second = turn * cos, turn * sin, -turn * rho, -rho * cos, -rho * sin, still - 1.0
    return np.moveaxis(np.array((first, second)), (0, 1), (-2, -1))


def interaction_segment(
    x: ArrayLike, y: ArrayLike, length: ArrayLike, alpha: ArrayLike, Z: ArrayLike
) -> Array:
    """Interaction matrix of a segment: x, y of its middle, length, alpha; Z (..., 2) or ()."""
    depth = _in_front(as_floats(Z, "Z"))
    depth = as_core(np.full(2, depth) if depth.ndim == 0 else depth, (2,), "Z")
    x, y, length, alpha, near, far = _together(
        x=x, y=y, length=length, alpha=alpha, Z_1=depth[..., 0], Z_2=depth[..., 1]
    )
    if not (length > 0.0).all():
        raise InvalidValueError(f"length: expected numbers above 0, got {length.min():.4g}.")
    cos, sin = np.cos(alpha), np.sin(alpha)
    dx, dy = 0.5 * length * cos, 0.5 * length * sin
    first = point_rows(x - dx, y - dy, 1.0 / near)
    last = point_rows(x + dx, y + dy, 1.0 / far)
    along = np.stack((cos, sin, -sin / length, cos / length), axis=-1).reshape(*x.shape, 2, 2)
    return np.concatenate((0.5 * (first + last), along @ (last - first)), axis=-2)


def interaction_ellipse(
    x: ArrayLike, y: ArrayLike, n20: ArrayLike, n02: ArrayLike, n11: ArrayLike, plane: ArrayLike
) -> Array:
    """Interaction matrix of an ellipse, the image of a circle or a sphere: x, y, n20, n02, n11."""
    x, y, n20, n02, n11, a, b, c = _together(
        x=x, y=y, n20=n20, n02=n02, n11=n11, **_inverse_depth(plane)
    )
    # the image moves by quadratic functions of x and y, of which these differences are exact
    right, left, up, down = (
        point_rows(x + dx, y + dy, a * (x + dx) + b * (y + dy) + c)
        for dx, dy in ((1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0))
    )
    L = np.zeros((*x.shape, 5, 6))
    L[..., :2, :] = point_rows(x, y, a * x + b * y + c)
    L[..., 0, 2:5] += 4.0 * np.stack((a * n20 + b * n11, n11, -n20), axis=-1)
    L[..., 1, 2:5] += 4.0 * np.stack((a * n11 + b * n02, n02, -n11), axis=-1)
    xx, xy = np.moveaxis(0.5 * (right - left), -2, 0)
    yx, yy = np.moveaxis(0.5 * (up - down), -2, 0)
    n20, n02, n11 = n20[..., None], n02[..., None], n11[..., None]
    L[..., 2, :] = 2.0 * (n20 * xx + n11 * yx)
    L[..., 3, :] = 2.0 * (n11 * xy + n02 * yy)
    L[..., 4, :] = n11 * (xx + yy) + n02 * yx + n20 * xy
    return L


def interaction_moment(moments: ArrayLike, i: int, j: int, plane: ArrayLike) -> Array:
    """Interaction matrix (..., 1, 6) of the raw moment m_ij of a region."""
    m = as_floats(moments, "moments")
    if not all(isinstance(k, int | np.integer) and k >= 0 for k in (i, j)):
        raise InvalidValueError(f"i, j: expected integers from 0, got {i!r:.40} and {j!r:.40}.")
    if m.ndim < 2 or min(m.shape[-2:]) < i + j + 2:
        raise ShapeError(f"moments: expected (..., K, K), K from {i + j + 2}, got {m.shape}.")
    _, a, b, c = _together(moments=m[..., 0, 0], **_inverse_depth(plane))
    here, right, up = m[..., i, j], m[..., i + 1, j], m[..., i, j + 1]
    left, down = m[..., i - 1, j], m[..., i, j - 1]  # without effect where i or j is 0
    left_up, right_down = m[..., i - 1, j + 1], m[..., i + 1, j - 1]
    order = i + j + 3
    row = (
        -i * (a * here + b * left_up + c * left) - a * here,
        -j * (a * right_down + b * here + c * down) - b * here,
        order * (a * right + b * up + c * here) - c * here,
        order * up + j * down,
        -order * right - i * left,
        i * left_up - j * right_down,
    )
    return np.stack(np.broadcast_arrays(*row), axis=-1)[..., None, :]


def interaction_theta_u(theta_u: ArrayLike) -> Array:
    """Interaction matrix of the rotation vector of the current camera in the desired one."""
    w = as_core(theta_u, (3,), "theta_u")
    L = np.zeros((*w.shape[:-1], 3, 6))
    half = 0.5 * np.linalg.norm(w, axis=-1)[..., None, None]
    if not (half < np.pi - 1e-9).all():
        raise InvalidValueError("theta_u: expected rotations of less than a turn, 2 pi.")
    small = half < 0.02
    safe = np.where(small, 1.0, half)
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
    return np.concatenate((np.broadcast_to(-np.eye(3), (*X.shape, 3)), skew(X)), axis=-1)


def interaction_plane_3d(normal: ArrayLike) -> Array:
    """Interaction matrix of a plane in space, ``normal . X = distance``: normal, distance."""
    n = as_core(normal, (3,), "normal")
    if not (np.abs(np.linalg.norm(n, axis=-1) - 1.0) <= 1e-6).all():
        raise InvalidValueError("normal: expected unit vectors; divide them by their length.")
    L = np.zeros((*n.shape[:-1], 4, 6))
    L[..., :3, 3:] = skew(n)
    L[..., 3, :3] = -n
    return L


def estimate_interaction(dS: ArrayLike, dX: ArrayLike) -> Array:
    """Interaction matrix from motions of the camera: least squares of ``dS = dX L^T``."""
    S, X = as_floats(dS, "dS"), as_vector(dX, 6, "dX")
    if S.ndim != 2 or X.ndim != 2 or len(S) != len(X):
        raise ShapeError(f"dS, dX: expected shapes (N, k) and (N, 6), got {S.shape} and {X.shape}.")
    scale = np.abs(X).max(axis=0, initial=0.0)
    L, _, rank, _ = np.linalg.lstsq(X / np.where(scale > 0.0, scale, 1.0), S, rcond=1e-10)
    if rank < 6:
        raise InvalidValueError(
            f"dX: it spans {rank} of 6 directions; translate along and rotate about all three axes."
        )
    return (L / scale[:, None]).T


def broyden(L: ArrayLike, ds: ArrayLike, dx: ArrayLike, factor: float = 1.0) -> Array:
    """Broyden's update: the matrix nearest to L that explains the last motion."""
    A, s, x = as_vector(L, 6, "L"), as_floats(ds, "ds"), as_vector(dx, 6, "dx")
    if A.ndim != 2 or s.shape != A.shape[:1] or x.ndim != 1:
        raise ShapeError(
            f"L, ds, dx: expected (k, 6), (k,), (6,), got {A.shape}, {s.shape}, {x.shape}."
        )
    part = as_number(factor, "factor", above=0.0)
    if part > 1.0:
        raise InvalidValueError(f"factor: expected a number in (0, 1], got {factor}.")
    with np.errstate(all="ignore"):
        B = A + part * np.outer(s - A @ x, np.linalg.pinv(x[:, None]))
    if not np.isfinite(B).all():
        raise InvalidValueError(f"dx: expected a displacement that can cause ds, got {dx!r:.60}.")
    return B


def _together(**given: Any) -> list[Array]:
    """Arguments as float arrays of one shape."""
    arrays = [as_floats(value, name) for name, value in given.items()]
    try:
        return list(np.broadcast_arrays(*arrays))
    except ValueError:
        shapes = ", ".join(f"{k} {v.shape}" for k, v in zip(given, arrays, strict=True))
        raise ShapeError(f"The arguments do not broadcast against each other: {shapes}.") from None


def _in_front(Z: Array) -> Array:
    """Depths, checked."""
    if not (Z > 0.0).all():
        raise InvalidValueError(
            f"Z: expected depths in front of the camera, above 0, got {Z.min():.4g} m."
        )
    return Z


def _inverse_depth(plane: ArrayLike) -> dict[str, Array]:
    """Coefficients of 1 / Z = a x + b y + c on a plane."""
    P = as_floats(plane, "plane")
    P = as_core(np.array((0.0, 0.0, 1.0, -_in_front(P))) if P.ndim == 0 else P, (4,), "plane")
    if not P[..., 3].all() or not P[..., :3].any(axis=-1).all():
        raise InvalidValueError(
            "plane: expected (A, B, C, D), A X + B Y + C Z + D = 0, with a normal and D not zero."
        )
    return dict(zip("ABC", np.moveaxis(-P[..., :3] / P[..., 3:], -1, 0), strict=True))
