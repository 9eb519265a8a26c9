"""Direct geometric model by algebra: all poses of the platform at given lengths or angles."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, as_vector
from .._outcomes import Outcome
from .direct import checked_actuators, rods
from .legs import check_robot, leg_states
from .looped import LoopedPlatform
from .results import Result, at_index
from .robot import Family, ParallelRobot, pose_of

_ACCURACIES = 3e-2, 1e-3, 1e-4  # of predictions, and what is tried where paths are missing
_REAL = 1e-6  # imaginary parts, relative, at simple ends of paths
_SAME = 1e-7  # distance of ends of two paths
_NEAR = 1e-3  # the same for paths that get stuck at multiple solutions
_FINITE = 1e-9  # |e.e| beside |e|^2
_FLAT = 1e-9  # smallest singular value, relative, of a robot that is singular everywhere


class AssemblyStatus(Outcome):
    """Completeness of the assembly modes."""

    ALL = 0, "All assembly modes are listed."
    DEGENERATE = (
        1,
        "The legs do not determine the platform: solutions form a continuum, or the robot is singular "
        "at every pose.",
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
    rows = (x[:, :count].reshape(*batch, count, *x.shape[2:]) for x in (T, valid, residual, det))
    return AssemblyModes(*rows, status.reshape(batch), complex_count.reshape(batch))


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

    c, b, l = rods(robot, q)
    o = c - b
    a1 = o[:, 1] - o[:, 0]
    h1 = 0.5 * ((a1 * a1).sum(axis=1) + l[:, 0] ** 2 - l[:, 1] ** 2)
    if robot.m == 3:
        a2 = o[:, 2] - o[:, 0]
        h2 = 0.5 * ((a2 * a2).sum(axis=1) + l[:, 0] ** 2 - l[:, 2] ** 2)
    else:
        a2, h2 = np.broadcast_to([0.0, 0.0, 1.0], a1.shape), np.zeros_like(h1)
    n = np.cross(a1, a2)
    nn = (n * n).sum(axis=1)
    size = robot.size
    flat = nn <= 1e-18 * size ** (4 if robot.m == 3 else 2)
    x = h1[:, None] * np.cross(a2, n) + h2[:, None] * np.cross(n, a1)
    x = x / np.where(flat, 1.0, nn)[:, None]
    square = l[:, 0] ** 2 - (x * x).sum(axis=1)
    double = np.abs(square) <= 1e-13 * size**2
    height = np.sqrt(np.maximum(square, 0.0)) / np.sqrt(np.where(flat, 1.0, nn))
    T = np.full((len(q), 2, 4, 4), np.nan)
    meet = ~flat & ((square > 0.0) | double)
    for k, sign in enumerate((1.0, -1.0)):
        rows = meet & ~double if k else meet
        T[rows, k] = np.eye(4)
        T[rows, k, :3, 3] = (o[:, 0] + x + sign * height[:, None] * n)[rows]
    residual, det = np.full((len(q), 2), np.nan), np.full((len(q), 2), np.nan)
    polish(c, b, l, np.array(robot.columns), T, residual, det)
    # parallel equations that agree leave a circle (points that coincide: a sphere)
    lengths = (a1 * a1).sum(axis=1), (a2 * a2).sum(axis=1)
    cross = h1[:, None] * a2 - h2[:, None] * a1
    agree = (cross * cross).sum(axis=1) <= 1e-18 * size**6
    agree &= (lengths[0] > 1e-18 * size**2) | (np.abs(h1) <= 1e-9 * size**2)
    agree &= (lengths[1] > 1e-18 * size**2) | (np.abs(h2) <= 1e-9 * size**2)
    status = (flat & agree).astype(np.int8)
    return T, residual, det, status, np.where(flat, 0, np.where(double, 1, 2))


def _spatial(robot: ParallelRobot, q: Array) -> Found:
    """Six legs in space, by homotopy; rows with missing paths are tried again more carefully."""
    N = len(q)
    ends, codes = np.full((N, 40, 8), np.nan, np.complex128), np.full((N, 40), 1.0)
    T = np.full((N, 40, 4, 4), np.nan)
    none = np.full((N, 40), np.nan)
    if _singular_everywhere(robot):
        degenerate = np.full(N, AssemblyStatus.DEGENERATE, np.int8)
        return T, none, none, degenerate, np.zeros(N, np.int64)
    rows, lost = np.arange(N), np.ones(N, np.bool_)
    for attempt, accuracy in enumerate(_ACCURACIES):
        ends[rows], codes[rows] = _tracked(robot, q[rows], accuracy, attempt)
        lost[rows] = [_is_incomplete(*pair) for pair in zip(ends[rows], codes[rows], strict=True)]
        rows = np.flatnonzero(lost)
        if not rows.size:
            break
    status = np.zeros(N, np.int8)
    complex_count = np.zeros(N, np.int64)
    unit = _unit(robot, q)
    for s, m in enumerate(members(robot, q)):
        x, real, stuck = _distinct(ends[s], codes[s])
        complex_count[s] = len(x)
        T[s, : len(x)] = _poses(robot, x, real)
        scale = np.append(np.ones(4), np.full(4, 1.0 / unit[s]))
        if any(_is_continuum(m, row * scale) for row in x[stuck]):
            status[s] = AssemblyStatus.DEGENERATE
    residual, det = none.copy(), none.copy()
    from .kernels import polish

    polish(*rods(robot, q), np.array(robot.columns), T, residual, det)
    T[~(residual <= 1e-11 * (robot.size + unit[:, None]))] = np.nan
    status[lost & (status == 0)] = AssemblyStatus.SOME_LOST
    _sort_from_home(robot, T, residual, det)
    return T, residual, det, status, complex_count


@cache
def _stored() -> tuple[Array, Array]:
    """The stored member and its 40 solutions: real and imaginary parts in turns."""
    with files(__package__).joinpath("start.npz").open("rb") as file, np.load(file) as data:
        return data["member"], data["solutions"]


def _tracked(
    robot: ParallelRobot, q: Array, accuracy: float, attempt: int
) -> tuple[NDArray[np.complex128], Array]:
    """Ends of the paths in anchors relative to the first leg, lengths in units of the robot."""
    from .kernels_homotopy import spatial

    start, first = _stored()
    turns = attempt * np.array([0.0, 1.1, 2.3, 3.1, 4.7, 5.2, 0.4])
    ends, codes = np.empty((len(q), 40, 16)), np.empty((len(q), 40))
    spatial(members(robot, q), start, first, turns, np.array([accuracy]), ends, codes)
    x = ends.view(np.complex128)
    unit = _unit(robot, q)
    x[..., 4:] *= unit[:, None, None]
    return x, codes


def _unit(robot: ParallelRobot, q: Array) -> Array:
    """Length by which a robot is made of size 1. Shapes: (N, 6) -> (N,)."""
    a, b = robot.base - robot.base[0], robot.platform - robot.platform[0]
    return np.sqrt((a * a).sum() + (b * b).sum() + (q * q).sum(axis=1)) / 3.0


def members(robot: ParallelRobot, q: Array) -> Array:
    """Coefficients of the quadrics, see `kernels_homotopy`. Shapes: (N, 6) -> (N, 81)."""
    unit = _unit(robot, q)[:, None, None]
    a = (robot.base - robot.base[0]) / unit
    b = (robot.platform - robot.platform[0]) / unit
    l2 = (q / unit[:, 0]) ** 2
    left, right = _product_matrices(a, 1.0), _product_matrices(b, -1.0)
    c = (a * a).sum(axis=-1) + (b * b).sum(axis=-1) + l2[:, :1] - l2
    A = c[..., None, None] * np.eye(4) + 2.0 * left @ right
    B = 4.0 * (right - left)
    i, j = np.triu_indices(4)
    u, v = np.triu_indices(4, 1)
    legs = np.concatenate((A[..., i, j], B[..., u, v]), axis=-1)[:, 1:]
    legs *= 4.0 / np.linalg.norm(legs, axis=-1, keepdims=True)
    return np.concatenate((l2[:, :1], legs.reshape(len(q), 80)), axis=1)


def _product_matrices(v: Array, side: float) -> Array:
    """Matrices of the quaternion products v e (side 1) and e v (-1). Shapes: (..., 3) -> 4x4."""
    M = np.zeros((*v.shape[:-1], 4, 4))
    M[..., 1:, 0], M[..., 0, 1:] = v, -v
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        M[..., 1 + k, 1 + j], M[..., 1 + j, 1 + k] = side * v[..., i], -side * v[..., i]
    return M


def _normalised(x: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Homogeneous coordinates with |e| = 1 and the largest entry of e real and positive."""
    e = x[:, :4]
    pivot = np.take_along_axis(e, np.abs(e).argmax(axis=1)[:, None], 1)
    return x * (np.abs(pivot) / pivot) / np.linalg.norm(e, axis=1)[:, None]


