"""Why a pose has no IK solution: a short numeric search."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .. import se3
from .._arrays import Array
from ..model import RobotModel
from .chain import locked_chain
from .constraints import Components
from .loop import joint_chain
from .pose_search import SearchTask, pose_search, search_space
from .request import Task
from .solver import Tolerances
from .status import IGMStatus

STARTS, STEPS = 4, 60  # effort of the search that only looks for the reason
ALL_STARTS, ALL_STEPS = 100, 40  # and where no other solver serves the arm
SEED = 20


@dataclass(frozen=True, slots=True, eq=False)
class Diagnosis:
    """Outcome of the search for poses without IK solution.

    Shapes: rows, status, met, residual (m,); closest (N, n); missing (N, 6); family (m, n).
    """

    rows: NDArray[np.int64]
    status: NDArray[np.int8]
    met: NDArray[np.bool_]
    residual: Array
    closest: Array
    missing: Array
    family: NDArray[np.bool_]


def diagnose(
    model: RobotModel,
    task: Task,
    thorough: NDArray[np.bool_],
    poses: Array,
    references: Array,
    limits: bool,
    tolerances: Tolerances,
    status: NDArray[np.int8],
) -> Diagnosis | None:
    """Status of poses without IK solution, the closest configuration and its error.

    Shapes: thorough (N,); poses (N, 4, 4) in world axes, references (N, n), status (N,). A search
    that met a pose outside the limits, or without the relations or the arm angle, proves nothing.
    """
    rows = np.flatnonzero(status == IGMStatus.NOT_CONVERGED)
    if rows.size == 0:
        return None
    chain = joint_chain(model)
    locks = dict(task.locks)
    places = {place: locks[int(c)] for place, c in enumerate(chain.columns) if int(c) in locks}
    if places:
        chain = locked_chain(chain, places)
    columns, n = chain.columns, model.n
    lower, upper = model.lower[columns], model.upper[columns]
    closest, missing = np.full((len(poses), n), np.nan), np.full((len(poses), 6), np.nan)
    closest[rows] = references[rows]
    if limits:
        closest[rows] = np.clip(closest[rows], model.lower, model.upper)
    for column, value in locks.items():
        closest[rows, column] = value
    U = se3.inverse(model.base) @ poses[rows]
    reason, met = np.zeros(rows.size, np.int8), np.zeros(rows.size, np.bool_)
    residual, family = np.zeros(rows.size), np.zeros((rows.size, n), np.bool_)
    for chosen, effort in (
        (~thorough[rows], (STARTS, STEPS)),
        (thorough[rows], (ALL_STARTS, ALL_STEPS)),
    ):
        if not chosen.any():
            continue
        at = np.ix_(rows[chosen], columns)
        space = search_space(chain, lower, upper, limits, effort[0], SEED)
        search = SearchTask(Components(task.mask, task.in_tool_axes), tolerances, *effort)
        found = pose_search(space, search, U[chosen], closest[at], True)
        closest[at], missing[rows[chosen]] = found.q, found.error
        reason[chosen], met[chosen], residual[chosen] = found.status, found.valid, found.residual
        family[np.ix_(chosen, columns)] = found.family
    no_reason = reason == IGMStatus.OUTSIDE_LIMITS
    if task.relations or task.by_arm_angle:
        no_reason |= met
    reason[no_reason], met[no_reason] = IGMStatus.NOT_CONVERGED, False
    closest[rows[no_reason]], missing[rows[no_reason]] = np.nan, np.nan
    return Diagnosis(rows, reason, met, residual, closest, missing, family)
