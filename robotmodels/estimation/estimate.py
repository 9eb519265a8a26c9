"""Estimated parameters with their covariance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from .._arrays import Array, Rebuilt, read_only
from .._outcomes import Outcome


class EstimateStatus(Outcome):
    """Outcome of an estimation.

    Examples
    --------
    >>> EstimateStatus.SOLVED.sentence
    'The parameters minimise the weighted squares of the residuals.'
    """

    SOLVED = 0, "The parameters minimise the weighted squares of the residuals."
    NOT_CONVERGED = (
        1,
        "The iterations ended before the parameters converged; use them with care.",
    )
    UNSTABLE = (
        2,
        "The simulated robot diverged, so that there are no parameters. Give the robot's own "
        "controller= and references, or start= near the true parameters, or use method 'wls'.",
    )
    POOR_PREDICTION = (
        3,
        "The parameters minimise the squares of the residuals, but the torques that they predict "
        "are far from the measured ones. Do not use the parameters until the cause is known.",
    )


@dataclass(frozen=True, slots=True, eq=False)
class Estimate(Rebuilt):
    """Parameters with standard errors. Read-only.

    Parameters
    ----------
    names : tuple of str
        The b parameters.
    values : ndarray, shape (b,)
        SI units; NaN, like all that follows from them, where a simulation diverged.
    covariance : ndarray, shape (b, b)
        Covariance of the estimates.
    sigma : ndarray, shape (m,)
        Standard deviation of the residuals of each group of equations.
    status : EstimateStatus
        Outcome.
    iterations : int
        Iterations of the method; 1 for direct methods.
    notes : tuple of str
        Remarks on the result.
    details : object
        Further results of the method; None for most.
    """

    names: tuple[str, ...]
    values: Array
    covariance: Array
    sigma: Array
    status: EstimateStatus = EstimateStatus.SOLVED
    iterations: int = 1
    notes: tuple[str, ...] = ()
    details: Any = None

    def __post_init__(self) -> None:
        for name in ("values", "covariance", "sigma"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    @property
    def standard_errors(self) -> Array:
        """Standard errors of the values, shape (b,)."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))

    @property
    def relative_errors(self) -> Array:
        """Standard errors relative to the values, shape (b,); infinite for a value of 0."""
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = self.standard_errors / np.abs(self.values)
            return np.where(self.values != 0.0, ratio, np.inf)

    @property
    def correlation(self) -> Array:
        """Correlation of the estimates, shape (b, b); NaN where a standard error is 0."""
        s = self.standard_errors
        with np.errstate(divide="ignore", invalid="ignore"):
            return self.covariance / np.outer(s, s)
