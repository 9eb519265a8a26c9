"""A joint motion as few keyframes, and what an animation plays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array, as_vector
from ..errors import InvalidValueError, ShapeError
from ..geometry import PRISMATIC
from ..model import RobotModel
from ..trajectories.joint_path import JointPath
from ..trajectories.pose_trajectory import PoseSamples, PoseTrajectory
from ..trajectories.resolved_motion import ResolvedMotion
from ..trajectories.trajectory import Samples, Trajectory

# A joint may be off by this much between keyframes, in radians and in parts of the robot's size:
# less than a pixel.
_TOLERANCE = 5e-4


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """The motion of one joint; between keyframes it moves in proportion to time."""

    path: str
    prismatic: bool
    times: Array
    values: Array


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """What an animation plays.

    Parameters
    ----------
    tracks : tuple of Track
        One for each joint.
    samples : int
        How many postures were given.
    duration : float
        Seconds.
    loop : bool
        Whether it starts again at its end.

    Examples
    --------
    >>> Motion((), 0, 0.0, True).keyframes
    0
    """

    tracks: tuple[Track, ...]
    samples: int
    duration: float
    loop: bool

    @property
    def keyframes(self) -> int:
        """Keyframes kept, of all joints together."""
        return sum(len(track.times) for track in self.tracks)


def sample_times(count: int, dt: float | None, fps: float | None) -> Array:
    """Times of the samples of a motion. Shapes: -> (count,)."""
    if dt is not None and fps is not None:
        raise InvalidValueError(f"dt and fps say the same: give one of them, got {dt} and {fps}.")
    name, value = ("dt", dt) if dt is not None else ("fps", 30.0 if fps is None else fps)
    value = float(as_vector([value], 1, name)[0])  # type: ignore[list-item]
    if value <= 0:
        raise InvalidValueError(f"{name}: expected a positive number, got {value}.")
    step = value if name == "dt" else 1.0 / value
    return step * np.arange(count, dtype=np.float64)


def as_motion_samples(value: object, n: int, name: str) -> Array:
    """Check the postures of an animation. Shapes: value (N, n) -> (N, n)."""
    q = as_vector(value, n, name)  # type: ignore[arg-type]
    if q.ndim != 2 or len(q) < 2:
        raise ShapeError(
            f"{name}: an animation needs at least two samples, shape (N, {n}), got {q.shape}; "
            "draw a single posture with show."
        )
    return q


def timed_samples(
    value: object, n: int, dt: float | None, fps: float | None, name: str
) -> tuple[Array, Array]:
    """The postures of an animation and their times.

    Shapes: value (N, n) -> times (N,), q (N, n).
    """
    if isinstance(value, Trajectory):
        return _sampled(value, n, float(sample_times(2, dt, fps)[1]), name)
    if isinstance(value, (PoseTrajectory, PoseSamples)):
        raise InvalidValueError(
            f"{name}: expected a motion of joints, got {type(value).__name__}; joint_path and "
            "resolved_motion find the joints that follow poses."
        )
    if not isinstance(value, (Samples, JointPath, ResolvedMotion)):
        if not isinstance(value, (Sequence, np.ndarray)) and not hasattr(value, "__array__"):
            raise InvalidValueError(
                f"{name}: expected a Trajectory, Samples, JointPath, ResolvedMotion or an array of "
                f"shape (N, {n}), got {type(value).__name__}."
            )
        q = as_motion_samples(value, n, name)
        return sample_times(len(q), dt, fps), q
    if isinstance(value, JointPath) and (lost := np.isnan(value.q).any(axis=-1)).any():
        first, count = int(lost.argmax()), int(lost.sum())
        raise InvalidValueError(
            f"{name}: {count} of the {lost.size} poses of the path have no posture, the first is "
            f"pose {first}; animate a part that is reached, such as path.q[:{first}]."
        )
    q = value.q[:, None] if value.q.ndim == 1 == n else value.q
    q = as_motion_samples(q, n, name)
    if dt is not None or fps is not None or np.isnan(value.t).any():
        return sample_times(len(q), dt, fps), q
    if value.t.shape != (len(q),) or (np.diff(value.t) <= 0.0).any():
        raise InvalidValueError(f"{name}: expected samples at ascending times; give dt or fps.")
    return value.t - value.t[0], q


def _sampled(motion: Trajectory, n: int, step: float, name: str) -> tuple[Array, Array]:
    if motion.motion.batch:
        raise ShapeError(
            f"{name}: expected one motion, got a batch of shape {motion.motion.batch}."
        )
    if motion.n != n:
        raise ShapeError(f"{name}: expected a motion of {n} joints, got one of {motion.n}.")
    T = motion.duration
    if T <= 0.0:
        raise InvalidValueError(f"{name}: the motion takes no time; draw its posture with show.")
    # the last frame is the end, whatever the rate
    times = np.linspace(0.0, T, max(2, 1 + int(np.ceil(T / step - 1e-9))))
    return times, motion.q(times).reshape(-1, n)


def joint_tracks(
    model: RobotModel, q: Array, times: Array, paths: Sequence[str], size: float
) -> tuple[Track, ...]:
    """Reduce a motion to keyframes, joint by joint. Shapes: q (N, n), times (N,)."""
    tracks = []
    for i, row in enumerate(model.table.joint_rows):
        prismatic = bool(model.table.sigma[row] == PRISMATIC)
        keep = keyframes(times, q[:, i : i + 1], _TOLERANCE * (size if prismatic else 1.0))
        tracks.append(Track(paths[i], prismatic, times[keep], q[keep, i]))
    return tuple(tracks)


def keyframes(times: Array, values: Array, tolerance: float) -> NDArray[np.int64]:
    """Samples from which straight lines give back all others (Ramer, Douglas and Peucker).

    Shapes: times (N,), values (N, k).
    """
    last = len(times) - 1
    kept, waiting = {0, last}, [(0, last)]
    while waiting:
        a, b = waiting.pop()
        if b - a < 2:
            continue
        s = ((times[a + 1 : b] - times[a]) / (times[b] - times[a]))[:, None]
        off = np.linalg.norm(values[a + 1 : b] - (1 - s) * values[a] - s * values[b], axis=1)
        k = int(off.argmax())
        if off[k] > tolerance:
            k += a + 1
            kept.add(k)
            waiting += [(a, k), (k, b)]
    return np.array(sorted(kept), dtype=np.int64)
