"""How far a robot model is from a robot that is known, as in a simulated calibration."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_vector
from ..errors import InvalidValueError
from ..kinematics import dgm
from ..model import RobotModel
from ..se3 import skew
from .errors_seen import BlockErrors
from .extended_table import Frame
from .registration import best_motion
from .result import CalibrationResult
from .robot import CalibratedRobot, as_calibrated, calibrated_pose

_STEPS = 50
_ROUNDING = 1e-13
"""Step relative to the size of the work, from which on further ones are rounding."""


class TrueErrors(NamedTuple):
    """Distances of the tool from where it really is; their angles are NaN.

    Attributes
    ----------
    as_it_stands : BlockErrors
        Of the robot as it is.
    base_fitted : BlockErrors
        With its base put where it suits best: what a method that does not see where the robot
        stands can be held to.
    base_and_tool_fitted : BlockErrors
        With its base and the point of its tool so: what is left is the table's.

    Examples
    --------
    >>> three = [BlockErrors(np.array([e]), np.array([np.nan])) for e in (3e-3, 2e-3, 1e-3)]
    >>> TrueErrors(*three).base_fitted.summary("m").rms
    0.002
    """

    as_it_stands: BlockErrors
    base_fitted: BlockErrors
    base_and_tool_fitted: BlockErrors


def true_errors(
    robot: RobotModel | CalibratedRobot | CalibrationResult,
    real: RobotModel | CalibratedRobot,
    q: ArrayLike,
    frame: Frame = None,
) -> TrueErrors:
    """Position errors of a robot against the one that it stands for (absolute accuracy).

    Residuals of a fit say how well measurements are met, not how far off the robot is elsewhere.
    Where the real robot is known, in a simulation, this tells.

    Parameters
    ----------
    robot : RobotModel, CalibratedRobot or CalibrationResult
        The robot that is judged, n joints.
    real : RobotModel or CalibratedRobot
        What it should be, n joints.
    q : array_like, shape (N, n)
        What the joints read, rad or m: three configurations or more, other ones than those of
        the fit.
    frame : str, int or None
        The end that is looked at; None is the tool.

    Returns
    -------
    TrueErrors
        Lengths in metres, shape (N,), as the robot stands and with base and tool fitted.

    Raises
    ------
    ShapeError, InvalidValueError, FrameNotFoundError
        Not N rows of n finite numbers, fewer than three; something that is no robot, or robots
        with different numbers of joints; an unknown frame.

    References
    ----------
    Seed book sections 1.4.4 and 1.4.6; ISO 9283:1998, "Manipulating industrial robots:
    performance criteria and related test methods", on the accuracy of poses.

    Examples
    --------
    >>> import robotmodels as rm
    >>> arm, q = rm.load("rx90"), np.random.default_rng(0).uniform(-2.0, 2.0, (50, 6))
    >>> real = arm.with_base(rm.se3.translation(0.003, 0.0, 0.004))
    >>> found = true_errors(arm, real, q)
    >>> [round(1e3 * errors.summary("m").rms, 6) for errors in found]
    [5.0, 0.0, 0.0]
    """
    model, real_model = _model_of(robot, "robot"), _model_of(real, "real")
    if model.n != real_model.n:
        raise InvalidValueError(
            f"real: expected a robot with the {model.n} joints of robot, got {real_model.n} joints."
        )
    readings = np.atleast_2d(as_vector(q, model.n, "q")).reshape(-1, model.n)
    if len(readings) < 3:
        raise InvalidValueError(
            f"q: expected three configurations or more to place a base by, got {len(readings)}."
        )
    T, goal = _poses(robot, readings, frame), _poses(real, readings, frame)[:, :3, 3]
    R, p = T[:, :3, :3], T[:, :3, 3]
    return TrueErrors(
        _lengths(p - goal),
        _lengths(_base_fitted(p, goal)),
        _lengths(_base_and_tool_fitted(p, goal, R)),
    )


def _base_fitted(p: Array, goal: Array) -> Array:
    Z = best_motion(p, goal)
    return p @ Z[:3, :3].T + Z[:3, 3] - goal


def _base_and_tool_fitted(p: Array, goal: Array, R: Array) -> Array:
    """Gauss-Newton in the six parameters of the base and the three of the tool's point."""
    Z, point = best_motion(p, goal), np.zeros(3)
    size = float(np.linalg.norm(np.ptp(goal, axis=0))) or 1.0
    for _ in range(_STEPS):
        turned = Z[:3, :3] @ R
        at = (p + R @ point) @ Z[:3, :3].T
        J = np.concatenate([np.broadcast_to(np.eye(3), R.shape), -skew(at), turned], axis=2)
        # the shortest step: base and tool need not be told apart
        step = np.linalg.lstsq(J.reshape(-1, 9), (goal - at - Z[:3, 3]).ravel(), rcond=1e-9)[0]
        point = point + step[6:]
        Z = best_motion(p + R @ point, goal)
        if np.linalg.norm(step[6:]) < _ROUNDING * size:
            break
    return _base_fitted(p + R @ point, goal)


def _model_of(robot: RobotModel | CalibratedRobot | CalibrationResult, name: str) -> RobotModel:
    if isinstance(robot, RobotModel):
        return robot
    if isinstance(robot, CalibratedRobot | CalibrationResult):
        return robot.model
    raise InvalidValueError(
        f"{name}: expected a RobotModel, a CalibratedRobot or the result of a fit, got "
        f"{type(robot).__name__}."
    )


def _poses(
    robot: RobotModel | CalibratedRobot | CalibrationResult, q: Array, frame: Frame
) -> Array:
    if isinstance(robot, RobotModel):
        return dgm(robot, q, frame)
    return calibrated_pose(as_calibrated(robot), q, frame)


def _lengths(residual: Array) -> BlockErrors:
    return BlockErrors(np.linalg.norm(residual, axis=1), np.full(len(residual), np.nan))
