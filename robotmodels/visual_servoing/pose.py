"""Pose of an object from image points: three points, many points, virtual visual servoing.

`p3p` intersects the two cones of three points; where the camera is on the cylinder through them,
two poses coincide, are found to about 1e-6 and are given once. `pnp` finds the pose of least
squared image error, of planar objects both minima, from the poses of triples. `refine_pose` is
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
    Poses with all points in front of the camera: ``T`` (..., S, 4, 4) by growing misfit, packed,
    missing ones NaN; ``valid`` and ``residual`` (..., S), the largest distance of an image point
    from its measurement; ``status`` (...), codes of `PoseStatus`.

References
----------
Book section 6.2.5.1; M. Fischler and R. Bolles, "Random sample consensus", Comm. ACM 24(6),
1981; M. Persson and K. Nordberg, "Lambda twist", ECCV 2018; G. Schweighofer and A. Pinz, "Robust
pose estimation from a planar target", IEEE Trans. PAMI 28(12), 2006; E. Marchand and F. Chaumette,
"Virtual visual servoing", 2002.

Examples
--------
>>> triangle = np.array([[2.0, 0, 0], [-1, 3**0.5, 0], [-1, -(3**0.5), 0]])
>>> p3p(triangle, triangle[:, :2] / 12**0.5)
<PoseSolutions: 4 poses. Each pose found is a minimum of the image error.>
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from .._arrays import Array, batch_shape
from .._outcomes import Outcome, Result
from ..errors import InvalidValueError
from ..se3 import as_single_pose
from .features import Points, placed, sight_of
from .results import as_points, as_sized, packed, taken

_FARTHEST = 100.0  # of normalised coordinates: 89.4 degrees off the optical axis
_THIN = 1e-9  # sine of the angle of a triangle that is a line
_FITS = 1e-10  # of the squared sides
_SAME = 1e-6  # of the longest side
_TRIPLES, _STARTS, _ITERATIONS, _NEWTON = 24, 6, 60, 12
_I, _J = np.array((0, 0, 1)), np.array((1, 2, 2))  # the sides of a triangle


class PoseStatus(Outcome):
    """Outcome of an estimation of a pose; fits int8."""

    FOUND = 0, "Each pose found is a minimum of the image error."
    TWO_MINIMA = 1, "Two poses are minima of the image error, the first with the smaller one."
    NONE_FOUND = 2, "No pose was found in front of the camera that fits the image."
    NOT_CONVERGED = 3, "The image error still decreases after the allowed iterations."


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class PoseSolutions(Result):
    """Poses of an object in the camera; ``np.asarray`` of the result is T. Read-only."""

    T: Array
    valid: NDArray[np.bool_]
    residual: Array
    status: NDArray[np.int8]
    outcomes = PoseStatus

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
    P, m = as_sized(points, (3, 3), "points"), _as_image(image, 3)
    batch = batch_shape((P[..., 0], m[..., 0]), ("points", "image"))
    P = np.broadcast_to(P, (*batch, 3, 3)).reshape(-1, 3, 3)
    m = np.broadcast_to(m, (*batch, 3, 2)).reshape(-1, 3, 2)
    flat = _sine(P) <= _THIN
    if flat.any():
        raise InvalidValueError(
            f"points: row {int(flat.argmax())} has three points on a line, which determine no pose."
        )
    T, s, off = _poses_of_triples(P, m)
    longest = ((P[:, _I] - P[:, _J]) ** 2).sum(axis=-1).max(axis=-1, keepdims=True)
    off = np.where((off <= _FITS * longest) & (s > 0.0).all(axis=-1), off, np.inf)
    return _packed((P, m, batch), T, off, s, _SAME * np.sqrt(longest), off < np.inf, 4)


def pnp(points: ArrayLike, image: ArrayLike) -> PoseSolutions:
    """Pose of three or more points of least squared image error; both minima if planar."""
    P, m, batch = _checked(points, image)
    if len(P) == 3:
        return p3p(P, m.reshape(*batch, 3, 2))
    sizes, axes = np.linalg.svd(P - P.mean(axis=0))[1:]
    planar = bool(sizes[2] <= 1e-6 * sizes[0])
    n, draws = len(P), np.random.default_rng(0)
    triples = np.array(list(combinations(range(min(n, 8)), 3)))
    if n > 8:
        triples = np.array([draws.choice(n, 3, replace=False) for _ in range(4 * _TRIPLES)])
    triples = triples[np.argsort(-_sine(P[triples]), kind="stable")[:_TRIPLES]]
    triples = triples[_sine(P[triples]) > _THIN]
    three = np.tile(P[triples], (len(m), 1, 1)), m[:, triples].reshape(-1, 3, 2)
    T = _poses_of_triples(*three, rounds=3)[0].reshape(len(m), 12 * len(triples), 4, 4)
    off = np.where((placed(T, P)[..., 2] > 0.0).all(axis=-1), _residual(T, P, m), np.inf)
    T = taken(T, np.argsort(off, axis=-1)[:, :_STARTS])
    if planar:  # the other pose of a planar object: its normal mirrored at the line of sight
        centre, other = placed(T, P.mean(axis=0)), T.copy()
        sight = centre / np.linalg.norm(centre, axis=-1, keepdims=True)
        for x in (T[..., :3, :3] @ axes[2], sight):  # half turns
            half = 2.0 * x[..., :, None] * x[..., None, :] - np.eye(3)
            other[..., :3, :3] = half @ other[..., :3, :3]
        other[..., :3, 3] = centre - other[..., :3, :3] @ P.mean(axis=0)
        T = np.concatenate((T, other), axis=1)
    T, cost, done = _refined(P, m, T)
    cost = np.where(done | ~done.any(axis=-1, keepdims=True), cost, np.inf)
    same = 1e-5 * np.abs(T[:, :1, 2, 3])
    return _packed((P, m, batch), T, cost, T.reshape(*cost.shape, 16), same, done, 1 + planar)


def refine_pose(points: ArrayLike, image: ArrayLike, T0: ArrayLike) -> PoseSolutions:
    """Virtual visual servoing: the pose of least image error near a first one."""
    P, m, batch = _checked(points, image)
    start = as_single_pose(T0, "T0")
    Points(P).measure(start)  # raises where points are behind the camera
    T, cost, done = _refined(P, m, np.tile(start, (len(m), 1, 1, 1)))
    return _packed((P, m, batch), T, cost, cost[..., None], 0.0, done, 1)


def _poses_of_triples(P: Array, m: Array, rounds: int = _NEWTON) -> tuple[Array, Array, Array]:
    """Candidates T (N, 12, 4, 4) with distances s (N, 12, 3) and their misfits (N, 12).

    Shapes: P (N, 3, 3), m (N, 3, 2).
    """
    rays = np.concatenate((m, np.ones((len(m), 3, 1))), axis=-1)
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    sides, chords = (((x[:, _I] - x[:, _J]) ** 2).sum(axis=-1) for x in (P, rays))
    s, off = _fitted(_cones(chords, sides), chords[:, None], sides[:, None], rounds)
    C, T = np.abs(s)[..., None] * rays[:, None], np.zeros((*s.shape[:2], 4, 4))
    T[..., :3, :3] = R = _triad(C) @ np.swapaxes(_triad(P), -1, -2)[:, None]
    T[..., :3, 3] = C.mean(axis=-2) - np.einsum("npij,nj->npi", R, P.mean(axis=-2))
    T[..., 3, 3] = 1.0
    return T, s, off


def _cones(chords: Array, sides: Array) -> Array:
    """Approximate distances (N, 12, 3) of three points from the camera, with double ones.

    With squared chords k between unit rays the law of cosines is (si - sj)^2 + si sj kij = sides.
    """
    # si = s0 (1 + angle vi), where small angles do not cancel: three quadrics in (v1, v2, 1)
    angle = np.sqrt(chords.max(axis=-1))
    k = chords / np.maximum(angle[:, None] ** 2, 1e-300)  # 0 where all rays coincide
    M, mixed = np.zeros((len(k), 3, 3, 3)), 0.5 * angle[:, None] * k
    M[:, (0, 1, 2, 2), (0, 1, 0, 1), (0, 1, 0, 1)] = 1.0
    mixed = mixed[:, (0, 1, 2, 2)]
    M[:, (0, 1, 2, 2), (0, 1, 0, 1), 2] = M[:, (0, 1, 2, 2), 2, (0, 1, 0, 1)] = mixed
    M[:, 2, 0, 1] = M[:, 2, 1, 0] = angle * mixed[:, 2] - 1.0
    M[:, :, 2, 2] = k
    # two combinations without the sides, and the three line pairs that they contain
    a = sides / sides.max(axis=-1)[:, None]
    n = np.cross(a, (1.0, -1.0, 0.0))
    n = np.stack((n, np.cross(a, n)), axis=1)
    n /= np.linalg.norm(n, axis=-1, keepdims=True)
    A, B = np.einsum("npi,nijk->pnjk", n, M)
    adjugate = [np.cross(D[:, (1, 2, 0)], D[:, (2, 0, 1)]) for D in (A, B)]
    cubic = [(x * y).sum(axis=(-2, -1)) for x in adjugate for y in (A, B)]
    companion = np.zeros(A.shape)
    companion[:, (1, 2), (0, 1)] = 1.0
    lead = np.where(cubic[3] == 0.0, 1e-300, cubic[3] / 3.0)
    companion[:, :, 2] = -np.stack((cubic[0] / 3.0, cubic[1], cubic[2]), axis=-1) / lead[:, None]
    g = np.linalg.eigvals(companion).real[..., None, None]
    A, B, scale = A[:, None], B[:, None], np.hypot(1.0, g)
    sizes, V = np.linalg.eigh((A + g * B) / scale)
    first, p, last = np.moveaxis(V, -1, 0)[:, :, :, None]
    low, high = np.sqrt(np.maximum((-sizes[..., :1], sizes[..., 2:]), 0.0))
    line = high[..., None] * last + np.array((1.0, -1.0))[:, None] * low[..., None] * first
    # points p x + q y of each line, on another cone
    q = np.cross(p, line)
    q /= np.linalg.norm(q, axis=-1, keepdims=True) + 1e-300
    other = (B - g * A) / scale
    pp, pq, qq = (((x @ other) * y).sum(axis=-1)[..., None] for x, y in ((p, p), (p, q), (q, q)))
    root = -(pq + np.copysign(np.sqrt(np.maximum(pq**2 - pp * qq, 0.0)), pq))
    z = np.stack((root * p + pp * q, qq * p + root * q), axis=1).reshape(len(k), 12, 3)
    s = z[..., 2:] + angle[:, None, None] * np.insert(z[..., :2], 0, 0.0, axis=-1)
    s = s * np.sign(s.sum(axis=-1, keepdims=True))
    size = _law(s, chords[:, None], 0.0).sum(axis=-1, keepdims=True)
    return s * np.sqrt(0.5 * sides.sum(axis=-1)[:, None, None] / np.maximum(size, 1e-300))


def _law(s: Array, chords: Array, sides: Any) -> Array:
    """Half the residuals of the law of cosines."""
    return 0.5 * ((s[..., _I] - s[..., _J]) ** 2 + s[..., _I] * s[..., _J] * chords - sides)


def _fitted(s: Array, chords: Array, sides: Array, rounds: int) -> tuple[Array, Array]:
    """Distances of the law of cosines by Newton's method, and their largest residuals."""
    part, row, J = np.ones((*s.shape[:2], 1)), np.arange(3), np.zeros((*s.shape, 3))
    residual = _law(s, chords, sides)
    off = np.abs(residual).max(axis=-1, keepdims=True)
    for _ in range(rounds):  # steps that increase the residual, near double roots, are cut
        gap = s[..., _I] - s[..., _J]
        J[..., row, _I] = gap + 0.5 * s[..., _J] * chords
        J[..., row, _J] = 0.5 * s[..., _I] * chords - gap
        inverse = np.cross(J[..., (1, 2, 0), :], J[..., (2, 0, 1), :])  # transposed
        determinant = (J[..., 0, :] * inverse[..., 0, :]).sum(axis=-1, keepdims=True)
        step = (residual[..., None, :] @ inverse)[..., 0, :]
        after = s - part * step / np.where(determinant == 0.0, np.inf, determinant)
        residual_after = _law(after, chords, sides)
        off_after = np.abs(residual_after).max(axis=-1, keepdims=True)
        better = off_after < off
        s, residual = np.where(better, after, s), np.where(better, residual_after, residual)
        off, part = np.where(better, off_after, off), np.where(better, 1.0, 0.25 * part)
    return s, off[..., 0]


