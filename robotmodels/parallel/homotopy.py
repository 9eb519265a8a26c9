"""Assembly modes of six legs: parameter homotopy from a stored robot, see `kernels_homotopy`."""

from __future__ import annotations

from functools import cache
from importlib.resources import files

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from .legs import Found, leg_states, rods
from .robot import ParallelRobot, pose_at

Complex = NDArray[np.complex128]
_DEGENERATE, _SOME_LOST = 1, 2  # codes of AssemblyStatus
_ACCURACIES = 3e-2, 1e-3, 1e-4  # of predictions, and what is tried where paths are missing
_REAL = 1e-6  # imaginary parts, relative, at simple ends of paths
_SAME = 1e-7  # distance of ends of two paths
_NEAR = 1e-3  # the same for paths that get stuck at multiple solutions
_FINITE = 1e-9  # |e.e| beside |e|^2, which are equal at real solutions
_NEARLY_INFINITE = 1e-6  # the same of solutions whose conjugates may be lost, never real ones
_FAR = 1e4  # |g| beside |e|, in units of the robot, of stuck paths to translations at infinity
_CONJUGATE = 1e-5  # distance of conjugate ends
_MANY = 8  # stuck paths, not in groups, are a continuum and no numerical accident
_TURNS = np.array([0.0, 1.1, 2.3, 3.1, 4.7, 5.2, 0.4])  # phases of the equations in new attempts
_PROJECTION = np.array([0.71, 0.37, 0.53, 0.29])  # no vector that symmetric robots prefer
_FLAT = 1e-9  # smallest singular value, relative, of a robot that is singular everywhere


def spatial(robot: ParallelRobot, q: Array) -> Found:
    """Six legs in space, by homotopy; rows with missing paths are tried again more carefully."""
    from .kernels import polish
    from .kernels_homotopy import paths

    N = len(q)
    T, status = np.full((N, 40, 4, 4), np.nan), np.zeros(N, np.int8)
    residual, det, complex_count = T[..., 0, 0].copy(), T[..., 0, 0].copy(), np.zeros(N, np.int64)
    if _is_singular_everywhere(robot):
        return T, residual, det, status + _DEGENERATE, complex_count
    unit, quadrics = _quadrics(robot, q)
    found: dict[int, tuple[Complex, NDArray[np.bool_]]] = {}
    lost = np.arange(N)
    for attempt, accuracy in enumerate(_ACCURACIES):
        ends, codes = np.empty((len(lost), 40, 16)), np.empty((len(lost), 40))
        paths(quadrics[lost], *_stored(), attempt * _TURNS, np.array([accuracy]), ends, codes)
        for s, x, code in zip(lost.tolist(), ends.view(np.complex128), codes, strict=True):
            found[s] = _finite(x, code)
        lost = np.array([s for s in lost.tolist() if _is_incomplete(*found[s])], np.int64)
    for s, (y, stuck) in found.items():
        if s in lost:
            many = stuck.sum() >= _MANY
            status[s] = _DEGENERATE if many else _SOME_LOST
        near = np.where(stuck[:, None] | stuck, _NEAR, _SAME)
        first = ~np.tril(_distances(y, y) < near, -1).any(axis=1)
        y, stuck = y[first], stuck[first]
        real = np.abs(y.imag).max(axis=1, initial=0.0) < np.where(stuck, _NEAR, _REAL)
        complex_count[s] = len(y)
        T[s, : len(y)][real] = _poses(robot, y.real[real], unit[s])
    columns, size = np.array(robot.columns), robot.size + unit[:, None]
    for _ in range(2):  # at a singular pose Newton's method is slow: a second round
        polish(*rods(robot, q), columns, T, residual, det)
    residual[~(residual <= 1e-11 * size)] = np.nan
    cosine = 0.5 * (np.einsum("skij,ij->sk", T[..., :3, :3], robot.home[:3, :3]) - 1.0)
    away = np.linalg.norm(T[..., :3, 3] - robot.home[:3, 3], axis=-1) / robot.length
    away = away + np.arccos(np.clip(cosine, -1.0, 1.0))
    order = np.argsort(np.where(np.isnan(residual), np.nan, away), axis=1, kind="stable")
    residual, det = (np.take_along_axis(values, order, 1) for values in (residual, det))
    T = np.take_along_axis(T, order[..., None, None], 1)
    T[np.isnan(residual)] = det[np.isnan(residual)] = np.nan
    return T, residual, det, status, complex_count


@cache
def _stored() -> tuple[Array, Array]:
    """The stored member and its 40 solutions: real and imaginary parts in turns."""
    path = files("robotmodels.parallel").joinpath("start.npz")
    with path.open("rb") as file, np.load(file) as data:
        return data["member"], data["solutions"]


