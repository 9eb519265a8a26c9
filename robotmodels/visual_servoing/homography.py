"""Homographies between two images of a plane, and the motions in them.

Parameters
----------
image_1, image_2 : array_like, shape (n, 2)
    The same points in both images, normalised coordinates, n from 4.
H : array_like, shape (3, 3)
    Homography of normalised coordinates, with any scale.
image : array_like, shape (n, 2), optional
    Points of the plane in the first image: only motions with them in front of it are given.

Returns
-------
ndarray of shape (3, 3), or PlaneMotions
    H scaled to a second singular value of 1 and positive depths; k is 1, 2 or 4 motions.

Raises
------
ShapeError, InvalidValueError
    Fewer than four points, points on a line, a singular matrix.

References
----------
Seed book section 6.2.5.1; O. Faugeras and F. Lustman 1988; Y. Ma, S. Soatto, J. Kosecka and
S. Sastry, "An invitation to 3-D vision", 5.3.

Examples
--------
>>> import numpy as np
>>> corners = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
>>> H = homography(corners, corners + [0.5, 0.0])
>>> H.round(6)[0] + 0.0, decompose_homography(H).R.shape
(array([1. , 0. , 0.5]), (4, 3, 3))
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_core, as_exact
from ..errors import InvalidValueError, ShapeError
from .results import Result


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class PlaneMotions(Result):
    """Motions that a homography allows, ``H = R + t n^T``.

    Parameters
    ----------
    R : ndarray, shape (k, 3, 3)
        Rotations from the first camera to the second, ``X_2 = R X_1 + t``.
    t : ndarray, shape (k, 3)
        Translations divided by the distance of the plane from the first camera.
    n : ndarray, shape (k, 3)
        Unit normals of the plane in the first camera, ``n . X_1 = distance``; NaN without
        translation, where k is 1.
    """

    R: Array
    t: Array
    n: Array


def homography(image_1: ArrayLike, image_2: ArrayLike) -> Array:
    """Homography ``x_2 ~ H x_1`` of points of a plane, by least squares of normalised points."""
    p, q = as_core(image_1, (2,), "image_1"), as_core(image_2, (2,), "image_2")
    if p.ndim != 2 or p.shape != q.shape or len(p) < 4:
        raise ShapeError(
            f"image_1, image_2: expected the same shape (n, 2), n from 4, got {p.shape}, {q.shape}."
        )
    (x, N), (y, M) = _scaled(p), _scaled(q)
    zero = np.zeros_like(x)
    A = np.vstack((np.hstack((x, zero, -y[:, :1] * x)), np.hstack((zero, x, -y[:, 1:2] * x))))
    _, sizes, Vt = np.linalg.svd(A)
    if sizes[7] <= 1e-9 * sizes[0]:
        raise InvalidValueError(
            "image_1, image_2: the points do not determine a homography; expected four of which no "
            "three are on a line."
        )
    H = np.linalg.solve(M, Vt[8].reshape(3, 3) @ N)
    H = H / np.linalg.svd(H, compute_uv=False)[1]
    depth = (np.c_[q, np.ones(len(q))] * (np.c_[p, np.ones(len(p))] @ H.T)).sum()
    return H if depth > 0.0 else -H


def decompose_homography(H: ArrayLike, image: ArrayLike | None = None) -> PlaneMotions:
    """Motions and planes of a homography: four in general, two with the plane in front."""
    A = as_exact(H, (3, 3), "H")
    _, (largest, middle, least), Vt = np.linalg.svd(A)
    if not least > 1e-12 * largest:
        raise InvalidValueError("H: expected a regular matrix; this one has a zero singular value.")
    A = A * np.sign(np.linalg.det(A)) / middle
    v1, v2, v3 = Vt
    a, c = (largest / middle) ** 2 - 1.0, 1.0 - (least / middle) ** 2
    if a + c < 1e-12:  # no translation
        U, _, Wt = np.linalg.svd(A)
        return PlaneMotions((U @ Wt)[None], np.zeros((1, 3)), np.full((1, 3), np.nan))
    found = []
    if min(a, c) <= 1e-13:  # translation along the normal: both signs are the same motion
        a, c = (a, 0.0) if a > c else (0.0, c)
    for sign in (1.0, -1.0) if min(a, c) > 0.0 else (1.0,):
        u = (np.sqrt(max(c, 0.0)) * v1 + sign * np.sqrt(max(a, 0.0)) * v3) / np.sqrt(a + c)
        before = np.stack((v2, u, np.cross(v2, u)), axis=-1)
        after = np.stack((A @ v2, A @ u, np.cross(A @ v2, A @ u)), axis=-1)
        U, _, Wt = np.linalg.svd(after @ before.T)
        R, n = U @ Wt, np.cross(v2, u)
        t = (A - R) @ n
        found += [(R, t, n), (R, -t, -n)]
    if image is not None:
        x = as_core(image, (2,), "image").reshape(-1, 2)
        found = [f for f in found if (x @ f[2][:2] + f[2][2] > 0.0).all()]
    R, t, n = (np.array([f[k] for f in found]) for k in range(3))
    return PlaneMotions(R.reshape(-1, 3, 3), t.reshape(-1, 3), n.reshape(-1, 3))


def _scaled(p: Array) -> tuple[Array, Array]:
    """Homogeneous points (n, 3) with mean 0 and unit spread, and the matrix that does it."""
    mean = p.mean(axis=0)
    spread = float(np.linalg.norm(p - mean) / np.sqrt(len(p))) or 1.0
    N = np.array(((1.0, 0.0, -mean[0]), (0.0, 1.0, -mean[1]), (0.0, 0.0, spread))) / spread
    return np.c_[p, np.ones(len(p))] @ N.T, N
