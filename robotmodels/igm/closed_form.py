"""All postures of six-joint arms with a closed form: three axes that meet, or three parallel.

`plan_loop` finds the family; `closed_form_postures` solves poses, checks every candidate on the
chain itself and takes out duplicates.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .. import se3
from .._arrays import Array
from .check import CHUNK, checked
from .loop import JointChain
from .postures import Postures
from .solver import Prepare, Solver, Tolerances, postures, prepare_alike
from .structure import Family, LoopPlan, plan_loop

__all__ = ["MOST", "ClosedForm", "closed_form_postures", "plan_loop"]

MOST = 8  # postures of one pose
DEFAULT = Tolerances()
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


@prepare_alike.register
def _(known: ClosedForm, chain: JointChain, prepare: Prepare) -> Solver | None:
    return prepare_closed_form(chain) or prepare(chain)


@postures.register
def _(solver: ClosedForm, U: Array, references: Array, tolerances: Tolerances) -> Postures:
    return closed_form_postures(solver.plan, solver.chain, U, references, tolerances)


def closed_form_postures(
    plan: LoopPlan, chain: JointChain, U: Array, references: Array, tolerances: Tolerances = DEFAULT
) -> Postures:
    """All real postures of a six-joint arm that has a closed form.

    Shapes: U (N, 4, 4), references (N, 6).
    """
    from .kernels.parallel import parallel_postures
    from .kernels.pieper import concurrent_postures, scratch

    N = len(U)
    slack = max(SLACK, tolerances.position / plan.size, tolerances.orientation)
    finite = np.all(np.isfinite(U), axis=(1, 2)) & np.all(np.isfinite(references), axis=1)
    # the kernels take finite numbers only
    poses = np.where(finite[:, None, None], U, np.eye(4))
    wanted = np.where(finite[:, None], plan.sense * references, 0.0)
    wanted = np.ascontiguousarray(wanted[:, plan.order])
    found, counts = np.zeros((N, MOST, 6)), np.zeros(N, np.int64)
    marks, work = np.zeros((N, MOST), np.int64), scratch()
    pose = se3.inverse(poses) if plan.inverted else poses
    for start in range(0, N, CHUNK):
        rows = slice(start, start + CHUNK)
        links = np.tile(plan.constants, (len(pose[rows]), 1, 1, 1))
        links[:, plan.slot] = plan.left @ pose[rows] @ plan.right
        out = wanted[rows], work, found[rows], marks[rows], counts[rows]
        if plan.family is Family.PARALLEL:
            parallel_postures(links, plan.size, slack, *out)
            continue
        pair, kinds = se3.inverse(plan.constants[1::-1]), np.ascontiguousarray(plan.sigma[:3])
        concurrent_postures(
            links, pair, int(plan.backwards), kinds, plan.meeting, plan.size, slack, *out
        )
    there = (np.arange(MOST) < counts[:, None]) & finite[:, None]
    q, free = np.empty(found.shape), np.empty(found.shape, np.bool_)
    q[..., plan.order] = plan.sense * found
    free[..., plan.order] = (marks[..., None] >> np.arange(6)) & 1 == 1
    return checked(chain, poses, q, there, tolerances, free=free & there[..., None])
