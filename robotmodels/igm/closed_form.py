"""All postures of six-joint arms with a closed form: three axes that meet, or three parallel.

`plan_loop` finds the family; `closed_form_postures` solves poses, checks every candidate on the
chain itself and takes out duplicates.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import se3
from .._arrays import Array
from .check import checked
from .loop import JointChain
from .postures import Postures
from .solver import Tolerances, postures
from .structure import Family, LoopPlan, plan_loop

__all__ = ["MOST", "ClosedForm", "closed_form_postures", "plan_loop"]

MOST = 8  # postures of one pose
CHUNK = 2048  # poses worked on at a time: 1 MB of candidates
ACCEPTED = 1e-9  # largest error of a posture [m, rad]
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
    accepted = max(ACCEPTED, *tolerances)
    q, valid, free = closed_form_postures(
        solver.plan, solver.chain, U, references, slack=slack, accepted=accepted
    )
    return checked(solver.chain, U, q, valid, tolerances, free=free)


def closed_form_postures(
    plan: LoopPlan,
    chain: JointChain,
    U: ArrayLike,
    references: ArrayLike | None = None,
    slack: float = SLACK,
    accepted: float = ACCEPTED,
) -> tuple[Array, NDArray[np.bool_], NDArray[np.bool_]]:
    """All real postures of a six-joint arm that has a closed form.

    Shapes: U (N, 4, 4), references (N, 6) or (6,) -> q, free (N, 8, 6); valid (N, 8).
    """
    from ._parallel import parallel_postures
    from ._verify import verified_postures
    from .kernels.pieper import concurrent_postures

    poses = np.array(U, dtype=np.float64, order="C")
    N = poses.shape[0]
    wanted = np.zeros((N, 6))
    if references is not None:
        wanted[:] = references
    loop_references = np.ascontiguousarray(plan.sense * wanted[:, plan.order])
    finite = np.all(np.isfinite(poses), axis=(1, 2)) & np.all(np.isfinite(wanted), axis=1)
    # eigenvalues are not asked of numbers that are none
    poses[~finite], loop_references[~finite] = np.eye(4), 0.0
    q = np.full((N, MOST, 6), np.nan)
    valid = np.zeros((N, MOST), np.bool_)
    free = np.zeros((N, MOST, 6), np.bool_)
    first_three = np.ascontiguousarray(plan.sigma[:3])
    for start in range(0, N, CHUNK):
        rows = slice(start, start + CHUNK)
        size = poses[rows].shape[0]
        found = np.zeros((size, MOST, 6))
        marks = np.zeros((size, MOST), np.int64)
        counts = np.zeros(size, np.int64)
        loop = (poses[rows], plan.constants, plan.slot, plan.left, plan.right, int(plan.inverted))
        if plan.family is Family.CONCURRENT:
            links = np.tile(plan.constants, (size, 1, 1, 1))
            pose = se3.inverse(poses[rows]) if plan.inverted else poses[rows]
            links[:, plan.slot] = plan.left @ pose @ plan.right
            concurrent_postures(
                links, se3.inverse(plan.constants[1::-1]), int(plan.backwards), first_three,
                plan.meeting, plan.size, slack,
                loop_references[rows], found, marks, counts,
            )  # fmt: skip
        else:
            parallel_postures(*loop, plan.size, slack, loop_references[rows], found, marks, counts)
        counts[~finite[rows]] = 0
        verified_postures(
            poses[rows], chain.sigma, chain.D, plan.order, plan.sense, accepted,
            found, marks, counts,
            q[rows], valid[rows], free[rows],
        )  # fmt: skip
    return q, valid, free
