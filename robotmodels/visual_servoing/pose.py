"""Pose of an object from image points: three points, many points, virtual visual servoing.

`p3p` finds the poses of three points; where the camera is on the cylinder through them, two poses
coincide, are found to about 1e-6 and are given once, and thin or small triangles near it may lack
one. `pnp` finds the pose of least squared image error, of planar
objects both minima: it starts from triples of points and refines on all points. `refine_pose` is
virtual visual servoing: a virtual camera is moved from a first pose until its image fits, with
steps that are damped where the error would grow (Levenberg-Marquardt).

Parameters
----------
points : array_like, shape (n, 3)
    Points of the object, m, n from 3, not all on a line; of `p3p` (..., 3, 3).
image : array_like, shape (..., n, 2)
    Their normalised image coordinates.
T0 : array_like, shape (4, 4)
    First pose of the object in the camera.

Returns
-------
PoseSolutions
    Poses with all points in front of the camera, by growing image error.

Raises
------
ShapeError, InvalidValueError, NotARotationError
    Arrays that do not fit each other, points on a line, an image of one point, a first pose with
    points behind the camera.

References
----------
Seed book section 6.2.5.1; M. Fischler and R. Bolles, "Random sample consensus", Comm. ACM 24(6),
1981; G. Schweighofer and A. Pinz, "Robust pose estimation from a planar target", IEEE Trans. PAMI
28(12), 2006; E. Marchand and F. Chaumette, "Virtual visual servoing", 2002.

Examples
--------
>>> import numpy as np
>>> from robotmodels.se3 import translation
>>> corners = np.array([[-0.1, -0.1, 0], [0.1, -0.1, 0], [0.1, 0.1, 0], [-0.1, 0.1, 0]])
>>> image = corners[:, :2] / 0.5
>>> pnp(corners, image).T[0, :3, 3].round(9) + 0.0
array([0. , 0. , 0.5])
>>> refine_pose(corners, image, translation(0.1, 0, 0.7)).T[0, :3, 3].round(9) + 0.0
array([0. , 0. , 0.5])
>>> triangle = [[2.0, 0, 0], [-1, 3**0.5, 0], [-1, -(3**0.5), 0]]
>>> p3p(triangle, np.array(triangle)[:, :2] / 12**0.5)
<PoseSolutions: 4 poses. Each pose found is a minimum of the image error.>
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, as_core
from .._outcomes import Outcome
from ..errors import InvalidValueError, ShapeError
from ..se3 import as_single_pose
from .features import Points, sight_of
from .results import Result
from .velocity import moved

_THIN = 1e-9  # sine of the angle of a triangle that is a line
_FITS = 1e-10  # of the squared sides
_SAME = 1e-6  # of distances or poses
_TURNED = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
_TRIPLES, _STARTS, _ITERATIONS = 24, 6, 60
_NEAR = 0.02  # of the depth: entries of poses that lead to the same minimum


class PoseStatus(Outcome):
    """Outcome of an estimation of a pose; fits int8."""

    FOUND = 0, "Each pose found is a minimum of the image error."
    TWO_MINIMA = 1, "Two poses are minima of the image error, the first with the smaller one."
    NONE_FOUND = 2, "No pose was found in front of the camera that fits the image."
    NOT_CONVERGED = 3, "The image error still decreases after the allowed iterations."


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class PoseSolutions(Result):
    """Poses of an object in the camera; rows are packed, missing ones NaN. Read-only.

    As an array (``np.asarray``) it is ``T``.

    Parameters
    ----------
    T : ndarray, shape (..., S, 4, 4)
        Poses ``T_camera_object``.
    valid : ndarray of bool, shape (..., S)
        Whether the row is a solution.
    residual : ndarray, shape (..., S)
        Largest distance of an image point from its measurement, normalised.
    status : ndarray of int8, shape (...)
        Codes of `PoseStatus`.
    """

    T: Array
    valid: NDArray[np.bool_]
    residual: Array
    status: NDArray[np.int8]
    _outcome = PoseStatus

    @property
    def count(self) -> NDArray[np.int64]:
        """Number of solutions, shape (...)."""
        return self.valid.sum(axis=-1)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Array:
        return np.array(self.T, dtype=dtype)

    def __repr__(self) -> str:
        if self.status.ndim:
            return f"<PoseSolutions: {self.valid.sum()} poses of {self.status.size} images>"
        return f"<PoseSolutions: {self.count} poses. {self.reason()}>"


def p3p(points: ArrayLike, image: ArrayLike) -> PoseSolutions:
    """Poses of three points, at most four."""
    P, m = as_core(points, (3, 3), "points"), as_core(image, (3, 2), "image")
    batch = _batch(P.shape[:-2], m.shape[:-2])
    P = np.broadcast_to(P, (*batch, 3, 3)).reshape(-1, 3, 3)
    m = np.broadcast_to(m, (*batch, 3, 2)).reshape(-1, 3, 2)
    flat = _sine(P) <= _THIN
    if flat.any():
        raise InvalidValueError(
            f"points: expected three points that are not on a line, row {int(flat.argmax())} are; "
            "no finite number of poses has their image."
        )
    T, valid = _p3p(P, m)
    codes = np.where(valid.any(axis=-1), PoseStatus.FOUND, PoseStatus.NONE_FOUND)
    residual = _residual(T, P[:, None], m[:, None])
    S = int(valid.sum(axis=-1).max(initial=0))
    return PoseSolutions(
        T[:, :S].reshape(*batch, S, 4, 4), valid[:, :S].reshape(*batch, S),
        residual[:, :S].reshape(*batch, S), codes.astype(np.int8).reshape(batch),
    )  # fmt: skip


def pnp(points: ArrayLike, image: ArrayLike) -> PoseSolutions:
    """Pose of three or more points of least squared image error; both minima if planar."""
    P, images = _checked(points, image)
    if len(P) == 3:
        return p3p(P, images)
    singular = np.linalg.svd(P - P.mean(axis=0), compute_uv=False)
    planar = bool(singular[2] <= 1e-6 * singular[0])
    found = [_minima(P, m, planar) for m in images.reshape(-1, len(P), 2)]
    return _packed(found, images.shape[:-2])


def refine_pose(points: ArrayLike, image: ArrayLike, T0: ArrayLike) -> PoseSolutions:
    """Virtual visual servoing: the pose of least image error near a first one."""
    P, images = _checked(points, image)
    T = as_single_pose(T0, "T0")
    Points(P).measure(T)  # raises where points are behind the camera
    found = []
    for m in images.reshape(-1, len(P), 2):
        pose, _, done = _refined(Points(P), m.ravel(), T)
        code = PoseStatus.FOUND if done else PoseStatus.NOT_CONVERGED
        found.append(([pose], [float(_residual(pose, P, m))], code))
    return _packed(found, images.shape[:-2])


def _p3p(P: Array, m: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Poses (N, 4, 4, 4) and whether they are solutions (N, 4), packed.

    Shapes: P (N, 3, 3), m (N, 3, 2).
    """
    N = len(P)
    rays = np.concatenate((m, np.ones((N, 3, 1))), axis=-1)
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    i, j = np.array((0, 0, 1)), np.array((1, 2, 2))
    sides = ((P[:, i] - P[:, j]) ** 2).sum(axis=-1)
    # the law of cosines is E(s) = sides for the distances s of the points from the camera
    E = np.zeros((N, 3, 3, 3))
    row = np.arange(3)
    E[:, row, i, i] = E[:, row, j, j] = 1.0
    E[:, row, i, j] = E[:, row, j, i] = -(rays[:, i] * rays[:, j]).sum(axis=-1)
    d = (sides / sides.max(axis=-1, keepdims=True))[..., None, None]
    # two cones without sides, in general coordinates z: no two solutions share x = z0 / z2
    cones = np.stack((d[:, 1] * E[:, 0] - d[:, 0] * E[:, 1], d[:, 2] * E[:, 0] - d[:, 0] * E[:, 2]))
    (a, b, c), (e, f, g) = (_in_y(_TURNED.T @ cone @ _TURNED) for cone in cones)
    ac, ab, bc = _mul(a, g) - _mul(e, c), _mul(a, f) - _mul(e, b), _mul(b, g) - _mul(f, c)
    quartic = (_mul(ac, ac) - _mul(ab, bc))[:, :5]
    companion = np.zeros((N, 4, 4))
    companion[:, row + 1, row] = 1.0
    companion[:, :, 3] = -quartic[:, :4] / np.where(quartic[:, 4:] == 0.0, 1e-300, quartic[:, 4:])
    x = np.linalg.eigvals(companion)  # (N, 4); rounding turns two near roots into a complex pair
    x = np.concatenate((x.real + np.abs(x.imag), x.real - np.abs(x.imag)), axis=-1)
    powers = np.stack([x**k for k in range(5)], axis=-1)
    top, bottom = (np.einsum("npk,nk->np", powers, p[:, :5]) for p in (ac, ab))
    y = -top / np.where(bottom == 0.0, 1e-300, bottom)
    s = np.stack((x, y, np.ones(x.shape)), axis=-1) @ _TURNED.T
    s = s * np.sign(s.sum(axis=-1, keepdims=True))
    size = np.einsum("npi,neij,npj->np", s, E, s)
    s = s * np.sqrt(sides.sum(axis=-1)[:, None] / np.maximum(size, 1e-300))[..., None]
    chords = ((rays[:, i] - rays[:, j]) ** 2).sum(axis=-1)[:, None]
    part, (step, residual) = np.ones(s.shape[:2]), _newton(s, chords, sides[:, None])
    off = np.abs(residual).max(axis=-1)
    for _ in range(40):  # steps that increase the residual, near double roots, are cut
        after = s - part[..., None] * step
        step_after, residual = _newton(after, chords, sides[:, None])
        off_after = np.abs(residual).max(axis=-1)
        better = off_after < off
        s, step = (np.where(better[..., None], b, a) for a, b in ((s, after), (step, step_after)))
        off, part = np.where(better, off_after, off), np.where(better, 1.0, 0.25 * part)
    best = np.argsort(off, axis=-1)  # of starts that lead to the same pose the best is kept
    s, off = np.take_along_axis(s, best[..., None], 1), np.take_along_axis(off, best, 1)
    good = (off <= _FITS * sides.max(axis=-1)[:, None]) & (s > 0.0).all(axis=-1)
    near = (
        np.abs(s[:, :, None] - s[:, None]).max(axis=-1) <= _SAME * np.abs(s).max(axis=-1)[:, None]
    )
    good &= ~np.any(near & np.tril(good[:, None] & np.ones((8, 8), bool), -1), axis=-1)
    order = np.argsort(~good, axis=-1, kind="stable")[:, :4]
    s, good = (np.take_along_axis(s, order[..., None], 1), np.take_along_axis(good, order, 1))
    C = np.where(good[..., None], s, 1.0)[..., None] * rays[:, None]
    T = np.zeros((N, 4, 4, 4))
    with np.errstate(all="ignore"):
        R = _triad(C) @ np.swapaxes(_triad(P), -1, -2)[:, None]
        T[..., :3, 3] = C.mean(axis=-2) - np.einsum("npij,nj->npi", R, P.mean(axis=-2))
    T[..., :3, :3], T[..., 3, 3] = R, 1.0
    T[~good] = np.nan
    return T, good


