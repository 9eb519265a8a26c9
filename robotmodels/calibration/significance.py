"""Parameters that measurements cannot determine: too few rows, or effects that noise hides."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from .._arrays import Array
from ..errors import InvalidValueError
from ..estimation.linearised import inverse_factor
from .identifiable import IdentifiableParameters, Reason
from .measurements import Measurement
from .prior import largest_factors
from .problem import problem_of, stacked
from .solve import Solution

_LARGEST_LENGTH, _LARGEST_ANGLE = 0.01, 0.02
"""Standard errors above which a parameter is not estimated: relative to the robot's size, and rad
(of the largest effect)."""


def check_enough(identifiable: IdentifiableParameters, measured: Sequence[Measurement]) -> None:
    """Refuse fewer rows than unknowns."""
    problem = problem_of(identifiable.kept, measured)
    P, F = problem.P, problem.F
    if P and problem.rows > P + F:
        return
    if not P:
        raise InvalidValueError(
            "No parameter is identifiable from these measurements. See identifiable_parameters, "
            "and measure with all joints spread over their ranges."
        )
    rows = max(len(m.axes) for m in measured if m.views)
    missing = -(-(P + F + 1 - problem.rows) // rows)
    raise InvalidValueError(
        f"{problem.rows} rows cannot determine {P} parameters and {F} unknown coordinates of "
        f"fixtures: measure at least {missing} more configurations (better three times as many "
        "rows as unknowns), or name fewer parameters."
    )


def insignificant_parameters(solution: Solution, start: Array) -> list[str]:
    """Names of insignificant parameters, given noise and prior."""
    # The larger standard error of start and solution counts: a fit may have diverged along a
    # parameter, and constraints violated at the start seem to hold information. The worst is
    # removed first, as it may hide others.
    problem, prior = solution.problem, solution.fit.prior
    length = _LARGEST_LENGTH * problem.parameters.table.size
    sizes = [length if e.element.is_length else _LARGEST_ANGLE for e in problem.parameters.entries]
    limit = np.full(problem.P + problem.F, np.inf)
    limit[: problem.P] = sizes / np.maximum(largest_factors(problem), 1e-300)
    information = np.diag(np.sqrt(prior.strength) / prior.sigma)
    factors = [
        np.asarray(
            np.linalg.qr(np.vstack([stacked(problem, x, solution.scales)[1], information]))[1]
        )
        for x in (start, solution.fit.x)
    ]
    kept = list(range(len(limit)))
    names: list[str] = []
    while kept:
        ratio = np.max(
            [np.linalg.norm(inverse_factor(R[:, kept]), axis=1) / limit[kept] for R in factors],
            axis=0,
        )
        worst = int(np.argmax(ratio))
        if ratio[worst] <= 1.0:
            break
        names.append(problem.parameters.names[kept.pop(worst)])
    return names


def adjusted(
    found: IdentifiableParameters, insignificant: Collection[str], gained: Collection[str]
) -> IdentifiableParameters:
    """Without insignificant parameters, and with those that the solution makes identifiable."""
    names = ({*found.names} - {*insignificant}) | {*gained}
    reasons = {**found.reasons, **dict.fromkeys(insignificant, Reason.NOISE)}
    regrouping = {name: found.regrouping.get(name, {name: 1.0}) for name in names}
    return replace(
        found,
        kept=found.candidates.subset(n for n in found.candidates.names if n in names),
        reasons={name: why for name, why in reasons.items() if name not in gained},
        regrouping={n: regrouping[n] for n in found.candidates.names if n in names},
    )
