"""Assembly modes of six legs: parameter homotopy from a stored robot, see `kernels_homotopy`."""

from __future__ import annotations

from functools import cache
from importlib.resources import files

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from .direct import AssemblyStatus, Found, rods
from .legs import leg_states
from .robot import ParallelRobot, pose_at

Complex = NDArray[np.complex128]
_ACCURACIES = 3e-2, 1e-3, 1e-4  # of predictions, and what is tried where paths are missing
_REAL = 1e-6  # imaginary parts, relative, at simple ends of paths
_SAME = 1e-7  # distance of ends of two paths
_NEAR = 1e-3  # the same for paths that get stuck at multiple solutions
_FINITE = 1e-9  # |e.e| beside |e|^2
_FAR = 1e4  # |g| beside |e|, in units of the robot, of stuck paths to translations at infinity
_CONJUGATE = 1e-5  # distance of conjugate ends
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
        return T, residual, det, status + AssemblyStatus.DEGENERATE, complex_count
    unit, quadrics = _quadrics(robot, q)
    x, codes = np.empty((N, 40, 8), np.complex128), np.empty((N, 40))
    start, lost = _stored(), np.ones(N, np.bool_)
    for attempt, accuracy in enumerate(_ACCURACIES):
        rows = np.flatnonzero(lost)
        ends, code = np.empty((len(rows), 40, 16)), np.empty((len(rows), 40))
        paths(quadrics[rows], *start, attempt * _TURNS, np.array([accuracy]), ends, code)
        x[rows], codes[rows] = ends.view(np.complex128), code
        lost[rows] = [_is_incomplete(x[s], codes[s]) for s in rows]
    for s in range(N):
        y, stuck = _finite(x[s], codes[s])
        near = np.where(stuck[:, None] | stuck, _NEAR, _SAME)
        first = ~np.tril(_distances(y, y) < near, -1).any(axis=1)
        y, stuck = y[first], stuck[first]
        real = np.abs(y.imag).max(axis=1, initial=0.0) < np.where(stuck, _NEAR, _REAL)
        complex_count[s] = len(y)
        T[s, : len(y)][real] = _poses(robot, y.real[real], unit[s])
        if any(_is_continuum(quadrics[s], row) for row in y[stuck]):
            status[s] = AssemblyStatus.DEGENERATE
    polish(*rods(robot, q), np.array(robot.columns), T, residual, det)
    T[~(residual <= 1e-11 * (robot.size + unit[:, None]))] = np.nan
    status[lost & (status == 0)] = AssemblyStatus.SOME_LOST
    cosine = 0.5 * (np.einsum("skij,ij->sk", T[..., :3, :3], robot.home[:3, :3]) - 1.0)
    away = np.linalg.norm(T[..., :3, 3] - robot.home[:3, 3], axis=-1) / robot.length
    order = np.argsort(away + np.arccos(np.clip(cosine, -1.0, 1.0)), axis=1, kind="stable")
    residual, det = (np.take_along_axis(values, order, 1) for values in (residual, det))
    return np.take_along_axis(T, order[..., None, None], 1), residual, det, status, complex_count


@cache
def _stored() -> tuple[Array, Array]:
    """The stored member and its 40 solutions: real and imaginary parts in turns."""
    with (
        files("robotmodels.parallel").joinpath("start.npz").open("rb") as file,
        np.load(file) as data,
    ):
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


def _is_incomplete(x: Complex, codes: Array) -> bool:
    """Whether paths are missing: ends that coincide, got stuck alone, or lack a conjugate."""
    y, stuck = _finite(x, codes)
    near = np.where(stuck, _NEAR, _SAME)
    twin = (_distances(y, y) + 9.0 * np.eye(len(y)) < near[:, None]).any(axis=1)
    conjugate = _distances(y, _normalised(y.conj())).min(axis=1, initial=9.0)
    alone = conjugate > np.where(stuck, _NEAR, _CONJUGATE)
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


def _is_continuum(m: Array, x: Complex) -> bool:
    """Whether a solution with a singular derivative lies on a curve of solutions."""
    i, j = np.triu_indices(4)
    legs = m[1:].reshape(5, 16)
    M = np.zeros((7, 8, 8))
    M[0] = np.diag(np.repeat([-m[0], 4.0], 4))
    M[1, range(4), range(4, 8)] = 1.0
    M[2:, i, j] = M[2:, j, i] = legs[:, :10]
    i, j = i[i != j], j[i != j]
    M[2:, 4 + i, j], M[2:, 4 + j, i] = legs[:, 10:], -legs[:, 10:]
    M = 0.5 * (M + np.swapaxes(M, 1, 2))

    def refined(y: Complex) -> Complex:
        for _ in range(15):
            step = np.linalg.pinv(np.vstack((2.0 * M @ y, x.conj())), rcond=1e-5)
            y = y - step @ np.append(y @ M @ y, x.conj() @ (y - x))
        return y

    x = refined(x)
    along = np.linalg.svd(np.vstack((2.0 * M @ x, x.conj())))[2][-1].conj()
    y = refined(x + 0.01 * along)
    return bool(np.abs(y @ M @ y).max() < 1e-10 and np.abs(y - x).max() > 1e-3)
