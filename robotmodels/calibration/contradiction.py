"""Measurements that contradict the others: known distances, and outliers under squares.

The measurements without the known distances, and the prior, predict these and their covariance.

Source: R. D. Cook, S. Weisberg, "Residuals and Influence in Regression", 1982, section 2.2.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from ..estimation import Loss
from ..estimation.outlying import outlying
from .measurements import KnownDistance
from .prior import ParameterPrior
from .problem import Problem, problem_of, satisfying, stacked
from .scale import needs_a_length
from .solve import Solution, refitted
from .validation import errors_of

_CONTRADICTED = 3.0  # difference from which a distance is reported, standard errors
_COMMON = 0.5
"""Part of the residuals assumed systematic, so that averaging over postures does not reduce it."""
_REFITS = 2  # largest number of fits without the outliers


class Contradiction(NamedTuple):
    """Numbers of the blocks of known distances that are wrong, and the note about them."""

    blocks: tuple[int, ...]
    note: str


def contradictions(
    solution: Solution, given: ParameterPrior | None, size_is_known: bool
) -> list[Contradiction]:
    """Known distances that differ from the prediction by all other measurements.

    ``given`` is the prior before it was widened, perhaps to suit a wrong distance.
    """
    measurements = solution.problem.measurements
    numbers = [k for k, m in enumerate(measurements) if isinstance(m, KnownDistance)]
    rival = ""
    if numbers and not size_is_known and needs_a_length(_without(solution, numbers)[0]):
        # if they alone determine the scale, the first one is taken as correct
        first, *numbers = numbers
        rival = _named(measurements[first])  # type: ignore[arg-type]
    if not numbers:
        return []
    problem, scales = _without(solution, numbers)
    others = refitted(solution, problem, solution.fit.x, scales, given)
    if len(others.fit.dropped) > len(solution.fit.dropped):
        return []
    known = [m for m in measurements if isinstance(m, KnownDistance)][-len(numbers) :]
    sigma = np.array([_sigma(m, solution.scales[k]) for k, m in zip(numbers, known, strict=True)])
    shift, covariance = _predicted_differences(solution, others, numbers, sigma)
    firsts = np.cumsum([0, *(m.blocks for m in measurements)])
    source = "the other measurements"
    source += " and the prior" if np.isfinite(solution.fit.prior.sigma).any() else ""
    found = []
    lengths = [m.length for m in known]
    for group, mean, deviation in _wrong_groups(shift, covariance, sigma, lengths):
        m, many = known[group[0]], len(group)
        size = float(np.linalg.norm(sigma[group])) / many
        error = math.sqrt(max(0.0, deviation**2 - size**2))
        digits = max(0, 1 - math.floor(math.log10(max(1e3 * error, 1e-6))))
        stated, its = f"{_named(m)}: stated {1e3 * m.length:.6g} mm, but", "the length, its points,"
        if many > 1:
            stated = f"{many} known distances of {1e3 * m.length:.6g} mm:"
            its = "the lengths, their points,"
        note = (
            f"{stated} {source} predict {1e3 * (m.length + mean):.{digits}f} +- "
            f"{1e3 * error:.{digits}f} mm (a difference of "
            f"{abs(mean) / deviation:.0f} standard errors). Check {its} and the "
            f"standard deviation of {1e3 * size * math.sqrt(many):.2g} mm."
        )
        note += f" Either this distance or {rival} is wrong." if rival else ""
        found.append(Contradiction(tuple(int(firsts[numbers[k]]) for k in group), note))
    return found


def _wrong_groups(
    shift: Array, covariance: Array, sigma: Array, lengths: Sequence[float]
) -> list[tuple[list[int], float, float]]:
    """Groups of wrong distances; equal lengths are one group if only their mean is wrong.

    With each its mean difference, given that the distances in no group are right, and the standard
    deviation of it. Shapes: shift, sigma (K,); covariance (K, K).
    """
    variance = covariance + np.diag(sigma**2)
    limit = _CONTRADICTED**2
    groups, left, rest = [], [], [*range(len(lengths))]
    while rest:
        alike = [k for k in rest if math.isclose(lengths[k], lengths[rest[0]], rel_tol=1e-9)]
        rest = [k for k in rest if k not in alike]
        mean = float(shift[alike].mean())
        apart = (shift[alike] - mean) ** 2 <= limit * variance[alike, alike]
        total = float(variance[np.ix_(alike, alike)].sum()) / len(alike) ** 2
        if len(alike) > 1 and apart.all() and mean**2 > limit * total:
            groups.append(alike)
        else:
            left += alike
    while left:  # differences given that the others are right
        inverse = np.linalg.inv(variance[np.ix_(left, left)])
        beyond = (inverse @ shift[left]) ** 2 > limit * np.diagonal(inverse)
        alone = shift[left] ** 2 / variance[left, left]
        if not beyond.any():
            break
        groups.append([left.pop(int(np.argmax(np.where(beyond, alone, -1.0))))])
    found = []
    for group in groups:  # a wrong distance may have let another one appear wrong
        kept, many = [*group, *left], len(group)
        inverse = np.linalg.inv(variance[np.ix_(kept, kept)])[:many]
        conditional = np.linalg.inv(inverse[:, :many])
        mean = float((conditional @ inverse @ shift[kept]).mean())
        total = float(conditional.sum()) / many**2
        if mean**2 > limit * total:
            found.append((group, mean, math.sqrt(total)))
        else:
            left += group
    return found


def _predicted_differences(
    solution: Solution, others: Solution, numbers: list[int], sigma: Array
) -> tuple[Array, Array]:
    """Predicted less stated lengths (K,), m, and the covariance of the prediction (K, K)."""
    rest = [k for k in range(len(solution.scales)) if k not in numbers]
    distances, scales = _without(solution, rest)
    x = _unbiased(others)
    residual, jacobian = stacked(distances, x, scales)
    T = sigma[:, None] * (jacobian @ others.fit.basis)
    rms = errors_of(solution.problem, others.corrections, others.fixture_values).rms["m"]
    return sigma * residual, T @ T.T + (_COMMON * rms) ** 2 * np.eye(len(numbers))


def _without(solution: Solution, left_out: Sequence[int]) -> tuple[Problem, tuple[Array, ...]]:
    """The problem without some measurements, and the noise of the others."""
    problem = solution.problem
    kept = [k for k in range(len(problem.measurements)) if k not in left_out]
    part = replace(
        problem,
        measurements=tuple(problem.measurements[k] for k in kept),
        factors=tuple(problem.factors[k] for k in kept),
    )
    return part, tuple(solution.scales[k] for k in kept)


def _unbiased(solution: Solution) -> Array:
    """The unknowns (P + F,) without the bias of contacts whose noise favours a smaller robot.

    The Jacobian at readings that satisfy the constraints is independent of the noise, so that it
    is the instrument of a step.
    """
    fit = solution.fit
    exact = satisfying(solution.problem, solution.corrections, solution.fixtures)
    if exact.rows != solution.problem.rows:
        return fit.x
    change = stacked(exact, fit.x, solution.scales)[1] - fit.jacobian
    return fit.x - fit.basis @ (fit.basis.T @ (change.T @ fit.residuals))


def _sigma(m: KnownDistance, scale: Array) -> float:
    """Standard deviation of a known distance, m."""
    if m.covariance is not None:
        return math.sqrt(m.covariance[0, 0, 0])
    return float(scale[0] if m.sigma is None else m.sigma[0, 0])


def _named(m: KnownDistance) -> str:
    return f"{m.name} {m.point} to {m.other}"


# --- outliers -------------------------------------------------------------------------------------


def with_outliers(
    solution: Solution, contradicted: list[Contradiction], given: ParameterPrior | None
) -> Solution:
    """The fit with its outliers; a known distance is one only if it is contradicted."""
    # Contacts leave the scale open, so that they shrink to zero size in a fit without the distance
    # that alone gives it. An outlier distorts the noise, the widths of the prior and the weights of
    # a fit, so that all are judged again by a fit without those listed.
    problem, fit = solution.problem, solution.fit
    if fit.loss is not Loss.SQUARES:
        return solution
    trusted = np.repeat(
        [not m.views for m in problem.measurements], [m.blocks for m in problem.measurements]
    )
    wrong = np.array([b for c in contradicted for b in c.blocks], dtype=np.int64)
    outliers = wrong if len(wrong) else fit.outliers
    if trusted.any() and not len(wrong):
        rows = fit.orthonormal_rows
        outliers = outlying(rows, fit.whitened, fit.block, fit.freedom, trusted)
    for _ in range(_REFITS):
        rest = _rows_without(solution, outliers, given) if len(outliers) else None
        if rest is None:
            break
        before = outliers
        rows, residual, freedom = rest
        outliers = outlying(rows, residual, fit.block, freedom, trusted, before)
        outliers = np.concatenate([wrong, outliers[~np.isin(outliers, wrong)]])
        if set(outliers) == set(before):
            break
    return replace(solution, fit=replace(fit, outliers=outliers))


def _rows_without(
    solution: Solution, outliers: NDArray[np.int64], given: ParameterPrior | None
) -> tuple[Array, Array, float] | None:
    """Orthonormal rows and residuals of all blocks by a fit without some; degrees of freedom.

    None where too little is left.
    """
    problem = solution.problem
    parts = np.split(np.arange(problem.blocks), np.cumsum([m.blocks for m in problem.measurements]))
    kept = [np.flatnonzero(~np.isin(part, outliers)) for part in parts]
    numbers = [k for k, _ in enumerate(problem.measurements) if len(kept[k])]
    rest = problem_of(
        problem.parameters, [problem.measurements[k].subset(kept[k]) for k in numbers]
    )
    if len(rest.fixtures) < problem.F or rest.rows <= problem.P + problem.F:
        return None
    values, scales = solution.fixture_values, list(solution.scales)
    start = np.array([*solution.corrections, *(values[f.name] for f in rest.fixtures)])
    found = refitted(solution, rest, start, tuple(scales[k] for k in numbers), given)
    for k, scale in zip(numbers, found.scales, strict=True):
        scales[k] = scale
    values = found.fixture_values
    x = np.array([*found.corrections, *(values[f.name] for f in problem.fixtures)])
    residual, jacobian = stacked(problem, x, tuple(scales))
    place = {f.name: problem.P + k for k, f in enumerate(problem.fixtures)}
    order = [*range(problem.P), *(place[f.name] for f in rest.fixtures)]
    return jacobian[:, order] @ found.fit.basis, residual, found.fit.freedom