def _newton(s: Array, chords: Array, sides: Array) -> tuple[Array, Array]:
    """Newton step of the law of cosines, and its residuals. Shapes: s (N, 4, 3), others (N, 1, 3).

    The law is written with the chords between unit rays, which small angles do not cancel in.
    """
    i, j, row = np.array((0, 0, 1)), np.array((1, 2, 2)), np.arange(3)
    gap, J = s[..., i] - s[..., j], np.zeros((*s.shape, 3))
    residual = 0.5 * (gap**2 + s[..., i] * s[..., j] * chords - sides)
    J[..., row, i], J[..., row, j] = gap + 0.5 * s[..., j] * chords, -gap + 0.5 * s[..., i] * chords
    r0, r1, r2 = np.moveaxis(J, -2, 0)
    inverse = np.stack((np.cross(r1, r2), np.cross(r2, r0), np.cross(r0, r1)), axis=-1)
    determinant = (r0 * inverse[..., 0]).sum(axis=-1)[..., None]
    scale = np.abs(J).max(axis=(-2, -1))[..., None] ** 3 + 1e-300
    safe = np.where(np.abs(determinant) < 1e-14 * scale, np.inf, determinant)
    return np.einsum("npij,npj->npi", inverse, residual) / safe, residual


def _in_y(Q: Array) -> tuple[Array, Array, Array]:
    """Coefficients, polynomials in x (N, 3), of y^2, y, 1 in [x y 1] Q [x y 1]^T."""
    zero = np.zeros(len(Q))
    return (
        np.stack((Q[:, 1, 1], zero, zero), axis=-1),
        2.0 * np.stack((Q[:, 1, 2], Q[:, 0, 1], zero), axis=-1),
        np.stack((Q[:, 2, 2], 2.0 * Q[:, 0, 2], Q[:, 0, 0]), axis=-1),
    )


