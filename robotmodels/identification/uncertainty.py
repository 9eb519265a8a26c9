"""Final standard errors of an estimate, and shrinkage where they are large."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .._arrays import Array
from .closed_loop.estimate import SimulatedEstimate
from .correlated import CorrelatedCovariance, correlated_covariance
from .equations import Equations
from .methods.estimate import Estimate, Method
from .methods.least_squares import shares, solved, used_weights
from .preparation.delay_rows import looked_at
from .preparation.signals import signals
from .processing_choice import LEAST_EQUATIONS
from .scale.reduction import Reduction
from .segment_spread import segment_inflation
from .weak_prior import plausible_sizes, shrunk

_LINEAR = (Method.OLS, Method.WLS, Method.IRLS)
"""Methods whose covariance is formed here, for correlated residuals."""
_WEIGHTED = (Method.WLS, Method.IRLS)
_NOTED = 1.5
_SEGMENTS = (
    "Standard errors were multiplied by {:.2g}: estimates from segments of the log differ by more "
    "than stationary residuals explain. The model may be incomplete, or the motion may excite "
    "different parameters at different times."
)


def with_uncertainty(
    way: Method, system: Equations, reduction: Reduction, estimate: Estimate, shrinkage: bool | None
) -> tuple[Estimate, Array, int]:
    """Estimate with its final covariance, standard errors for white residuals (b,), and lags.

    Methods that simulate the robot bring their own covariance. Weighted least squares is shrunk by
    a weak prior on request or, by default, where the log determines too little.
    """
    if isinstance(estimate, SimulatedEstimate):
        return estimate, estimate.white, estimate.lags
    white = estimate.deviations
    spread, ratio, grown = _spread(way, system, reduction, estimate)
    if grown > _NOTED:
        estimate = replace(estimate, notes=(*estimate.notes, _SEGMENTS.format(grown)))
    prior = None
    if way in _WEIGHTED and shrinkage is not False:
        always = shrinkage is True or reduction.rows < LEAST_EQUATIONS * len(reduction.names)
        prior = _shrunk(system, reduction, estimate, spread, ratio, always)
    if prior is not None:
        estimate = replace(prior, covariance=prior.covariance * np.outer(ratio, ratio))
    elif way in _LINEAR:
        estimate = replace(estimate, covariance=spread.covariance)
    else:
        estimate = replace(estimate, covariance=estimate.covariance * np.outer(ratio, ratio))
    return estimate, white, spread.lags


def _spread(
    way: Method, system: Equations, reduction: Reduction, estimate: Estimate
) -> tuple[CorrelatedCovariance, Array, float]:
    """Covariance for correlated residuals, its ratio of standard errors, and that of segments.

    Methods that are not linear, or not of all equations at once, have a covariance of their own for
    white residuals; correlation makes it larger as it does that of weighted least squares.
    """
    linear = way if way in _LINEAR else Method.WLS
    weights = used_weights(linear, reduction)
    values, inverse, rest = solved(reduction, weights)
    taken = shares(reduction, weights, inverse)
    at = estimate.values if way in _LINEAR else values
    spread = correlated_covariance(system, at, weights, inverse, taken=taken)
    white = rest / (reduction.rows - len(values)) * np.diag(inverse)
    grown = segment_inflation(system, reduction, weights, np.sqrt(np.diag(spread.covariance)))
    spread = replace(spread, covariance=grown**2 * spread.covariance)
    ratio = np.sqrt(np.diag(spread.covariance) / np.where(white > 0.0, white, 1.0))
    return spread, ratio, grown


def _shrunk(
    system: Equations,
    reduction: Reduction,
    estimate: Estimate,
    spread: CorrelatedCovariance,
    ratio: Array,
    always: bool,
) -> Estimate | None:
    """The estimate with a weak prior, where the log needs it."""
    part = looked_at(system.log, system.processing.motion)
    found = signals(part, system.processing)
    sizes = plausible_sizes(system.base, system.names, found.q, found.v, found.a, found.tau)
    deviations = np.sqrt(np.diag(spread.covariance))
    return shrunk(reduction, estimate, deviations, ratio, sizes, always)
