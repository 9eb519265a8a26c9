"""A joint motion for an animation: its samples, at most 30 a second."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .._arrays import Array, as_number, as_vector
from ..errors import InvalidValueError, ShapeError
from ..trajectories.joint_path import JointPath
from ..trajectories.pose_trajectory import PoseSamples, PoseTrajectory
from ..trajectories.resolved_motion import ResolvedMotion
from ..trajectories.trajectory import Samples, Trajectory

_FPS = 30.0


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """The motion of one joint, linear between keyframes."""

    path: str
    prismatic: bool
    times: Array
    values: Array


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """The motion that an animation plays.

    Parameters
    ----------
    tracks : tuple of Track
        One for each joint.
    samples : int
        How many configurations were given.
    duration : float
        Seconds.
    loop : bool
        Whether it starts again at its end.
    """

    tracks: tuple[Track, ...]
    samples: int
    duration: float
    loop: bool

    @property
    def keyframes(self) -> int:
        """Keyframes of all joints together."""
        return sum(len(track.times) for track in self.tracks)


def keyframes(times: Array, q: Array) -> tuple[Array, Array]:
    """Samples of a motion, interpolated where there are more than 30 a second.

    Shapes: times (N,), q (N, n) -> times (K,), q (K, n).
    """
    count = 1 + max(1, int(np.ceil(times[-1] * _FPS - 1e-9)))
    if len(times) <= count:
        return times, q
    t = np.linspace(0.0, times[-1], count)
    return t, np.stack([np.interp(t, times, column) for column in q.T], axis=1)


def sample_times(count: int, dt: float | None, fps: float | None) -> Array:
    """Times of the samples of a motion. Shapes: -> (count,)."""
    if dt is not None and fps is not None:
        raise InvalidValueError("dt, fps: give one of them.")
    if dt is None:
        dt = 1.0 / as_number(_FPS if fps is None else fps, "fps", above=0.0)
    return as_number(dt, "dt", above=0.0) * np.arange(count, dtype=np.float64)


def timed_samples(
    value: Any, n: int, dt: float | None, fps: float | None, name: str
) -> tuple[Array, Array]:
    """The configurations of an animation and their times. Shapes: -> times (N,), q (N, n)."""
    if isinstance(value, Trajectory):
        return _sampled(value, n, float(sample_times(2, dt, fps)[1]), name)
    timed = isinstance(value, (Samples, JointPath, ResolvedMotion))
    array = isinstance(value, Sequence) or hasattr(value, "__array__")
    if isinstance(value, (PoseTrajectory, PoseSamples)) or not (timed or array):
        raise InvalidValueError(
            f"{name}: expected a motion of joints, got {type(value).__name__}; joint_path and "
            "resolved_motion find the joints that follow poses."
        )
    if isinstance(value, JointPath) and (missing := np.isnan(value.q).any(axis=-1)).any():
        raise InvalidValueError(
            f"{name}: poses of the path have no posture, the first is pose {missing.argmax()}; "
            f"animate a part that is reached, such as path.q[:{missing.argmax()}]."
        )
    given: Any = value.q if timed else value
    q = as_vector(given[:, None] if timed and given.ndim == 1 == n else given, n, name)
    if q.ndim == 3 and q.shape[1] == 1:  # one solution for each pose, as igm_numeric gives them
        q = q[:, 0]
    if q.ndim != 2 or len(q) < 2:
        raise ShapeError(
            f"{name}: an animation needs at least two samples, shape (N, {n}), got {q.shape}; "
            "draw a single posture with show."
        )
    if not timed or dt is not None or fps is not None or np.isnan(value.t).any():
        return sample_times(len(q), dt, fps), q
    t: Array = value.t
    if t.shape != (len(q),) or (np.diff(t) <= 0.0).any():
        raise InvalidValueError(f"{name}: expected samples at ascending times; give dt or fps.")
    return t - t[0], q


def _sampled(motion: Trajectory, n: int, step: float, name: str) -> tuple[Array, Array]:
    """Samples of a trajectory; the last one is its end."""
    if motion.n != n:
        raise ShapeError(f"{name}: expected a motion of {n} joints, got one of {motion.n}.")
    T = motion.duration
    if T <= 0.0:
        raise InvalidValueError(f"{name}: the motion takes no time; draw its posture with show.")
    times = np.linspace(0.0, T, max(2, 1 + int(np.ceil(T / step - 1e-9))))
    return times, motion.q(times).reshape(-1, n)
