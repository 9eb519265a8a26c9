"""The type of motions of the tool: a path in space and a law of time on it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, Value, as_floats
from ..errors import ShapeError
from ..se3 import skew
from ..se3.orientation import rotation_vectors_of
from .checks import seconds_shown
from .trajectory import Sampled, Trajectory


@dataclass(frozen=True, slots=True, eq=False)
class PoseSamples(Sampled):
    """A motion of the tool at given times. As an array (``np.asarray``) it is its poses.

    Parameters
    ----------
    t : ndarray, shape (N,)
        Times, s.
    T : ndarray, shape (N, 4, 4)
        World poses, m.
    twist, acceleration : ndarray, shape (N, 6)
        Velocity and acceleration ``[v; w]`` of the tool's origin, world axes, m and rad per s and
        s^2.
    """

    t: Array
    T: Array
    twist: Array
    acceleration: Array

    def __repr__(self) -> str:
        return f"<PoseSamples: {seconds_shown(self.t)}\n  {_speeds(self.twist)}>"


@dataclass(frozen=True, slots=True, eq=False)
class PoseTrajectory(Value):
    """Motion of the tool: a path in space and a law of time on it.

    Parameters
    ----------
    path : PosePath
        Pose for every value of its parameter.
    law : Trajectory
        The parameter at every time, scalar.
    """

    path: PosePath
    law: Trajectory

    @property
    def duration(self) -> float:
        """Seconds."""
        return self.law.duration

    def pose(self, t: ArrayLike) -> Array:
        """World poses (t.shape..., 4, 4) at times t, m.

        The tool rests before and after the motion; where it does not, such a time is an error.
        """
        s = self.law.q(t)
        # the last pose is met to the last digit, though the law ends a rounding beside it
        s = np.where(np.asarray(t, dtype=np.float64) >= self.duration, self.path.end, s)
        return self.path.poses(s.reshape(-1)).reshape(*s.shape, 4, 4)

    def twist(self, t: ArrayLike) -> Array:
        """Velocities (t.shape..., 6), ``[v; w]`` of the tool's origin in world axes."""
        return self._rates(t)[0]

    def acceleration(self, t: ArrayLike) -> Array:
        """Derivatives (t.shape..., 6) of the twist, m/s^2 and rad/s^2."""
        return self._rates(t)[1]

    def _rates(self, t: ArrayLike) -> tuple[Array, Array]:
        law = self.law.at(t)
        rate, change = (x.reshape(*law.q.shape, 6) for x in self.path.rates(law.q.reshape(-1)))
        v, a = law.v[..., None], law.a[..., None]
        return rate * v, rate * a + change * (v * v)

    def at(self, t: ArrayLike) -> PoseSamples:
        """Poses, twists and accelerations together at times t (N,)."""
        times = as_floats(t, "t")
        if times.ndim != 1:
            raise ShapeError(f"t: expected shape (N,), got {times.shape}.")
        return PoseSamples(times, self.pose(times), *self._rates(times))

    def resample(self, samples: int | None = None, period: float | None = None) -> PoseSamples:
        """The motion on a regular grid of time, as `Trajectory.resample`."""
        return self.at(self.law.grid(samples, period))

    def __repr__(self) -> str:
        # a path has no extremes of its own: they are looked for at samples
        seen = self.at(np.linspace(0.0, self.duration, 501))
        metres = float(np.linalg.norm(np.diff(seen.T[:, :3, 3], axis=0), axis=-1).sum())
        return (
            f"<PoseTrajectory: {self.duration:.6g} s, a way of {metres:.4g} m"
            f"\n  {_speeds(seen.twist)}>"
        )


def _speeds(twist: Array) -> str:
    v, w = (np.linalg.norm(part, axis=-1).max(initial=0.0) for part in (twist[:, :3], twist[:, 3:]))
    return f"greatest speeds {v:.4g} m/s and {w:.4g} rad/s"


