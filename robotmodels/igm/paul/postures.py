"""All postures of poses by a plan.

Source: Seed book section 1.2.3.2.
"""

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

    Shapes: q, free (N, S, k); valid, residual, path (N, S); delicate (N,).
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

    Shapes: U (N, 4, 4), references (N, k) or (k,).
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
