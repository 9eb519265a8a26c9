"""What is always so in an arm: where axes meet, which are parallel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array
from ...geometry import REVOLUTE
from ..lengths import spread_configurations
from ..poses import link_poses
from .task import SingularTask, generator_of


@dataclass(frozen=True, slots=True, eq=False)
class ArmStructure:
    """Permanent structure of an arm: wrist centre and parallel axes.

    Shapes: joints, revolute (k,); centre, last_two, shoulder (3,); parallel (k, k).
    """

    joints: NDArray[np.int64]
    revolute: NDArray[np.bool_]
    centre: Array | None
    last_two: Array | None
    shoulder: Array | None
    parallel: NDArray[np.bool_]
    size: float


def arm_structure(task: SingularTask) -> ArmStructure:
    """Find the permanent structure of an arm at a few random configurations."""
    model = task.model
    joints = model.table.joint_rows[task.moving] + 1
    revolute = model.table.sigma[joints - 1] == REVOLUTE
    poses = [link_poses(model, q) for q in spread_configurations(model, 3, generator_of(None))]
    parallel = np.ones((len(joints), len(joints)), dtype=bool)
    for links in poses:
        z = links[joints - 1, :3, 2]
        parallel &= sines(z) < 1e-7
    last_two = centre = shoulder = None
    if len(joints) >= 3:
        last_two = _always_meeting(poses, joints[-2:], revolute[-2:], task.length)
        centre = _with_third(poses, joints[-2], joints[-3], revolute[-3], last_two, task.length)
        shoulder = _always_meeting(poses, joints[[1, 2]], revolute[1:3], task.length)
        shoulder = _with_third(poses, joints[1], joints[0], revolute[0], shoulder, task.length)
    return ArmStructure(joints, revolute, centre, last_two, shoulder, parallel, task.length)


def sines(z: Array) -> Array:
    """Sines of the angles between axes. Shapes: z (k, 3) -> (k, k)."""
    return np.linalg.norm(np.cross(z[:, None], z[None, :]), axis=-1)


def _always_meeting(
    poses: list[Array], joints: NDArray[np.int64], revolute: NDArray[np.bool_], length: float
) -> Array | None:
    """Point where two axes in succession meet, in the frame of the first; None if they do not."""
    heights = []
    for links in poses:
        first, second = links[int(joints[0]) - 1], links[int(joints[1]) - 1]
        z, w = first[:3, 2], second[:3, 2]
        normal, between = np.cross(z, w), second[:3, 3] - first[:3, 3]
        size = np.linalg.norm(normal)
        if size < 1e-6 or not revolute.all() or abs(between @ normal) > 1e-7 * length * size:
            return None
        heights.append(float(np.cross(between, w) @ normal / size**2))
    if np.ptp(heights) > 1e-7 * length:
        return None
    return np.array([0.0, 0.0, heights[0] if abs(heights[0]) > 1e-12 * length else 0.0])


def _with_third(
    poses: list[Array], holder: int, third: int, turns: bool, point: Array | None, length: float
) -> Array | None:
    """The point, if a third axis always goes through it."""
    if point is None or not turns:
        return None
    for links in poses:
        frame, axis = links[int(holder) - 1], links[int(third) - 1]
        between = frame[:3, :3] @ point + frame[:3, 3] - axis[:3, 3]
        if np.linalg.norm(np.cross(axis[:3, 2], between)) > 1e-7 * length:
            return None
    return point
