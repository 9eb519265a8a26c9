"""Arms that Paul's method solves: its plan gives all candidates, at singular poses too."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array, read_only
from .branches import SIDES, branches, ranked
from .closed_form import ClosedForm
from .loop import JointChain
from .motion import lever, random_postures, tool_poses
from .paul.plan import PaulPlan, derive_plan
from .paul.postures import SLACK, SMALL, ZERO
from .postures import Postures, difference
from .singular import solve_singular
from .solver import Solver, Tolerances, postures

TESTS = 128
"""Random postures that a plan has to give back before it is used."""
ACCEPTED = 1e-9
"""Largest error of a posture of the plan [m, rad]."""
OVERSHOOT = 1e-5
"""Overshoot tried as a double root at singular poses, beside the length of the arm."""
ROUGH = 1e-2
"""Errors up to which candidates at singular poses are refined [m, rad]."""
TOLERANCES = read_only([SLACK, ZERO, 1e-4, ACCEPTED])


@dataclass(frozen=True, slots=True, eq=False)
class ByPlan:
    """Arm whose regular poses are solved by Paul's plan."""

    plan: PaulPlan
    family: Solver
    labels: tuple[str, ...]
    branch_of_way: NDArray[np.int16]

    @property
    def instructions(self) -> NDArray[np.uint32]:
        """The plan as the kernel reads it."""
        assert self.plan.program is not None
        return self.plan.program.plan

    @property
    def most(self) -> int:
        """Most postures of a pose."""
        assert self.plan.program is not None
        return self.plan.program.branches

    @property
    def chain(self) -> JointChain:
        """The arm that is solved."""
        return self.family.chain

    @property
    def method(self) -> str:
        """The family, in words."""
        if isinstance(self.family, ClosedForm):
            return f"Paul's equations; {self.family.method}"
        return "Paul's equations"


def prepare_by_plan(chain: JointChain, family: Solver) -> ByPlan | None:
    """Derive the plan of an arm and test it."""
    plan = derive_plan(chain)
    if plan.program is None or plan.program.branches > 16:
        return None
    q = random_postures(chain, TESTS, np.random.default_rng(0))
    rows, residual, marks = run(plan, plan.program.numbers, tool_poses(chain, q), q)
    S = rows.shape[1]
    sure = marks[:, 1] == 0
    there = (np.arange(S) < marks[:, :1]) & sure[:, None]
    rows[~there] = np.nan
    away = np.abs(difference(chain.sigma, rows, q[:, None])).max(axis=-1)
    given_back = np.any(away < 1e-6, axis=1)
    if np.sum(sure) < TESTS // 2 or not np.array_equal(given_back, sure):
        return None
    none = np.zeros((TESTS, S), np.bool_)
    found = Postures(rows, there, residual, none, np.zeros(rows.shape, np.bool_), none)
    code, labels = branches(family, found)
    ways, codes = marks[:, 2 + S :][there], code[there]
    table = np.full(int(ways.max(initial=0)) + 1, -1, np.int16)
    table[ways] = codes
    if not np.array_equal(table[ways], codes) or len(labels) > len(SIDES):
        table, labels = np.empty(0, np.int16), tuple(str(i + 1) for i in range(S))
    return ByPlan(plan, family, labels, read_only(table, np.int16))


def run(
    plan: PaulPlan,
    numbers: Array,
    poses: Array,
    references: Array,
    tolerances: Array = TOLERANCES,
) -> tuple[Array, Array, NDArray[np.int64]]:
    """Run a plan by its kernel.

    Shapes: poses (N, 4, 4), references (N, k), tolerances (4,) -> q (N, S, k), residual (N, S),
    marks (N, 2 + 2 S).
    """
    from .paul._run import run_plan

    assert plan.program is not None
    N, k, S = poses.shape[0], references.shape[1], plan.program.branches
    q, residual = np.empty((N, S, k)), np.empty((N, S))
    marks = np.empty((N, 2 + 2 * S), np.int64)
    run_plan(plan.program.plan, numbers, tolerances, poses, references, q, residual, marks)
    return q, residual, marks


@cache
def plan_kernel() -> Callable[..., int]:
    """The kernel of plans, imported when the first arm is prepared: see `regular_postures`."""
    from ._regular import regular_postures

    return regular_postures


def numbers_for_world(plan: PaulPlan, to_base: Array) -> Array:
    """The numbers of a plan's program for poses in the world."""
    assert plan.program is not None
    numbers = np.array(plan.program.numbers)
    at = int(plan.program.plan[12])
    before = numbers[at : at + 12].reshape(3, 4)
    before[...] = before @ to_base
    return read_only(numbers)


@postures.register
def _(solver: ByPlan, U: Array, references: Array, tolerances: Tolerances) -> Postures:
    chain, plan = solver.chain, solver.plan
    assert plan.program is not None
    numbers = plan.program.numbers
    slack = max(OVERSHOOT, tolerances.position / lever(chain), tolerances.orientation)
    limits = np.array([slack, ZERO, SMALL, max(ROUGH, *tolerances)])

    def candidates(
        poses: Array, wanted: Array
    ) -> tuple[Array, NDArray[np.bool_], NDArray[np.bool_]]:
        q, _, marks = run(plan, numbers, poses, wanted, limits)
        there = np.arange(q.shape[1]) < marks[:, :1]
        return q, there, free_joints(plan, marks[:, 2 : 2 + q.shape[1]], there)

    return solve_singular(chain, candidates, U, references, tolerances)


def free_joints(
    plan: PaulPlan, bits: NDArray[np.int64], there: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Joints at their reference, from the bits of unknowns; of a sum of angles the first one."""
    out = np.zeros((*bits.shape, plan.chain.k), np.bool_)
    for n, step in enumerate(plan.steps):
        for m, number in enumerate(step.unknowns[:2]):
            joint = plan.arm.joints.unknowns[number].terms[0][0]
            out[..., joint] |= there & ((bits >> (2 * n + m)) & 1 == 1)
    return out


@branches.register
def _(solver: ByPlan, found: Postures) -> tuple[NDArray[np.int16], tuple[str, ...]]:
    if solver.branch_of_way.size == 0:
        # the sides of the family are not those of the plan: ranks serve both
        return ranked(np.zeros(found.valid.shape, np.int16), ("",), found)
    return branches(solver.family, found)
