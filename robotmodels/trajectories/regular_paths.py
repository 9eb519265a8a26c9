"""Paths with a regular parameter: their own, or their length where that rests or jumps."""

from __future__ import annotations

import numpy as np

from .._arrays import Array
from ..errors import InvalidValueError
from ..model import RobotModel, check_model
from .joint_path import joint_path
from .motions import FunctionMotion, Motion
from .path_events import PathEventKind
from .point_to_point import linear
from .pose_trajectory import PoseTrajectory
from .splines import cubic_spline
from .trajectory import Trajectory

_SLOW, _STILL = 1e-3, 2e-5  # of the greatest rate: slower ends, and rests inside, need the length
_BEND = 1e-3  # of the greatest rate: changes between samples that are looked at more closely
_TURN = 1e-2  # rad: a smaller change of direction within a millionth of the path is no kink
_SAMPLES = 8  # for each interval of the grid
_KNOTS = 800  # more of them would lose digits of the second derivative


def path_of(path: object, model: RobotModel | None, points: int) -> tuple[Motion | str, bool]:
    """A regular path of n joints (or why there is none), and whether it is scalar."""
    if isinstance(path, PoseTrajectory):
        return _through_poses(path, model, points), False
    if not isinstance(path, Trajectory):
        raise InvalidValueError(
            f"path: expected a Trajectory or a PoseTrajectory, got {type(path).__name__}; a path "
            "through points is cubic_spline(points, times, ends='not_a_knot')."
        )
    if path.motion.batch:
        raise InvalidValueError("path: expected one path, got a batch of motions.")
    if not float(path.motion.duration) > 0.0:
        raise InvalidValueError("path: it has no length; its ends are the same.")
    return _regular(path.motion, points), path.scalar


def _through_poses(path: PoseTrajectory, model: RobotModel | None, points: int) -> Motion | str:
    """Joints along a path of poses, at even steps of its own parameter."""
    if model is None:
        raise InvalidValueError("model: a path of poses needs the robot that follows it.")
    check_model(model)
    end = path.path.end
    evenly = PoseTrajectory(path.path, linear(0.0, end, duration=end))
    found = joint_path(model, evenly, samples=2 * max(points, 200) + 1)
    if not found.complete:
        stops = (PathEventKind.OUT_OF_REACH, PathEventKind.OUTSIDE_LIMITS, PathEventKind.JUMP)
        first = next(event for event in found.events if event.kind in stops)
        return f"The joints cannot follow the poses: {first}"
    return _regular(cubic_spline(found.q, found.t, ends="not_a_knot").motion, points)


def _regular(motion: Motion, points: int) -> Motion | str:
    """The motion itself where its velocity is continuous and nowhere small, else by its length."""
    end = float(motion.duration)
    t = np.linspace(0.0, end, _SAMPLES * points + 1)
    q, rate, bend = motion.derivatives(t, (0, 1, 2))
    speed, swing = (np.sqrt(np.einsum("ij,ij->i", x, x)) for x in (rate, bend))
    most = float(speed.max())
    # inside, a path may turn back in its own parameter, which goes on, but not rest in it
    moves = min(speed[0], speed[-1]) > _SLOW * most and (speed + swing * t[1]).min() > _STILL * most
    if moves and not _jumps(motion, t, q, most):
        return motion
    return _by_length(motion, np.linspace(0.0, end, 10 * _KNOTS + 1))


def _jumps(motion: Motion, t: Array, q: Array, most: float) -> bool:
    """Whether the velocity jumps: of functions, a change that does not shrink with the step."""
    if not isinstance(motion, FunctionMotion):
        return bool(np.isinf(motion.extremes(2)).any())
    change = np.abs(np.diff(q, 3, axis=0)).max(axis=1, initial=0.0) / t[1]
    worst = np.argsort(change)[-20:]
    return any(
        change[k] > _BEND * most and _is_sharp(motion, t[k], t[k + 3], change[k], None)
        for k in worst.tolist()
    )


def _by_length(motion: Motion, t: Array) -> Motion | str:
    """Spline through points of the path, over its length in joint space."""
    (q,) = motion.derivatives(t, (0,))
    length = np.concatenate(((0.0,), np.cumsum(np.linalg.norm(np.diff(q, axis=0), axis=1))))
    if not length[-1] > 0.0:
        raise InvalidValueError("path: it has no length; no joint moves.")
    moved = np.concatenate(((True,), np.diff(length) > 1e-9 * length[-1]))
    times = np.interp(length[-1] * toward_ends(_KNOTS), length[moved], t[moved])
    times[-1] = t[-1]
    (knots,) = motion.derivatives(times, (0,))
    chords = np.diff(knots, axis=0)
    sizes = np.linalg.norm(chords, axis=1)
    unit = chords / np.where(sizes > 0.0, sizes, 1.0)[:, None]
    turn = np.linalg.norm(np.diff(unit, axis=0), axis=1)
    for k in np.argsort(turn)[::-1][:20]:
        if turn[k] > _TURN and _is_sharp(motion, times[k], times[k + 2], turn[k], length[-1]):
            return f"The path turns by {turn[k]:.3g} rad at s = {times[k + 1]:.6g}."
    apart = np.concatenate(((True,), sizes > 0.0))
    at = np.concatenate(((0.0,), np.cumsum(sizes[sizes > 0.0])))
    return cubic_spline(knots[apart], at, ends="not_a_knot").motion


def _is_sharp(motion: Motion, low: float, high: float, size: float, length: float | None) -> bool:
    """Whether the velocity changes by as much within any part of an interval, however short.

    With the ``length`` of the path its direction, where it moves.
    """
    for _ in range(3):
        t = np.linspace(low, high, 68)
        (q,) = motion.derivatives(t, (0,))
        slope, seen = np.diff(q, axis=0) / (t[1] - t[0]), np.arange(67)
        if length is not None:
            sizes = np.linalg.norm(slope, axis=1)
            seen = np.flatnonzero(sizes * (t[1] - t[0]) > 1e-10 * length)
            slope = slope[seen] / sizes[seen, None]
        if seen.size < 3:
            break
        change = np.linalg.norm(np.diff(slope, axis=0), axis=1)
        k = int(change.argmax())
        if change[k] < 0.5 * size:
            return False
        low, high = float(t[seen[k]]), float(t[seen[k + 1] + 1])
    return True


def toward_ends(intervals: int) -> Array:
    """Fractions from 0 to 1 that are dense at both ends, where a path from rest bends most."""
    return np.sin(np.linspace(0.0, 0.5 * np.pi, intervals + 1)) ** 2
