"""Final standard errors of an estimate, and shrinkage where they are large."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .._arrays import Array
from ..estimation.covariance import (
    CorrelatedCovariance,
    correlated_covariance,
    jackknife_inflation,
)
from ..estimation.estimate import Estimate
from ..estimation.factor import TriangularFactors
from ..estimation.linear import (
    group_leverage,
    solved,
)
from .delay import representative_part
from .equations import Equations
from .methods.base import Method
from .methods.linear import Wls, used_weights
from .processing import LEAST_EQUATIONS
from .reduction import segments
from .signals import signals
from .weak_prior import plausible_sizes, shrunk

_SEGMENTS = 25
_NOTED = 1.5
"""Least jackknife inflation factor for a note."""


@dataclass(frozen=True, slots=True, eq=False)
class Uncertainty:
    """Standard errors for white residuals (b,), and lags of the correlation window."""

    iid_standard_errors: Array
    correlation_lags: int


def with_uncertainty(
    method: Method, system: Equations, factors: TriangularFactors, estimate: Estimate
) -> tuple[Estimate, Uncertainty]:
    """Estimate with its final covariance.

    Weighted least squares uses a weak prior on request or where the log determines little.
    """
    if method.covariance == "given":
        details = estimate.details
        return estimate, Uncertainty(details.iid_standard_errors, details.correlation_lags)
    white = estimate.standard_errors
    spread, ratio, inflation = _spread(method, system, factors, estimate)
    if inflation > _NOTED:
        note = (
            f"Standard errors were multiplied by {inflation:.2g}: estimates from segments of the "
            "log differ by more than stationary residuals explain. The model may be incomplete, or "
            "the motion may excite different parameters at different times."
        )
        estimate = replace(estimate, notes=(*estimate.notes, note))
    shrunk_estimate = _shrunk(method, system, factors, estimate, spread, ratio)
    if shrunk_estimate is None and method.covariance == "correlated":
        estimate = replace(estimate, covariance=spread.covariance)
    else:
        estimate = estimate if shrunk_estimate is None else shrunk_estimate
        estimate = replace(estimate, covariance=estimate.covariance * np.outer(ratio, ratio))
    return estimate, Uncertainty(white, spread.lags)


def _spread(
    method: Method, system: Equations, factors: TriangularFactors, estimate: Estimate
) -> tuple[CorrelatedCovariance, Array, float]:
    """Covariance for correlated residuals, ratio of standard errors (b,), and inflation.

    Covariances of other methods are for white residuals; they are scaled by the ratio of weighted
    least squares.
    """
    weights = used_weights(method, factors)
    values, inverse, rest = solved(factors, weights)
    leverage = group_leverage(factors, weights, inverse)
    at = estimate.values if method.covariance == "correlated" else values
    spread = correlated_covariance(system, at, weights, inverse, leverage=leverage)
    white = rest / (factors.rows - len(values)) * np.diag(inverse)
    # a part of a long log is enough
    part = representative_part(system.log, system.processing.motion)
    part_system = system if part is system.log else system.with_log(part).cached()
    inflation = 1.0
    if sum(len(block) for block in part_system.blocks()) >= _SEGMENTS:
        errors = np.sqrt(np.diag(spread.covariance))
        share = len(part) / len(system.log)
        inflation = jackknife_inflation(
            segments(part_system, _SEGMENTS), factors, weights, errors, share
        )
    spread = replace(spread, covariance=inflation**2 * spread.covariance)
    ratio = np.sqrt(np.diag(spread.covariance) / np.where(white > 0.0, white, 1.0))
    return spread, ratio, inflation


def _shrunk(
    method: Method,
    system: Equations,
    factors: TriangularFactors,
    estimate: Estimate,
    spread: CorrelatedCovariance,
    ratio: Array,
) -> Estimate | None:
    """The estimate with a weak prior, where it is requested or the log needs it."""
    if not isinstance(method, Wls):
        return None
    # an explicit choice of parameters is kept
    choice = False if method.shrinkage is None and method.essential else method.shrinkage
    if choice is not None and not choice:
        return None
    always = bool(choice) or factors.rows < LEAST_EQUATIONS * len(factors.names)
    part = representative_part(system.log, system.processing.motion)
    filtered = signals(part, system.processing)
    sizes = plausible_sizes(
        system.base, system.names, filtered.q, filtered.v, filtered.a, filtered.tau
    )
    errors = np.sqrt(np.diag(spread.covariance))
    return shrunk(factors, estimate, errors, ratio, sizes, always)
