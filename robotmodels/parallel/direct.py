"""Direct geometric models (forward kinematics): the pose near a given one, all assembly modes.

`dgm` iterates Newton's method from a pose nearby. `assembly_modes` continues the 40 complex
solutions of a stored robot (Gough platforms), solves the sextic (planar robots), or intersects
spheres and circles (Delta and five-bar). Kinematic loops are searched from random postures, which
is no proof (``SOME_LOST``).

Parameters
----------
robot, q
    See `robotmodels.parallel`.
T0 : array_like, shape (..., 4, 4), optional
    Where to start; default the home pose.

Returns
-------
PlatformPoses or AssemblyModes
    ``T`` are poses (..., 4, 4), NaN where none was found, or (..., S, 4, 4), packed, with ``valid``
    and ``count``: by ascending angle of planar robots, else by the distance from home. ``status``
    are codes of `PoseStatus` or `AssemblyStatus`, ``residual`` the largest error of a leg's length,
    m, ``det`` as `determinant`, ``iterations`` those of Newton's method; ``complex_count`` is the
    number of solutions in complex numbers, the real ones included, none at infinity.

References
----------
Book section 2.4; C. Wampler, Mechanism and Machine Theory 31 (1996) 331-337; J.-P. Merlet,
"Parallel Robots", 2nd ed., chapter 4.

Examples
--------
>>> from robotmodels.parallel import planar_3rpr
>>> robot = planar_3rpr([[0, 0], [15.91, 0], [0, 10]], [[0, 0], [17.04, 0], [13.23, 16.1]])
>>> modes = assembly_modes(robot, [14.98, 15.38, 12.0])
>>> modes.count, modes.complex_count, dgm(robot, [14.98, 15.38, 12.0], modes.T[0]).status
(np.int64(6), array(6), array(0, dtype=int8))
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import LARGEST, Array, as_bounded, as_vector, batch_rows
from .._outcomes import Outcome
from ..errors import InvalidValueError
from .legs import Found, Robot, is_looped, leg_states, rods
from .robot import Family, ParallelRobot, PlatformResult, pose_at

_PLANE = np.array(Family.PLANAR_3RPR.value[1])  # components of a twist in the plane


class PoseStatus(Outcome):
    """Outcome of an iterative direct model."""

    CONVERGED = 0, "The pose is found, on the same side of singular positions as the start."
    NOT_CONVERGED = 1, "No pose was found near the start: legs may be too short to meet."
    LEFT_THE_MODE = 2, "A pose is found beyond a singular position, where the determinant is 0."


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class PlatformPoses(PlatformResult):
    """Poses of the platform, see the head of the file. Read-only."""

    outcomes: ClassVar = PoseStatus
    T: Array
    status: NDArray[np.int8]
    iterations: NDArray[np.int64]
    residual: Array
    det: Array


class AssemblyStatus(Outcome):
    """Completeness of the assembly modes."""

    ALL = 0, "All assembly modes are listed."
    DEGENERATE = 1, "The legs do not determine the platform: solutions form a continuum."
    SOME_LOST = 2, "Assembly modes may be missing: not every path or start led to a solution."


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class AssemblyModes(PlatformResult):
    """All poses of the platform at given lengths or angles, packed. Read-only."""

    outcomes: ClassVar = AssemblyStatus
    T: Array
    valid: NDArray[np.bool_]
    residual: Array
    det: Array
    status: NDArray[np.int8]
    complex_count: NDArray[np.int64]

    def reason(self, i: int | tuple[int, ...] = ()) -> str:
        """Outcome of row i as a sentence; i is left out for a single row."""
        words = PlatformResult.reason(self, i)
        if words == AssemblyStatus.ALL.sentence and not self.count[i]:
            return "There is no assembly mode: legs of these lengths do not meet the platform."
        return words


def dgm(robot: Robot, q: ArrayLike, T0: ArrayLike | None = None) -> PlatformPoses:
    """Direct geometric model by Newton's method from a pose nearby."""
    if is_looped(robot):
        return PlatformPoses(*robot.closed(q, T0))
    q = checked_actuators(robot, q)
    start = robot.home if T0 is None else robot.checked(T0, "T0")
    batch, (rows, T0) = batch_rows((q, start.reshape(*start.shape[:-2], 16)), ("q", "T0"))
    T, out = np.empty((len(rows), 4, 4)), np.empty((len(rows), 4))
    from .kernels import direct

    direct(*rods(robot, rows), T0.reshape(-1, 4, 4), np.array(robot.columns), T, out)
    T[out[:, 0] == PoseStatus.NOT_CONVERGED] = np.nan
    code, iterations, residual, det = (x.reshape(batch) for x in out.T)
    T = T.reshape(*batch, 4, 4)
    return PlatformPoses(T, code.astype(np.int8), iterations.astype(np.int64), residual, det)


