"""Arms that Paul's method solves: its plan gives all candidates, at singular poses too."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array, read_only
from .branches import branches
from .closed_form import ClosedForm
from .loop import JointChain
from .motion import lever, random_postures, tool_poses
from .paul.plan import PaulPlan, derive_plan
from .paul.program import SMALL_AMPLITUDE, ZERO_AMPLITUDE, Program
from .postures import Postures, difference
from .singular import solve_singular
from .solver import Solver, Tolerances, postures

TESTS = 128
"""Random postures that a plan has to give back before it is used."""
OVERSHOOT = 1e-5
"""Overshoot tried as a double root at singular poses, beside the length of the arm."""
ROUGH = 1e-2
"""Errors up to which candidates at singular poses are refined [m, rad]."""


@dataclass(frozen=True, slots=True, eq=False)
class ByPlan:
    """Arm whose regular poses are solved by Paul's plan."""

    plan: PaulPlan
    program: Program
    family: Solver
    labels: tuple[str, ...]
    branch_of_way: NDArray[np.int16]

    @property
    def most(self) -> int:
        """Most postures of a pose."""
        return self.program.branches

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
    program = plan.program
    if program is None or program.branches > 16:
        return None
    q = random_postures(chain, TESTS, np.random.default_rng(0))
    rows, residual, marks = program.run(tool_poses(chain, q), q)
    S, sure = rows.shape[1], marks[:, 1] == 0
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
    apart = np.sort(np.where(there, code, np.arange(-1, -1 - S, -1)), axis=1)
    if not np.array_equal(table[ways], codes) or np.any(np.diff(apart, axis=1) == 0):
        # the sides of the family are not those of the plan: ranks serve both
        table, labels = np.empty(0, np.int16), tuple(str(i + 1) for i in range(S))
    return ByPlan(plan, program, family, labels, read_only(table, np.int16))


@postures.register
def _(solver: ByPlan, U: Array, references: Array, tolerances: Tolerances) -> Postures:
    chain = solver.chain
    slack = max(OVERSHOOT, tolerances.position / lever(chain), tolerances.orientation)
    limits = (slack, ZERO_AMPLITUDE, SMALL_AMPLITUDE, max(ROUGH, *tolerances))

    def candidates(
        poses: Array, wanted: Array
    ) -> tuple[Array, NDArray[np.bool_], NDArray[np.bool_]]:
        q, _, marks = solver.program.run(poses, wanted, limits)
        there = np.arange(q.shape[1]) < marks[:, :1]
        return q, there, free_joints(solver.plan, marks[:, 2 : 2 + q.shape[1]], there)

    found = solve_singular(chain, candidates, U, references, tolerances)
    lost = np.flatnonzero(~found.valid.any(axis=1))
    if lost.size == 0:
        return found
    # what one equation leaves free another one determines, or its reference has no solution
    lost = lost[is_degenerate(solver, U[lost], references[lost])]
    rest = np.ascontiguousarray(U[lost]), references[lost]
    return found.put(lost, postures(solver.family, *rest, tolerances))


def is_degenerate(solver: ByPlan, U: Array, references: Array) -> NDArray[np.bool_]:
    """Poses at which an equation of the plan leaves its unknown free, or nearly so, (N,)."""
    return solver.program.run(np.ascontiguousarray(U), references)[2][:, 1] != 0


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
        return np.zeros(found.valid.shape, np.int16), ("",)
    return branches(solver.family, found)