@dataclass(frozen=True, slots=True, eq=False)
class FixedAxisPath(Value):
    """Line or circle, with a rotation about a fixed axis, both in proportion to s from 0 to 1."""

    start: Array
    last: Array
    shift: Array
    centre: Array
    normal: Array
    sweep: float
    axis: Array
    turn: float

    @property
    def end(self) -> float:
        """The parameter runs from 0 to 1."""
        return 1.0

    @property
    def length(self) -> float:
        """Length of the position path, m."""
        return float(np.linalg.norm(self.shift)) + self.radius * abs(self.sweep)

    @property
    def radius(self) -> float:
        """Radius of the circle, m; 0 on a line."""
        if self.sweep == 0.0:
            return 0.0
        arm = self.start[:3, 3] - self.centre
        return float(np.linalg.norm(arm - self.normal * (self.normal @ arm)))

    def poses(self, s: Array) -> Array:
        """World poses. Shapes: s (N,) -> (N, 4, 4)."""
        T = np.zeros((s.size, 4, 4))
        T[:, :3, :3] = rotation_about(self.axis, self.turn * s) @ self.start[:3, :3]
        T[:, :3, 3] = self.start[:3, 3] + s[:, None] * self.shift
        if self.sweep:
            # as a displacement from the start: adding a distant centre would cost digits
            across = np.cross(self.normal, self.start[:3, 3] - self.centre)
            inward = np.cross(self.normal, across)
            angle = self.sweep * s[:, None]
            T[:, :3, 3] += np.sin(angle) * across + 2.0 * np.sin(0.5 * angle) ** 2 * inward
        T[:, 3, 3] = 1.0
        T[s == 0.0], T[s == 1.0] = self.start, self.last
        return T

    def rates(self, s: Array) -> tuple[Array, Array]:
        """Twist and its derivative with respect to s. Shapes: s (N,) -> twist, change (N, 6)."""
        twist, change = np.zeros((s.size, 6)), np.zeros((s.size, 6))
        twist[:, :3], twist[:, 3:] = self.shift, self.turn * self.axis
        if self.sweep:
            arm = rotation_about(self.normal, self.sweep * s) @ (self.start[:3, 3] - self.centre)
            twist[:, :3] = self.sweep * np.cross(self.normal, arm)
            change[:, :3] = self.sweep * np.cross(self.normal, twist[:, :3])
        return twist, change