def _triad(P: Array) -> Array:
    """Right-handed axes on three points, as columns. Shapes: (..., 3, 3) -> same."""
    x = P[..., 1, :] - P[..., 0, :]
    x = x / np.maximum(np.linalg.norm(x, axis=-1, keepdims=True), 1e-300)
    z = np.cross(x, P[..., 2, :] - P[..., 0, :])
    z = z / np.maximum(np.linalg.norm(z, axis=-1, keepdims=True), 1e-300)
    return np.stack((x, np.cross(z, x), z), axis=-1)


def _sine(P: Array) -> Array:
    """Double area by the square of the longest side. Shapes: (..., 3, 3) -> (...)."""
    longest = ((P[..., _I, :] - P[..., _J, :]) ** 2).sum(axis=-1).max(axis=-1)
    a, b = P[..., 1, :] - P[..., 0, :], P[..., 2, :] - P[..., 0, :]
    return np.linalg.norm(np.cross(a, b), axis=-1) / np.where(longest > 0.0, longest, 1.0)


def _residual(T: Array, P: Array, m: Array) -> Array:
    """Largest image error. Shapes: T (N, S, 4, 4), P (n, 3) or (N, n, 3), m (N, n, 2) -> (N, S)."""
    P = P if P.ndim == 2 else P[:, None]
    X = P @ np.swapaxes(T[..., :3, :3], -1, -2) + T[..., None, :3, 3]
    with np.errstate(all="ignore"):
        return np.linalg.norm(X[..., :2] / X[..., 2:] - m[:, None], axis=-1).max(axis=-1)


