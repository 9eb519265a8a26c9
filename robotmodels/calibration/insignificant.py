"""Parameters that noise hides."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from .._arrays import Array
from ..estimation.linearised import inverse_factor
from .identifiable import IdentifiableParameters, Reason
from .prior import largest_factors
from .problem import stacked
from .solve import Solution

LARGEST_LENGTH, LARGEST_ANGLE = 0.01, 0.02
"""Standard errors above which a parameter is not estimated: relative to the robot's size, and rad
(of the largest effect)."""
_TINY = 1e-300


def insignificant_parameters(solution: Solution, start: Array) -> list[str]:
    """Names of insignificant parameters, given noise and prior."""
    # The larger standard error of start and solution counts: a fit may have diverged along a
    # parameter, and constraints violated at the start seem to hold information. The worst is
    # removed first, as it may hide others.
    problem, prior = solution.problem, solution.fit.prior
    reach = problem.parameters.skeleton.size
    limit = np.full(problem.P + problem.F, np.inf)
    limit[: problem.P] = [
        LARGEST_LENGTH * reach if entry.element.is_length else LARGEST_ANGLE
        for entry in problem.parameters.entries
    ] / np.maximum(largest_factors(problem), _TINY)
    information = np.diag(np.sqrt(prior.strength) / prior.sigma)
    factors = [
        np.asarray(
            np.linalg.qr(np.vstack([stacked(problem, x, solution.scales)[1], information]))[1]
        )
        for x in (start, solution.fit.x)
    ]
    kept = list(range(len(limit)))
    left_out: list[str] = []
    while kept:
        ratios = [np.linalg.norm(inverse_factor(R[:, kept]), axis=1) / limit[kept] for R in factors]
        ratio = np.maximum(*ratios)
        worst = int(np.argmax(ratio))
        if ratio[worst] <= 1.0:
            break
        left_out.append(problem.parameters.names[kept.pop(worst)])
    return left_out


def without_insignificant(
    found: IdentifiableParameters, names: list[str]
) -> IdentifiableParameters:
    """Identifiable parameters without the insignificant ones."""
    return replace(
        found,
        kept=found.kept.without(name for name in names if name in found.names),
        reasons={**found.reasons, **dict.fromkeys(names, Reason.NOISE)},
        regrouping={k: v for k, v in found.regrouping.items() if k not in names},
    )


def with_gained(found: IdentifiableParameters, names: Collection[str]) -> IdentifiableParameters:
    """Identifiable parameters with others that only the solution makes identifiable."""
    kept = [n for n in found.candidates.names if n in found.names or n in names]
    return replace(
        found,
        kept=found.candidates.subset(kept),
        reasons={name: why for name, why in found.reasons.items() if name not in names},
        regrouping={**found.regrouping, **{name: {name: 1.0} for name in names}},
    )
