"""Consistency of known distances with the other measurements.

The other measurements and the prior predict the distances: a wrong one is a shift of its row, and
a mistake common to several a scale of their rows (mean-shift outlier models, chosen forward).

Source: R. D. Cook, S. Weisberg, "Residuals and Influence in Regression", 1982, section 2.2.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from .._arrays import Array
from .errors_seen import block_errors
from .identifiable import needs_a_length
from .measurements import KnownDistance
from .prior import ParameterPrior, refitted
from .problem import Problem, satisfying, stacked
from .solve import Solution

_CONTRADICTED = 3.0
"""Difference from which a distance is reported, standard errors."""
_AS_LIKELY = 6.0
"""Difference of squared errors below which two explanations are about equally likely (1 to 20)."""
_COMMON = 0.5
"""Part of the residuals assumed systematic, so that averaging over postures does not reduce it."""
_ALONE = 1e-8
"""1 - leverage of a row below which no other row predicts it."""


class Contradiction(NamedTuple):
    """Known distances and their prediction without them."""

    blocks: tuple[int, ...]
    """Their numbers among all blocks."""
    measurements: tuple[KnownDistance, ...]
    sigma: float
    """Standard deviation of their mean length, m."""
    others: float
    """Prediction of their mean length, m."""
    doubt: float
    """Standard error of the prediction, m."""
    prior: bool
    """Whether a prior takes part in the prediction."""
    rivals: tuple[str, ...]
    """Other known distances of which one may be wrong instead."""

    def sentence(self) -> str:
        """The note about it."""
        m, doubt, many = self.measurements[0], 1e3 * self.doubt, len(self.measurements)
        length = 1e3 * math.fsum(m.length for m in self.measurements) / many
        errors = abs(1e3 * self.others - length) / (1e3 * math.hypot(self.sigma, self.doubt))
        digits = max(0, 1 - math.floor(math.log10(max(doubt, 1e-6))))
        stated = f"{_named(m)}: stated {length:.6g} mm, but"
        its = "Check the length, its two points, and its"
        if many > 1:
            equal = len({m.length for m in self.measurements}) == 1
            stated = f"{many} known distances of {length:.6g} mm{'' if equal else ' in the mean'}:"
            its = "Check the lengths, their points, and their"
        either = f" It or {' or '.join(self.rivals)}: one of these." if self.rivals else ""
        return (
            f"{stated} the other measurements{' and the prior' if self.prior else ''} predict "
            f"{1e3 * self.others:.{digits}f} +- {doubt:.{digits}f} mm (a difference of "
            f"{errors:.0f} standard errors). {its} standard deviation of "
            f"{1e3 * self.sigma * math.sqrt(many):.2g} mm.{either}"
        )


def contradictions(
    solution: Solution,
    given: ParameterPrior | None,
    size_is_known: bool,
    truncation: float | None = None,
) -> list[Contradiction]:
    """Known distances that differ from what all else predicts, the first found first.

    ``given`` is the prior before it was widened, perhaps to suit a wrong distance.
    """
    measurements = solution.problem.measurements
    numbers = [k for k, m in enumerate(measurements) if isinstance(m, KnownDistance)]
    known = [m for m in measurements if isinstance(m, KnownDistance)]
    if not known:
        return []
    scales = [solution.scales[k] for k in numbers]
    is_open = not size_is_known and needs_a_length(_kept(solution, numbers)[0], ())
    # where they alone give the scale, one of them does, and then the scale is left open
    without = _refitted(solution, numbers[1:] if is_open else numbers, given, truncation)
    M, v = _evidence(solution, without, numbers, known, scales)
    sigma = np.array([_sigma(m, scale) for m, scale in zip(known, scales, strict=True)])
    length = np.array([m.length for m in known])
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
    many = np.array([len(groups[j]) > 1 for j in chosen], dtype=bool)
    while True:
        G = columns[:, chosen]
        spread = np.linalg.inv(G.T @ M @ G)
        shift = spread @ (G.T @ v)
        left = max(total - float(shift @ (G.T @ v)), 0.0) / max(rank - len(chosen), 1)
        # differences among distances beyond their noise make what they have in common uncertain
        variance = np.diagonal(spread) * np.where(many, max(1.0, left), 1.0)
        errors = shift**2 / variance
        if not len(chosen) or errors.min() > _CONTRADICTED**2:
            break
        out = int(errors.argmin())
        del chosen[out], rivals[out]
        many = np.delete(many, out)
    firsts = np.cumsum([0, *(m.blocks for m in measurements)])
    found = []
    for j, s, square, others in zip(chosen, shift, variance, rivals, strict=True):
        group = list(groups[j])
        mean = float(length[group].mean())
        own = float(np.linalg.norm(sigma[group])) / len(group)
        doubt = math.sqrt(max(square * mean**2 - own**2, 0.0))
        found.append(
            Contradiction(
                tuple(int(firsts[numbers[k]]) for k in group), tuple(known[k] for k in group), own,
                mean * (1.0 - s), doubt, bool(np.isfinite(solution.fit.prior.sigma).any()),
                tuple(_named(known[groups[k][0]]) for k in others),
            )
        )  # fmt: skip
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
        told = seen > _ALONE * (columns**2).sum(axis=0)
        gain = np.where(told, (columns.T @ v) ** 2 / np.where(told, seen, 1.0), 0.0)
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
    without: Solution | None,
    numbers: list[int],
    known: list[KnownDistance],
    scales: list[Array],
) -> tuple[Array, Array]:
    """Inverse covariance M of (stated - predicted lengths) / sigma, and its product with them.

    It comes from the fit without distances, or, where there is none, from that with them, in which
    the whitened residuals are the product and I - T T' is M. Shapes: -> (K, K), (K,).
    """
    fit = solution.fit if without is None else without.fit
    x = fit.x if without is None else _of_satisfied(without)
    distances = replace(solution.problem, measurements=tuple(known), factors=((),) * len(known))
    residual, jacobian = stacked(distances, x, tuple(scales))
    T = jacobian @ fit.basis
    if without is None:
        M, v = np.eye(len(known)) - T @ T.T, -residual
    else:
        M = np.linalg.inv(np.eye(len(known)) + T @ T.T)
        v = -M @ residual
    errors = block_errors(solution.problem, x[: distances.P], x[distances.P :])
    sigma = np.array([_sigma(m, scale) for m, scale in zip(known, scales, strict=True)])
    common = np.diag((_COMMON * errors.summary("m").rms / sigma) ** 2)
    damped = np.linalg.inv(np.eye(len(known)) + M @ common)
    return damped @ M, damped @ v


def _refitted(
    solution: Solution, out: list[int], given: ParameterPrior | None, truncation: float | None
) -> Solution | None:
    """The fit without some measurements; None where it determines less than the fit with them."""
    others, scales = _kept(solution, out)
    found = refitted(given, others, solution, solution.fit.x, scales, truncation)
    return None if len(found.fit.dropped) > len(solution.fit.dropped) else found


def _kept(solution: Solution, out: list[int]) -> tuple[Problem, tuple[Array, ...]]:
    """The problem without some measurements, and the noise of the others."""
    problem = solution.problem
    kept = [k for k in range(len(problem.measurements)) if k not in out]
    part = replace(
        problem,
        measurements=tuple(problem.measurements[k] for k in kept),
        factors=tuple(problem.factors[k] for k in kept),
    )
    return part, tuple(solution.scales[k] for k in kept)


def _of_satisfied(solution: Solution) -> Array:
    """The unknowns without the bias of contacts whose noise makes a smaller robot fit better.

    The Jacobian at readings that satisfy the constraints is independent of the noise, so that it
    is the instrument of a step. Shapes: -> (P + F,).
    """
    fit = solution.fit
    exact = satisfying(solution.problem, solution.deviation, solution.fixtures)
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
