"""Fit of given parameters, with noise estimation.

Source: Seed book section 1.4.4.3.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .._arrays import Array, Rebuilt, read_only
from ..estimation import FitStatus, Loss, NonlinearFit, Prior, fit_nonlinear
from ..estimation.losses import robust_scale
from .measurements import Measurement
from .problem import Problem, guessed_fixtures, stacked

_FIRST_LENGTH = 1e-3
"""Standard deviation of lengths before it has been estimated, m."""
_LITTLE = 0.05
"""Initial noise beside a prior, relative to the initial noise without one."""
_ROUNDS = 10
_LENT = 50.0
"""Pseudo-rows by which noise estimates of one kind are drawn to their common value."""
_SETTLED = 1e-3
_ROUGH = 1e-6
"""Tolerance of the steps while the noise is still being estimated."""
_EXACT = 1e-9
"""Smallest standard deviation that is estimated, rad or part of the robot's size: below, the data
are exact."""


@dataclass(frozen=True, slots=True, eq=False)
class Solution(Rebuilt):
    """Fitted parameters and fixtures.

    Parameters
    ----------
    problem : Problem
        What was fitted.
    fit : NonlinearFit
        Of the vector [parameters, fixtures], rows in standard deviations.
    scales : tuple of ndarray, shapes (k,)
        Standard deviations of the rows of each measurement (m, rad): estimated where it states
        none.
    """

    problem: Problem
    fit: NonlinearFit
    scales: tuple[Array, ...]

    @property
    def deviation(self) -> Array:
        """Values of the parameters, shape (P,)."""
        return self.fit.x[: self.problem.P]

    @property
    def fixtures(self) -> Array:
        """Values of the fixtures, shape (F,)."""
        return self.fit.x[self.problem.P :]


def first_scales(problem: Problem) -> tuple[Array, ...]:
    """Initial standard deviations: 1 mm, and 1 mm over the reach as an angle."""
    size = problem.parameters.table.size
    length = _FIRST_LENGTH * min(1.0, size)
    return tuple(
        read_only([length if unit == "m" else length / size for unit in m.units])
        for m in problem.measurements
    )


def solve(
    problem: Problem,
    start: Array | None = None,
    *,
    scales: tuple[Array, ...] | None = None,
    from_scales: tuple[Array, ...] | None = None,
    loss: Loss = Loss.SQUARES,
    prior: Prior | None = None,
    truncation: float | None = None,
    tolerance: float = 1e-12,
) -> Solution:
    """Iteratively reweighted nonlinear least squares; unstated noise is estimated."""
    if start is None:
        xi = np.zeros(problem.P)
        start = np.concatenate([xi, guessed_fixtures(problem, xi)])
    known = all(_states_noise(m) for m in problem.measurements)
    estimated = scales is None and not known
    current = scales or from_scales or first_scales(problem)
    if not (scales or from_scales or prior is None or _has_few_rows(problem)):
        # beside a prior, noise that explains everything would be an answer too: it is the larger
        # of two, and an estimate that begins with too little noise ends at the smaller
        current = tuple(read_only(_LITTLE * scale) for scale in current)
    block = problem.block
    is_settled = not estimated
    for _ in range(_ROUNDS):
        fit = fit_nonlinear(
            lambda x, s=current: stacked(problem, x, s), start, block=block, loss=loss,
            prior=prior, truncation=truncation, sigma_known=known or scales is not None,
            tolerance=tolerance if is_settled else max(tolerance, _ROUGH),
        )  # fmt: skip
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
            tolerance = max(tolerance, _ROUGH)  # exact data: steps are rounding long before
    if fit.status is FitStatus.STALLED and _is_exact(problem, current):
        # what is left is rounding, which no step lowers
        fit = replace(fit, status=FitStatus.CONVERGED)
    return Solution(problem, fit, current)


def _has_few_rows(problem: Problem) -> bool:
    """Whether there are hardly more rows than unknowns, so that noise may seem to be none."""
    return problem.rows < 1.5 * (problem.P + problem.F)


def _states_noise(m: Measurement) -> bool:
    return m.sigma is not None or m.covariance is not None


def _floor(unit: str, size: float) -> float:
    """Smallest standard deviation that is estimated."""
    return _EXACT * size if unit == "m" else _EXACT


def _is_exact(problem: Problem, scales: tuple[Array, ...]) -> bool:
    size = problem.parameters.table.size
    return any(
        bool((scale <= [_floor(unit, size) for unit in m.units]).any())
        for m, scale in zip(problem.measurements, scales, strict=True)
    )


def _estimated_scales(
    problem: Problem, fit: NonlinearFit, scales: tuple[Array, ...]
) -> tuple[Array, ...]:
    """Noise of each measurement and unit, shrunk to the common value of its kind."""
    leverage = (fit.orthonormal_rows**2).sum(axis=1)
    size = problem.parameters.table.size
    found: dict[tuple[type, str], list[tuple[int, float, float]]] = {}
    first = 0
    for k, (m, scale) in enumerate(zip(problem.measurements, scales, strict=True)):
        rows = slice(first, first + m.blocks * len(m.axes))
        first = rows.stop
        if _states_noise(m):
            continue
        residual = fit.residuals[rows].reshape(m.blocks, -1)
        share = leverage[rows].reshape(m.blocks, -1)
        for unit in sorted(set(m.units)):
            of_unit = np.array([u == unit for u in m.units])
            fitted = float(share[:, of_unit].sum())
            freedom = max(of_unit.sum() * m.blocks - fitted, 0.0)
            if fit.loss is Loss.SQUARES:
                square = float((residual[:, of_unit] ** 2).sum())
                factor = np.sqrt(square / freedom) if freedom > 0.5 else 1.0
            else:
                count = np.full(m.blocks, of_unit.sum())
                factor = robust_scale(np.linalg.norm(residual[:, of_unit], axis=1), count, fitted)
            own = float(scale[of_unit][0]) * float(factor)
            found.setdefault((type(m), unit), []).append((k, own, freedom))
    new = [scale.copy() for scale in scales]
    for (_, unit), parts in found.items():
        square = sum(own**2 * freedom for _, own, freedom in parts)
        total = sum(freedom for _, _, freedom in parts)
        for k, own, freedom in parts:
            if total > 0.0 and len(parts) > 1:
                lent = _LENT * square / total
                own = np.sqrt((own**2 * freedom + lent) / (freedom + _LENT))
            of_unit = [u == unit for u in problem.measurements[k].units]
            new[k][of_unit] = max(own, _floor(unit, size))
    return tuple(read_only(scale) for scale in new)
