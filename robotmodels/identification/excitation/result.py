"""What a search for an exciting trajectory returns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..._arrays import Array, Rebuilt, read_only
from ..._outcomes import Outcome
from ...minimal_parameters import BaseParameters
from ...model import RobotModel
from ...trajectories import Trajectory
from .basis import MotionBasis
from .criterion import ExcitationCriterion
from .kept import ExcitationLimits
from .quality import ExcitationQuality


class ExcitationStatus(Outcome):
    """How a search ended.

    Examples
    --------
    >>> ExcitationStatus(0).sentence
    'The criterion fell by less than 1 % over the last 25 iterations, or not at all.'
    """

    CONVERGED = 0, "The criterion fell by less than 1 % over the last 25 iterations, or not at all."
    LIMIT_OF_ITERATIONS = (
        1,
        "The limit on iterations or evaluations was reached before the criterion converged.",
    )
    INFEASIBLE = 2, "No motion was found that keeps every limit."


@dataclass(frozen=True, slots=True, eq=False)
class ExcitationStart(Rebuilt):
    """One start of the search.

    Parameters
    ----------
    before, after : ExcitationQuality
        Of the random motion and of what it became.
    history : ndarray, shape (K,)
        Smooth criterion over the iterations; each of its stages has one of its own, so that it may
        jump between them.
    stages : ndarray, shape (S,)
        Iterations of each stage.
    status : ExcitationStatus
        How it ended.
    """

    before: ExcitationQuality
    after: ExcitationQuality
    history: Array
    stages: Array
    status: ExcitationStatus

    def __post_init__(self) -> None:
        object.__setattr__(self, "history", read_only(self.history))
        object.__setattr__(self, "stages", read_only(self.stages, np.int64))


@dataclass(frozen=True, slots=True, eq=False)
class ExcitingTrajectory(Rebuilt):
    """A motion that shows a robot's base parameters, and how it was judged.

    Parameters
    ----------
    trajectory : Trajectory
        One period, n joints, from 0 to ``basis.duration``.
    model : RobotModel
        The robot.
    base : BaseParameters
        Which the motion is for.
    criterion : ExcitationCriterion
        What was made small.
    quality : ExcitationQuality
        Of the trajectory.
    limits : ExcitationLimits
        What it asks of the robot, beside what is allowed.
    starts : tuple of ExcitationStart
        Every start, in the order they were made.
    baseline : tuple of ExcitationQuality
        Random motions that keep the same limits.
    basis : MotionBasis
        Functions that the motion is made of.
    coefficients : ndarray, shape (P, n)
        Their coefficients.
    status : ExcitationStatus
        Of the best start.
    notes : tuple of str
        What is to be known besides, in sentences.
    """

    trajectory: Trajectory
    model: RobotModel
    base: BaseParameters
    criterion: ExcitationCriterion
    quality: ExcitationQuality
    limits: ExcitationLimits
    starts: tuple[ExcitationStart, ...]
    baseline: tuple[ExcitationQuality, ...]
    basis: MotionBasis
    coefficients: Array
    status: ExcitationStatus
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "coefficients", read_only(self.coefficients))

    @property
    def condition(self) -> float:
        """Condition number of the base regressor, columns in SI units."""
        return self.quality.condition

    @property
    def scaled_condition(self) -> float:
        """The same with columns of unit length."""
        return self.quality.scaled_condition

    @property
    def log_det(self) -> float:
        """Logarithm of the determinant of the mean information of a sample."""
        return self.quality.log_det

    @property
    def baseline_conditions(self) -> Array:
        """Condition numbers of the random motions, ascending."""
        return np.sort([one.condition for one in self.baseline])

    def __str__(self) -> str:
        random = self.baseline_conditions
        lines = [
            f"Exciting trajectory of {self.model.name}: {self.basis.kind.value}, "
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
        if broken:
            lines += ["  limits that are not kept:", *(f"    {line}" for line in broken)]
        else:
            lines.append("  every limit is kept")
        lines += [f"  {note}" for note in self.notes]
        return "\n".join(lines)

    def __repr__(self) -> str:
        return (
            f"<ExcitingTrajectory of {self.model.name!r}: condition number {self.condition:.4g}, "
            f"{self.status.name.lower().replace('_', ' ')}>"
        )
