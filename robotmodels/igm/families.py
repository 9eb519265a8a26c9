"""Which family serves an arm: the order in which they are tried."""

from __future__ import annotations

import numpy as np

from ..errors import InvalidValueError
from .asked import WHOLE_POSE, Task
from .closed_form import prepare_closed_form
from .dependent import prepare_dependent
from .elimination import prepare_elimination
from .fewer import prepare_fewer
from .lock import locked_chain
from .loop import JointChain
from .many_starts import prepare_many_starts
from .mask import prepare_masked
from .neighbour import prepare_neighbour
from .prismatic import prepare_prismatic
from .redundant import prepare_redundant
from .relations import prepare_related
from .solver import Solver


def prepare_task(chain: JointChain, task: Task) -> Solver | None:
    """Choose and prepare the solver of a task: locked joints, then the mask, then the arm."""
    places = {int(column): place for place, column in enumerate(chain.columns)}
    locks = {places[column]: value for column, value in task.locks if column in places}
    if locks:
        chain = locked_chain(chain, locks)
    if task.relations:
        if chain.k <= 6:
            raise InvalidValueError(
                f"relations: the tool is moved by {chain.k} joints; only more than six leave "
                "something to relate."
            )
        A = np.array([row for row, _ in task.relations])
        still = np.setdiff1d(np.arange(A.shape[1]), chain.columns)
        if A[:, still].any():
            raise InvalidValueError(
                "relations: a joint that does not move the tool cannot be part of one."
            )
        return prepare_related(chain, A[:, chain.columns], [b for _, b in task.relations], prepare)
    if task.mask != WHOLE_POSE:
        return prepare_masked(chain, task.mask, task.in_tool_axes, prepare)
    return prepare(chain)


def prepare(chain: JointChain) -> Solver | None:
    """Choose and prepare the solver of a chain."""
    if chain.k < 6:
        return prepare_fewer(chain, prepare)
    if chain.k > 6:
        return prepare_redundant(chain, prepare)
    if chain.k == 6:
        # an arm in a plane, say, whose joints are more than its freedoms
        dependent = prepare_dependent(chain, prepare)
        if dependent is not None:
            return dependent
        closed = prepare_closed_form(chain)
        if closed is not None:
            return closed
        prismatic = prepare_prismatic(chain)
        if prismatic is not None:
            return prismatic
        neighbour = prepare_neighbour(chain)
        if neighbour is not None:
            return neighbour
        elimination = prepare_elimination(chain)
        # accepted also where most poses need further forms: it is slow but complete
        if elimination is not None and elimination.missed == 0:
            return elimination
        return prepare_many_starts(chain)
    return None
