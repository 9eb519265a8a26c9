"""Measurements that contradict the others: known distances, and outliers under squares.

The other measurements and the prior predict the distances: a wrong one is a shift of its row, and
a mistake common to several a scale of their rows (mean-shift outlier models, chosen forward).

Source: R. D. Cook, S. Weisberg, "Residuals and Influence in Regression", 1982, section 2.2.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from ..estimation import Loss
from ..estimation.outlying import outlying
from .identifiability.scale import needs_a_length
from .measurements import KnownDistance
from .prior import ParameterPrior
from .problem import Problem, problem_of, satisfying, stacked
from .solve import Solution, refitted
from .validation import errors_of

_CONTRADICTED = 3.0
"""Difference from which a distance is reported, standard errors."""
_AS_LIKELY = 6.0
"""Difference of squared errors below which two explanations are about equally likely (1 to 20)."""
_COMMON = 0.5
"""Part of the residuals assumed systematic, so that averaging over postures does not reduce it."""
_ALONE = 1e-8
"""1 - leverage of a row below which no other row predicts it."""
_REFITS = 2
"""Largest number of fits without the outliers."""


class Contradiction(NamedTuple):
    """Known distances, numbers of their blocks, and their prediction by all else.

    ``sigma``: standard deviation of their mean length; ``others`` and ``error``: prediction of it
    and standard error, m; ``rivals``: distances of which one may be wrong instead.
    """

    blocks: tuple[int, ...]
    measurements: tuple[KnownDistance, ...]
    sigma: float
    others: float
    error: float
    prior: bool
    rivals: tuple[str, ...]

    def sentence(self) -> str:
        """The note about it."""
        m, error, many = self.measurements[0], 1e3 * self.error, len(self.measurements)
        length = 1e3 * math.fsum(m.length for m in self.measurements) / many
        errors = abs(1e3 * self.others - length) / (1e3 * math.hypot(self.sigma, self.error))
        digits = max(0, 1 - math.floor(math.log10(max(error, 1e-6))))
        stated = f"{_named(m)}: stated {length:.6g} mm, but"
        its = "Check the length, its two points, and its"
        if many > 1:
            equal = len({m.length for m in self.measurements}) == 1
            stated = f"{many} known distances of {length:.6g} mm{'' if equal else ' in the mean'}:"
            its = "Check the lengths, their points, and their"
        either = f" It or {' or '.join(self.rivals)}: one of these." if self.rivals else ""
        return (
            f"{stated} the other measurements{' and the prior' if self.prior else ''} predict "
            f"{1e3 * self.others:.{digits}f} +- {error:.{digits}f} mm (a difference of "
            f"{errors:.0f} standard errors). {its} standard deviation of "
            f"{1e3 * self.sigma * math.sqrt(many):.2g} mm.{either}"
        )


def contradictions(
    solution: Solution, given: ParameterPrior | None, size_is_known: bool
) -> list[Contradiction]:
    """Known distances that differ from the prediction by all else, the first found first.

    ``given`` is the prior before it was widened, perhaps to suit a wrong distance.
    """
    measurements = solution.problem.measurements
    numbers = [k for k, m in enumerate(measurements) if isinstance(m, KnownDistance)]
    known = [m for m in measurements if isinstance(m, KnownDistance)]
    if not known:
        return []
    sigma = np.array([_sigma(m, solution.scales[k]) for k, m in zip(numbers, known, strict=True)])
    length = np.array([m.length for m in known])
    is_open = not size_is_known and needs_a_length(_without(solution, numbers)[0], ())
    # where they alone give the scale, one of them does, and then the scale is left open
    M, v = _evidence(solution, numbers[1:] if is_open else numbers, numbers, sigma, given)
    if is_open:
        M, v = _explained(M, v, length / sigma)
    groups = [(k,) for k in range(len(known))]
    if size_is_known:
        alike = [tuple(np.flatnonzero(length == value).tolist()) for value in np.unique(length)]
        groups += [g for g in dict.fromkeys([*alike, tuple(range(len(known)))]) if len(g) > 1]
    columns = np.zeros((len(known), len(groups)))
    for j, group in enumerate(groups):
        columns[list(group), j] = (length / sigma)[list(group)]
    chosen, rivals, rank = _chosen(M, v, columns, groups)
    total = float(v @ np.linalg.pinv(M, rcond=_ALONE, hermitian=True) @ v)
    while True:
        G = columns[:, chosen]
        spread = np.linalg.inv(G.T @ M @ G)
        shift = spread @ (G.T @ v)
        left = max(total - float(shift @ (G.T @ v)), 0.0) / max(rank - len(chosen), 1)
        # differences among distances beyond their noise make what they have in common uncertain
        many = np.array([len(groups[j]) > 1 for j in chosen], dtype=bool)
        variance = np.diagonal(spread) * np.where(many, max(1.0, left), 1.0)
        errors = shift**2 / variance
        if not chosen or errors.min() > _CONTRADICTED**2:
            break
        worst = int(errors.argmin())
        del chosen[worst], rivals[worst]
    firsts = np.cumsum([0, *(m.blocks for m in measurements)])
    has_prior = bool(np.isfinite(solution.fit.prior.sigma).any())
    found = []
    for j, s, square, others in zip(chosen, shift, variance, rivals, strict=True):
        group = list(groups[j])
        mean = float(length[group].mean())
        of_mean = float(np.linalg.norm(sigma[group])) / len(group)
        found.append(
            Contradiction(
                tuple(int(firsts[numbers[k]]) for k in group),
                tuple(known[k] for k in group),
                of_mean,
                mean * (1.0 - s),
                math.sqrt(max(square * mean**2 - of_mean**2, 0.0)),
                has_prior,
                tuple(_named(known[groups[k][0]]) for k in others),
            )
        )
    return found


def _chosen(
    M: Array, v: Array, columns: Array, groups: list[tuple[int, ...]]
) -> tuple[list[int], list[list[int]], int]:
    """Columns that explain v, one after the other, single columns that do so as well; rank of M."""
    rank = int((np.linalg.eigvalsh(M) > _ALONE).sum())
    chosen: list[int] = []
    rivals: list[list[int]] = []
    while len(chosen) < rank:
        seen = np.einsum("kj,kl,lj->j", columns, M, columns)
        has_effect = seen > _ALONE * (columns**2).sum(axis=0)
        gain = np.where(has_effect, (columns.T @ v) ** 2 / np.where(has_effect, seen, 1.0), 0.0)
        for j, group in enumerate(groups):
            if len(group) > 1:  # a common mistake leaves no differences among its distances
                at = list(group)
                part = np.linalg.pinv(M[np.ix_(at, at)], rcond=_ALONE, hermitian=True)
                gain[j] /= max(1.0, (v[at] @ part @ v[at] - gain[j]) / (len(at) - 1))
        if gain.max() <= _CONTRADICTED**2:
            break
        # of explanations that are about equally likely, the one by the fewest mistakes
        likely = np.flatnonzero(gain > gain.max() - _AS_LIKELY).tolist()
        best = min(likely, key=lambda j: (len(groups[j]), -gain[j]))
        chosen.append(best)
        rivals.append([j for j in likely if j != best and len(groups[j] + groups[best]) == 2])
        M, v = _explained(M, v, columns[:, best])
    return chosen, rivals, rank


def _explained(M: Array, v: Array, column: Array) -> tuple[Array, Array]:
    """Evidence M, v that is left where the factor of a column is free."""
    side = M @ column
    size = float(column @ side)
    if size <= _ALONE * float(column @ column):
        return M, v
    return M - np.outer(side, side) / size, v - side * float(column @ v) / size


def _evidence(
    solution: Solution,
    left_out: list[int],
    numbers: list[int],
    sigma: Array,
    given: ParameterPrior | None,
) -> tuple[Array, Array]:
    """Inverse covariance M (K, K) of (stated - predicted lengths) / sigma, and M times them (K,).

    By the fit without distances; by that with them where the other determines less.
    """
    problem, scales = _without(solution, left_out)
    without = refitted(solution, problem, solution.fit.x, scales, given)
    is_less = len(without.fit.dropped) > len(solution.fit.dropped)
    fit, x = (solution.fit, solution.fit.x) if is_less else (without.fit, _unbiased(without))
    others = [k for k in range(len(solution.scales)) if k not in numbers]
    distances, scales = _without(solution, others)
    residual, jacobian = stacked(distances, x, scales)
    T, unit = jacobian @ fit.basis, np.eye(len(numbers))
    if is_less:  # the whitened residuals are M times the differences, and I - T T' is M
        M, v = unit - T @ T.T, -residual
    else:
        M = np.linalg.inv(unit + T @ T.T)
        v = -M @ residual
    rms = errors_of(solution.problem, x[: distances.P], x[distances.P :]).rms["m"]
    damped = np.linalg.inv(unit + M @ np.diag((_COMMON * rms / sigma) ** 2))
    return damped @ M, damped @ v


def _without(solution: Solution, left_out: list[int]) -> tuple[Problem, tuple[Array, ...]]:
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
    """The fit with its outliers; known distances are none unless they are contradicted."""
    # Contacts leave the scale open, so that they shrink to nothing in a fit without the distance
    # that alone gives it. An outlier bends the noise, the widths of the prior and the weights of a
    # fit, so that all are judged again by a fit without those listed.
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
    """Orthonormal rows and residuals of all blocks by a fit without some, and its freedom.

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
