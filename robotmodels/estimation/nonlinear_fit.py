"""What a nonlinear fit gives: the estimate, its covariance, and all to check it again."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array, Rebuilt, read_only
from .._outcomes import Outcome
from .losses import Loss
from .prior import Prior


class FitStatus(Outcome):
    """How a fit ended."""

    CONVERGED = 0, "The fit has converged: further steps are rounding."
    STALLED = (
        1,
        "The fit has stalled: no step lowers the sum although the slope says so; the Jacobian may "
        "be wrong, or the residuals not smooth.",
    )
    ITERATION_LIMIT = (
        2,
        "The fit has reached the limit of its iterations before its steps were small; start nearer "
        "or allow more iterations.",
    )
    SINGULAR = (
        3,
        "The measurements do not determine all parameters: some combinations have no effect; "
        "leave parameters out, add a prior, or measure where they act.",
    )


@dataclass(frozen=True, slots=True, eq=False)
class NonlinearFit(Rebuilt):
    """Parameters fitted to measurements. Read-only.

    Parameters
    ----------
    x : ndarray, shape (P,)
        The estimate.
    status : FitStatus
        How the fit ended; ``status.sentence`` says it.
    covariance : ndarray, shape (P, P)
        Of the estimate; infinite variances where the measurements determine nothing, NaN where
        there are no more rows than parameters and the noise is to be estimated.
    scale : float
        Standard deviation of the residuals in units of the stated ones: from the sum of squares, or
        from the median if the loss is robust.
    freedom : float
        Parameters that the measurements determine: less than P with a prior or where directions
        have been dropped.
    residuals : ndarray, shape (M,)
        Rows at ``x``, in their units.
    jacobian : ndarray, shape (M, P)
        Of the rows at ``x``.
    sigma : ndarray, shape (M,)
        Stated standard deviations of the rows.
    block : ndarray of int, shape (M,)
        Measurement of each row.
    weights : ndarray, shape (M,)
        Weights of the loss, 1 for rows that count in full; those of a measurement are equal.
    outliers : ndarray of int, shape (K,)
        Measurements farther from what the others predict (squares: from fits without them) than
        noise explains, the worst first. They stay in the fit with their weights.
    loss : Loss
        Which loss.
    sigma_known : bool
        Whether the stated deviations were taken as they stand.
    prior : Prior
        What was known before.
    singular_values : ndarray, shape (P,)
        Of the weighted Jacobian with the prior, columns scaled to length 1; largest first.
    dropped : ndarray, shape (k, P)
        Directions without effect (or under the truncation), as rows, in units of the parameters.
    x0 : ndarray, shape (P,)
        Where the fit started.
    steps : ndarray, shape (n, 5)
        One row a step: sum of squares before, predicted decrease, actual decrease, damping, step
        relative to the parameters (both scaled by the columns).
    """

    x: Array
    status: FitStatus
    covariance: Array
    scale: float
    freedom: float
    residuals: Array
    jacobian: Array
    sigma: Array
    block: NDArray[np.int64]
    weights: Array
    outliers: NDArray[np.int64]
    loss: Loss
    sigma_known: bool
    prior: Prior
    singular_values: Array
    dropped: Array
    x0: Array
    steps: Array

    def __post_init__(self) -> None:
        for name in (
            "x", "covariance", "residuals", "jacobian", "sigma", "weights", "singular_values",
            "dropped", "x0", "steps",
        ):  # fmt: skip
            object.__setattr__(self, name, read_only(getattr(self, name)))
        for name in ("block", "outliers"):
            object.__setattr__(self, name, read_only(getattr(self, name), np.int64))

    @property
    def deviations(self) -> Array:
        """Standard deviations of the parameters, shape (P,)."""
        return np.sqrt(np.diagonal(self.covariance))

    @property
    def converged(self) -> bool:
        """Whether the fit has ended as it should."""
        return self.status is FitStatus.CONVERGED

    @property
    def rank(self) -> int:
        """Number of combinations of parameters that are determined."""
        return len(self.x) - len(self.dropped)

    @property
    def iterations(self) -> int:
        """Number of steps taken."""
        return len(self.steps)

    @property
    def whitened(self) -> Array:
        """Residuals divided by their stated standard deviations, shape (M,)."""
        return self.residuals / self.sigma

    @property
    def freedom_left(self) -> float:
        """Rows less the parameters that they determine."""
        return len(self.residuals) - self.freedom