def _refined(P: Array, m: Array, T: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Levenberg-Marquardt on the image error: poses, squared errors, whether they converged.

    Shapes: m (N, n, 2), T (N, S, 4, 4) -> (N, S, 4, 4), (N, S), (N, S).
    """
    feature, m = Points(P), m.reshape(len(m), 1, 2 * len(P))
    damping, done = np.full(T.shape[:2], 1e-6), np.zeros(T.shape[:2], bool)
    sight = sight_of(feature, T)
    cost = np.where(sight.exists, ((sight.s - m) ** 2).sum(axis=-1), np.inf)
    for _ in range(_ITERATIONS):
        A = feature._rows(sight.s, sight.depth)
        H = np.swapaxes(A, -1, -2) @ A * (1.0 + damping[..., None, None] * np.eye(6))
        step = np.linalg.solve(H, np.swapaxes(A, -1, -2) @ (sight.s - m)[..., None])[..., 0]
        after = T.copy()
        turn = Rotation.from_rotvec(step[..., 3:].reshape(-1, 3)).as_matrix()
        after[..., :3, :] = turn.reshape(*step.shape[:-1], 3, 3) @ T[..., :3, :]
        after[..., :3, 3] += step[..., :3]
        other = sight_of(feature, after)
        cost_after = np.where(other.exists, ((other.s - m) ** 2).sum(axis=-1), np.inf)
        reach = np.maximum(1.0, np.abs(T[..., :3, 3]).max(axis=-1))
        small = np.abs(step).max(axis=-1) <= 1e-11 * reach
        better = ((cost_after <= (1.0 + 1e-13) * cost) | small & other.exists) & ~done
        T = np.where(better[..., None, None], after, T)
        cost, done = np.where(better, cost_after, cost), done | small
        damping = np.clip(np.where(better, 0.1, 10.0) * damping, 1e-12, 1e12)
        if done.all():
            break
        sight = sight_of(feature, T)
    return T, cost, done


def _as_image(image: Any, n: int) -> Array:
    """Normalised image points (..., n, 2); pixels are refused, whose poses would be wrong."""
    m = as_sized(image, (n, 2), "image")
    if np.abs(m).max(initial=0.0) > _FARTHEST:
        raise InvalidValueError(
            f"image: expected normalised coordinates X / Z, got {float(np.abs(m).max()):.6g}; "
            "if these are pixels, give camera.normalise(pixels)."
        )
    return m


def _checked(points: Any, image: Any) -> tuple[Array, Array, tuple[int, ...]]:
    """Points (n, 3), images (N, n, 2) and the shape of their batch."""
    P = as_points(points, "points", 3)
    m = _as_image(image, len(P))
    sizes = np.linalg.svd(P - P.mean(axis=0), compute_uv=False)
    if sizes[1] <= _THIN * sizes[0]:
        raise InvalidValueError("points: expected points that are not all on one line.")
    if (np.ptp(m, axis=-2) <= _THIN * np.abs(m).max(axis=-2)).all(axis=-1).any():
        raise InvalidValueError("image: expected image points that do not all coincide.")
    batch = m.shape[:-2]
    return P, m.reshape(math.prod(batch), *m.shape[-2:]), batch


def _packed(
    given: tuple[Array, Array, Any], T: Array, off: Array, x: Array, same: Any, done: Any, most: int
) -> PoseSolutions:
    """Solutions by growing misfits, without those whose x differ by up to ``same``.

    Shapes: T (N, S, 4, 4), off and done (N, S), infinite for none, x (N, S, k), same (N, 1).
    """
    P, m, batch = given
    order = np.argsort(off, axis=-1)
    T, x, done, off = (taken(a, order) for a in (T, x, done, off))
    valid = np.isfinite(off)
    near = np.abs(x[:, :, None] - x[:, None]).max(axis=-1) <= np.reshape(same, (-1, 1, 1))
    valid &= ~np.tril(near & valid[:, None], -1).any(axis=-1)
    valid &= valid.cumsum(axis=-1) <= most
    codes = np.where(valid.any(axis=-1), PoseStatus.FOUND, PoseStatus.NONE_FOUND)
    codes[(valid.sum(axis=-1) == 2) & (most == 2)] = PoseStatus.TWO_MINIMA
    codes[(valid & ~done).any(axis=-1)] = PoseStatus.NOT_CONVERGED
    valid, T = packed(valid, T)
    T, valid, off = (a.reshape(*batch, *a.shape[1:]) for a in (T, valid, _residual(T, P, m)))
    return PoseSolutions(T, valid, off, codes.astype(np.int8).reshape(batch))
