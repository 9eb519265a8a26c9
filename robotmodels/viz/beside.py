"""Postures of one robot beside each other, because over each other they may hide one another."""

from __future__ import annotations

from operator import index

import numpy as np

from .. import se3
from .._arrays import Array
from ..errors import InvalidValueError
from ..kinematics import link_poses
from ..model import RobotModel
from ..visual import characteristic_length
from .nodes import Label, Node

_INK = (0.1, 0.1, 0.1, 1.0)

FROM_THE_FRONT = (np.radians(-78.0), np.radians(32.0))
"""Azimuth and elevation from which rows of postures are seen one above the other."""


def beside(model: RobotModel, q: Array, columns: int) -> tuple[list[RobotModel], list[Node]]:
    """Copies of the robot, one for each posture, in rows with numbers. Shapes: q (N, n)."""
    try:
        wide = index(columns)
    except TypeError:
        wide = 0
    if wide < 1 or isinstance(columns, bool):
        raise InvalidValueError(
            f"columns: expected how many postures stand in a row, 1 or more, got {columns!r}."
        )
    size = characteristic_length(model.table, model.tool)
    poses = link_poses(model, q)
    ends = poses[:, model.tip - 1] @ model.tool
    points = np.concatenate((poses[..., :3, 3].reshape(-1, 3), ends[:, :3, 3], [model.base[:3, 3]]))
    low, high = points.min(axis=0), points.max(axis=0)
    step = high - low + 0.25 * size
    step[1] = max(step[1], 1.2 * (high[2] - low[2]))  # or a row would hide the one behind it
    robots, numbers = [], []
    for k in range(len(q)):
        row, column = divmod(k, wide)
        shift = se3.translation(column * step[0], -row * step[1], 0.0)
        robots.append(model.with_base(shift @ model.base))
        foot = shift @ se3.translation(*(model.base[:3, 3] - (0.0, 0.32 * size, 0.0)))
        numbers.append(Node(f"numbers/{k + 1}", foot, Label(str(k + 1), 0.7 * size), _INK))
    return robots, numbers
