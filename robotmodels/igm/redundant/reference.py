"""Postures of a redundant arm whose free joints stand at their references, or near them."""

from __future__ import annotations

import numpy as np

from ..._arrays import Array
from ..lock import stacked
from ..solver import Found, Tolerances, nothing_found, postures
from .arm import Redundant
from .locked_arms import locked_postures
from .members import nearest_members

_CHUNK = 64  # poses that are searched at a time


@postures.register
def postures_at_reference(
    solver: Redundant, U: Array, references: Array, tolerances: Tolerances
) -> Found:
    """Postures with the free joints at their references, or as near as a pose has any."""
    N, k = U.shape[0], solver.chain.k
    found = nothing_found(N, 1, k)
    if solver.order == solver.sampled:
        values = references[:, list(solver.order)]
        found = locked_postures(solver.arms, solver.order, values, U, references, tolerances)
    elif len(solver.order) == 1:
        found = _from_other_joints(solver, U, references, tolerances)
    missing = np.flatnonzero(~found.valid.any(axis=1))
    parts, rows = [found], [np.arange(N)]
    for start in range(0, missing.size, _CHUNK):
        chosen = missing[start : start + _CHUNK]
        parts.append(nearest_members(solver, U[chosen], references[chosen], tolerances))
        rows.append(chosen)
    found = stacked(parts, rows, N)
    found.free[..., list(solver.order)] = found.valid[..., None]
    found.family[...] = found.valid
    return found


def _from_other_joints(
    solver: Redundant, U: Array, references: Array, tolerances: Tolerances
) -> Found:
    """Postures at the reference of the free joint where the arm without it has no family."""
    from ..crossings import Relations
    from ..relations import Related

    (joint,) = solver.order
    row = np.eye(solver.chain.k)[[joint]]
    period = np.where(solver.chain.sigma[[joint]] == 0, 2.0 * np.pi, 0.0)
    wanted = Relations(row, references[:, [joint]], period)
    related = Related(solver.chain, wanted, solver.sampled[0], solver.inner, solver.arms)
    found = postures(related, U, references, tolerances)
    found.q[..., joint] = np.where(found.valid, references[:, [joint]], np.nan)
    return found
