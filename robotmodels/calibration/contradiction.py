"""Consistency of known distances with the other measurements."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..estimation import Loss
from ..estimation.leverage import orthonormal_rows
from ..estimation.outlying import outlying
from .errors_seen import block_errors
from .identifiability.scale import needs_a_length
from .measurements import KnownDistance
from .solve import Solution, solve

_DOUBTFUL, _CONTRADICTED = 2.0, 3.0
"""Residual from which a distance is checked by a fit without it, and difference from which it is
reported, standard errors."""
_COMMON = 0.5
"""Part of the residuals assumed systematic, so that averaging over postures does not reduce it."""
_ALONE = 1e-8
"""1 - leverage of a row below which no other row predicts it."""


class Contradiction(NamedTuple):
    """A known distance and its prediction by a fit without it."""

    block: int
    """Its number among all blocks."""
    measurement: KnownDistance
    sigma: float
    """Its standard deviation, m."""
    others: float
    """The prediction, m."""
    doubt: float
    """Standard error of the prediction, m."""
    without: Solution
    """The fit without it."""

    @property
    def errors(self) -> float:
        """Difference in standard errors."""
        return abs(self.others - self.measurement.length) / math.hypot(self.sigma, self.doubt)

    def sentence(self) -> str:
        """The note about it."""
        m, doubt = self.measurement, 1e3 * self.doubt
        digits = max(0, 1 - math.floor(math.log10(max(doubt, 1e-6))))
        prior = np.isfinite(self.without.fit.prior.deviation).any()
        return (
            f"{m.name} {m.point} to {m.other}: stated {1e3 * m.length:.6g} mm, but the other "
            f"measurements{' and the prior' if prior else ''} predict "
            f"{1e3 * self.others:.{digits}f} +- {doubt:.{digits}f} mm (a difference of "
            f"{self.errors:.0f} standard errors). Check the length, its two points, and its "
            f"standard deviation of {1e3 * self.sigma:.2g} mm."
        )


def contradictions(
    solution: Solution, size_is_known: bool, truncation: float | None = None
) -> list[Contradiction]:
    """Known distances that differ from the fit without them, the worst first."""
    problem, fit = solution.problem, solution.fit
    measurements = problem.measurements
    if not any(isinstance(m, KnownDistance) for m in measurements):
        return []
    share = (orthonormal_rows(fit) ** 2).sum(axis=1)
    found, first, block = [], 0, 0
    for k, (m, scale) in enumerate(zip(measurements, solution.scales, strict=True)):
        row, at = first, block
        first, block = first + m.blocks * len(m.axes), block + m.blocks
        left = 1.0 - share[row]
        doubtful = left < _ALONE or abs(fit.whitened[row]) > _DOUBTFUL * math.sqrt(left)
        if not isinstance(m, KnownDistance) or not doubtful:
            continue
        others = replace(
            problem,
            measurements=(*measurements[:k], *measurements[k + 1 :]),
            factors=(*problem.factors[:k], *problem.factors[k + 1 :]),
        )
        if not size_is_known and needs_a_length(others, ()):
            continue
        without = solve(
            others, fit.x, from_scales=(*solution.scales[:k], *solution.scales[k + 1 :]),
            loss=fit.loss, prior=fit.prior, truncation=truncation,
        )  # fmt: skip
        places = problem.columns(m)
        part = m.linearise([], without.fixtures[places])
        along = part.by_fixtures[0, 0]
        spread = without.fit.covariance[np.ix_(problem.P + places, problem.P + places)]
        variance = float(along @ spread @ along)
        sigma = float(scale[0])
        if m.sigma is not None:
            sigma = float(m.sigma[0, 0])
        elif m.covariance is not None:
            sigma = math.sqrt(m.covariance[0, 0, 0])
        if not 0.0 <= variance < np.inf:
            continue
        length = m.length + float(part.residual[0, 0])
        errors = block_errors(others, without.deviation, without.fixtures)
        doubt = math.hypot(math.sqrt(variance), _COMMON * errors.summary("m").rms)
        found.append(Contradiction(at, m, sigma, length, doubt, without))
    found = sorted((c for c in found if c.errors > _CONTRADICTED), key=lambda c: -c.errors)
    if not found or not size_is_known:
        return found  # of two that give the scale against each other, either may be wrong
    # the worst bends the fit, so that others are judged by the fit without it
    worst, rest = found[0], contradictions(found[0].without, size_is_known, truncation)
    return [worst, *(c._replace(block=c.block + (c.block >= worst.block)) for c in rest)]


def judged(solution: Solution, contradicted: list[Contradiction]) -> Solution:
    """The fit with its outliers where there are known distances: those contradicted come first.

    Contacts leave the scale open, so that they shrink to nothing in a fit without the distance
    that alone gives it; other outliers are thus told with all that are not contradicted in place.
    """
    measurements = solution.problem.measurements
    if all(m.views for m in measurements) or solution.fit.loss is not Loss.SQUARES:
        return solution
    if contradicted:
        worst = contradicted[0]
        rest = judged(worst.without, [])
        numbers = np.delete(np.arange(solution.problem.blocks), worst.block)[rest.fit.outliers]
        known = [c.block for c in contradicted]
        outliers = np.array([*known, *numbers[~np.isin(numbers, known)]], dtype=np.int64)
    else:
        blocks = [m.blocks for m in measurements]
        trusted = np.repeat([not m.views for m in measurements], blocks)
        starts = np.searchsorted(solution.fit.block, np.arange(solution.problem.blocks))
        outliers = outlying(
            orthonormal_rows(solution.fit), solution.fit.whitened, starts, solution.fit.freedom,
            trusted,
        )  # fmt: skip
    return replace(solution, fit=replace(solution.fit, outliers=outliers))
