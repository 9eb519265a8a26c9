"""All postures of six-joint arms with a closed form: three axes that meet, or three parallel.

`plan_loop` finds the family; `closed_form_postures` solves poses, checks every candidate on the
chain itself and takes out duplicates.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array
from .check import checked
from .loop import JointChain
from .solver import Found, Tolerances, postures
from .structure import Family, LoopPlan, plan_loop

__all__ = ["MOST", "ClosedForm", "closed_form_postures", "plan_loop"]

MOST = 8  # postures of one pose
CHUNK = 2048  # poses worked on at a time: 1 MB of candidates
ACCEPTED = 1e-9  # largest error of a posture [m, rad]
SLACK = 1e-9  # overshoot beside the length of the arm that is tried as a double root


@dataclass(frozen=True, slots=True, eq=False)
class ClosedForm:
    """A six-joint arm with three axes that meet, or three that are parallel.

    Parameters
    ----------
    chain : JointChain
        The arm.
    plan : LoopPlan
        Its loop in normal form.
    """

    chain: JointChain
    plan: LoopPlan

    @property
    def method(self) -> str:
        """The family in words."""
        return self.plan.family.value


def prepare_closed_form(chain: JointChain) -> ClosedForm | None:
    """The closed form of a six-joint arm, None if it has none.

    Examples
    --------
    >>> from robotmodels.igm.loop import joint_chain
    >>> from robotmodels.robots import load
    >>> prepare_closed_form(joint_chain(load("irb140"))).method
    'three revolute axes that meet in a point (Pieper)'
    """
    plan = plan_loop(chain)
    return None if plan is None else ClosedForm(chain, plan)


@postures.register
def _(solver: ClosedForm, U: Array, references: Array, tolerances: Tolerances) -> Found:
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

    Parameters
    ----------
    plan : LoopPlan
        The loop in normal form, from `plan_loop`.
    chain : JointChain
        The arm the plan was made of.
    U : array_like, shape (N, 4, 4)
        Poses of the tool in R_0, ``U = D_0 M_1 D_1 ... M_6 D_6`` [m].
    references : array_like, shape (N, 6) or (6,), optional
        Values, in the order of the chain, for joints that a singular pose leaves free [rad or m].
        Zero where they are left out.
    slack : float
        Overshoot beside the length of the arm that is tried as a double root.
    accepted : float
        Largest error of a posture [m, rad].

    Returns
    -------
    q : ndarray, shape (N, 8, 6)
        Postures in the order of the chain, packed, angles in (-pi, pi] [rad or m]; NaN in the rows
        without one.
    valid : ndarray of bool, shape (N, 8)
        Rows that hold a posture. Each meets its pose to ``accepted`` m and rad, and to 1e-12 or so
        away from folds, where two postures fall together.
    free : ndarray of bool, shape (N, 8, 6)
        Joints that the pose left free, so that the posture has infinitely many neighbours. They
        took their reference, or the value nearest to it at which the others can follow.

    Notes
    -----
    Postures closer than 1e-6 in every joint are returned once. A pose that is not finite has none.

    Examples
    --------
    >>> from robotmodels.igm.loop import joint_chain
    >>> from robotmodels.kinematics import dgm
    >>> from robotmodels.robots import load
    >>> chain = joint_chain(load("rx90"))
    >>> T = dgm(load("rx90"), [[0.3, -0.2, 0.5, 1.0, -0.7, 0.4]])
    >>> q, valid, free = closed_form_postures(plan_loop(chain), chain, T)
    >>> int(valid.sum()), bool(free.any())
    (8, False)
    """
    from ._concurrent import concurrent_postures
    from ._parallel import parallel_postures
    from ._verify import verified_postures

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
            concurrent_postures(
                *loop, first_three, int(plan.backwards), plan.meeting, plan.size, slack,
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