def _mul(p: Array, q: Array) -> Array:
    """Products of polynomials, constant first. Shapes: (N, a), (N, b) -> (N, a + b - 1)."""
    out = np.zeros((len(p), p.shape[1] + q.shape[1] - 1))
    for k in range(p.shape[1]):
        out[:, k : k + q.shape[1]] += p[:, k, None] * q
    return out


def _triad(P: Array) -> Array:
    """Right-handed axes on three points, as columns. Shapes: (..., 3, 3) -> same."""
    x = P[..., 1, :] - P[..., 0, :]
    x = x / np.linalg.norm(x, axis=-1, keepdims=True)
    z = np.cross(x, P[..., 2, :] - P[..., 0, :])
    z = z / np.linalg.norm(z, axis=-1, keepdims=True)
    return np.stack((x, np.cross(z, x), z), axis=-1)


def _sine(P: Array) -> Array:
    """Double area by the square of the longest side. Shapes: (..., 3, 3) -> (...)."""
    a, b = P[..., 1, :] - P[..., 0, :], P[..., 2, :] - P[..., 0, :]
    longest = np.maximum(np.maximum((a**2).sum(-1), (b**2).sum(-1)), ((a - b) ** 2).sum(-1))
    return np.linalg.norm(np.cross(a, b), axis=-1) / np.where(longest > 0.0, longest, 1.0)


