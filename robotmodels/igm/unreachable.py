"""Why a pose has no IK solution: a short numeric search."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .. import se3
from .._arrays import Array
from ..model import RobotModel
from .asked import Task
from .chain import locked_chain
from .loop import joint_chain
from .pose_search import SearchTask, pose_search, search_space
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
    no_solver: bool,
    poses: Array,
    references: Array,
    limits: bool,
    tolerances: Tolerances,
    status: NDArray[np.int8],
) -> Diagnosis | None:
    """Status of poses without IK solution, the closest configuration and its error.

    Shapes: poses (N, 4, 4) in world axes, references (N, n), status (N,).
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
    restarts, steps = (ALL_STARTS, ALL_STEPS) if no_solver else (STARTS, STEPS)
    lower, upper = model.lower[columns], model.upper[columns]
    space = search_space(chain, lower, upper, limits, restarts, SEED)
    search = SearchTask(np.array(task.mask), task.in_tool_axes, tolerances, restarts, steps)
    closest, missing = np.full((len(poses), n), np.nan), np.full((len(poses), 6), np.nan)
    closest[rows] = references[rows]
    if limits:
        closest[rows] = np.clip(closest[rows], model.lower, model.upper)
    for column, value in locks.items():
        closest[rows, column] = value
    U = se3.inverse(model.base) @ poses[rows]
    found = pose_search(space, search, U, closest[np.ix_(rows, columns)], True)
    closest[np.ix_(rows, columns)], missing[rows] = found.q, found.error
    family = np.zeros((rows.size, n), np.bool_)
    family[:, columns] = found.family
    return Diagnosis(rows, found.status, found.valid, found.residual, closest, missing, family)
