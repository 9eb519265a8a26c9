"""Limits of a motion along a path, as rows that are linear in the acceleration and squared rate.

With s' the rate of the path parameter and x = s'^2, joint velocities are ``q' s'``, accelerations
``q' s'' + q'' x``, and torques ``a s'' + b x + c`` with a, b, c from three calls of the inverse
dynamic model (book section 4.4.1.1). Friction that depends on the speed is replaced by its
tangent at the rates of the solution before, until these do not change any more.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from .._arrays import Array, as_reals
from .._choices import as_instance
from ..dynamics.inverse import rigid_torques, warn_without_masses
from ..errors import InvalidValueError, ShapeError
from ..friction import Friction, check_friction
from ..friction.protocols import torque_at
from ..model import RobotModel, check_model
from .joint_path import joint_path
from .limits import MotionLimits, checked_limits
from .motions import FunctionMotion, Motion
from .point_to_point import linear
from .pose_trajectory import PoseTrajectory
from .splines import cubic_spline
from .trajectory import Trajectory

_FREE = MotionLimits()
SLOWEST = 1e-30  # rate at which friction is that of a joint that only just moves
_ROUNDING = 1e-9  # of the greatest rate: a joint that is slower does not move
_STOPPED = 1e-12  # of the greatest velocity
_SWEEPS = 60
_SETTLED = 1e-10  # relative change of the duration
_SLOW, _STILL = 1e-3, 2e-5  # of the greatest rate: slower ends, and rests inside, need the length
_TURN = 1e-2  # rad: a smaller change of direction within a millionth of the path is no kink
_SAMPLES = 8  # for each interval of the grid
_KNOTS = 800  # more of them would lose digits of the second derivative


class Rows(NamedTuple):
    """``lower <= a u + b x + c <= upper`` and ``x <= top``, of K quantities at N + 1 points.

    Shapes: a, b, c (N + 1, K), top (N + 1,); still (K,), the last c without friction.
    """

    a: Array
    b: Array
    c: Array
    top: Array
    still: Array


class Passes(NamedTuple):
    """Outcome of the two passes: `path_rates` at the points, and the point that failed, or -1."""

    found: Array
    failed: int
    duration: float
    rows: Rows


class PathLimits:
    """Limits of the motion of a robot along paths, the same for all candidate paths."""

    def __init__(
        self, n: int, model: RobotModel | None, limits: MotionLimits | None,
        torque: object, friction: bool | Friction, both_ends: bool, torque_rate: object = None,
    ) -> None:  # fmt: skip
        bounds = checked_limits(_FREE if limits is None else limits, n)
        assert bounds is not None
        self.n, self.model, self.limits = n, model, bounds
        self.torque = checked_torque(torque, model, n)
        jerk = np.minimum(bounds.jerk, -bounds.jerk_lower)
        none = np.full(n, np.inf)
        pull = none if torque_rate is None else checked_torque(torque_rate, model, n, "torque_rate")
        if (np.stack((jerk, pull)) <= 0.0).any():
            raise InvalidValueError("limits of jerk, torque_rate: expected limits above zero.")
        rows = np.isfinite([bounds.acceleration, bounds.acceleration_lower, jerk]).any(axis=0)
        self.acceleration = np.flatnonzero(rows)
        self.loaded = np.flatnonzero(np.isfinite([self.torque, pull]).any(axis=0))
        lower = (bounds.acceleration_lower[rows], -self.torque[self.loaded])
        upper = (bounds.acceleration[rows], self.torque[self.loaded])
        lower, upper = np.concatenate(lower), np.concatenate(upper)
        size = np.maximum(*(np.where(np.isfinite(b), np.abs(b), 0.0) for b in (lower, upper)))
        self.scale = np.where(size > 0.0, size, 1.0)
        self.lower, self.upper = lower / self.scale, upper / self.scale
        self.rates = np.concatenate((jerk[rows], pull[self.loaded])) / self.scale
        # accelerations at both ends of every interval, as is usual; torques if requested
        self.ends = np.repeat([1, int(both_ends)], [self.acceleration.size, self.loaded.size])
        self.names = np.array(
            [f"acceleration of joint {j + 1}" for j in self.acceleration]
            + [f"torque of joint {j + 1}" for j in self.loaded]
            + [f"velocity of joint {j + 1}" for j in range(n)]
            + [""]
        )
        own = not isinstance(friction, bool | np.bool_)
        if own and not isinstance(friction, Friction):
            raise InvalidValueError(
                f"friction: expected True, False or a friction model, got {friction!r:.60}."
            )
        self.friction, self.drives, self.viscous = (friction if own else None), None, False
        if model is not None and self.loaded.size:
            self.drives = model.drive_matrices
            if own:
                check_friction(friction, n)  # type: ignore[arg-type]
            if not friction:
                self.friction, self.viscous = False, False
            else:
                self.viscous = own or (self.drives is not None and bool(self.drives.viscous.any()))
            if model.twin.torques_warn:
                warn_without_masses(model, 4)
        if not (self.lower.size or np.isfinite(bounds.velocity).any()):
            raise InvalidValueError(
                "limits: all are infinite, so the time would be zero; give limits of velocity and "
                "acceleration, or of torque."
            )

    def drag(self, q: Array, v: Array) -> Array:
        """Torques of friction at velocities. Shapes: q, v (..., n) -> (..., n)."""
        drag = np.zeros(v.shape)
        if self.friction is False:
            return drag
        if self.drives is not None:
            drag = self.drives.torque(v, None) - self.drives.offset
        if self.friction is not None:
            drag = drag + torque_at(self.friction, v, q)  # type: ignore[arg-type]
        return drag

    def torques(self, q: Array, v: Array, a: Array) -> Array:
        """Torques (N, n) of a motion; zeros without limits of torque."""
        if self.model is None or not self.loaded.size:
            return np.zeros(q.shape)
        tau = rigid_torques(self.model, q, v, a) + self.drag(q, v)
        return tau if self.drives is None else tau + a @ self.drives.rotor + self.drives.offset

    def parts(self, q: Array, v: Array, a: Array) -> tuple[Array, Array, Array]:
        """A, B and C (N, n) of the torques ``A / T^2 + B / T + C`` of a motion in T seconds.

        Shapes: q (N, n) and its derivatives by the fraction of T.
        """
        assert self.model is not None
        v = at_rest(v)
        C = rigid_torques(self.model, q, 0.0 * q, 0.0 * q)
        A = rigid_torques(self.model, q, v, a) - C
        dry = self.drag(q, SLOWEST * v)
        B = self.drag(q, v) - dry
        if self.drives is not None:
            A, C = A + a @ self.drives.rotor, C + self.drives.offset
        return A, B, C + dry

    def not_held(self, q: Array, place: Callable[[int], str], stuck: bool) -> str:
        """Sentence on the posture (N, n) whose torques at rest exceed their limits most, if any.

        ``stuck``: whether dry friction helps to hold it.
        """
        if not self.loaded.size or not q.size:
            return ""
        none = np.zeros(q.shape)
        load = self.torques(q, none, none)
        dry = np.abs(self.drag(q, none + SLOWEST)) if stuck else none
        margin = self.torque * (1.0 + 1e-9) - np.abs(load) + dry
        if (margin >= 0.0).all():
            return ""
        i, j = np.unravel_index(int(margin.argmin()), margin.shape)
        return (
            f"Gravity exceeds the torques at {place(int(i))}: joint {j + 1} needs "
            f"{abs(load[i, j]):.6g} to be held still and has {self.torque[j]:.6g}"
            f"{' and dry friction' if dry.any() else ''}, margin of {margin[i, j]:.4g} "
            "(N m or N)."
        )

    def rows(self, q: Array, rate: Array, bend: Array) -> Rows:
        """Rows at points of a path. Shapes: q and its derivatives by s (N + 1, n)."""
        some, N = self.acceleration, len(q)
        a, b, c = np.zeros((3, N, self.scale.size))
        k, still = some.size, np.zeros(self.scale.size)
        a[:, :k], b[:, :k] = rate[:, some], bend[:, some]
        if self.loaded.size and self.model is not None:
            load, none = self.loaded, np.zeros(q.shape)
            tau = rigid_torques(
                self.model,
                np.concatenate((q, q, q)),
                np.concatenate((none, none, rate)),
                np.concatenate((none, rate, bend)),
            ).reshape(3, N, self.n)
            gravity, inertial, moving = tau[0], tau[1] - tau[0], tau[2] - tau[0]
            if self.drives is not None:
                rotor = self.drives.rotor
                inertial, moving = inertial + rate @ rotor, moving + bend @ rotor
                gravity = gravity + self.drives.offset
            steady, still[k:] = gravity, gravity[-1, load]
            if self.drives is not None or self.friction:
                steady = gravity + self.drag(q, SLOWEST * self.direction(rate))
            a[:, k:], b[:, k:], c[:, k:] = inertial[:, load], moving[:, load], steady[:, load]
        scale = self.scale
        return Rows(a / scale, b / scale, c / scale, self.top(rate), still / scale)

    def top(self, rate: Array) -> Array:
        """Greatest squared rates (N,) that the limits of velocity allow. Shapes: rate (N, n)."""
        with np.errstate(divide="ignore"):
            most = np.where(rate > 0.0, self.limits.velocity, -self.limits.velocity_lower)
            return np.minimum((most / np.abs(rate)).min(axis=1) ** 2, 1e300)

    def direction(self, rate: Array) -> Array:
        """The rates, with those that are nothing but rounding made zero."""
        return np.where(np.abs(rate) > _ROUNDING * np.abs(rate).max(initial=0.0), rate, 0.0)

    def passes(
        self, s: Array, q: Array, rate: Array, bend: Array, ends: tuple[float, float] = (0.0, 0.0),
        rows: Rows | None = None, sweeps: int = _SWEEPS, tight: Array | float = 0.0,
    ) -> Passes:  # fmt: skip
        """Quickest rates at points s (N + 1,) of a path whose derivatives are given there.

        ``tight`` (2, N, K): by how much the lower and upper limits are narrower on each interval.
        """
        from .kernels import path_rates

        rows = self.rows(q, rate, bend) if rows is None else rows
        if ends[1] == 0.0:  # at rest dry friction does not help to brake
            rows.c[-1] = rows.still
        steps, given, narrow = np.diff(s), np.square(ends), np.zeros((2, len(s) - 1, 1)) + tight
        bounds = (self.lower + narrow[0], self.upper - narrow[1])

        def swept(rows: Rows) -> Passes:
            found = np.empty((len(s), 6))
            failed = path_rates(
                steps, rows.a, rows.b, rows.c, *bounds, self.ends, rows.top, given, found
            )
            if failed >= 0:
                return Passes(found, failed, np.inf, rows)
            speed = np.sqrt(np.maximum(found[:, 0], 0.0))
            pace = speed[1:] + speed[:-1]
            duration = float((2.0 * steps / pace).sum()) if pace.min() > 0.0 else np.inf
            return Passes(found, -1, duration, rows)

        now = swept(rows)
        if not self.viscous or now.failed >= 0:
            return now
        x, best = now.found[:, 0], None
        for _ in range(sweeps):
            last, now = now, swept(self.tangent(rows, x, q, rate))
            if now.failed >= 0:
                x, now = 0.25 * x, last
                continue
            if best is not None and abs(now.duration - last.duration) <= _SETTLED * now.duration:
                return now
            best, x = now, now.found[:, 0]
        return now if best is None else best

    def tangent(self, rows: Rows, x: Array, q: Array, rate: Array) -> Rows:
        """Rows with the friction that depends on the speed, by its tangent at squared rates x."""
        k, turns = self.acceleration.size, self.direction(rate)
        speed = np.sqrt(np.maximum(x, 0.0))[:, None]
        square = np.where(x > 0.0, x, np.inf)[:, None]
        first = self.drag(q, SLOWEST * turns)
        here = (self.drag(q, turns * speed) - first)[:, self.loaded]
        if self.friction is None:  # proportional to the speed
            slope = 0.5 * here / square
        else:
            over, under = (
                self.drag(q, turns * speed * (1.0 + h))[:, self.loaded] for h in (1e-4, -1e-4)
            )
            slope = (over - under) / (4e-4 * square)
        b, c = rows.b.copy(), rows.c.copy()
        b[:, k:] += slope / self.scale[k:]
        c[:, k:] += np.where(x[:, None] > 0.0, here - slope * x[:, None], 0.0) / self.scale[k:]
        return rows._replace(b=b, c=c)


def at_rest(v: Array) -> Array:
    """Velocities (N, n) with those that are nothing but rounding made zero: no dry friction."""
    return np.where(np.abs(v) > _STOPPED * np.abs(v).max(initial=0.0), v, 0.0)


def checked_torque(
    torque: object, model: RobotModel | None, n: int, name: str = "torque"
) -> Array:  # fmt: skip
    """Greatest torques (n,), infinite where there is no limit; by default those of the table."""
    if model is None:
        if torque is not None:
            raise InvalidValueError(f"{name}: limits of torque need the robot, model=.")
        return np.full(n, np.inf)
    check_model(model)
    if model.n != n:
        raise ShapeError(f"path: expected {model.n} joints, as {model.name} has, got {n}.")
    limit = as_reals(model.table.effort if torque is None else torque, name)  # type: ignore[arg-type]
    if limit.shape not in ((), (n,)):
        raise ShapeError(f"{name}: expected one number or {n}, got shape {limit.shape}.")
    if not (limit >= 0.0).all():
        raise InvalidValueError(f"{name}: expected limits of at least 0 N m, got {limit}.")
    return np.broadcast_to(limit, n)


def path_of(path: object, model: RobotModel | None, points: int) -> tuple[Motion | str, bool]:
    """A regular path of n joints (or why there is none), and whether it is scalar."""
    if isinstance(path, PoseTrajectory):
        path = _through_poses(path, model, points)
        if isinstance(path, str):
            return path, False
    advice = " (of points: cubic_spline(points, times, ends='not_a_knot'))"
    path = as_instance(path, Trajectory, "path", advice)
    motion = path.motion
    if not (end := motion.duration) > 0.0:
        raise InvalidValueError("path: it has no length; its ends are the same.")
    # the path itself serves where its velocity is continuous and nowhere small
    t = np.linspace(0.0, end, _SAMPLES * points + 1)
    rate, bend = motion.derivatives(t, (1, 2))
    speed, swing = (np.sqrt(np.einsum("ij,ij->i", x, x)) for x in (rate, bend))
    most = float(speed.max())
    # inside, a path may turn back in its own parameter, which goes on, but not rest in it
    moves = min(speed[0], speed[-1]) > _SLOW * most and (speed + swing * t[1]).min() > _STILL * most
    if moves and not isinstance(motion, FunctionMotion) and not np.any(motion.jumps(1)):
        return motion, path.scalar
    return _by_length(motion, np.linspace(0.0, end, 10 * _KNOTS + 1)), path.scalar


def _through_poses(path: PoseTrajectory, model: RobotModel | None, points: int) -> Trajectory | str:
    """Joints along a path of poses, at even steps of its own parameter."""
    if model is None:
        raise InvalidValueError("model: a path of poses needs the robot that follows it.")
    end = path.path.end
    evenly = PoseTrajectory(path.path, linear(0.0, end, duration=end))
    found = joint_path(model, evenly, samples=2 * max(points, 200) + 1)
    if found.stops:
        return f"The joints cannot follow the poses: {found.stops[0]}"
    return cubic_spline(found.q, found.t, ends="not_a_knot")


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


def _is_sharp(motion: Motion, low: float, high: float, size: float, length: float) -> bool:
    """Whether the direction turns by as much within any part of an interval, however short."""
    for _ in range(3):
        t = np.linspace(low, high, 68)
        slope = np.diff(motion.derivatives(t, (0,))[0], axis=0)
        sizes = np.linalg.norm(slope, axis=1)
        seen = np.flatnonzero(sizes > 1e-10 * length)  # where it moves
        if seen.size < 3:
            break
        turn = np.linalg.norm(np.diff(slope[seen] / sizes[seen, None], axis=0), axis=1)
        k = int(turn.argmax())
        if turn[k] < 0.5 * size:
            return False
        low, high = float(t[seen[k]]), float(t[seen[k + 1] + 1])
    return True


def toward_ends(intervals: int) -> Array:
    """Fractions from 0 to 1 that are dense at both ends, where a path from rest bends most."""
    return np.sin(np.linspace(0.0, 0.5 * np.pi, intervals + 1)) ** 2
