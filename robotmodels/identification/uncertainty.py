"""Final standard errors of an estimate, and shrinkage where they are large."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .._arrays import Array
from ..estimation.covariance import (
    CorrelatedCovariance,
    correlated_covariance,
    jackknife_inflation,
)
from ..estimation.estimate import Estimate
from ..estimation.factor import TriangularFactors
from ..estimation.linear import group_leverage, solved
from .delay import representative_part
from .equations import Equations, segments
from .methods.base import Method
from .methods.linear import Wls, used_weights
from .processing import LEAST_EQUATIONS
from .signals import signals
from .weak_prior import plausible_sizes, shrunk

_SEGMENTS = 25
_NOTED = 1.5  # least jackknife inflation factor for a note


def with_uncertainty(
    method: Method, system: Equations, factors: TriangularFactors, estimate: Estimate
) -> tuple[Estimate, Array, int]:
    """Estimate with its final covariance, standard errors for white residuals (b,), and lags.

    Weighted least squares uses a weak prior on request or where the log determines little.
    """
    if method.covariance == "given":
        details = estimate.details
        return estimate, details.iid_standard_errors, details.correlation_lags
    white = estimate.standard_errors
    spread, ratio, inflation = _spread(method, system, factors, estimate)
    if inflation > _NOTED:
        note = (
            f"Standard errors were multiplied by {inflation:.2g}: estimates from segments of the "
            "log differ by more than stationary residuals explain. The model may be incomplete, or "
            "the motion may excite different parameters at different times."
        )
        estimate = replace(estimate, notes=(*estimate.notes, note))
    shrinkage = method.shrinkage if isinstance(method, Wls) else False
    if shrinkage is None and method.essential:  # an explicit choice of parameters is kept
        shrinkage = False
    if shrinkage is not False:
        part = representative_part(system.log, system.processing.motion)
        x = signals(part, system.processing)
        sizes = plausible_sizes(system.base, system.names, x.q, x.v, x.a, x.tau)
        errors = np.sqrt(np.diag(spread.covariance))
        always = bool(shrinkage) or factors.rows < LEAST_EQUATIONS * len(factors.names)
        shrunk_estimate = shrunk(factors, estimate, errors, ratio, sizes, always)
        if shrunk_estimate is not None:
            covariance = shrunk_estimate.covariance * np.outer(ratio, ratio)
            return replace(shrunk_estimate, covariance=covariance), white, spread.lags
    if method.covariance == "correlated":
        return replace(estimate, covariance=spread.covariance), white, spread.lags
    covariance = estimate.covariance * np.outer(ratio, ratio)
    return replace(estimate, covariance=covariance), white, spread.lags


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
        parts, share = segments(part_system, _SEGMENTS), len(part) / len(system.log)
        inflation = jackknife_inflation(parts, factors, weights, errors, share)
    spread = replace(spread, covariance=inflation**2 * spread.covariance)
    ratio = np.sqrt(np.diag(spread.covariance) / np.where(white > 0.0, white, 1.0))
    return spread, ratio, inflation
