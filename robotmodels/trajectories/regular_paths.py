"""Paths with a regular parameter: their own, or their length where that rests or jumps."""

from __future__ import annotations

import numpy as np

from .._arrays import Array
from ..errors import InvalidValueError
from ..kinematics.singular.task import whole_number
from ..model import RobotModel, check_model
from .joint_path import joint_path
from .motions import Motion
from .path_events import PathEventKind
from .point_to_point import linear
from .pose_trajectory import PoseTrajectory
from .splines import cubic_spline
from .trajectory import Trajectory

_SLOW, _STILL = 1e-3, 2e-5  # of the greatest rate: slower ends, and rests inside, need the length
_BEND = 1e-3  # of the greatest rate: changes between samples that are looked at more closely
_ZOOM = 17
_ROUNDS = 5
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
    speed = np.sqrt((rate * rate).sum(axis=1))
    most = float(speed.max())
    # inside, a path may turn back in its own parameter, which goes on, but not rest in it
    inner = speed + np.sqrt((bend * bend).sum(axis=1)) * (t[1] - t[0])
    moves = min(speed[0], speed[-1]) > _SLOW * most and inner.min() > _STILL * most
    if moves and not _jumps(motion, t, q, most):
        return motion
    return _by_length(motion, np.linspace(0.0, end, 10 * _KNOTS + 1))


def _jumps(motion: Motion, t: Array, q: Array, most: float) -> bool:
    """Whether the velocity jumps: a change of slope that does not shrink with the step."""
    slope = np.diff(q, axis=0) / np.diff(t)[:, None]
    change = np.diff(slope, axis=0)
    bend = np.abs(np.diff(change, axis=0)).max(axis=1, initial=0.0)
    at = np.flatnonzero(bend > _BEND * most)
    at = at[np.argsort(bend[at])[-20:]]
    if not at.size:
        return False
    low, high, first, left = t[at], t[at + 3], bend[at], bend[at]
    for _ in range(_ROUNDS):
        fine = low[:, None] + (high - low)[:, None] * np.linspace(0.0, 1.0, _ZOOM)
        (values,) = motion.derivatives(fine.reshape(-1), (0,))
        slopes = np.diff(values.reshape(*fine.shape, -1), axis=1) / np.diff(fine)[..., None]
        steps = np.abs(np.diff(slopes, axis=1)).max(axis=2)
        k, row = steps.argmax(axis=1), np.arange(at.size)
        low, high, left = fine[row, k], fine[row, k + 2], steps[row, k]
    return bool((left > 0.2 * first).any())


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
        if turn[k] > _TURN and _is_kink(motion, times[k], times[k + 2], length[-1], turn[k]):
            return f"The path turns by {turn[k]:.3g} rad at s = {times[k + 1]:.6g}."
    apart = np.concatenate(((True,), sizes > 0.0))
    return cubic_spline(
        knots[apart], np.concatenate(((0.0,), np.cumsum(sizes[sizes > 0.0]))), ends="not_a_knot"
    ).motion


def _is_kink(motion: Motion, low: float, high: float, length: float, turn: float) -> bool:
    """Whether the direction changes by as much within any part of an interval, however short."""
    for _ in range(3):
        t = np.linspace(low, high, 4 * _ZOOM)
        (q,) = motion.derivatives(t, (0,))
        chords = np.diff(q, axis=0)
        sizes = np.linalg.norm(chords, axis=1)
        seen = np.flatnonzero(sizes > 1e-10 * length)
        if seen.size < 3:
            break
        unit = chords[seen] / sizes[seen, None]
        turns = np.linalg.norm(np.diff(unit, axis=0), axis=1)
        k = int(turns.argmax())
        if turns[k] < 0.5 * turn:
            return False
        low, high = float(t[seen[k]]), float(t[seen[k + 1] + 1])
    return True


def toward_ends(intervals: int) -> Array:
    """Fractions from 0 to 1 that are dense at both ends, where a path from rest bends most."""
    return np.sin(np.linspace(0.0, 0.5 * np.pi, intervals + 1)) ** 2


def checked_points(points: int) -> int:
    """Number of intervals of a grid."""
    return whole_number(points, "points", 2)
