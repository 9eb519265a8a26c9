"""Measurements that contradict the others: known distances, and outliers under squares.

The measurements without the known distances, and the prior, predict these and their covariance.

Source: R. D. Cook, S. Weisberg, "Residuals and Influence in Regression", 1982, section 2.2.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from .._arrays import Array
from ..estimation import Loss
from .identifiable import needs_a_length
from .measurements import KnownDistance
from .prior import ParameterPrior
from .problem import Problem, satisfying, stacked
from .solve import Solution, refitted
from .validation import errors_of

_CONTRADICTED = 3.0  # difference from which a distance is reported, standard errors
_COMMON = 0.5  # part of the residuals that is systematic: averaging postures does not reduce it


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
    if numbers and not size_is_known and needs_a_length(_part(solution, numbers, False)[0]):
        # if they alone determine the scale, the first one is taken as correct
        first, *numbers = numbers
        rival = _named(measurements[first])
    if not numbers:
        return []
    problem, scales = _part(solution, numbers, False)
    others = refitted(solution, problem, solution.fit.x, scales, given)
    if len(others.fit.dropped) > len(solution.fit.dropped):
        return []
    shift, covariance, sigma = _predicted_differences(solution, others, numbers)
    firsts = np.cumsum([0, *(m.blocks for m in measurements)])
    source = "the other measurements"
    source += " and the prior" if np.isfinite(solution.fit.prior.sigma).any() else ""
    known: list[Any] = [measurements[k] for k in numbers]
    lengths, found = [m.length for m in known], []
    for group, mean, deviation in _wrong_groups(shift, covariance + np.diag(sigma**2), lengths):
        length, many = lengths[group[0]], len(group)
        size = float(np.linalg.norm(sigma[group])) / many
        error = math.sqrt(max(0.0, deviation**2 - size**2))
        digits = max(0, 1 - math.floor(math.log10(max(1e3 * error, 1e-6))))
        stated = f"{_named(known[group[0]])}: stated {1e3 * length:.6g} mm, but"
        its = "the length, its points,"
        if many > 1:
            stated = f"{many} known distances of {1e3 * length:.6g} mm:"
            its = "the lengths, their points,"
        note = (
            f"{stated} {source} predict {1e3 * (length + mean):.{digits}f} +- "
            f"{1e3 * error:.{digits}f} mm (a difference of {abs(mean) / deviation:.0f} standard "
            f"errors). Check {its} and the standard deviation of "
            f"{1e3 * size * math.sqrt(many):.2g} mm."
        )
        note += f" Either this distance or {rival} is wrong." if rival else ""
        found.append(Contradiction(tuple(int(firsts[numbers[k]]) for k in group), note))
    return found


def _wrong_groups(
    shift: Array, variance: Array, lengths: Sequence[float]
) -> list[tuple[list[int], float, float]]:
    """Wrong distances, or all those of equal length, with their mean shift and its deviation.

    One after another, the most significant first. Shapes: shift (K,), variance (K, K).
    """
    inverse, rest, groups = np.linalg.inv(variance), [*range(len(lengths))], []
    alike = [[j for j in rest if math.isclose(lengths[j], x, rel_tol=1e-9)] for x in lengths]
    found: list[tuple[list[int], float, float]] = []
    while rest:
        tried = []
        for group in (*([k] for k in rest), *(g for g in alike if set(g) <= set(rest))):
            H = np.array([np.isin(np.arange(len(lengths)), g) for g in (*groups, group)], float).T
            covariance = np.linalg.inv(H.T @ inverse @ H)
            means = covariance @ H.T @ inverse @ shift
            tried.append((abs(means[-1]) / math.sqrt(covariance[-1, -1]), group, means, covariance))
        ratio, group, means, covariance = max(tried, key=lambda trial: trial[0])
        if ratio <= _CONTRADICTED:
            break
        groups.append(group)
        rest = [k for k in rest if k not in group]
        deviations = np.sqrt(np.diag(covariance))
        found = list(zip(groups, means.tolist(), deviations.tolist(), strict=True))
    return [x for x in found if abs(x[1]) > _CONTRADICTED * x[2]]


def _predicted_differences(
    solution: Solution, others: Solution, numbers: list[int]
) -> tuple[Array, Array, Array]:
    """Predicted less stated lengths (K,), m, covariance of the prediction (K, K), noise (K,)."""
    distances, scales = _part(solution, numbers, True)
    sigma = np.array([
        math.sqrt(m.covariance[0, 0, 0]) if m.covariance is not None
        else scale[0] if m.sigma is None else m.sigma[0, 0]
        for m, scale in zip(distances.measurements, scales, strict=True)
    ])  # fmt: skip
    x = _unbiased(others)
    residual, jacobian = stacked(distances, x, scales)
    T = sigma[:, None] * (jacobian @ others.fit.basis)
    rms = errors_of(solution.problem, others.corrections, others.fixture_values).rms["m"]
    return sigma * residual, T @ T.T + (_COMMON * rms) ** 2 * np.eye(len(numbers)), sigma


def _part(
    solution: Solution, numbers: Sequence[int], kept: bool
) -> tuple[Problem, tuple[Array, ...]]:
    """The problem with some measurements alone, or without them, and their noise."""
    problem = solution.problem
    chosen = [k for k in range(len(problem.measurements)) if (k in numbers) is kept]
    part = replace(problem, measurements=tuple(problem.measurements[k] for k in chosen))
    return part, tuple(solution.scales[k] for k in chosen)


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


def _named(m: Any) -> str:
    return f"{m.name} {m.point} to {m.other}"


# --- outliers -------------------------------------------------------------------------------------


def with_outliers(solution: Solution, contradicted: list[Contradiction]) -> Solution:
    """The fit with its outliers; a known distance is one only if it is contradicted."""
    fit, measurements = solution.fit, solution.problem.measurements
    if fit.loss is not Loss.SQUARES:
        return solution
    wrong = np.array([b for c in contradicted for b in c.blocks], dtype=np.int64)
    trusted = np.repeat([not m.views for m in measurements], [m.blocks for m in measurements])
    outliers = np.concatenate([wrong, fit.outliers[~trusted[fit.outliers]]])
    return replace(solution, fit=replace(fit, outliers=outliers))
