"""Parameters whose effect is smaller than the noise, although it is there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .._arrays import Array
from .extended_table.elements import ErrorLaw
from .extended_table.parameters import GeometricParameter
from .identifiability.identifiable import IdentifiableParameters, Reason
from .problem import stacked
from .solve import Solution

LARGEST_LENGTH, LARGEST_ANGLE = 0.02, 0.05
"""Standard deviations that say nothing of a parameter: in sizes of the robot, and rad."""


def untold_by(solution: Solution, start: Array) -> list[str]:
    """Parameters of the table that the measurements do not tell from nothing, at their noise.

    The standard deviations are those of the linear model where the fit started: a fit that ran
    away along such a parameter would find it well told there. The least told is left out first,
    as it may hide others.

    Parameters
    ----------
    solution : Solution
        A fit, for its noise.
    start : ndarray, shape (P + F,)
        Where it started.

    Returns
    -------
    list of str
        Names.

    References
    ----------
    Seed book section 1.4.4.2.
    """
    problem = solution.problem
    model = problem.parameters.model
    reach = problem.parameters.skeleton.size
    limit = np.full(problem.P + problem.F, np.inf)
    limit[: problem.P] = [_limit(e, model.f, reach) for e in problem.parameters.entries]
    _, J = stacked(problem, start, solution.scales)
    length = np.linalg.norm(J, axis=0)
    length[length == 0.0] = 1.0
    J = J / length
    kept = list(range(J.shape[1]))
    left_out: list[str] = []
    while kept:
        inverse = np.linalg.pinv(J[:, kept].T @ J[:, kept], rcond=1e-15, hermitian=True)
        deviation = np.sqrt(np.maximum(np.diagonal(inverse), 0.0)) / length[kept]
        ratio = deviation / limit[kept]
        worst = int(np.argmax(ratio))
        if ratio[worst] <= 1.0:
            break
        left_out.append(problem.parameters.names[kept.pop(worst)])
    return left_out


def without_untold(found: IdentifiableParameters, names: list[str]) -> IdentifiableParameters:
    """Identifiable parameters less those that noise hides.

    Parameters
    ----------
    found : IdentifiableParameters
        As judged without noise.
    names : list of str
        Which are left out.

    Returns
    -------
    IdentifiableParameters
        With `Reason.NOISE` for them.
    """
    return replace(
        found,
        kept=found.kept.without(names),
        reasons={**found.reasons, **dict.fromkeys(names, Reason.NOISE)},
        regrouping={k: v for k, v in found.regrouping.items() if k not in names},
    )


def _limit(entry: GeometricParameter, f: int, reach: float) -> float:
    if entry.law is not ErrorLaw.CONSTANT or not 0 < entry.row <= f:
        return np.inf
    return LARGEST_LENGTH * reach if entry.element.is_length else LARGEST_ANGLE
