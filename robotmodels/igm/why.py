"""Why a pose has no posture: a short numeric search tells."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from ..geometry import FIXED, PRISMATIC
from ..model import RobotModel
from .numeric import igm_numeric
from .request import Task
from .solver import Tolerances
from .status import IGMStatus

SEARCH_STARTS, SEARCH_STEPS = 4, 60
"""How long the search looks that says why a pose has no posture."""


@dataclass(frozen=True, slots=True, eq=False)
class Search:
    """Result of the numeric search for poses without a posture.

    Shapes: rows, status, met, residual (m,); closest (N, n); missing (N, 6); family (m, n).
    """

    rows: NDArray[np.int64]
    status: NDArray[np.int8]
    met: NDArray[np.bool_]
    residual: Array
    closest: Array
    missing: Array
    family: NDArray[np.bool_]


def search(
    model: RobotModel,
    task: Task,
    whole: bool,
    poses: Array,
    references: Array,
    limits: bool,
    tolerances: Tolerances,
    status: NDArray[np.int8],
) -> Search | None:
    """Status of poses without a posture, with the closest posture and its error.

    Shapes: poses (N, 4, 4), references (N, n), status (N,).
    """
    empty = np.flatnonzero(status == IGMStatus.NOT_CONVERGED)
    if empty.size == 0:
        return None
    free = model if not task.locks else _with_locked_joints(model, task)
    columns = np.setdiff1d(np.arange(model.n), [column for column, _ in task.locks])
    effort = {} if whole else {"restarts": SEARCH_STARTS, "iterations": SEARCH_STEPS}
    found = igm_numeric(
        free, poses[empty], references[np.ix_(empty, columns)],
        mask=np.array(task.mask), mask_axes="tool" if task.in_tool_axes else "world",
        position_tolerance=tolerances.position, orientation_tolerance=tolerances.orientation,
        limits=limits, **effort,
    )  # fmt: skip
    assert found.closest is not None
    assert found.error is not None
    closest, missing = np.full((len(poses), model.n), np.nan), np.full((len(poses), 6), np.nan)
    for column, value in task.locks:
        closest[empty, column] = value
    closest[np.ix_(empty, columns)] = found.closest
    missing[empty] = found.error[:, 0]
    family = np.zeros((empty.size, model.n), np.bool_)
    family[:, columns] = found.family_joints[:, 0]
    return Search(
        empty, found.status, found.valid[:, 0], found.residual[:, 0], closest, missing, family
    )


def _with_locked_joints(model: RobotModel, task: Task) -> RobotModel:
    """The arm with fixed frames where its joints are locked: geometry only."""
    table = model.table
    sigma, theta, r = table.sigma.copy(), table.theta.copy(), table.r.copy()
    kept = np.ones(model.n, dtype=np.bool_)
    for column, value in task.locks:
        row = table.joint_rows[column]
        (r if sigma[row] == PRISMATIC else theta)[row] += value
        sigma[row], kept[column] = FIXED, False
    fixed = replace(
        table, sigma=sigma, theta=theta, r=r, lower=table.lower[kept], upper=table.upper[kept],
        velocity=table.velocity[kept], effort=table.effort[kept],
    )  # fmt: skip
    return RobotModel.from_table(fixed, base=model.base, tool=model.tool, tip=model.tip)
