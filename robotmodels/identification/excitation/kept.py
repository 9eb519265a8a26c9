"""Which limits a motion keeps: everywhere on it, or on a grid with what may lie between."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..._arrays import Array, Rebuilt, read_only
from ...dynamics import idm
from ...model import RobotModel
from ...regressors.drives import couplings
from ...trajectories import LimitsReport, Trajectory
from .boxes import clearances
from .problem import ExcitationProblem

_DENSE = 8  # times as many samples as the problem has


@dataclass(frozen=True, slots=True, eq=False)
class ExcitationLimits(Rebuilt):
    """What a motion asks of the robot, beside what is allowed.

    Positions, velocities and accelerations are exact extremes of the motion. Torques and
    clearances are looked at on a grid, with an allowance for what lies between its samples: an
    eighth of the second difference for a torque, which is smooth but for the jumps of dry friction
    (both sides of these are looked at besides), and a half of it for a clearance, which has kinks
    where another face of a box becomes the nearest.

    Parameters
    ----------
    motion : LimitsReport
        Extremes of positions, velocities, accelerations and jerks.
    torque_limits : ndarray, shape (n,)
        Infinite where there is none.
    torque : ndarray, shape (n,)
        Greatest absolute torques, N m or N, with what may lie between samples; of the model's own
        parameters.
    clearance : ndarray, shape (B,)
        Least distance of the frames of each box from its forbidden side, m, less what may lie
        between samples.
    step : float
        Seconds between samples of the grid.
    between : ndarray, shape (2,)
        Greatest amount that was added to a torque and taken from a clearance.
    """

    motion: LimitsReport
    torque_limits: Array
    torque: Array
    clearance: Array
    step: float
    between: Array

    def __post_init__(self) -> None:
        for name in ("torque_limits", "torque", "clearance", "between"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    @property
    def kept(self) -> bool:
        """Whether all limits are kept."""
        return not self.violations()

    def violations(self) -> tuple[str, ...]:
        """The limits that are not kept, one sentence each.

        Returns
        -------
        tuple of str
            Empty if all are kept.
        """
        found = list(self.motion.violations())
        found += [
            f"joint {j + 1}: torque {self.torque[j]:.6g}, allowed {self.torque_limits[j]:.6g}"
            for j in np.flatnonzero(self.torque > self.torque_limits)
        ]
        found += [
            f"box {k + 1}: a frame is {-self.clearance[k]:.4g} m beyond it"
            for k in np.flatnonzero(self.clearance < 0.0)
        ]
        return tuple(found)

    def __repr__(self) -> str:
        if self.kept:
            return "<ExcitationLimits: every limit is kept>"
        return "\n  ".join(["<ExcitationLimits: exceeded", *self.violations()]) + ">"


def limits_kept(problem: ExcitationProblem, trajectory: Trajectory) -> ExcitationLimits:
    """Extremes of a motion beside all limits of a problem."""
    model = problem.model
    times = np.linspace(0.0, problem.basis.duration, _DENSE * len(problem.t) + 1)
    q, v, a = trajectory.motion.derivatives(times, (0, 1, 2))
    torque = np.abs(idm(model, q, v, a))
    more = _between(torque, 0.125)
    peaks = (torque + more).max(axis=0)
    beside = _beside_jumps(model, times, v)
    if beside.size:
        q_, v_, a_ = trajectory.motion.derivatives(beside, (0, 1, 2))
        peaks = np.maximum(peaks, np.abs(idm(model, q_, v_, a_)).max(axis=0))
    clearance, most = np.empty(len(problem.boxes)), 0.0
    for k, box in enumerate(problem.boxes):
        free = clearances(model, box, q)
        less = _between(free, 0.5)
        clearance[k], most = (free - less).min(), max(most, float(less.max()))
    return ExcitationLimits(
        trajectory.check(problem.limits), problem.torque_limits, peaks,
        clearance, float(times[1]), np.array([more.max(initial=0.0), most]),
    )  # fmt: skip


def _between(y: Array, part: float) -> Array:
    """A part of the second differences of samples (N, m)."""
    bend = np.zeros(y.shape)
    bend[1:-1] = part * np.abs(np.diff(y, 2, axis=0))
    bend[0], bend[-1] = bend[1], bend[-2]
    return bend


def _beside_jumps(model: RobotModel, times: Array, v: Array) -> Array:
    """Times just before and after a joint or a coupled motor turns round."""
    turning = np.hstack((v, *((v @ row)[:, None] for row, _ in couplings(model))))
    before, which = np.nonzero(turning[:-1] * turning[1:] < 0.0)
    one, two = turning[before, which], turning[before + 1, which]
    step = times[1] - times[0]
    at = times[before] + step * one / (one - two)
    # a straight line finds the zero to a part of the step; look at both sides of that part
    near = 0.02 * step
    return np.clip(np.concatenate((at - near, at + near)), times[0], times[-1])
