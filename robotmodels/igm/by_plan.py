"""Arms that Paul's method solves: its plan for the poses it is sure of, a family for the others."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array, read_only
from .branches import SIDES, branches, ranked
from .check import checked
from .closed_form import ClosedForm, closed_form_postures
from .gather import assembled, rows_of
from .loop import JointChain
from .motion import random_postures, tool_poses
from .paul.plan import PaulPlan, derive_plan
from .paul.postures import SLACK, SMALL, ZERO
from .self_motion import singular_postures
from .solver import Found, Solver, Tolerances, postures
from .structure import Family
from .thorough import MET, thorough_postures, two_singularities

TESTS = 128
"""Random postures that a plan has to give back before it is used."""
ACCEPTED = 1e-9
"""Largest error of a posture of the plan [m, rad]."""
ROUGH = 1e-2
"""Errors up to which candidates at singular positions are improved [m, rad]."""
TOLERANCES = read_only([SLACK, ZERO, SMALL, ACCEPTED])


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
    away = np.abs(_short(chain, rows - q[:, None])).max(axis=-1)
    given_back = np.any(away < 1e-6, axis=1)
    if np.sum(sure) < TESTS // 2 or not np.array_equal(given_back, sure):
        return None
    none = np.zeros((TESTS, S), np.bool_)
    found = Found(rows, there, residual, none, np.zeros(rows.shape, np.bool_), none)
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
def _(solver: ByPlan, U: Array, references: Array, tolerances: Tolerances) -> Found:
    if not isinstance(solver.family, ClosedForm) or max(tolerances) > ACCEPTED:
        return postures(solver.family, U, references, tolerances)
    chain, loop, plan = solver.chain, solver.family.plan, solver.plan
    assert plan.program is not None
    numbers = plan.program.numbers

    def candidates(poses: Array, wanted: Array, slack: float) -> tuple[Array, NDArray[np.bool_]]:
        a, there, _ = closed_form_postures(loop, chain, poses, wanted, slack, ROUGH)
        limits = np.array([slack, ZERO, SMALL, ROUGH])
        b, _, marks = run(plan, numbers, poses, wanted, limits)
        return (
            np.concatenate([a, b], axis=1),
            np.concatenate([there, np.arange(b.shape[1]) < marks[:, :1]], axis=1),
        )

    if loop.family is not Family.CONCURRENT:
        # at a singular position the plan and the family do not lose the same digits
        return thorough_postures(chain, candidates, U, references, tolerances)
    # a wrist or shoulder that is aligned and nothing else is what the family is made for
    q, valid, free = closed_form_postures(loop, chain, U, references)
    found = checked(chain, U, q, valid, tolerances, free=free)
    marks = run(plan, numbers, U, references)[2]
    fewer = marks[:, 0] > found.valid.sum(axis=1)
    rest = np.flatnonzero(fewer | ~_plain(chain, found))
    if rest.size == 0:
        return found
    part = thorough_postures(chain, candidates, U[rest], references[rest], tolerances)
    others = np.setdiff1d(np.arange(len(U)), rest)
    return assembled(len(U), chain.k, [(others, rows_of(found, others)), (rest, part)])


@branches.register
def _(solver: ByPlan, found: Found) -> tuple[NDArray[np.int16], tuple[str, ...]]:
    if solver.branch_of_way.size == 0:
        # the sides of the family are not those of the plan: ranks serve both
        return ranked(np.zeros(found.valid.shape, np.int16), ("",), found)
    return branches(solver.family, found)


def _plain(chain: JointChain, found: Found) -> NDArray[np.bool_]:
    """Poses whose postures are met, and singular only where the family says so, shape (N,)."""
    double, member = singular_postures(chain, found)
    near = two_singularities(chain, found)
    unsaid = double | (member != found.family) | (found.residual > MET)
    return ~near & ~np.any(unsaid & found.valid, axis=1)


def _short(chain: JointChain, way: Array) -> Array:
    """Differences of postures, angles by the shorter way round."""
    turn = 2.0 * np.pi
    return np.where(chain.sigma == 0, way - turn * np.round(way / turn), way)
