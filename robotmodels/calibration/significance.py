"""Parameters that measurements cannot determine: too few rows, or effects that noise hides."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace

import numpy as np

from .._arrays import Array
from ..errors import InvalidValueError
from ..estimation.linearised import inverse_factor
from ..kinematics.lengths import spread_configurations
from ..model import RobotModel
from .identifiable import IdentifiableParameters, Reason, identifiable_on
from .measurements import Measurement
from .prior import largest_factors
from .problem import guessed_fixtures, problem_of, stacked
from .solve import Solution

_LARGEST_LENGTH, _LARGEST_ANGLE = 0.01, 0.02
"""Standard errors above which a parameter is not estimated: relative to the robot's size, and rad
(of the largest effect)."""
_TINY = 1e-300
_SEED = 17
_ROWS = 4
"""Rows per unknown in the simulated larger data set."""
_STILL = 0.02
"""Range of readings below which a joint counts as fixed, rad or m."""


def check_enough(
    identifiable: IdentifiableParameters,
    measured: Sequence[Measurement],
    known_lengths: Iterable[str],
    known: Iterable[str],
    dependent: float,
) -> None:
    """Refuse fewer rows than unknowns."""
    problem = problem_of(identifiable.kept, measured)
    if problem.P and problem.rows > problem.P + problem.F:
        return
    candidates, zero = identifiable.candidates, np.zeros(len(identifiable.candidates))
    P, F = identifiable.count, problem.F
    if any(m.views for m in measured):
        whole = problem_of(candidates, measured)
        more = identifiable_on(
            candidates,
            _more(whole.parameters.model, measured, _ROWS * (whole.P + F)),
            known_lengths,
            known,
            fixtures=guessed_fixtures(whole, zero),
            dependent=dependent,
        )
        P = max(P, more.count)
    if not P:
        raise InvalidValueError(
            "No parameter is identifiable from these measurements. See identifiable_parameters, "
            "and measure with all joints spread over their ranges."
        )
    rows = max(len(m.axes) for m in measured if m.views)
    missing = max(1, -(-(P + F + 1 - problem.rows) // rows))
    raise InvalidValueError(
        f"{problem.rows} rows cannot determine {P} parameters and {F} unknown coordinates of "
        f"fixtures: measure at least {missing} more configurations (better three times as many "
        "rows as unknowns), or name fewer parameters."
    )


def _more(model: RobotModel, measured: Sequence[Measurement], rows: int) -> list[Measurement]:
    """The measurements at many random configurations; joints that are still stay so."""
    readings = np.concatenate([view.q for m in measured for view in m.views])
    still = (np.ptp(readings, axis=0) < _STILL) & (len(np.unique(readings, axis=0)) > 1)
    rng = np.random.default_rng(_SEED)
    more: list[Measurement] = []
    for m in measured:
        if m.views:
            times = -(-rows // (m.blocks * len(m.axes)))
            m = m.subset(np.tile(np.arange(m.blocks), times))
            drawn: dict[int, Array] = {}
            for view in m.views:
                q = spread_configurations(model, m.blocks, rng)
                q[:, still] = readings[0, still]
                drawn.setdefault(id(view.q), q)
            m = m.with_configurations([drawn[id(view.q)] for view in m.views])
        more.append(m)
    return more


def insignificant_parameters(solution: Solution, start: Array) -> list[str]:
    """Names of insignificant parameters, given noise and prior."""
    # The larger standard error of start and solution counts: a fit may have diverged along a
    # parameter, and constraints violated at the start seem to hold information. The worst is
    # removed first, as it may hide others.
    problem, prior = solution.problem, solution.fit.prior
    limit = np.full(problem.P + problem.F, np.inf)
    limit[: problem.P] = [
        _LARGEST_LENGTH * problem.parameters.table.size if e.element.is_length
        else _LARGEST_ANGLE
        for e in problem.parameters.entries
    ] / np.maximum(largest_factors(problem), _TINY)  # fmt: skip
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
