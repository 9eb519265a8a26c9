"""Check that there are more rows than unknowns."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from .._arrays import Array
from ..errors import InvalidValueError
from ..kinematics.lengths import spread_configurations
from .identifiable import DEPENDENT, IdentifiableParameters, identifiable_on
from .measurements import Measurement
from .problem import guessed_fixtures, problem_of

_SEED = 17
_ROWS = 4
"""Rows per unknown in the simulated larger data set."""
_STILL = 0.02
"""Range of readings below which a joint counts as fixed, rad or m."""


def check_enough(
    found: IdentifiableParameters,
    measured: Sequence[Measurement],
    known_lengths: Iterable[str] = (),
    known: Iterable[str] = (),
    dependent: float = DEPENDENT,
) -> None:
    """Refuse fewer rows than unknowns."""
    problem = problem_of(found.kept, measured)
    if problem.P and problem.rows > problem.P + problem.F:
        return
    P, F = _told_by_more(found, measured, known_lengths, known, dependent), problem.F
    if not P:
        raise InvalidValueError(
            "No parameter is identifiable from these measurements. See identifiable_parameters, "
            "and measure with all joints spread over their ranges."
        )
    rows = max(len(m.axes) for m in measured if m.views)
    missing = max(1, -(-(P + F + 1 - problem.rows) // rows))
    raise InvalidValueError(
        f"{problem.rows} rows cannot tell {P} parameters and {F} unknown coordinates of fixtures: "
        f"measure at least {missing} more configurations (better three times as many rows as "
        "unknowns), or name fewer parameters."
    )


def _told_by_more(
    found: IdentifiableParameters, measured: Sequence[Measurement], known_lengths: Iterable[str],
    known: Iterable[str], dependent: float,
) -> int:  # fmt: skip
    """Number of identifiable parameters with many random configurations."""
    candidates = found.candidates
    rng = np.random.default_rng(_SEED)
    seen = [view.q for m in measured for view in m.views]
    if not seen:
        return found.count
    readings = np.concatenate(seen)
    still = (np.ptp(readings, axis=0) < _STILL) & (len(np.unique(readings, axis=0)) > 1)
    whole = problem_of(candidates, measured)
    wanted = _ROWS * (whole.P + whole.F)
    more = []
    for m in measured:
        if not m.views:
            more.append(m)
            continue
        times = -(-wanted // (m.blocks * len(m.axes)))
        larger = m.subset(np.tile(np.arange(m.blocks), times))
        drawn: dict[int, Array] = {}
        for view in larger.views:
            q = spread_configurations(candidates.model, larger.blocks, rng)
            q[:, still] = readings[0, still]
            drawn.setdefault(id(view.q), q)
        more.append(larger.with_configurations([drawn[id(view.q)] for view in larger.views]))
    zero = np.zeros(whole.P)
    kept = identifiable_on(
        candidates, more, known_lengths, known, fixtures=guessed_fixtures(whole, zero),
        dependent=dependent,
    )  # fmt: skip
    return max(kept.count, found.count)
