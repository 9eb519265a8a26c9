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
    """What is always so in an arm: where its last axes meet, which axes are parallel.

    Parameters
    ----------
    joints : ndarray of int, shape (k,)
        Numbers of the frames of the joints that move the frame asked about, from the base.
    revolute : ndarray of bool, shape (k,)
        Which of them turn.
    centre : ndarray, shape (3,), or None
        Point where the last three axes meet, in the frame of the last but one joint, metres.
    last_two : ndarray, shape (3,), or None
        Point where the last two axes meet, in the same frame, metres.
    shoulder : ndarray, shape (3,), or None
        Point where the first three axes meet, in the frame of the second joint, metres.
    parallel : ndarray of bool, shape (k, k)
        Pairs of axes that are parallel at all configurations.
    size : float
        A length of the arm, metres.

    Examples
    --------
    >>> from robotmodels.kinematics.singular.task import singular_task
    >>> from robotmodels.robots import load
    >>> arm_structure(singular_task(load("rx90"))).centre
    array([0., 0., 0.])
    """

    joints: NDArray[np.int64]
    revolute: NDArray[np.bool_]
    centre: Array | None
    last_two: Array | None
    shoulder: Array | None
    parallel: NDArray[np.bool_]
    size: float


def arm_structure(task: SingularTask) -> ArmStructure:
    """Look for what is always so, at a few random configurations.

    Parameters
    ----------
    task : SingularTask
        The robot and the frame.

    Returns
    -------
    ArmStructure
        Wrist centre and parallel axes.

    Examples
    --------
    >>> from robotmodels.kinematics.singular.task import singular_task
    >>> from robotmodels.robots import load
    >>> arm_structure(singular_task(load("ur5"))).parallel[1]
    array([False,  True,  True,  True, False, False])
    """
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
    """Sines of the angles between axes.

    Parameters
    ----------
    z : ndarray, shape (k, 3)
        Unit vectors.

    Returns
    -------
    ndarray, shape (k, k)
        Of each pair.

    Examples
    --------
    >>> sines(np.eye(3)[:2])
    array([[0., 1.],
           [1., 0.]])
    """
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
