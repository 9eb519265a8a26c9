"""Why a pose has no IK solution: a short numeric search."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from ..model import RobotModel
from .chain import without_locked
from .check import checked
from .constraints import Components
from .loop import joint_chain
from .pose_search import Outcome, SearchTask, pose_search, search_space
from .request import Task
from .solver import Tolerances
from .status import IGMStatus

REASON = (4, 60)
"""Starts and steps of the search that only looks for the reason."""
THOROUGH = (100, 40)
"""The same where no other solver serves the arm."""
SEED = 20
NEAR = 1e-5
"""Error up to which a closest posture says nothing of the reach: it is refined [m, rad]."""


def diagnose(
    model: RobotModel,
    task: Task,
    thorough: NDArray[np.bool_],
    U: Array,
    references: Array,
    limits: bool,
    tolerances: Tolerances,
) -> Outcome:
    """Status of poses without IK solution, the closest posture and its error, in columns of q.

    Shapes: thorough (N,); U (N, 4, 4) in R_0, references (N, n). A search that met a pose outside
    the limits, or without the relations or the arm angle, proves nothing: NaN, not converged.
    """
    chain = without_locked(joint_chain(model), task.locks)
    columns, N = chain.columns, len(U)
    lower, upper = model.lower[columns], model.upper[columns]
    q, family = references.copy(), np.zeros(references.shape, np.bool_)
    error, residual = np.empty((N, 6)), np.empty(N)
    met, status = np.empty(N, np.bool_), np.empty(N, np.int8)
    for rows, effort in (
        (np.flatnonzero(~thorough), REASON), (np.flatnonzero(thorough), THOROUGH),
    ):  # fmt: skip
        if rows.size:
            at = np.ix_(rows, columns)
            space = search_space(chain, lower, upper, limits, effort[0], SEED)
            # closed forms may miss a singular pose: the whole pose is searched before its position
            search = SearchTask(Components(task.mask, task.in_tool_axes), tolerances, *effort)
            found = pose_search(space, search, U[rows], q[at], True)
            q[at], family[at], error[rows] = found.q, found.family, found.error
            residual[rows], met[rows], status[rows] = found.residual, found.valid, found.status
    near = np.flatnonzero(thorough & ~met & (residual < NEAR))
    if near.size and not limits and task == Task(locks=task.locks):
        # beside a singular posture the error falls with the square of the distance
        candidates, there = q[np.ix_(near, columns)][:, None], np.ones((near.size, 1), np.bool_)
        found = checked(chain, U[near], candidates, there, tolerances, rough=np.inf)
        hit, row = near[found.valid[:, 0]], found.valid[:, 0]
        q[np.ix_(hit, columns)], residual[hit] = found.q[row, 0], found.residual[row, 0]
        met[hit], error[hit], status[near] = True, 0.0, IGMStatus.NOT_CONVERGED
        status[hit] = IGMStatus.REACHED
    no_reason = status == IGMStatus.OUTSIDE_LIMITS
    if task.relations or task.by_arm_angle:
        no_reason |= met
    q[no_reason], error[no_reason] = np.nan, np.nan
    met[no_reason], status[no_reason] = False, IGMStatus.NOT_CONVERGED
    return Outcome(q, error, residual, met, family, status)
