"""Results of a search for an exciting trajectory."""

from __future__ import annotations

from dataclasses import dataclass
from operator import attrgetter

import numpy as np

from ..._arrays import Array, Frozen
from ..._outcomes import Outcome
from ...minimal_parameters import BaseParameters
from ...model import RobotModel
from ...trajectories import LimitsReport, Trajectory
from .motions import KINDS, MotionBasis


class ExcitationStatus(Outcome):
    """Outcome of a search."""

    CONVERGED = 0, "The criterion decreased by less than 1 % in the last 25 iterations."
    LIMIT_OF_ITERATIONS = 1, "The iterations ended before the criterion converged (iterations=)."
    INFEASIBLE = 2, "No motion was found that keeps every limit."


@dataclass(frozen=True, slots=True)
class ExcitationQuality:
    """Condition numbers of a stacked base regressor, with the exact sign of dry friction.

    The condition numbers are in SI units, with columns of length 1, and weighted by the noise of
    the joints and the sizes of the parameters; ``log_det`` is that of the weighted ``W^T W / N``.
    """

    condition: float
    scaled_condition: float
    weighted_condition: float
    log_det: float

    def of(self, criterion: str) -> float:
        """Value that the criterion minimises."""
        return self.weighted_condition if criterion == "condition" else -self.log_det


@dataclass(frozen=True, slots=True, eq=False)
class ExcitationLimits(Frozen):
    """Extremes of a motion and limits: joints, torques (n,), least distance in m (inf if none).

    Those of torques and distances have an allowance for extremes between samples.
    """

    motion: LimitsReport
    torque_limits: Array
    torque: Array
    clearance: float

    @property
    def kept(self) -> bool:
        """Whether all limits are kept."""
        return not self.violations()

    def violations(self) -> tuple[str, ...]:
        """The limits that are not kept, one sentence each."""
        found = [
            f"joint {j + 1}: torque {self.torque[j]:.6g}, allowed {self.torque_limits[j]:.6g}"
            for j in np.flatnonzero(self.torque > self.torque_limits)
        ]
        if self.clearance < 0.0:
            found.append(
                f"workspace, obstacles: a frame is {-self.clearance:.4g} m outside of the "
                "workspace or within an obstacle"
            )
        return (*self.motion.violations(), *found)


@dataclass(frozen=True, slots=True, eq=False)
class ExcitationStart(Frozen):
    """One start: its random motion and the improved one, and the smooth criterion (K,) in between.

    ``stages`` are the iterations of each stage; between them the criterion may jump.
    """

    before: ExcitationQuality
    after: ExcitationQuality
    history: Array
    stages: Array
    status: ExcitationStatus

    def rank(self, criterion: str) -> tuple[bool, float]:
        """Sort key; the best start has the smallest."""
        return self.status is ExcitationStatus.INFEASIBLE, self.after.of(criterion)


@dataclass(frozen=True, slots=True, eq=False)
class ExcitingTrajectory(Frozen):
    """Exciting trajectory for the identification of base parameters, with its quality and limits.

    Parameters
    ----------
    trajectory, model, base, criterion
        One period, n joints; the robot; the parameters to be identified; what was minimised.
    limits : ExcitationLimits
        Extremes and limits: ``kept``, ``violations()``, ``motion``, ``torque``,
        ``torque_limits``, ``clearance``.
    starts, baseline : tuples of ExcitationStart and ExcitationQuality
        Every start (``before, after, history, stages, status``); random motions within the limits.
    basis, coefficients : MotionBasis, ndarray of shape (P, n)
        Functions that the motion is made of, and their coefficients.
    notes : tuple of str
        Limits that were assumed, and how far the starts agree.
    """

    trajectory: Trajectory
    model: RobotModel
    base: BaseParameters
    criterion: str
    limits: ExcitationLimits
    starts: tuple[ExcitationStart, ...]
    baseline: tuple[ExcitationQuality, ...]
    basis: MotionBasis
    coefficients: Array
    notes: tuple[str, ...] = ()

    @property
    def best(self) -> ExcitationStart:
        """The start that became the trajectory."""
        return min(self.starts, key=lambda start: start.rank(self.criterion))

    status = property(attrgetter("best.status"), doc="Outcome of the best start.")
    quality = property(attrgetter("best.after"), doc="Condition numbers and log det.")
    condition = property(attrgetter("best.after.condition"), doc="Condition number, SI units.")
    scaled_condition = property(attrgetter("best.after.scaled_condition"), doc="Of unit columns.")
    log_det = property(attrgetter("best.after.log_det"), doc="Of the mean information of a sample.")

    @property
    def baseline_conditions(self) -> Array:
        """Condition numbers of the random motions, ascending."""
        return np.sort([quality.condition for quality in self.baseline])

    def __str__(self) -> str:
        random = self.baseline_conditions
        lines = [
            f"Exciting trajectory of {self.model.name}: {KINDS[self.basis.kind]}, "
            f"{self.basis.duration:g} s, {len(self.base)} base parameters",
            f"  {self.status.sentence}",
            f"  condition number     {self.condition:10.4g}",
            f"  with scaled columns  {self.scaled_condition:10.4g}",
            f"  log det              {self.log_det:10.4g}",
        ]
        if random.size:
            lines.append(
                f"  {random.size} random motions within the same limits: condition number "
                f"{np.median(random):.4g} in the middle, {random[0]:.4g} at best"
            )
        after = ", ".join(f"{start.after.condition:.4g}" for start in self.starts)
        lines.append(f"  condition numbers of the {len(self.starts)} starts: {after}")
        broken = self.limits.violations()
        lines.append("  limits that are not kept:" if broken else "  every limit is kept")
        lines += [f"    {line}" for line in broken]
        return "\n".join([*lines, *(f"  {note}" for note in self.notes)])

    def __repr__(self) -> str:
        status = self.status.name.lower().replace("_", " ")
        return (
            f"<ExcitingTrajectory of {self.model.name!r}: condition number {self.condition:.4g}, "
            f"{status}>"
        )
