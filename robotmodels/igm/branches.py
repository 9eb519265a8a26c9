"""Labels of postures: on which side of its shoulder, elbow and wrist singularity an arm stands."""

from __future__ import annotations

from dataclasses import replace
from functools import singledispatch

import numpy as np
from numpy.typing import NDArray

from .arm_angle import ArmAngle
from .closed_form import ClosedForm
from .reduced import FewerJoints
from .solver import Found, Solver
from .structure import Family

SIDES = tuple(
    f"shoulder{shoulder} elbow{elbow} wrist{wrist}"
    for shoulder in "+-"
    for elbow in "+-"
    for wrist in "+-"
)
"""Labels of six-joint arms with a closed form; the signs are those of three geometric products."""


@singledispatch
def branches(solver: Solver, found: Found) -> tuple[NDArray[np.int16], tuple[str, ...]]:
    """Number the postures of each pose and name the numbers. Shapes: -> code (N, S)."""
    return ranked(np.zeros(found.valid.shape, np.int16), ("",), found)


@branches.register
def _(solver: ClosedForm, found: Found) -> tuple[NDArray[np.int16], tuple[str, ...]]:
    from ._sides import sides

    plan = solver.plan
    code = np.empty(found.valid.shape, np.int16)
    sides(
        solver.chain.sigma, solver.chain.D, plan.order, int(plan.family is Family.PARALLEL),
        found.q, found.valid, code,
    )  # fmt: skip
    return ranked(code, SIDES, found)


@branches.register
def _(solver: FewerJoints, found: Found) -> tuple[NDArray[np.int16], tuple[str, ...]]:
    way = solver.ways[0]
    if not isinstance(way.solver, ClosedForm):
        return ranked(np.zeros(found.valid.shape, np.int16), ("",), found)
    # the virtual joints are at zero
    longer = np.zeros((*found.q.shape[:2], way.solver.chain.k))
    longer[..., way.places] = found.q
    return branches(way.solver, replace(found, q=longer))


@branches.register
def _(solver: ArmAngle, found: Found) -> tuple[NDArray[np.int16], tuple[str, ...]]:
    from ._sides import arm_sides

    code = np.empty(found.valid.shape, np.int16)
    arm_sides(solver.chain.D, found.q, found.valid, code)
    return ranked(code, SIDES, found)


def ranked(
    code: NDArray[np.int16], labels: tuple[str, ...], found: Found
) -> tuple[NDArray[np.int16], tuple[str, ...]]:
    """Unique branch codes: postures of one code are ranked within each pose.

    Shapes: code (N, S).
    """
    from ._sides import ranks

    if found.valid.shape[1] == 0:
        return code, labels
    rank = np.zeros(code.shape, np.int16)
    ranks(found.q, found.valid, code, rank)
    most = int(rank.max(initial=0))
    bare = labels == ("",)
    if bare:
        named = tuple(str(r + 1) for r in range(most + 1))
    else:
        named = (*labels, *(f"{s} ({r + 1})" for r in range(1, most + 1) for s in labels))
    unique = (code + len(labels) * rank).astype(np.int16)
    unique[~found.valid] = -1
    return unique, named