def _residual(T: Array, P: Array, m: Array) -> Array:
    """Largest image error. Shapes: T (..., 4, 4), P (..., n, 3), m (..., n, 2) -> (...)."""
    X = P @ np.swapaxes(T[..., :3, :3], -1, -2) + T[..., None, :3, 3]
    return np.linalg.norm(X[..., :2] / X[..., 2:] - m, axis=-1).max(axis=-1)


def _minima(P: Array, m: Array, planar: bool) -> tuple[list[Array], list[float], PoseStatus]:
    """Poses of least image error, their errors and the status. Shapes: P (n, 3), m (n, 2)."""
    n = len(P)
    triples = np.array(list(combinations(range(min(n, 8)), 3)))
    if n > 8:
        draws = np.random.default_rng(0)
        triples = np.array([draws.choice(n, 3, replace=False) for _ in range(4 * _TRIPLES)])
    triples = triples[np.argsort(-_sine(P[triples]), kind="stable")[:_TRIPLES]]
    triples = triples[_sine(P[triples]) > _THIN]
    T, valid = _p3p(P[triples], m[triples])
    T = T[valid]
    X = P @ np.swapaxes(T[:, :3, :3], -1, -2) + T[:, None, :3, 3]
    T = T[(X[..., 2] > 0.0).all(axis=-1)]
    starts = [*T[np.argsort(_residual(T, P, m))[:_STARTS]], _frontal(P, m)]
    feature, found = Points(P), list[tuple[bool, float, float, Array]]()
    tried: list[Array] = []
    while starts:
        start = starts.pop(0)
        if any(np.abs(start - other).max() <= _NEAR * other[2, 3] for other in tried):
            continue
        pose, cost, done = _refined(feature, m.ravel(), start)
        if planar and not tried:
            starts.insert(0, _flipped(pose, P))
        known = any(np.abs(pose - other).max() <= 1e-5 * other[2, 3] for *_, other in found)
        tried += [start, pose]
        if np.isfinite(cost) and not known:
            found.append((not done, cost, float(_residual(pose, P, m)), pose))
    if not found:
        return [], [], PoseStatus.NONE_FOUND
    found.sort(key=lambda minimum: minimum[:2])  # those that converged first
    kept = [minimum for minimum in found if not minimum[0]][: 1 + planar] or found[:1]
    code = PoseStatus.TWO_MINIMA if len(kept) == 2 else PoseStatus.FOUND
    code = PoseStatus.NOT_CONVERGED if kept[0][0] else code
    return [f[3] for f in kept], [f[2] for f in kept], code