def assembly_modes(robot: Robot, q: ArrayLike) -> AssemblyModes:
    """All assembly modes (all solutions of the direct geometric model)."""
    looped = is_looped(robot)
    q = as_vector(q, robot.m, "q") if looped else checked_actuators(robot, q)
    T, residual, det, status, complex_count = _found(robot, q.reshape(-1, robot.m))
    batch = q.shape[:-1]
    valid = ~np.isnan(residual)
    count = int(valid.sum(axis=1).max(initial=0))
    cut: Any = (x[:, :count] for x in (T, valid, residual, det))
    if len(batch) != 1:
        cut = (x.reshape(*batch, *x.shape[1:]) for x in cut)
    more = status.reshape(batch), complex_count.reshape(batch)
    return AssemblyModes(*cut, *more)  # type: ignore[reportCallIssue]


def _found(robot: Robot, q: Array) -> Found:
    """Assembly modes of rows q (N, m), by the method of the family."""
    if is_looped(robot):
        return robot.assemblies(q)
    if robot.family is Family.GOUGH:
        return spatial(robot, q)
    turns = robot.family in (Family.PLANAR_3RPR, Family.PLANAR_3RRR)
    return _planar(robot, q) if turns else _spheres(robot, q)


def _planar(robot: ParallelRobot, q: Array) -> Found:
    """Three legs in the plane."""
    from .kernels import planar

    T, values, out = np.empty((len(q), 6, 4, 4)), np.empty((2, len(q), 6)), np.empty((len(q), 2))
    planar(*rods(robot, q), robot.home, _PLANE, T, *values, out)
    return T, values[0], values[1], out[:, 0].astype(np.int8), out[:, 1].astype(np.int64)


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
    up = np.sqrt(np.maximum(square, 0.0) / nn)[:, None] * n
    T = np.tile(np.eye(4), (len(q), 2, 1, 1))
    T[..., :3, 3] = (o[:, 0] + x)[:, None] + np.stack((up, -up), axis=1)
    T[flat | ~((square > 0.0) | double)] = T[double, 1] = np.nan
    residual, det = np.full((len(q), 2), np.nan), np.full((len(q), 2), np.nan)
    polish(c, b, lengths, np.array(robot.columns), T, residual, det)
    # planes that are parallel and agree leave a circle; those of coinciding centres a sphere
    cross = h[:, :1] * a[:, 1] - h[:, 1:] * a[:, 0]
    agree = (cross * cross).sum(axis=1) <= 1e-18 * size**6
    apart = (a * a).sum(axis=-1) > 1e-18 * size**2
    agree &= (apart | (np.abs(h) <= 1e-9 * size**2)).all(axis=1)
    status = (flat & agree).astype(np.int8)
    return T, residual, det, status, np.where(flat, 0, np.where(double, 1, 2))


def checked_actuators(robot: ParallelRobot, q: ArrayLike) -> Array:
    """Actuated lengths or angles, lengths not negative. Shapes: -> (..., m)."""
    q = as_bounded(as_vector(q, robot.m, "q"), "q", LARGEST)
    if not robot.has_cranks and (least := q.min(initial=0.0)) < 0.0:
        raise InvalidValueError(
            f"q: expected lengths of legs (not strokes) that are not negative, got {least:.6g} m."
        )
    return q


# --- six legs: parameter homotopy from a stored robot, see `kernels_homotopy` ---------------------


Complex = NDArray[np.complex128]
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
        return T, residual, det, status + AssemblyStatus.DEGENERATE, complex_count
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
            status[s] = AssemblyStatus.DEGENERATE if many else AssemblyStatus.SOME_LOST
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
