"""The type of motions of the tool: a path in space and a law of time on it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, Value, as_floats
from ..errors import ShapeError
from ..se3 import skew
from ..se3.orientation import rotation_vectors_of
from .motions import PiecewisePolynomial
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
        return f"<PoseTrajectory: {self.duration:.6g} s; {self.resample(501)!r}>"


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

    ``progress`` has a coordinate for each line, from 0 to 1 over time; neighbours overlap in the
    blends. Shapes: poses_at (m, 4, 4); steps (m - 1, 6), translations and rotation vectors.
    """

    poses_at: Array
    steps: Array
    progress: PiecewisePolynomial

    @property
    def end(self) -> float:
        """Seconds from the start of the first blend to the end of the last."""
        return self.progress.duration

    def poses(self, s: Array) -> Array:
        """World poses. Shapes: s (N,) -> (N, 4, 4)."""
        first, lines = self._lines(s)
        T = self.poses_at[first]
        for step, g, _, _ in lines:
            T[:, :3, :3] = rotation_about(*_turned(step[:, 3:], g)) @ T[:, :3, :3]
            T[:, :3, 3] += g[:, None] * step[:, :3]
        T[s <= 0.0], T[s >= self.end] = self.poses_at[0], self.poses_at[-1]
        return T

    def rates(self, s: Array) -> tuple[Array, Array]:
        """Twist and its derivative with respect to s. Shapes: s (N,) -> twist, change (N, 6)."""
        twist, change = np.zeros((2, s.size, 6))
        for step, g, v, a in self._lines(s)[1]:
            # a later line turns what the line before it does
            R = rotation_about(*_turned(step[:, 3:], g))
            w, alpha = (R @ np.stack((twist, change), axis=-1)[:, 3:]).transpose(2, 0, 1)
            twist[:, 3:], change[:, 3:] = w, alpha + np.cross(v[:, None] * step[:, 3:], w)
            twist += v[:, None] * step
            change += a[:, None] * step
        return twist, change

    def _lines(self, s: Array) -> tuple[NDArray[np.intp], list[tuple[Array, ...]]]:
        """The first line that is under way (N,); steps, progress and its rates of it and the next.

        The lines before it are complete, those behind these two have not begun.
        """
        L, rows = len(self.steps), np.arange(s.size)
        parts = np.zeros((3, s.size, L + 1))
        parts[..., :L] = self.progress.derivatives(s, (0, 1, 2))
        first = np.minimum((parts[0] >= 1.0).sum(axis=1), L - 1)
        steps = np.vstack((self.steps, np.zeros((1, 6))))
        return first, [(steps[first + k], *parts[:, rows, first + k]) for k in range(2)]


def _turned(vectors: Array, part: Array) -> tuple[Array, Array]:
    """Axes and angles of parts of rotation vectors. Shapes: vectors (N, 3), part (N,)."""
    axis, angle = axis_and_angle(vectors)
    return axis, angle * part


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
    """Rotations by an angle about a unit axis (Rodrigues' formula)."""
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