def _usable(x: NDArray[np.complex128], codes: Array) -> NDArray[np.bool_]:
    """Ends with a rotation: not at e.e = 0."""
    return (
        (np.abs((x[:, :4] ** 2).sum(axis=1)) > _FINITE) & (codes < 2) & np.isfinite(x).all(axis=1)
    )


def _is_incomplete(x: NDArray[np.complex128], codes: Array) -> bool:
    """Whether paths are missing: ends that coincide, that got stuck alone, that lack a conjugate."""
    y = _normalised(x)
    kept = _usable(y, codes)
    y, stuck = y[kept], codes[kept] == 1
    far = np.abs(y[:, None] - y).max(axis=-1) + np.eye(len(y)) * 9.0
    near = np.where(stuck, _NEAR, _SAME)
    twins = (far < near[:, None]).any(axis=1)
    conjugate = np.abs(y[:, None] - _normalised(y.conj())).max(axis=-1)
    alone = conjugate.min(axis=1, initial=9.0) > np.where(stuck, _NEAR, 1e-5)
    return bool((stuck & ~twins).any() or (~stuck & twins).any() or alone.any())


def _distinct(
    x: NDArray[np.complex128], codes: Array
) -> tuple[NDArray[np.complex128], NDArray[np.bool_], NDArray[np.bool_]]:
    """Finite ends without repetition, which of them are real, and which got stuck."""
    y = _normalised(x)
    kept = _usable(y, codes)
    y, stuck = y[kept], codes[kept] == 1
    far = np.abs(y[:, None] - y).max(axis=-1)
    near = np.where(stuck[:, None] | stuck, _NEAR, _SAME)
    first = ~(np.tril(far < near, -1)).any(axis=1)
    y, stuck = y[first], stuck[first]
    real = np.abs(y.imag).max(axis=1, initial=0.0) < np.where(stuck, _NEAR, _REAL)
    return y, real, stuck


