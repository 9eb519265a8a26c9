"""The direct geometric model of a calibrated robot, from what its joints read."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._arrays import Array, as_vector
from ...kinematics import dgm
from ..extended_table.skeleton import Frame
from .calibrated import CalibratedRobot


def calibrated_pose(robot: CalibratedRobot, q_read: ArrayLike, frame: Frame = None) -> Array:
    """Direct geometric model of a calibrated robot, from the readings of its joints.

    Parameters
    ----------
    robot : CalibratedRobot
        The robot, n joints.
    q_read : array_like, shape (..., n)
        Readings, rad or m.
    frame : str, int or None
        A measured end or any frame of the model; None is the tool.

    Returns
    -------
    ndarray, shape (..., 4, 4)
        World poses, metres.

    Raises
    ------
    ShapeError, InvalidValueError, FrameNotFoundError
        Wrong length, NaN or infinity; an unknown frame.

    References
    ----------
    Seed book sections 1.2.2 and 1.4.6.

    Examples
    --------
    See `calibrated_model`.
    """
    readings = as_vector(q_read, robot.model.n, "q_read")
    q = robot.joint_errors.actual(readings)
    if not robot.bending.is_zero:
        n, (path, after) = robot.model.n, tip_of(robot, frame)
        T = robot.bending.poses(readings.reshape(-1, n), q.reshape(-1, n), path, after)
        return T.reshape(*q.shape[:-1], 4, 4)
    end = robot.end(frame)
    if end is None:
        return dgm(robot.model, q, frame)
    return dgm(robot.model, q, end.parent) @ end.pose


def tip_of(robot: CalibratedRobot, frame: Frame = None) -> tuple[NDArray[np.int64], Array]:
    """Path of a frame in the extended table, and its constant pose behind the path's end."""
    skeleton, end = robot.parameters.skeleton, robot.end(frame)
    if end is not None:
        return robot.bending.path_to(end.row), skeleton.after[end.row - 1 - robot.model.f]
    found, pose = robot.model.twin.frame(frame), np.eye(4)
    pose[:3, :3], pose[:3, 3] = found.rotation, found.position
    return robot.bending.path_to(found.parent), pose