def _quadrics(robot: ParallelRobot, q: Array) -> tuple[Array, Array]:
    """Unit of length (N,), and coefficients (N, 81) of the quadrics, see `kernels_homotopy`."""
    a, b = robot.base - robot.base[0], robot.platform - robot.platform[0]
    unit = np.sqrt((a * a).sum() + (b * b).sum() + (q * q).sum(axis=1)) / 3.0
    a, b, l2 = a / unit[:, None, None], b / unit[:, None, None], (q / unit[:, None]) ** 2
    left, right = _product_matrices(a, 1.0), _product_matrices(b, -1.0)
    c = (a * a).sum(axis=-1) + (b * b).sum(axis=-1) + l2[:, :1] - l2
    A = c[..., None, None] * np.eye(4) + 2.0 * left @ right
    B = 4.0 * (right - left)
    i, j = np.triu_indices(4)
    legs = np.concatenate((A[..., i, j], B[..., i, j][..., i != j]), axis=-1)[:, 1:]
    legs *= 4.0 / np.linalg.norm(legs, axis=-1, keepdims=True)
    return unit, np.concatenate((l2[:, :1], legs.reshape(len(q), 80)), axis=1)


def _product_matrices(v: Array, side: float) -> Array:
    """Matrices of the quaternion products v e (side 1) and e v (-1). Shapes: (..., 3) -> 4x4."""
    M = np.zeros((*v.shape[:-1], 4, 4))
    M[..., 1:, 0], M[..., 0, 1:] = v, -v
    M[..., 1:, 1:] = side * np.cross(np.eye(3), v[..., None, :])
    return M


def _finite(x: Complex, codes: Array) -> tuple[Complex, NDArray[np.bool_]]:
    """Ends with a rotation, |e| = 1 and a real projection of e, and which of them got stuck."""
    ee, norm = (x[:, :4] ** 2).sum(axis=1), np.linalg.norm(x[:, :4], axis=1)
    kept = (codes < 2) & np.isfinite(x).all(axis=1)
    kept &= np.abs(ee) > _FINITE * norm**2
    kept &= (codes == 0) | (np.linalg.norm(x[:, 4:], axis=1) <= _FAR * norm)
    return _normalised(x[kept]), codes[kept] == 1


def _normalised(x: Complex) -> Complex:
    """Homogeneous coordinates with |e| = 1 and a positive projection of e on a fixed vector."""
    along = x[:, :4] @ _PROJECTION
    phase = np.abs(along) / np.where(along == 0.0, 1.0, along)
    return x * (phase / np.linalg.norm(x[:, :4], axis=1))[:, None]


def _distances(x: Complex, y: Complex) -> Array:
    """Largest differences of entries. Shapes: (S, 8), (R, 8) -> (S, R)."""
    return np.abs(x[:, None] - y).max(axis=-1)


def _is_incomplete(y: Complex, stuck: NDArray[np.bool_]) -> bool:
    """Whether paths are missing: ends that coincide, got stuck alone, or lack a conjugate."""
    near = np.where(stuck, _NEAR, _SAME)
    twin = (_distances(y, y) + 9.0 * np.eye(len(y)) < near[:, None]).any(axis=1)
    conjugate = _distances(y, _normalised(y.conj())).min(axis=1, initial=9.0)
    alone = conjugate > np.where(stuck, _NEAR, _CONJUGATE)
    alone &= np.abs((y[:, :4] ** 2).sum(axis=1)) > _NEARLY_INFINITE
    return bool((stuck != twin).any() or alone.any())


def _poses(robot: ParallelRobot, x: Array, unit: float) -> Array:
    """Poses of real soma coordinates. Shapes: (S, 8) -> (S, 4, 4)."""
    w, v, g = x[:, :1], x[:, 1:4], x[:, 5:]
    size = np.linalg.norm(v, axis=1, keepdims=True)
    turn = 2.0 * np.arctan2(size, w) * v / np.maximum(size, 1e-300)
    p = 2.0 * (g * w - x[:, 4:5] * v - np.cross(g, v)) / (x[:, :4] ** 2).sum(axis=1)[:, None]
    T = pose_at(np.concatenate((unit * p, turn), axis=1))
    T[:, :3, 3] += robot.base[0] - T[:, :3, :3] @ robot.platform[0]
    return T


def _is_singular_everywhere(robot: ParallelRobot) -> bool:
    """Whether the lines of the legs depend on each other at random poses."""
    random = np.random.default_rng(5).uniform(-1.0, 1.0, (4, 6)) * np.repeat([robot.size, 2.0], 3)
    rows = leg_states(robot, pose_at(random)).rows
    s = np.linalg.svd(rows / np.repeat([1.0, robot.length], 3), compute_uv=False)
    return bool((s[:, -1] < _FLAT * s[:, 0]).all())
