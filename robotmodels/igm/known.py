"""What the inverse model keeps of a robot between calls: its joints, and prepared families."""

from __future__ import annotations

import weakref
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from .. import se3
from .._arrays import Array, read_only
from ..geometry import REVOLUTE
from ..model import RobotModel
from .by_plan import ByPlan, prepare_by_plan
from .families import prepare_task
from .loop import joint_chain
from .request import Task
from .solver import Solver

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


# by identity: a model's hash reads all of its numbers
_ARMS: dict[tuple[int, bool], tuple[weakref.ref[RobotModel], KnownArm]] = {}


def known_arm(model: RobotModel, whole: bool = True) -> KnownArm:
    """Cached solvers of a model, created on first use; for whole poses with the plan."""
    key = id(model), whole
    entry = _ARMS.get(key)
    if entry is None or entry[0]() is not model:
        entry = (weakref.ref(model, lambda _: _ARMS.pop(key, None)), _prepared(model, whole))
        _ARMS[key] = entry
    return entry[1]


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
