"""Which family serves an arm: the order in which they are tried."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from .arm_angle import prepare_arm_angle
from .by_plan import ByPlan, is_degenerate
from .chain import without_locked
from .closed_form import ClosedForm, prepare_closed_form
from .constraints import WHOLE, Components, Constraints, constraints
from .elimination import prepare_elimination
from .loop import JointChain
from .motion import lever
from .postures import Postures, difference
from .reduced import FewerJoints, Masked, OneAxis, is_aligned, prepare_reduced
from .redundant import Redundant, prepare_redundant, redundant_joint
from .request import Task
from .search import ManyStarts, prepare_many_starts
from .solver import Solver


def prepare_task(chain: JointChain, task: Task) -> Solver | None:
    """Choose and prepare the solver of a task: locked joints, then the mask, then the arm."""
    chain = without_locked(chain, task.locks)
    if task.relations:
        A = np.array([row for row, _ in task.relations])[:, chain.columns]
        b = np.array([right for _, right in task.relations])
        return prepare_many_starts(Constraints(chain, WHOLE, A, b, lever(chain)))
    return prepare(chain, Components(task.mask, task.in_tool_axes))


def prepare(chain: JointChain, components: Components = WHOLE) -> Solver | None:
    """Choose and prepare the solver of a chain for the requested components of a pose."""
    if chain.k == 0:
        return None
    whole = all(components.asked)
    components = WHOLE if whole else components
    if whole and chain.k == 7 and np.all(chain.columns >= 0):
        by_angle = prepare_arm_angle(chain)
        if by_angle is not None:
            return by_angle
    joint = redundant_joint(chain, components)
    if joint is not None:
        return prepare_redundant(chain, components, joint, partial(prepare, components=components))
    if whole and chain.k == 6:
        return _of_six_joints(chain)
    return prepare_reduced(chain, components, prepare, prepare_closed_form)


def _of_six_joints(chain: JointChain) -> Solver | None:
    """Closed forms first, then elimination and search."""
    solver = prepare_closed_form(chain)
    if solver is not None:
        return solver
    elimination = prepare_elimination(chain)
    # accepted also where most poses need further forms: it is slow but complete
    if elimination is not None and elimination.missed == 0:
        return elimination
    return prepare_many_starts(constraints(chain))


def may_miss_solutions(
    solver: Solver, U: Array, found: Postures, references: Array
) -> NDArray[np.bool_]:
    """Poses at which a method has no proof that its solutions are all, (N,)."""
    if isinstance(solver, OneAxis):
        return ~is_aligned(solver, U) | _searches(solver.inner)
    if not isinstance(solver, Redundant):
        return np.full(len(U), _searches(solver))
    joint, others = solver.joint, np.delete(np.arange(solver.chain.k), solver.joint)
    rest = Postures(
        found.q[..., others], found.valid, found.residual, found.double,
        found.free[..., others], found.family,
    )  # fmt: skip
    out = may_miss_solutions(solver.inner, U, rest, references[:, others])
    # a search found the nearest value of the joint
    d = difference(solver.chain.sigma, found.q, references[:, None])[..., joint]
    return out | np.any(found.free[..., joint] & (np.abs(d) > 1e-9), axis=1)


def may_be_reached(solver: Solver | None, U: Array, references: Array) -> NDArray[np.bool_]:
    """Poses without solution of which the method does not prove that they are out of reach, (N,).

    A joint that an equation leaves free takes its reference, at which another one may have no root.
    """
    if isinstance(solver, ByPlan):
        return is_degenerate(solver, U, references)
    return np.full(len(U), solver is None or isinstance(solver, (ClosedForm, FewerJoints)))


def _searches(solver: Solver) -> bool:
    """Whether solutions come from a search, in any of the chains that are solved on the way."""
    if isinstance(solver, Masked):
        return _searches(solver.inner)
    if isinstance(solver, FewerJoints):
        return any(_searches(way.solver) for way in solver.ways)
    return isinstance(solver, (ManyStarts, OneAxis, Redundant))
