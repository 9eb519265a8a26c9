"""Fit of given parameters, with an estimate of the noise.

Book section 1.4.4.3.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array, Rebuilt, read_only
from ..estimation import FitStatus, Loss, NonlinearFit, fit_nonlinear
from ..estimation.losses import robust_scale
from .measurements import Measurement
from .prior import ParameterPrior, gaussian_prior, widened
from .problem import Problem, guessed_fixtures, stacked

_SMALL = 0.05  # initial noise beside a prior, relative to the initial noise without one
_ROUNDS = 10
_PSEUDO_ROWS = 50.0
"""Pseudo-rows by which noise estimates of one kind are drawn to their common value."""
_SETTLED = 1e-3
ROUGH = 1e-6
"""Tolerance of steps while the noise is estimated, and of fits without some measurements."""
_EXACT = 1e-9
"""Smallest standard deviation that is estimated, rad or part of the robot's size: below, the data
are exact."""
_WIDENINGS = 4  # largest number of fits for the prior's width


@dataclass(frozen=True, slots=True, eq=False)
class Solution(Rebuilt):
    """Fitted parameters and fixtures, with the options of the fit.

    ``fit`` is of the vector [parameters, fixtures], its rows in standard deviations; ``scales``
    (k,) are the standard deviations of the rows of each measurement, m or rad.
    """

    problem: Problem
    fit: NonlinearFit
    scales: tuple[Array, ...]
    prior: ParameterPrior | None
    truncation: float | None

    @property
    def corrections(self) -> Array:
        """Corrections of the parameters, shape (P,)."""
        return self.fit.x[: self.problem.P]

    @property
    def fixtures(self) -> Array:
        """Values of the fixtures, shape (F,)."""
        return self.fit.x[self.problem.P :]

    @property
    def fixture_values(self) -> dict[str, float]:
        """Values of the fixtures by name, m or rad."""
        names = (fixture.name for fixture in self.problem.fixtures)
        return dict(zip(names, self.fixtures.tolist(), strict=True))


def states_noise(m: Measurement) -> bool:
    """Whether the noise of a measurement is stated, so that it is not estimated."""
    return m.sigma is not None or m.covariance is not None


def by_units(problem: Problem, length: float, angle: float) -> tuple[Array, ...]:
    """A number for the rows in m and one for those in rad of each measurement, shapes (k,)."""
    return tuple(
        read_only([length if unit == "m" else angle for unit in m.units])
        for m in problem.measurements
    )


def first_scales(problem: Problem) -> tuple[Array, ...]:
    """Initial standard deviations: of lengths, and as much over the robot's size as an angle."""
    table = problem.parameters.table
    return by_units(problem, table.expected_error, table.expected_error / table.size)


def solve(
    problem: Problem,
    start: Array | None = None,
    *,
    loss: Loss = Loss.SQUARES,
    prior: ParameterPrior | None = None,
    truncation: float | None = None,
    scales: tuple[Array, ...] | None = None,
    from_scales: tuple[Array, ...] | None = None,
    tolerance: float = 1e-12,
) -> Solution:
    """Iteratively reweighted nonlinear least squares; unstated noise is estimated."""
    if start is None:
        xi = np.zeros(problem.P)
        start = np.concatenate([xi, guessed_fixtures(problem, xi)])
    gaussian = None if prior is None else gaussian_prior(prior, problem)
    known = all(states_noise(m) for m in problem.measurements)
    is_settled = known or scales is not None
    current = scales or from_scales or first_scales(problem)
    if not (scales or from_scales or prior is None) and (
        problem.rows >= 1.5 * (problem.P + problem.F)
    ):
        # with a prior the noise has two solutions; the larger one explains all residuals as noise,
        # and a small initial value leads to the smaller one
        current = tuple(read_only(_SMALL * scale) for scale in current)
    for _ in range(_ROUNDS):
        fit = fit_nonlinear(
            lambda x, s=current: stacked(problem, x, s),
            start,
            block=problem.block,
            loss=loss,
            prior=gaussian,
            truncation=truncation,
            sigma_known=known or scales is not None,
            tolerance=tolerance if is_settled else max(tolerance, ROUGH),
        )
        if is_settled:
            break
        previous, current = current, _estimated_scales(problem, fit, current)
        start = fit.x
        # the ratios of the scales weight the rows; a common factor changes nothing, unless there
        # is a prior to be weighed against
        ratios = np.concatenate([new / old for new, old in zip(current, previous, strict=True)])
        changed = np.ptp(ratios) if prior is None else np.abs(ratios - 1.0).max()
        is_settled = float(changed) < _SETTLED * float(ratios.max())
        if _is_exact(problem, current):
            tolerance = max(tolerance, ROUGH)  # exact data: steps are rounding long before
    if fit.status is FitStatus.STALLED and _is_exact(problem, current):
        fit = replace(fit, status=FitStatus.CONVERGED)  # no step lowers residuals of rounding
    return Solution(problem, fit, current, prior, truncation)


