"""Choice of the solver of an arm: the order of trial, and the cache of prepared solvers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import NDArray

from .. import se3
from .._arrays import Array, read_only
from ..geometry import REVOLUTE
from ..kinematics.lengths import ModelCache
from ..model import RobotModel
from .arm_angle import prepare_arm_angle
from .by_plan import ByPlan, is_degenerate, prepare_by_plan
from .chain import without_locked
from .closed_form import ClosedForm, prepare_closed_form
from .constraints import WHOLE, Components, Constraints, constraints
from .elimination import prepare_elimination
from .loop import JointChain, joint_chain
from .motion import lever
from .postures import Postures, difference
from .reduced import FewerJoints, Masked, OneAxis, is_aligned, prepare_reduced
from .redundant import Redundant, free_joints, prepare_redundant, redundant_joint
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
    whole = all(components.requested)
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
    out = np.zeros(len(U), np.bool_)
    if isinstance(solver, Redundant):
        # a search found the nearest value of a joint
        d = difference(solver.chain.sigma, found.q, references[:, None])
        away = found.free & (np.abs(d) > 1e-9)
        out = np.any(away[..., free_joints(solver)], axis=(1, 2))
        while isinstance(solver, Redundant):
            solver = solver.inner
    if isinstance(solver, OneAxis):
        return out | ~is_aligned(solver, U) | _searches(solver.inner)
    return out | _searches(solver)


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


# --- cache ---

KEPT_TASKS = 32
"""Tasks (masks, locked values) prepared for one model that are remembered."""


@dataclass(frozen=True, slots=True, eq=False)
class KnownArm:
    """Cache of the solvers prepared for a robot.

    Shapes: columns (k,); to_base (4, 4); turns, never (n,); joints (3, n); zero (1, n).
    """

    columns: NDArray[np.int64]
    to_base: Array
    turns: NDArray[np.bool_]
    never: NDArray[np.bool_]
    joints: Array
    plan: ByPlan | None
    numbers: Array | None
    kernel: Callable[..., int] | None
    instructions: NDArray[np.uint32] | None
    most: int
    zero: Array
    solvers: dict[Task, Solver | None] = field(default_factory=dict)


_ARMS = ModelCache()


def known_arm(model: RobotModel, whole: bool = True) -> KnownArm:
    """Cached solvers of a model, created on first use; for whole poses with the plan."""
    return _ARMS(model, whole, lambda: _prepared(model, whole))


def solver_for(model: RobotModel, arm: KnownArm, task: Task) -> Solver | None:
    """Solver of a task, from the cache if possible."""
    if task not in arm.solvers:
        if len(arm.solvers) >= KEPT_TASKS:
            arm.solvers.pop(next(iter(arm.solvers)))
        arm.solvers[task] = prepare_task(joint_chain(model), task)
    return arm.solvers[task]


def _prepared(model: RobotModel, for_whole_poses: bool) -> KnownArm:
    chain = joint_chain(model)
    turns = model.table.sigma[model.table.joint_rows] == REVOLUTE
    to_base = read_only(se3.inverse(model.base))
    whole = Task()
    family = prepare_task(chain, whole) if for_whole_poses else None
    plan = None
    if family is not None and np.array_equal(chain.columns, np.arange(model.n)):
        plan = prepare_by_plan(chain, family)
    joints = read_only(np.array([model.lower, model.upper, turns]))
    numbers = None
    if plan is not None:
        numbers = plan.program.adapted(to_base, joints, plan.branch_of_way)
    return KnownArm(
        columns=chain.columns,
        to_base=to_base,
        turns=read_only(turns, np.bool_),
        never=read_only(np.zeros(model.n), np.bool_),
        joints=joints,
        plan=plan,
        numbers=numbers,
        kernel=None if plan is None else plan.program.kernel,
        instructions=None if plan is None else plan.program.plan,
        most=0 if plan is None else plan.most,
        zero=read_only(np.zeros((1, model.n))),
        solvers={whole: family if plan is None else plan} if for_whole_poses else {},
    )
