"""Direct geometric model by algebra: all poses of the platform at given lengths or angles."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, as_vector
from .._outcomes import Outcome
from .direct import checked_actuators, rods
from .legs import check_robot, leg_states
from .looped import LoopedPlatform
from .results import Result, at_index
from .robot import Family, ParallelRobot, pose_at

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


class AssemblyStatus(Outcome):
    """Completeness of the assembly modes."""

    ALL = 0, "All assembly modes are listed."
    DEGENERATE = (
        1,
        "The legs do not determine the platform: solutions form a continuum, or the robot is "
        "singular at every pose.",
    )
    SOME_LOST = 2, "Assembly modes may be missing: not every path or start led to a solution."


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class AssemblyModes(Result):
    """All poses of the platform at given lengths or angles. Read-only.

    Parameters
    ----------
    T : ndarray, shape (..., S, 4, 4)
        Poses, packed, NaN where there is none: by ascending angle of planar robots, else by the
        distance from home.
    valid : ndarray of bool, shape (..., S)
        Whether the row is a solution.
    residual : ndarray, shape (..., S)
        Largest error of a leg's length, m.
    det : ndarray, shape (..., S)
        Determinants of the unit lines of the legs ``[u, (R b) x u]`` in the components of the
        twist that the platform has; zero at singular poses, one sign for each side.
    status : ndarray of int8, shape (...)
        Codes of `AssemblyStatus`.
    complex_count : ndarray of int64, shape (...)
        Number of solutions in complex numbers, the real ones included.

    Examples
    --------
    >>> from robotmodels.parallel import assembly_modes, planar_3rpr
    >>> robot = planar_3rpr([[0, 0], [15.91, 0], [0, 10]], [[0, 0], [17.04, 0], [13.23, 16.1]])
    >>> modes = assembly_modes(robot, [14.98, 15.38, 12.0])
    >>> modes.count, modes.complex_count, modes.reason()
    (np.int64(6), array(6), 'All assembly modes are listed.')
    """

    outcomes: ClassVar = AssemblyStatus
    T: Array
    valid: NDArray[np.bool_]
    residual: Array
    det: Array
    status: NDArray[np.int8]
    complex_count: NDArray[np.int64]

    def reason(self, i: int | tuple[int, ...] = ()) -> str:
        """Outcome of row i as a sentence; i is left out for a single row."""
        if at_index(self.status, i) == AssemblyStatus.ALL and at_index(self.count, i) == 0:
            return "There is no assembly mode: legs of these lengths do not meet the platform."
        return Result.reason(self, i)


def assembly_modes(robot: ParallelRobot | LoopedPlatform, q: ArrayLike) -> AssemblyModes:
    """All assembly modes (all solutions of the forward kinematics).

    Gough platforms: continuation of the 40 complex solutions of a stored robot; planar robots: the
    sextic; Delta and five-bar: intersections of spheres and circles. Loops of any other kind are
    searched by Newton's method from random postures, which is no proof (``SOME_LOST``).

    Parameters
    ----------
    robot : ParallelRobot or LoopedPlatform
        The robot, m legs.
    q : array_like, shape (..., m)
        Actuated lengths, m, or angles, rad.

    Returns
    -------
    AssemblyModes
        Poses, with their determinants.

    Raises
    ------
    ShapeError, InvalidValueError
        Arrays of the wrong shape, NaN, negative lengths.

    References
    ----------
    Seed book section 2.4.2; C. Wampler, "Forward displacement analysis of general six-in-parallel
    SPS (Stewart) platform manipulators using soma coordinates", Mechanism and Machine Theory 31
    (1996) 331-337; J.-P. Merlet, "Parallel Robots", 2nd ed., chapter 4.

    Examples
    --------
    >>> import numpy as np
    >>> from robotmodels.parallel import assembly_modes, gough_symmetric, igm
    >>> robot = gough_symmetric(1.0, kind="MSSM")
    >>> modes = assembly_modes(robot, igm(robot, robot.pose([0.1, 0, 0.9, 0, 0.1, 0.2])).q[0])
    >>> modes.complex_count, bool(modes.residual[modes.valid].max() < 1e-12)
    (array(16), True)
    """
    check_robot(robot)
    if isinstance(robot, LoopedPlatform):
        q = as_vector(q, robot.m, "q")
        return _packed(robot.assemblies(q.reshape(-1, robot.m)), q.shape[:-1])
    q = checked_actuators(robot, q)
    batch, rows = q.shape[:-1], np.ascontiguousarray(q.reshape(-1, robot.m))
    if robot.family is Family.GOUGH:
        found = _spatial(robot, rows)
    elif robot.m == 3 and 5 in robot.columns:
        found = _planar(robot, rows)
    else:
        found = _spheres(robot, rows)
    return _packed(found, batch)


Complex = NDArray[np.complex128]
Found = tuple[Array, Array, Array, NDArray[np.int8], NDArray[np.int64]]
"""Candidates T (N, S, 4, 4), NaN where none, residual, det (N, S), status, complex count (N,)."""


def _packed(found: Found, batch: tuple[int, ...]) -> AssemblyModes:
    """Result with solutions first and no more rows than needed."""
    T, residual, det, status, complex_count = found
    valid = ~np.isnan(T[..., 0, 3])
    count = int(valid.sum(axis=1).max(initial=0))
    if (valid[:, 1:] > valid[:, :-1]).any():
        order = np.argsort(~valid, axis=1, kind="stable")
        valid, residual, det = (np.take_along_axis(x, order, 1) for x in (valid, residual, det))
        T = np.take_along_axis(T, order[..., None, None], 1)
    residual[~valid] = det[~valid] = np.nan
    fields: list[Any] = [
        x[:, :count].reshape(*batch, count, *x.shape[2:]) for x in (T, valid, residual, det)
    ]
    fields += [status.reshape(batch), complex_count.reshape(batch)]
    return AssemblyModes(*fields)


def _planar(robot: ParallelRobot, q: Array) -> Found:
    """Three legs in the plane."""
    from .kernels import planar

    N = len(q)
    T, out = np.full((N, 6, 4, 4), np.nan), np.empty((N, 3))
    residual, det = np.full((N, 6), np.nan), np.full((N, 6), np.nan)
    planar(*rods(robot, q), np.array(robot.columns), T, residual, det, out)
    moves = out[:, 2] > 0.0
    T[moves] = np.nan
    T[..., 2, 3] += robot.home[2, 3]
    return T, residual, det, moves.astype(np.int8), out[:, 1].astype(np.int64)


def _spheres(robot: ParallelRobot, q: Array) -> Found:
    """Three spheres about the shifted knees, or two circles. Shapes: q (N, m)."""
    from .kernels import polish

    c, b, lengths = rods(robot, q)
    o = c - b
    # planes of two spheres each, a . x = h from the first centre; circles are in the plane z = 0
    a = np.zeros((len(q), 2, 3))
    a[:, : robot.m - 1] = o[:, 1:] - o[:, :1]
    h = 0.5 * ((a * a).sum(axis=-1) + lengths[:, :1] ** 2)
    h[:, : robot.m - 1] -= 0.5 * lengths[:, 1:] ** 2
    if robot.m == 2:
        a[:, 1, 2], h[:, 1] = 1.0, 0.0
    n = np.cross(a[:, 0], a[:, 1])
    nn, size = (n * n).sum(axis=1), robot.size
    flat = nn <= 1e-18 * size ** (2 * robot.m - 2)
    nn = np.where(flat, 1.0, nn)
    x = (h[:, :1] * np.cross(a[:, 1], n) + h[:, 1:] * np.cross(n, a[:, 0])) / nn[:, None]
    square = lengths[:, 0] ** 2 - (x * x).sum(axis=1)
    double = np.abs(square) <= 1e-13 * size**2
    height = np.sqrt(np.maximum(square, 0.0) / nn)
    T = np.full((len(q), 2, 4, 4), np.nan)
    for k, rows in enumerate((~flat & ((square > 0.0) | double), ~flat & (square > 0.0) & ~double)):
        T[rows, k] = np.eye(4)
        T[rows, k, :3, 3] = (o[:, 0] + x + (1 - 2 * k) * height[:, None] * n)[rows]
    residual, det = np.full((len(q), 2), np.nan), np.full((len(q), 2), np.nan)
    polish(c, b, lengths, np.array(robot.columns), T, residual, det)
    # planes that are parallel and agree leave a circle; those of coinciding centres a sphere
    cross = h[:, :1] * a[:, 1] - h[:, 1:] * a[:, 0]
    agree = (cross * cross).sum(axis=1) <= 1e-18 * size**6
    apart = (a * a).sum(axis=-1) > 1e-18 * size**2
    agree &= (apart | (np.abs(h) <= 1e-9 * size**2)).all(axis=1)
    status = (flat & agree).astype(np.int8)
    return T, residual, det, status, np.where(flat, 0, np.where(double, 1, 2))


def _spatial(robot: ParallelRobot, q: Array) -> Found:
    """Six legs in space, by homotopy; rows with missing paths are tried again more carefully."""
    from .kernels import polish
    from .kernels_homotopy import spatial

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
        spatial(quadrics[rows], *start, attempt * _TURNS, np.array([accuracy]), ends, code)
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
    rows = leg_states(robot, pose_at(random), np.zeros(4, np.int64)).rows
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
