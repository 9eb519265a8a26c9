"""A trajectory as the lines that a figure draws: dense, with both sides of every jump."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from .._arrays import Array
from ..errors import InvalidValueError, ShapeError
from ..trajectories.piecewise import PiecewisePolynomial
from ..trajectories.pose_trajectory import PoseTrajectory
from ..trajectories.trajectory import Samples, Trajectory

_SAMPLES = 601
_BEFORE = 1e-9  # of the duration: where the value before a jump is read


@dataclass(frozen=True, slots=True, eq=False)
class Drawn:
    """Positions and derivatives of n joints at the times of a figure.

    Shapes: t (N,), values (4, N, n).
    """

    t: Array
    values: Array
    breaks: tuple[Array, ...]
    duration: float

    @property
    def n(self) -> int:
        """Number of joints."""
        return self.values.shape[-1]


def drawn(trajectory: Any, name: str = "trajectory") -> Drawn:
    """Samples of a trajectory to draw."""
    if isinstance(trajectory, Samples):
        return _of_samples(trajectory, name)
    if isinstance(trajectory, PoseTrajectory):
        raise InvalidValueError(
            f"{name}: this is a motion of the tool. Draw its law of time with `.law`, its path "
            "with plot_pose_path, or the joints that joint_path finds."
        )
    if not isinstance(trajectory, Trajectory):
        raise InvalidValueError(
            f"{name}: expected a Trajectory or its Samples, got {type(trajectory).__name__}."
        )
    motion = trajectory.motion
    if motion.batch:
        raise InvalidValueError(
            f"{name}: expected one motion, got a batch of shape {motion.batch}; draw one of them "
            "as Samples(t, q[i], v[i], a[i], jerk[i]) of trajectory.at(t)."
        )
    T = float(motion.duration)
    breaks: tuple[Array, ...] = ()
    if isinstance(motion, PiecewisePolynomial):
        breaks = tuple(np.unique(row) for row in motion.breaks)
    inner = np.concatenate([np.linspace(0.0, T, _SAMPLES), *breaks])
    before = np.concatenate([np.empty(0), *breaks]) - _BEFORE * T
    times = np.unique(np.concatenate((inner[inner <= T], before[before > 0.0])))
    samples = trajectory.at(times)
    return _of_samples(samples, name, breaks, T)


def _of_samples(
    samples: Samples, name: str, breaks: tuple[Array, ...] = (), T: float | None = None
) -> Drawn:
    t = samples.t.reshape(-1)
    if not t.size:
        raise InvalidValueError(f"{name}: there are no samples to draw.")
    rows = [samples.q, samples.v, samples.a, samples.jerk]
    if samples.q.shape == samples.t.shape:  # a scalar trajectory
        rows = [row[..., None] for row in rows]
    if any(row.ndim != 2 or len(row) != t.size for row in rows):
        raise ShapeError(
            f"{name}: expected samples of one motion, q of shape ({t.size}, n), got "
            f"{samples.q.shape}."
        )
    return Drawn(t, np.stack(rows), breaks, float(t[-1] - t[0]) if T is None else T)
