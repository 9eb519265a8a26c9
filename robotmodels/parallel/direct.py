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
    Where to start; default the home pose, of a Gough platform without limits raised to the mean of
    the lengths.

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
Seed book section 2.4; C. Wampler, Mechanism and Machine Theory 31 (1996) 331-337; J.-P. Merlet,
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
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import LARGEST, Array, as_bounded, as_vector, batch_rows
from .._outcomes import Outcome
from ..errors import InvalidValueError
from .families import height_above
from .legs import Found, Robot, is_looped, rods
from .robot import Family, ParallelRobot, PlatformResult

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
    start = _start(robot, q) if T0 is None else robot.checked(T0, "T0")
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
        from .homotopy import spatial

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


def _start(robot: ParallelRobot, q: Array) -> Array:
    """Where Newton's method starts without a given pose. Shapes: (..., m) -> (..., 4, 4)."""
    place = robot.base.mean(axis=0) - robot.platform.mean(axis=0)
    up = robot.home[:3, 3] - place
    turned = not np.allclose(robot.home[:3, :3], np.eye(3))
    if robot.family is not Family.GOUGH or np.isfinite(robot.upper).all() or turned:
        return robot.home
    normal = up / np.linalg.norm(up) if up.any() else np.array([0.0, 0.0, 1.0])
    start = np.broadcast_to(robot.home, (*q.shape[:-1], 4, 4)).copy()
    height = height_above(robot, place, normal, (q**2).mean(axis=-1))
    start[..., :3, 3] = place + height[..., None] * normal
    return start