@dataclass(frozen=True, slots=True, eq=False)
class BlendedPoses(Value):
    """Lines between poses, each with a rotation about a fixed axis, and blends at the poses.

    Shapes: poses_at (m, 4, 4); twists (m - 1, 6); times, blends (m,).
    """

    poses_at: Array
    twists: Array
    times: Array
    blends: Array
    smooth: bool

    @property
    def end(self) -> float:
        """Seconds from the start of the first blend to the end of the last."""
        return float(self.times[-1] + 0.5 * self.blends[-1])

    def poses(self, s: Array) -> Array:
        """World poses. Shapes: s (N,) -> (N, 4, 4)."""
        corner, before, after, f1, f2 = self._fades(s)
        w1, a1 = axis_and_angle(before[:, 3:])
        w2, a2 = axis_and_angle(after[:, 3:])
        T = np.zeros((s.size, 4, 4))
        R = rotation_about(w2, a2 * f2[0]) @ rotation_about(w1, a1 * f1[0])
        T[:, :3, :3] = R @ self.poses_at[corner, :3, :3]
        T[:, :3, 3] = self.poses_at[corner, :3, 3]
        T[:, :3, 3] += before[:, :3] * f1[0][:, None] + after[:, :3] * f2[0][:, None]
        T[:, 3, 3] = 1.0
        T[s <= 0.0], T[s >= self.end] = self.poses_at[0], self.poses_at[-1]
        return T

    def rates(self, s: Array) -> tuple[Array, Array]:
        """Twist and its derivative with respect to s. Shapes: s (N,) -> twist, change (N, 6)."""
        _, before, after, f1, f2 = self._fades(s)
        w2, a2 = axis_and_angle(after[:, 3:])
        carried = before.copy()
        turned = rotation_about(w2, a2 * f2[0]) @ before[:, 3:, None]
        carried[:, 3:] = turned[..., 0]
        twist = carried * f1[1][:, None] + after * f2[1][:, None]
        change = carried * f1[2][:, None] + after * f2[2][:, None]
        change[:, 3:] += np.cross(after[:, 3:], carried[:, 3:]) * (f1[1] * f2[1])[:, None]
        return twist, change

    def _fades(self, s: Array) -> tuple[NDArray[np.intp], Array, Array, Array, Array]:
        """Corner of the nearest blend, the twists of its lines, and how far they have gone from it.

        The last two are arrays (3, N): times along the line before and the line after, and their
        first two derivatives.
        """
        # in the middle of what is straight, not of the line: one blend may be much the longer
        reach = self.times + 0.5 * self.blends, self.times - 0.5 * self.blends
        corner = np.searchsorted(0.5 * (reach[0][:-1] + reach[1][1:]), s, side="right")
        none = np.zeros((1, 6))
        before = np.concatenate((none, self.twists))[corner]
        after = np.concatenate((self.twists, none))[corner]
        t, b = s - self.times[corner], self.blends[corner]
        width = np.where(b > 0.0, b, 1.0)
        x = np.clip(np.where(b > 0.0, t / width + 0.5, t >= 0.0), 0.0, 1.0)
        if self.smooth:
            gone = x**3 * (1.0 - 0.5 * x) * b
            rate, rise = x * x * (3.0 - 2.0 * x), 6.0 * x * (1.0 - x) / width
        else:
            gone, rate, rise = 0.5 * x * x * b, x, 1.0 / width
        inside = (x > 0.0) & (x < 1.0)
        rise = np.where(inside, rise, 0.0)
        # outside the blend one of the two runs at its full rate
        beyond = np.maximum(t - 0.5 * b, 0.0)
        f2 = np.stack((gone + beyond, rate, rise))
        # the two times add up to the time since the corner
        f1 = np.stack((t - f2[0], 1.0 - rate, -rise))
        return corner, before, after, f1, f2


PosePath = FixedAxisPath | BlendedPoses


def arc(
    T0: Array,
    T1: Array,
    centre: Array | None = None,
    normal: Array | None = None,
    sweep: float = 0.0,
) -> FixedAxisPath:
    """Line or circular arc between checked poses, with the shorter rotation about a fixed axis."""
    axis, angle = axis_and_angle(rotation_vectors_of(T1[:3, :3] @ T0[:3, :3].T))
    turn, zero, z = float(angle), np.zeros(3), np.array([0.0, 0.0, 1.0])
    if centre is None or normal is None:
        return FixedAxisPath(T0, T1, T1[:3, 3] - T0[:3, 3], zero, z, 0.0, axis, turn)
    return FixedAxisPath(T0, T1, zero, centre, normal, sweep, axis, turn)


def rotation_about(axis: Array, angle: Array) -> Array:
    """Rotations by an angle about a unit axis (Rodrigues' formula, seed eq. [1.9])."""
    K = skew(axis)
    angle = np.asarray(angle, dtype=np.float64)[..., None, None]
    # 1 - cos by the half angle, which keeps its digits at small angles
    return np.eye(3) + np.sin(angle) * K + (2.0 * np.sin(0.5 * angle) ** 2) * (K @ K)


def axis_and_angle(vector: Array) -> tuple[Array, Array]:
    """Unit axis and angle of rotation vectors; the axis of no rotation is z."""
    angle = np.linalg.norm(vector, axis=-1)
    turns = (angle > 0.0)[..., None]
    axis = np.where(turns, vector / np.where(turns, angle[..., None], 1.0), (0.0, 0.0, 1.0))
    return axis, angle