def _frontal(P: Array, m: Array) -> Array:
    """The object parallel to the image with the size and the place of its image: the last start."""
    flat = np.linalg.svd(P - P.mean(axis=0))[2]
    flat[2] *= np.linalg.det(flat)
    depth = np.linalg.norm(P - P.mean(axis=0)) / (np.linalg.norm(m - m.mean(axis=0)) + 1e-12)
    T = np.eye(4)
    T[:3, :3] = flat
    T[:3, 3] = depth * np.append(m.mean(axis=0), 1.0) - flat @ P.mean(axis=0)
    return T


def _flipped(T: Array, P: Array) -> Array:
    """The other pose of a planar object far away: its normal mirrored at the line of sight."""
    centre = P.mean(axis=0)
    normal = T[:3, :3] @ np.linalg.svd(P - centre)[2][2]
    place = T[:3, :3] @ centre + T[:3, 3]
    sight = place / np.linalg.norm(place)
    turn = np.cross(normal, sight)
    half = np.arctan2(np.linalg.norm(turn), normal @ sight)
    if np.sin(half) < 1e-6:
        return T
    from scipy.spatial.transform import Rotation

    R = Rotation.from_rotvec(2.0 * half * turn / np.linalg.norm(turn)).as_matrix() @ T[:3, :3]
    other = np.eye(4)
    other[:3, :3], other[:3, 3] = R, place - R @ centre
    return other


def _refined(feature: Points, m: Array, T: Array) -> tuple[Array, float, bool]:
    """Levenberg-Marquardt on the image error: pose, squared error, whether it converged."""
    damping, sight = 1e-6, sight_of(feature, T)
    if not sight.exists:
        return T, np.inf, False
    e = sight.s - m
    cost = float(e @ e)
    for _ in range(_ITERATIONS):
        A = feature._rows(sight.s, sight.depth)
        H, g = A.T @ A, A.T @ e
        step: Array = -np.linalg.lstsq(H + damping * np.diag(np.diag(H)), g, rcond=None)[0]  # type: ignore[assignment]
        after = moved(T, step)
        other = sight_of(feature, after)
        e_after = other.s - m if other.exists else np.full(len(m), np.inf)
        small = float(np.abs(step).max()) <= 1e-11 * max(1.0, float(np.abs(T[:3, 3]).max()))
        if float(e_after @ e_after) <= cost or small:
            T, sight, e = after, other, e_after
            cost, damping = float(e @ e), 0.1 * damping
        else:
            damping = max(10.0 * damping, 1e-6)
        if small:
            return T, cost, True
        if damping > 1e12:
            break
    return T, cost, False


def _checked(points: Any, image: Any) -> tuple[Array, Array]:
    P = as_core(points, (3,), "points")
    if P.ndim != 2 or len(P) < 3:
        raise ShapeError(f"points: expected shape (n, 3), n from 3, got {P.shape}.")
    m = as_core(image, (len(P), 2), "image")
    sizes = np.linalg.svd(P - P.mean(axis=0), compute_uv=False)
    if sizes[1] <= _THIN * sizes[0]:
        raise InvalidValueError("points: expected points that are not all on one line.")
    if (np.ptp(m, axis=-2) <= _THIN * np.abs(m).max(axis=-2)).all(axis=-1).any():
        raise InvalidValueError("image: expected image points that do not all coincide.")
    return P, m


def _batch(*shapes: tuple[int, ...]) -> tuple[int, ...]:
    try:
        return np.broadcast_shapes(*shapes)
    except ValueError:
        raise ShapeError(f"points, image: leading axes {shapes} do not fit each other.") from None


def _packed(found: list[Any], batch: tuple[int, ...]) -> PoseSolutions:
    """Solutions of several images as one result."""
    S = max((len(poses) for poses, _, _ in found), default=0)
    T, residual = np.full((len(found), S, 4, 4), np.nan), np.full((len(found), S), np.nan)
    for k, (poses, errors, _) in enumerate(found):
        T[k, : len(poses)] = np.reshape(poses, (-1, 4, 4))
        residual[k, : len(poses)] = errors
    codes = np.array([code for *_, code in found], np.int8).reshape(batch)
    valid = ~np.isnan(residual).reshape(*batch, S)
    return PoseSolutions(T.reshape(*batch, S, 4, 4), valid, residual.reshape(*batch, S), codes)
