"""Correction for controllers that keep their nominal model: joint offsets and false targets."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import least_squares

from .._arrays import Array, Frozen, as_mask, as_vector
from ..errors import InvalidValueError
from ..geometry import REVOLUTE
from ..igm.request import above_zero
from ..igm.solutions import IGMSolutions
from ..kinematics import dgm
from .inverse import corrected_igm, pose_errors
from .robot import CalibratedRobot, as_calibrated, calibrated_pose

if TYPE_CHECKING:
    from .result import CalibrationResult

_CLOSE = 1e-15
_RANK_TOLERANCE = 1e-8  # singular values beside the largest below which offsets are dependent


@dataclass(frozen=True, slots=True, eq=False)
class JointOffsets(Frozen):
    """One constant offset for each joint, and the errors without and with them.

    Parameters
    ----------
    offset : ndarray, shape (n,)
        To be added to the joint values that the controller commands, rad or m.
    rank : int
        Number of independent combinations of offsets; of the others the smallest are taken.
    before, after : ndarray, shape (N, 6)
        Error of the real tool at the commanded pose without and with them: position (m) and
        rotation vector (rad), world axes.
    """

    offset: Array
    rank: int
    before: Array
    after: Array

    @property
    def position(self) -> tuple[float, float]:
        """Root mean square of the position errors before and after, metres."""
        return _rms(self.before[:, :3]), _rms(self.after[:, :3])

    @property
    def orientation(self) -> tuple[float, float]:
        """Root mean square of the rotation errors before and after, radians."""
        return _rms(self.before[:, 3:]), _rms(self.after[:, 3:])

    @property
    def worst(self) -> tuple[float, float]:
        """Largest position error (m) and rotation error (rad) that remain."""
        sizes = np.linalg.norm(self.after.reshape(-1, 2, 3), axis=-1).max(axis=0, initial=0.0)
        return float(sizes[0]), float(sizes[1])


@dataclass(frozen=True, slots=True, eq=False)
class PoseOffsets(Frozen):
    """False targets: commanded to a controller with the nominal model, they lead to the true ones.

    Parameters
    ----------
    solutions : IGMSolutions
        The readings at the true targets.
    command : ndarray, shape (..., S, 4, 4)
        The pose that the nominal robot has there, metres; NaN in rows without a solution. The
        controller must stay on the branch of the row.
    """

    solutions: IGMSolutions
    command: Array

    def nearest(self, q: ArrayLike) -> Array:
        """False target (..., 4, 4) of the solution nearest to a posture (..., n); NaN if none."""
        rows = self.solutions.q
        nearest = self.solutions.nearest(q)
        if not rows.shape[-2]:
            return np.full((*nearest.shape[:-1], 4, 4), np.nan)
        same = (rows == nearest[..., None, :]).all(axis=-1).argmax(axis=-1)
        command = np.broadcast_to(self.command, (*nearest.shape[:-1], *self.command.shape[-3:]))
        return np.take_along_axis(command, same[..., None, None, None], axis=-3)[..., 0, :, :]


def joint_offsets(
    robot: CalibratedRobot | CalibrationResult,
    q: ArrayLike,
    mask: ArrayLike | None = None,
    length: float | None = None,
) -> JointOffsets:
    """Constant joint offsets that are the best in the mean, for a controller that keeps its model.

    Parameters
    ----------
    robot
        See `robotmodels.calibration`.
    q : array_like, shape (N, n)
        Configurations over which the errors are least, as commanded: rad or m.
    mask : array_like, shape (6,), optional
        Components ``x y z rx ry rz`` (world axes) that count; default all, and positions alone for
        a result of positions alone: orientations that were not measured must not weigh.
    length : float, optional
        Metres that weigh as much as a radian; default the mean distance of the tool from the
        base.

    Returns
    -------
    JointOffsets
        Offsets, and the errors before and after. Constant errors of the joint variables are
        cancelled exactly.

    Examples
    --------
    >>> from robotmodels.calibration import calibrated_model, candidate_parameters
    >>> from robotmodels.robots import load
    >>> parameters = candidate_parameters(load("rx90"))
    >>> robot = calibrated_model(parameters, 0.01 * (np.array(parameters.names) == "theta3"))
    >>> q = np.random.default_rng(0).uniform(-2, 2, size=(20, 6))
    >>> joint_offsets(robot, q).offset.round(9) + 0.0
    array([ 0.  ,  0.  , -0.01,  0.  ,  0.  ,  0.  ])
    """
    if mask is None:
        mask = getattr(robot, "measured_mask", None)
    robot = as_calibrated(robot)
    n = robot.model.n
    commanded = np.atleast_2d(as_vector(q, n, "q")).reshape(-1, n)
    requested = as_mask(mask)
    if not len(commanded):
        raise InvalidValueError("q: expected one configuration or more, got none.")
    wanted = dgm(robot.nominal, commanded)
    if length is None:
        away = np.linalg.norm(wanted[:, :3, 3] - robot.nominal.base[:3, 3], axis=1)
        length = float(away.mean()) or 1.0
    length = above_zero(length, "length")
    weight = np.where(requested, np.repeat([1.0, length], 3), 0.0)
    revolute = robot.model.table.sigma[robot.model.table.joint_rows] == REVOLUTE
    unit = np.where(revolute, 1.0, length)

    def errors(offset: Array) -> Array:
        return pose_errors(calibrated_pose(robot, commanded + unit * offset), wanted)

    close = {"xtol": _CLOSE, "ftol": _CLOSE, "gtol": _CLOSE}
    fit = least_squares(lambda x: (weight * errors(x)).ravel(), np.zeros(n), "3-point", **close)
    rank = np.linalg.matrix_rank(fit.jac, rtol=_RANK_TOLERANCE)
    before, after = errors(np.zeros(n)), errors(fit.x)
    return JointOffsets(unit * fit.x, int(rank), before, after)


def pose_offsets(
    robot: CalibratedRobot | CalibrationResult,
    T: ArrayLike,
    q_ref: ArrayLike | None = None,
    mask: ArrayLike | None = None,
    mask_axes: str = "world",
    limits: bool = False,
    lock: Mapping[int | str, float] | None = None,
) -> PoseOffsets:
    """False targets for a controller that solves the nominal inverse model.

    The controller finds the joint values of ``command`` with its nominal model; at those readings
    the real tool is at ``T``. Exact for six joints, posture by posture; with fewer or more joints
    the controller must resolve its choice as it does for the nominal robot.

    Parameters
    ----------
    robot
        See `robotmodels.calibration`.
    T : array_like, shape (..., 4, 4)
        World poses that the tool shall reach, metres.
    q_ref, mask, mask_axes, limits, lock
        As for `corrected_igm`.

    Returns
    -------
    PoseOffsets
        Commands, one for each posture.

    Examples
    --------
    >>> from robotmodels.calibration import calibrated_model, candidate_parameters
    >>> from robotmodels.igm import igm
    >>> from robotmodels.robots import load
    >>> parameters = candidate_parameters(load("rx90"))
    >>> xi = 1e-3 * np.random.default_rng(0).normal(size=len(parameters))
    >>> robot, q = calibrated_model(parameters, xi), np.array([0.1, 0.2, 1.3, 0.4, 0.5, 0.6])
    >>> T = dgm(robot.nominal, q)
    >>> command = pose_offsets(robot, T, q).command[0]
    >>> reached = calibrated_pose(robot, igm(robot.nominal, command).nearest(q))
    >>> bool(np.abs(reached - T).max() < 1e-12)
    True
    """
    robot = as_calibrated(robot)
    solutions = corrected_igm(robot, T, q_ref, mask, mask_axes, limits, lock)
    command = np.full((*solutions.valid.shape, 4, 4), np.nan)
    command[solutions.valid] = dgm(robot.nominal, solutions.q[solutions.valid])
    return PoseOffsets(solutions, command)


def _rms(rows: Array) -> float:
    """Root mean square of the lengths of rows."""
    return float(np.sqrt(np.mean(np.sum(rows**2, axis=-1)))) if len(rows) else 0.0
