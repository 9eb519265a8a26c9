"""The type of motions of the tool: a path in space and a law of time on it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, Frozen, Rebuilt, as_floats
from ..errors import ShapeError
from .number_text import seconds_shown
from .paths import PosePath
from .trajectory import Trajectory


@dataclass(frozen=True, slots=True, eq=False)
class PoseSamples(Frozen):
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

    def __len__(self) -> int:
        return self.t.size

    def __repr__(self) -> str:
        return f"<PoseSamples: {seconds_shown(self.t)}\n  {_speeds(self.twist)}>"

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        return np.array(self.T, dtype=dtype, copy=copy)


@dataclass(frozen=True, slots=True, eq=False)
class PoseTrajectory(Rebuilt):
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
        return float(self.law.duration)

    def pose(self, t: ArrayLike) -> Array:
        """World poses (t.shape..., 4, 4) at times t, m.

        The tool rests before and after the motion; where it does not, such a time is an error.
        """
        s = self.law.q(t)
        return self._poses(np.asarray(t, dtype=np.float64), s)

    def _poses(self, t: Array, s: Array) -> Array:
        # the last pose is met to the last digit, though the law ends a rounding beside it
        s = np.where(t >= self.duration, self.path.end, s)
        return self.path.poses(s.reshape(-1)).reshape(*s.shape, 4, 4)

    def twist(self, t: ArrayLike) -> Array:
        """Velocities (t.shape..., 6), ``[v; w]`` of the tool's origin in world axes."""
        s, v = self.law.q(t), self.law.v(t)
        return self.path.rates(s.reshape(-1))[0].reshape(*s.shape, 6) * v[..., None]

    def acceleration(self, t: ArrayLike) -> Array:
        """Derivatives (t.shape..., 6) of the twist, m/s^2 and rad/s^2."""
        s, v, a = self.law.q(t), self.law.v(t), self.law.a(t)
        rate, change = (x.reshape(*s.shape, 6) for x in self.path.rates(s.reshape(-1)))
        return rate * a[..., None] + change * (v * v)[..., None]

    def at(self, t: ArrayLike) -> PoseSamples:
        """Poses, twists and accelerations together at times t (N,)."""
        times = as_floats(t, "t")
        if times.ndim != 1:
            raise ShapeError(f"t: expected shape (N,), got {times.shape}.")
        law = self.law.at(times)
        s, v, a = np.asarray(law.q), law.v[:, None], law.a[:, None]
        rate, change = self.path.rates(s)
        return PoseSamples(times, self._poses(times, s), rate * v, rate * a + change * (v * v))

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
