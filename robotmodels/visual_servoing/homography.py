"""Homographies between two images of a plane, and the motions in them.

Parameters
----------
image_1, image_2, image : array_like, shape (..., n, 2)
    The same points in both images, normalised coordinates, n from 4; points of the plane in the
    first image, of which only motions with them in front are given.
H : array_like, shape (..., 3, 3)
    Homography of normalised coordinates, with any scale.

Returns
-------
ndarray of shape (..., 3, 3), or PlaneMotions
    H scaled to a second singular value of 1 and positive depths; up to 1, 2 or 4 motions.

References
----------
Book section 6.2.5.1; O. Faugeras and F. Lustman 1988; Y. Ma, S. Soatto, J. Kosecka and
S. Sastry, "An invitation to 3-D vision", 5.3.

Examples
--------
>>> corners = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
>>> H = homography(corners, corners + [0.5, 0.0])
>>> H.round(6)[0] + 0.0, decompose_homography(H).R.shape
(array([1. , 0. , 0.5]), (4, 3, 3))
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, Frozen, Value
from ..errors import InvalidValueError, ShapeError
from .results import as_sized, packed


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class PlaneMotions(Frozen, Value):
    """Motions that a homography allows, ``H = R + t n^T``; missing rows of a batch are NaN.

    ``R, t`` (..., k, 3, 3) and (..., k, 3) move points from the first camera to the second, ``X_2 =
    R X_1 + t``, translations divided by the distance of the plane from the first camera; ``n``
    (..., k, 3) are unit normals of the plane in the first camera, NaN without translation.
    """

    R: Array
    t: Array
    n: Array


def homography(image_1: ArrayLike, image_2: ArrayLike) -> Array:
    """Homography ``x_2 ~ H x_1`` of points of a plane, by least squares of normalised points."""
    p, q = as_sized(image_1, (2,), "image_1"), as_sized(image_2, (2,), "image_2")
    if p.ndim < 2 or p.shape != q.shape or p.shape[-2] < 4:
        raise ShapeError(
            f"image_1, image_2: expected one shape (..., n, 2), n from 4, got {p.shape}, {q.shape}."
        )
    (x, N), (y, M) = _scaled(p), _scaled(q)
    in_x = np.concatenate((x, 0.0 * x, -y[..., :1] * x), axis=-1)
    in_y = np.concatenate((0.0 * x, x, -y[..., 1:2] * x), axis=-1)
    A = np.concatenate((in_x, in_y), axis=-2)
    _, sizes, Vt = np.linalg.svd(A)
    if (sizes[..., 7] <= 1e-9 * sizes[..., 0]).any():
        raise InvalidValueError(
            "image_1, image_2: they do not determine a homography: too many are on a line."
        )
    H = np.linalg.solve(M, Vt[..., 8, :].reshape(N.shape) @ N)
    H = H / np.linalg.svd(H, compute_uv=False)[..., 1, None, None]
    after = p @ np.swapaxes(H[..., :2], -1, -2) + H[..., None, :, 2]
    depth = (after[..., :2] * q).sum(axis=(-2, -1)) + after[..., 2].sum(axis=-1)
    return np.where(depth[..., None, None] > 0.0, H, -H)


def decompose_homography(H: ArrayLike, image: ArrayLike | None = None) -> PlaneMotions:
    """Motions and planes of a homography: four in general, two with the plane in front."""
    A = as_sized(H, (3, 3), "H")
    sizes, Vt = np.linalg.svd(A)[1:]
    if not (sizes[..., 2] > 1e-12 * sizes[..., 0]).all():
        raise InvalidValueError("H: expected a regular matrix; this one has a zero singular value.")
    A = A * (np.sign(np.linalg.det(A)) / sizes[..., 1])[..., None, None]
    squares = (sizes / sizes[..., 1:2]) ** 2
    a, c = squares[..., 0] - 1.0, 1.0 - squares[..., 2]
    still = a + c < 1e-12  # no translation
    axial = np.minimum(a, c) <= 1e-13  # along the normal: both signs are the same motion
    a, c = np.where(still | axial & (a <= c), 0.0, a), np.where(axial & (a > c), 0.0, c)
    a, c = np.sqrt((a, np.where(still, 1.0, c)) / np.where(still, 1.0, a + c))[..., None]
    v1, v2, v3 = np.moveaxis(Vt, -2, 0)
    u = np.stack((c * v1 + a * v3, c * v1 - a * v3), axis=-2)
    v2, At = np.broadcast_to(v2[..., None, :], u.shape), np.swapaxes(A, -1, -2)
    n = np.cross(v2, u)
    before = np.stack((v2, u, n), axis=-2)
    after = np.stack((v2 @ At, u @ At, np.cross(v2 @ At, u @ At)), axis=-1)
    U, _, Wt = np.linalg.svd(after @ before)
    R = U @ Wt
    t = np.where(still[..., None, None], 0.0, ((A[..., None, :, :] - R) @ n[..., None])[..., 0])
    n = np.where(still[..., None, None], np.nan, n)
    t, n = (np.stack((x, -x), axis=-2).reshape(*x.shape[:-2], 4, 3) for x in (t, n))
    valid = np.arange(4) < np.where(still, 1, np.where(axial, 2, 4))[..., None]
    if image is not None:
        x = np.atleast_2d(as_sized(image, (2,), "image"))
        height = n[..., :2] @ np.swapaxes(x, -1, -2) + n[..., 2:]
        valid = valid & ((height > 0.0).all(axis=-1) | still[..., None])
    return PlaneMotions(*packed(valid, np.repeat(R, 2, axis=-3), t, n)[1:])


def _scaled(p: Array) -> tuple[Array, Array]:
    """Homogeneous points (..., n, 3) with mean 0 and unit spread, and the matrix that does it."""
    mean = p.mean(axis=-2)
    spread = np.sqrt(((p - mean[..., None, :]) ** 2).sum(axis=(-2, -1)) / p.shape[-2])
    N = np.zeros((*mean.shape[:-1], 3, 3))
    N[..., 0, 0] = N[..., 1, 1] = 1.0 / np.where(spread > 0.0, spread, 1.0)
    N[..., :2, 2], N[..., 2, 2] = -mean * N[..., :1, 0], 1.0
    return np.insert(p, 2, 1.0, axis=-1) @ np.swapaxes(N, -1, -2), N
