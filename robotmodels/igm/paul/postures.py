"""All postures of poses by a plan."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._arrays import Array
from ...errors import InvalidValueError, ShapeError
from ..check import checked
from ..solver import Tolerances
from .plan import PaulPlan

SLACK = 1e-9
"""Overshoot beside the amplitude that is tried as a double root."""
ZERO = 1e-13
"""Amplitudes beside their usual size that count as zero: the joint is free."""
SMALL = 1e-6
"""Amplitudes beside their usual size below which a pose is called delicate."""
ROUGH = 1e-2
"""Candidates that miss a delicate pose by less (m, rad) are improved."""
CHUNK = 4096


@dataclass(frozen=True, slots=True, eq=False)
class PaulPostures:
    """Postures of N poses, S rows for each, k joints in the order of the chain. Read-only.

    Parameters
    ----------
    q : ndarray, shape (N, S, k)
        Postures, packed, angles in (-pi, pi] [rad or m]; NaN in the rows without one.
    valid : ndarray of bool, shape (N, S)
        Rows that hold a posture.
    residual : ndarray, shape (N, S)
        The larger of the position error [m] and the rotation angle [rad]; NaN without posture.
    free : ndarray of bool, shape (N, S, k)
        Joints that the pose left free; they took their reference.
    path : ndarray of int, shape (N, S)
        Solutions taken: two bits for each step, the first step in the lowest. -1 without posture,
        and for delicate poses, whose rows are made new.
    delicate : ndarray of bool, shape (N,)
        Poses at or near a singularity of a step (small amplitude, double root, free joint): what
        is returned is right, but postures may be missing.

    Examples
    --------
    >>> from robotmodels.igm.paul import derive_plan, paul_postures
    >>> from robotmodels.kinematics import dgm
    >>> from robotmodels.robots import load
    >>> arm = load("ur5e")
    >>> found = paul_postures(derive_plan(arm), dgm(arm, [[0.1, -1.2, 1.3, 0.4, 0.5, 0.6]]))
    >>> int(found.valid.sum()), bool(found.delicate[0])
    (8, False)
    """

    q: Array
    valid: NDArray[np.bool_]
    residual: Array
    free: NDArray[np.bool_]
    path: NDArray[np.int64]
    delicate: NDArray[np.bool_]

    def __post_init__(self) -> None:
        for field in fields(self):
            getattr(self, field.name).flags.writeable = False


def paul_postures(
    plan: PaulPlan,
    U: ArrayLike,
    references: ArrayLike | None = None,
    position_tolerance: float = 1e-9,
    orientation_tolerance: float = 1e-9,
) -> PaulPostures:
    """All postures that a complete plan finds for poses, checked on the table.

    Parameters
    ----------
    plan : PaulPlan
        A complete plan, from `derive_plan`.
    U : array_like, shape (N, 4, 4)
        Poses of the tool in R_0, ``Z^-1 T`` [m].
    references : array_like, shape (N, k) or (k,), optional
        Values, in the order of the chain, for joints that a pose leaves free [rad or m]; default 0.
    position_tolerance, orientation_tolerance : float
        When a pose counts as met [m, rad]. With wider tolerances than 1e-9 candidates are moved
        to the posture nearest to the pose before it is decided.

    Returns
    -------
    PaulPostures
        Postures closer than 1e-6 in every joint are returned once. A pose that is not finite has
        none.

    Raises
    ------
    InvalidValueError
        The plan is not complete.
    ShapeError
        Poses or references of the wrong shape.

    References
    ----------
    Seed book section 1.2.3.2.

    Examples
    --------
    >>> from robotmodels.igm.paul import derive_plan, paul_postures
    >>> from robotmodels.robots import load
    >>> pose_a = [[0, 0, -1, 0.1414], [0, 1, 0, -0.3], [1, 0, 0, 0.8414], [0, 0, 0, 1]]
    >>> plan = derive_plan(load("lab_trr"))
    >>> paul_postures(plan, [pose_a], position_tolerance=1e-4).q.round(3)
    array([[[-0.3  , -0.785, -0.785]]])
    """
    from ._run import run_plan

    program, k = plan.program, plan.form.k
    if program is None:
        names = ", ".join(str(plan.form.rows[j].frame) for j in plan.remaining)
        raise InvalidValueError(
            f"plan: expected a complete one, this one leaves the joints {names} unsolved; use "
            "another method."
        )
    poses = np.array(U, dtype=np.float64, order="C")
    if poses.ndim != 3 or poses.shape[1:] != (4, 4):
        raise ShapeError(f"U: expected shape (N, 4, 4), got {poses.shape}.")
    N, S = poses.shape[0], program.branches
    wanted = np.zeros((N, k))
    if references is not None:
        given = np.asarray(references, dtype=np.float64)
        if given.shape not in ((k,), (N, k)):
            raise ShapeError(f"references: expected shape ({N}, {k}) or ({k},), got {given.shape}.")
        wanted[:] = given
    q, residual = np.empty((N, S, k)), np.empty((N, S))
    marks = np.empty((N, 2 + 2 * S), np.int64)
    wide = max(position_tolerance, orientation_tolerance) > 1e-9
    limit = max(ROUGH, position_tolerance, orientation_tolerance) if wide else 1e-9
    numbers = np.array([SLACK, ZERO, SMALL, limit])
    for start in range(0, N, CHUNK):
        rows = slice(start, start + CHUNK)
        run_plan(
            program.plan, program.numbers, numbers, poses[rows], wanted[rows], q[rows],
            residual[rows], marks[rows],
        )  # fmt: skip
    delicate = marks[:, 1] != 0
    again = delicate if not wide else np.ones(N, np.bool_)
    rows = np.flatnonzero(again)
    if rows.size and not wide:
        # candidates that are only near the pose as well
        numbers[3] = ROUGH
        part, part_residual, part_marks = q[rows], residual[rows], marks[rows]
        run_plan(
            program.plan, program.numbers, numbers, poses[rows], wanted[rows], part, part_residual,
            part_marks,
        )  # fmt: skip
        q[rows], residual[rows], marks[rows] = part, part_residual, part_marks
    there = np.arange(S) < marks[:, :1]
    free = _free_joints(plan, marks[:, 2 : 2 + S], there)
    path = np.where(there, marks[:, 2 + S :], -1)
    q[~there], residual[~there] = np.nan, np.nan
    valid = there.copy()
    if rows.size:
        candidates = np.where(there[rows, :, None], q[rows], 0.0)
        found = checked(
            plan.chain, poses[rows], candidates, there[rows],
            Tolerances(position_tolerance, orientation_tolerance), free=free[rows],
            rough=max(limit, ROUGH),
        )  # fmt: skip
        q[rows], valid[rows], residual[rows] = found.q, found.valid, found.residual
        free[rows], path[rows] = found.free, -1
        q[~valid], residual[~valid] = np.nan, np.nan
    return PaulPostures(q, valid, residual, free, path, delicate)


def _free_joints(
    plan: PaulPlan, bits: NDArray[np.int64], there: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """The joints whose bits are set; of a sum of angles the first one stands for it."""
    out = np.zeros((*bits.shape, plan.form.k), np.bool_)
    if not bits[there].any():
        return out
    for n, step in enumerate(plan.steps):
        for m, number in enumerate(step.unknowns[:2]):
            joint = plan.arm.joints.unknowns[number].terms[0][0]
            out[..., joint] |= there & ((bits >> (2 * n + m)) & 1 == 1)
    return out