def _poses(robot: ParallelRobot, x: NDArray[np.complex128], real: NDArray[np.bool_]) -> Array:
    """Poses of soma coordinates, NaN where they are not real. Shapes: (S, 8) -> (S, 4, 4)."""
    e, g = x.real[:, :4], x.real[:, 4:]
    ee = (e * e).sum(axis=1)[:, None]
    w, v = e[:, :1], e[:, 1:]
    turn = np.arctan2(np.linalg.norm(v, axis=1), w[:, 0])
    axis = v / np.maximum(np.linalg.norm(v, axis=1), 1e-300)[:, None]
    p = 2.0 * (g[:, 1:] * w - g[:, :1] * v - np.cross(g[:, 1:], v)) / ee
    T = pose_of(np.concatenate((p, 2.0 * turn[:, None] * axis), axis=1))
    T[:, :3, 3] += robot.base[0] - T[:, :3, :3] @ robot.platform[0]
    T[~real] = np.nan
    return T


def _rows(robot: ParallelRobot, T: Array) -> Array:
    """Lines of six legs, moments in the characteristic length. Shapes: (N, 4, 4) -> (N, 6, 6)."""
    rows = leg_states(robot, T, np.zeros(len(T), np.int64)).rows
    return rows / np.repeat([1.0, robot.length], 3)


def _singular_everywhere(robot: ParallelRobot) -> bool:
    """Whether the lines of the legs depend on each other at random poses."""
    random = np.random.default_rng(5).uniform(-1.0, 1.0, (4, 6)) * np.repeat([robot.size, 2.0], 3)
    values = np.linalg.svd(_rows(robot, pose_of(random)), compute_uv=False)
    return bool((values[:, -1] < _FLAT * values[:, 0]).all())


def _is_continuum(m: Array, x: NDArray[np.complex128]) -> bool:
    """Whether a solution with a singular derivative lies on a curve of solutions."""
    i, j = np.triu_indices(4)
    u, v = np.triu_indices(4, 1)
    M = np.zeros((7, 8, 8))
    M[0, range(4), range(4)], M[0, range(4, 8), range(4, 8)] = -m[0], 4.0
    M[1, range(4), range(4, 8)] = 1.0
    legs = m[1:].reshape(5, 16)
    M[2:, i, j] = M[2:, j, i] = legs[:, :10]
    M[2:, 4 + u, v], M[2:, 4 + v, u] = legs[:, 10:], -legs[:, 10:]
    M = 0.5 * (M + np.swapaxes(M, 1, 2))

    def refined(y: NDArray[np.complex128]) -> NDArray[np.complex128]:
        for _ in range(15):
            step = np.linalg.pinv(np.vstack((2.0 * M @ y, x.conj())), rcond=1e-5)
            y = y - step @ np.append(y @ M @ y, x.conj() @ (y - x))
        return y

    x = refined(x)
    along = np.linalg.svd(np.vstack((2.0 * M @ x, x.conj())))[2][-1].conj()
    y = refined(x + 0.01 * along)
    return bool(np.abs(y @ M @ y).max() < 1e-10 and np.abs(y - x).max() > 1e-3)


def _sort_from_home(robot: ParallelRobot, T: Array, residual: Array, det: Array) -> None:
    """Order solutions by their distance from the home pose, in place."""
    cosine = 0.5 * (np.einsum("skij,ij->sk", T[..., :3, :3], robot.home[:3, :3]) - 1.0)
    away = np.linalg.norm(T[..., :3, 3] - robot.home[:3, 3], axis=-1) / robot.length
    order = np.argsort(away + np.arccos(np.clip(cosine, -1.0, 1.0)), axis=1, kind="stable")
    T[:] = np.take_along_axis(T, order[..., None, None], 1)
    residual[:], det[:] = (np.take_along_axis(x, order, 1) for x in (residual, det))
