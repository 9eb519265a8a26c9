"""What every method of identification returns."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from ..._arrays import Array, Rebuilt, read_only
from ..._outcomes import Outcome
from ...errors import InvalidValueError


class Method(Enum):
    """How the equations are solved.

    Examples
    --------
    >>> Method.WLS.value
    'weighted least squares'
    """

    OLS = "ordinary least squares"
    WLS = "weighted least squares"
    IRLS = "iteratively re-weighted least squares"
    ROBUST = "robust least squares"
    TLS = "total least squares"
    RIDGE = "least squares drawn toward a prior"
    IV = "instrumental variables of the simulated robot"
    DIDIM = "direct and inverse dynamic identification models"
    CLOE = "closed-loop output error"
    SEQUENTIAL = "joint by joint from the last to the first"
    RECURSIVE = "recursive least squares in time"


class EstimateStatus(Outcome):
    """What became of an estimate.

    Examples
    --------
    >>> EstimateStatus.SOLVED.sentence
    'The parameters solve the equations best.'
    """

    SOLVED = 0, "The parameters solve the equations best."
    NOT_CONVERGED = (
        1,
        "The iterations ended before the parameters stood still; use them with care.",
    )
    UNSTABLE = (
        2,
        "The simulated robot ran away, so that there are no parameters. Give the robot's own "
        "controller= and references, or start= of a robot that is near, or take method 'wls'.",
    )
    POOR_PREDICTION = (
        3,
        "The parameters solve the equations best, but the torques that they predict are far from "
        "the measured ones. Do not use the parameters until the cause is known.",
    )


@dataclass(frozen=True, slots=True, eq=False)
class Estimate(Rebuilt):
    """Parameters with deviations. Read-only.

    Parameters
    ----------
    method : Method
        How.
    names : tuple of str
        The b parameters.
    values : ndarray, shape (b,)
        SI units; NaN, as all that follows from them, where the simulated robot ran away.
    covariance : ndarray, shape (b, b)
        Of the estimates.
    sigma : ndarray, shape (m,)
        Deviation of the residuals of each kind of equations, N m or N.
    status : EstimateStatus
        What became of it.
    iterations : int
        Of the method; 1 for one that needs none.
    notes : tuple of str
        What to know.
    """

    method: Method
    names: tuple[str, ...]
    values: Array
    covariance: Array
    sigma: Array
    status: EstimateStatus = EstimateStatus.SOLVED
    iterations: int = 1
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in ("values", "covariance", "sigma"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    @property
    def deviations(self) -> Array:
        """Standard deviations, shape (b,)."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))

    @property
    def relative_deviations(self) -> Array:
        """Relative to the values, shape (b,); infinite for a value of 0."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(self.values != 0.0, self.deviations / np.abs(self.values), np.inf)

    @property
    def correlation(self) -> Array:
        """Of the estimates, shape (b, b); NaN where a deviation is 0."""
        s = self.deviations
        with np.errstate(divide="ignore", invalid="ignore"):
            return self.covariance / np.outer(s, s)


def check_values(estimate: Estimate) -> None:
    """Refuse an estimate without parameters, whose simulated robot ran away."""
    if estimate.status is EstimateStatus.UNSTABLE:
        raise InvalidValueError(f"result: {estimate.status.sentence}")
