"""Measurements that contradict the others: known distances, and outliers under squares.

The measurements without the known distances, and the prior, predict these and their covariance.

Source: R. D. Cook, S. Weisberg, "Residuals and Influence in Regression", 1982, section 2.2.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from .._arrays import Array
from ..estimation import Loss
from .identifiable import needs_a_length
from .measurements import KnownDistance, whitened
from .prior import ParameterPrior
from .problem import Problem, satisfying, stacked
from .solve import Solution, refitted
from .validation import errors_of

_CONTRADICTED = 3.0  # difference from which a distance is reported, standard errors
_COMMON = 0.5  # part of the residuals that is systematic: averaging postures does not reduce it


def with_contradictions(
    solution: Solution, given: ParameterPrior | None, size_is_known: bool
) -> tuple[Solution, tuple[str, ...]]:
    """The fit whose outliers are its contradicted known distances and others, and notes on them.

    ``given`` is the prior before it was widened, perhaps to suit a wrong distance.
    """
    measurements, fit = solution.problem.measurements, solution.fit
    numbers = [k for k, m in enumerate(measurements) if isinstance(m, KnownDistance)]
    rival, wrong, notes = "", [], []
    if numbers and not size_is_known and needs_a_length(_part(solution, numbers)[0]):
        # if they alone determine the scale, the first one is taken as correct
        first, *numbers = numbers
        rival = f" Either this distance or {_named(measurements[first])} is wrong."
    known: list[Any] = [measurements[k] for k in numbers]
    firsts = np.cumsum([0, *(m.blocks for m in measurements)])
    source = "the other measurements" + " and the prior" * bool(np.isfinite(fit.prior.sigma).any())
    for group, mean, deviation, size in _wrong_groups(solution, given, numbers, known):
        length = known[group[0]].length
        wrong += [int(firsts[numbers[k]]) for k in group]
        name = _named(known[group[0]]) if len(group) == 1 else f"{len(group)} known distances"
        error = math.sqrt(max(0.0, deviation**2 - size**2 / len(group)))
        digits = max(0, 1 - math.floor(math.log10(max(1e3 * error, 1e-6))))
        notes.append(
            f"{name}: stated {1e3 * length:.6g} mm, but {source} predict "
            f"{1e3 * (length + mean):.{digits}f} +- {1e3 * error:.{digits}f} mm (a difference of "
            f"{abs(mean) / deviation:.0f} standard errors). Check the length, its points, and its "
            f"standard deviation of {1e3 * size:.2g} mm.{rival}"
        )
    if fit.loss is not Loss.SQUARES:
        return solution, tuple(notes)
    trusted = np.repeat([not m.views for m in measurements], [m.blocks for m in measurements])
    outliers = np.array([*wrong, *fit.outliers[~trusted[fit.outliers]]], dtype=np.int64)
    return replace(solution, fit=replace(fit, outliers=outliers)), tuple(notes)


def _named(m: Any) -> str:
    """A known distance by its name and its two points."""
    return f"{m.name} {m.point} to {m.other}"


def _wrong_groups(
    solution: Solution, given: ParameterPrior | None, numbers: list[int], known: list[Any]
) -> list[tuple[list[int], float, float, float]]:
    """Wrong distances, or all those of equal length: mean shift, its deviation, rms of sigma, m.

    One after another, the most significant first.
    """
    if not numbers:
        return []
    problem, scales = _part(solution, numbers)
    others = refitted(solution, problem, solution.fit.x, scales, given)
    if len(others.fit.dropped) > len(solution.fit.dropped):
        return []
    distances, scales = _part(solution, numbers, kept=True)
    one = np.ones((1, 1))
    sigma = np.array([1.0 / whitened(m, one, s)[0, 0] for m, s in zip(known, scales, strict=True)])
    residual, jacobian = stacked(distances, _unbiased(others), scales)
    shift, T = sigma * residual, sigma[:, None] * (jacobian @ others.fit.basis)
    rms = errors_of(solution.problem, others.corrections, others.fixture_values).rms["m"]
    variance = T @ T.T + (_COMMON * rms) ** 2 * np.eye(len(known)) + np.diag(sigma**2)
    inverse, rest, groups = np.linalg.inv(variance), [*range(len(known))], []
    alike = [[j for j in rest if math.isclose(known[j].length, m.length, rel_tol=1e-9)]
             for m in known]  # fmt: skip
    means, deviations = np.zeros(0), np.zeros(0)
    while rest:
        tried = []
        for group in (*([k] for k in rest), *(g for g in alike if set(g) <= set(rest))):
            H = np.array([np.isin(np.arange(len(known)), g) for g in (*groups, group)], float).T
            covariance = np.linalg.inv(H.T @ inverse @ H)
            mean, deviation = covariance @ H.T @ inverse @ shift, np.sqrt(np.diag(covariance))
            tried.append((abs(mean[-1]) / deviation[-1], group, mean, deviation))
        ratio, group, mean, deviation = max(tried, key=lambda trial: trial[0])
        if ratio <= _CONTRADICTED:
            break
        groups, means, deviations = [*groups, group], mean, deviation
        rest = [k for k in rest if k not in group]
    sizes = [float(np.sqrt(np.mean(sigma[group] ** 2))) for group in groups]
    found = zip(groups, means.tolist(), deviations.tolist(), sizes, strict=True)
    return [each for each in found if abs(each[1]) > _CONTRADICTED * each[2]]


def _part(
    solution: Solution, numbers: Collection[int], kept: bool = False
) -> tuple[Problem, tuple[Array, ...]]:
    """The problem without some measurements, or with these alone, and their noise."""
    measurements: Sequence[Any] = solution.problem.measurements
    chosen = [k for k in range(len(measurements)) if (k in numbers) is kept]
    part = replace(solution.problem, measurements=tuple(measurements[k] for k in chosen))
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
