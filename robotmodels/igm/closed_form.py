"""All postures of six-joint arms with a closed form: three axes that meet, or three parallel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .. import se3
from .._arrays import Array
from .check import checked
from .loop import JointChain
from .postures import Postures, assembled
from .solver import Tolerances, postures
from .structure import Family, LoopPlan, plan_loop

MOST = 8  # postures of one pose
CHUNK = 4096  # poses worked on at a time
SLACK = 1e-9  # overshoot beside the length of the arm that is tried as a double root


@dataclass(frozen=True, slots=True, eq=False)
class ClosedForm:
    """A six-joint arm with three axes that meet, or three that are parallel."""

    chain: JointChain
    plan: LoopPlan

    @property
    def method(self) -> str:
        """The family in words."""
        return self.plan.family.value


def prepare_closed_form(chain: JointChain) -> ClosedForm | None:
    """The closed form of a six-joint arm, None if it has none."""
    plan = plan_loop(chain)
    return None if plan is None else ClosedForm(chain, plan)


@postures.register
def _(solver: ClosedForm, U: Array, references: Array, tolerances: Tolerances) -> Postures:
    slack = max(SLACK, tolerances.position / solver.plan.size, tolerances.orientation)
    parts = []
    for start in range(0, len(U), CHUNK):
        rows = np.arange(start, min(start + CHUNK, len(U)))
        q, there, free = candidates(solver.plan, U[rows], references[rows], slack)
        part = checked(
            solver.chain, U[rows], q, there, tolerances, free=free, double=np.zeros_like(there)
        )
        parts.append((rows, part))
    return assembled(len(U), 6, parts)


def candidates(
    plan: LoopPlan, U: Array, references: Array, slack: float
) -> tuple[Array, NDArray[np.bool_], NDArray[np.bool_]]:
    """Candidates q (N, 8, 6), which exist (N, 8), free joints (N, 8, 6)."""
    from .kernels.parallel import parallel_postures
    from .kernels.pieper import concurrent_postures

    N = len(U)
    links = np.tile(plan.constants, (N, 1, 1, 1))
    links[:, plan.slot] = plan.left @ (se3.inverse(U) if plan.inverted else U) @ plan.right
    wanted = np.ascontiguousarray(plan.sense * references[:, plan.order])
    found, marks = np.zeros((N, MOST, 6)), np.zeros((N, MOST), np.int64)
    counts = np.zeros(N, np.int64)
    if plan.family is Family.PARALLEL:
        parallel_postures(links, plan.size, slack, wanted, found, marks, counts)
    else:
        concurrent_postures(
            links, se3.inverse(plan.constants[1::-1]), int(plan.backwards), plan.sigma[:3],
            plan.meeting, plan.size, slack, wanted, found, marks, counts,
        )  # fmt: skip
    there = np.arange(MOST) < counts[:, None]
    q, free = np.empty(found.shape), np.empty(found.shape, np.bool_)
    q[..., plan.order] = plan.sense * found
    free[..., plan.order] = there[..., None] & (marks[..., None] >> np.arange(6) & 1 == 1)
    return q, there, free
