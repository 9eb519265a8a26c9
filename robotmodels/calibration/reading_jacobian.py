"""How the tool of a calibrated robot moves with what its joints read."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_vector
from ..kinematics import jacobian
from .calibrated import CalibratedRobot, tip_of


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
    >>> from robotmodels.calibration.calibrated import calibrated_model
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
