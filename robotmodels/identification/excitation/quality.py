"""How well a motion excites: numbers of its stacked base regressor."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..._arrays import Array
from ...trajectories import Trajectory
from .criterion import ExcitationCriterion, triangular_factor
from .problem import ExcitationProblem
from .stacked import StackedRegressor


@dataclass(frozen=True, slots=True)
class ExcitationQuality:
    """Numbers of a stacked base regressor, dry friction with its sign as it is.

    Parameters
    ----------
    condition : float
        Condition number of the columns as they are, in SI units, rows of all joints alike.
    scaled_condition : float
        The same with each column divided by its length.
    weighted_condition : float
        The same with the rows divided by the noise of their joint and the columns multiplied by
        the values that were given; equal to ``condition`` where none were.
    log_det : float
        ``log det`` of the mean information of a sample, ``W^T W / N``, of the weighted rows and
        columns.

    Examples
    --------
    >>> ExcitationQuality(50.0, 20.0, 50.0, -12.0).of(ExcitationCriterion.CONDITION)
    50.0
    """

    condition: float
    scaled_condition: float
    weighted_condition: float
    log_det: float

    def of(self, criterion: ExcitationCriterion) -> float:
        """The number that a criterion makes small.

        Parameters
        ----------
        criterion : ExcitationCriterion
            Which.

        Returns
        -------
        float
            The weighted condition number, or minus the logarithm of the determinant.
        """
        if criterion is ExcitationCriterion.CONDITION:
            return self.weighted_condition
        return -self.log_det


def quality(problem: ExcitationProblem, trajectory: Trajectory, times: Array) -> ExcitationQuality:
    """Quality of a motion at some times. Shapes: times (N,)."""
    q, v, a = trajectory.motion.derivatives(times, (0, 1, 2))
    base = problem.base
    W = StackedRegressor(problem.model, base.names, base.drive).matrix(q, v, a)
    b = len(base)
    plain = triangular_factor(W.reshape(-1, b))
    alike = (problem.weight == 1.0).all()
    weighted = plain if alike else triangular_factor((W * problem.weight).reshape(-1, b))
    lengths = np.linalg.norm(plain, axis=0)
    s = np.linalg.svd(weighted, compute_uv=False) / np.sqrt(len(times))
    with np.errstate(divide="ignore"):
        log_det = float(2.0 * np.log(s).sum())
    return ExcitationQuality(
        _condition(np.linalg.svd(plain, compute_uv=False)),
        _condition(np.linalg.svd(plain / np.where(lengths > 0.0, lengths, 1.0), compute_uv=False)),
        _condition(s),
        log_det,
    )


def _condition(s: Any) -> float:
    return float(s[0] / s[-1]) if s[-1] > 0.0 else np.inf