def refitted(
    like: Solution,
    problem: Problem,
    start: Array,
    scales: tuple[Array, ...],
    prior: ParameterPrior | None = None,
    tolerance: float = 1e-12,
) -> Solution:
    """Fit of other measurements with the options of a fit, from its noise.

    A given ``prior`` is widened where these measurements require it; default that of the fit.
    """
    for _ in range(_WIDENINGS):
        solution = solve(
            problem,
            start,
            loss=like.fit.loss,
            prior=prior or like.prior,
            truncation=like.truncation,
            from_scales=scales,
            tolerance=tolerance,
        )
        wider = None if prior is None else widened(prior, problem, solution.fit)
        if wider is prior:
            break
        prior, start, scales = wider, solution.fit.x, solution.scales
    return solution


def _least(problem: Problem) -> tuple[Array, ...]:
    """Smallest standard deviations that are estimated."""
    return by_units(problem, _EXACT * problem.parameters.table.size, _EXACT)


def _is_exact(problem: Problem, scales: tuple[Array, ...]) -> bool:
    return bool((np.concatenate(scales) <= np.concatenate(_least(problem))).any())


def _estimated_scales(
    problem: Problem, fit: NonlinearFit, scales: tuple[Array, ...]
) -> tuple[Array, ...]:
    """Noise of each measurement and unit, shrunk to the common value of its kind."""
    leverage = (fit.orthonormal_rows**2).sum(axis=1)
    estimates: dict[tuple[type, str], list[tuple[int, NDArray[np.bool_], float, float]]] = {}
    parts = zip(problem.measurements, scales, problem.row_slices, strict=True)
    for k, (m, scale, rows) in enumerate(parts):
        if states_noise(m):
            continue
        for unit in sorted(set(m.units)):
            of_unit = np.array(m.units) == unit
            residual = fit.residuals[rows].reshape(m.blocks, -1)[:, of_unit]
            fitted = float(leverage[rows].reshape(m.blocks, -1)[:, of_unit].sum())
            freedom = max(residual.size - fitted, 0.0)
            if fit.loss is Loss.SQUARES:
                factor = np.sqrt((residual**2).sum() / freedom) if freedom > 0.5 else 1.0
            else:
                count = np.full(m.blocks, of_unit.sum())
                factor = robust_scale(np.linalg.norm(residual, axis=1), count, fitted)
            std = float(scale[of_unit][0] * factor)
            estimates.setdefault((type(m), unit), []).append((k, of_unit, std, freedom))
    new, least = [scale.copy() for scale in scales], _least(problem)
    for parts in estimates.values():
        total = sum(freedom for *_, freedom in parts)
        square = sum(std**2 * freedom for *_, std, freedom in parts)
        for k, of_unit, std, freedom in parts:
            if total > 0.0 and len(parts) > 1:
                pooled = _PSEUDO_ROWS * square / total
                std = np.sqrt((std**2 * freedom + pooled) / (freedom + _PSEUDO_ROWS))
            new[k][of_unit] = np.maximum(std, least[k][of_unit])
    return tuple(read_only(scale) for scale in new)
