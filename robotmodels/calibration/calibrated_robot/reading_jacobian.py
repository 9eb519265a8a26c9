"""How the tool of a calibrated robot moves with what its joints read."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..._arrays import Array, as_vector
from ...kinematics import jacobian
from ...se3.orientation import rotation_vectors_of
from .calibrated import CalibratedRobot
from .calibrated_pose import tip_of


def reading_jacobian(robot: CalibratedRobot, q_read: ArrayLike) -> Array:
    """Jacobian of a calibrated robot by the readings of its joints.

    Parameters
    ----------
    robot : CalibratedRobot
        The robot, n joints.
    q_read : array_like, shape (..., n)
        Readings, rad or m.

    Returns
    -------
    ndarray, shape (..., 6, n)
        ``[v; w]`` of the tool per unit of each reading, world axes; exact but for what changes
        with the loads of gravity, which is a central difference.

    Raises
    ------
    ShapeError, InvalidValueError
        Wrong length; NaN or infinity.

    References
    ----------
    Seed book sections 1.3.1 and 1.4.6.

    Examples
    --------
    >>> from robotmodels.calibration import candidate_parameters
    >>> from robotmodels.calibration.calibrated_robot.calibrated import calibrated_model
    >>> from robotmodels.robots import load
    >>> parameters = candidate_parameters(load("erd:ur10"), compliance="uniform")
    >>> soft = 1e-6 * np.array([name.startswith("compliance") for name in parameters.names])
    >>> reading_jacobian(calibrated_model(parameters, soft), np.zeros((5, 6))).shape
    (5, 6, 6)
    """
    n, errors = robot.model.n, robot.joint_errors
    readings = as_vector(q_read, n, "q_read")
    rows = readings.reshape(-1, n)
    q = errors.actual(rows)
    if robot.bending.is_zero:
        J = jacobian(robot.model, q) @ errors.slope(rows)
    else:
        by_joint, by_load = robot.bending.jacobians(rows, q, *tip_of(robot))
        J = by_joint @ errors.slope(rows) + by_load
    return J.reshape(*readings.shape[:-1], 6, n)


def missing_of_pose(T: Array, wanted: Array) -> Array:
    """Pose errors: translation (m) and rotation vector (rad) from each pose to the wanted one.

    Shapes: T, wanted (N, 4, 4) -> (N, 6).
    """
    turn = wanted[:, :3, :3] @ T[:, :3, :3].swapaxes(-1, -2)
    return np.concatenate([wanted[:, :3, 3] - T[:, :3, 3], rotation_vectors_of(turn)], axis=1)


def missing_slope(J: Array, phi: Array) -> Array:
    """Minus the derivative of `missing_of_pose` at a rotation error ``phi``.

    Shapes: J (N, 6, n), phi (N, 3) -> (N, 6, n).
    """
    t = np.linalg.norm(phi, axis=1)
    half = 0.5 * np.where(t < 1e-3, 1.0, t)
    c = np.where(t < 1e-3, 1.0 / 12.0 + t * t / 720.0,
                 (1.0 - half / np.tan(half)) / (4.0 * half * half))  # fmt: skip
    K = np.zeros((len(phi), 3, 3))
    K[:, [2, 0, 1], [1, 2, 0]] = phi
    K[:, [1, 2, 0], [2, 0, 1]] = -phi
    turned = np.eye(3) + 0.5 * K + c[:, None, None] * (K @ K)
    return np.concatenate([J[:, :3], turned @ J[:, 3:]], axis=1)
