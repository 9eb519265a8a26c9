"""Targets, errors and Newton's steps of a robot whose links bend, in the readings of its joints."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array
from ...kinematics import dgm
from ..calibrated_robot.calibrated import CalibratedRobot
from ..calibrated_robot.calibrated_pose import calibrated_pose
from ..calibrated_robot.reading_jacobian import missing_of_pose, missing_slope, reading_jacobian

NEWTON_STEPS = 20
LONGEST = 0.5  # step of a joint [rad, or the length of the arm]
DEPENDENT = 1e-10  # singular values beside the largest that count as zero
ROUNDED = 1e-15

Flags = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Task:
    """Targets, mask and held joints of M postures of a calibrated robot.

    Shapes: targets (M, 4, 4), axes (M, 3, 3), mask (6,), held (M, n), unit (n,).
    """

    robot: CalibratedRobot
    targets: Array
    axes: Array
    mask: Flags
    held: Flags
    unit: Array
    length: float

    def at(self, rows: NDArray[np.int64]) -> Task:
        """Of some of the postures."""
        return replace(self, targets=self.targets[rows], axes=self.axes[rows], held=self.held[rows])


def reading_errors(task: Task, reading: Array) -> Array:
    """What is missing at readings (M, n): shape (M, 6), in the axes, zero where not asked."""
    missing = missing_of_pose(calibrated_pose(task.robot, reading), task.targets)
    return _in_axes(task.axes, missing[..., None])[..., 0] * task.mask


def sizes(errors: Array, mask: Flags) -> Array:
    """The larger of the missing translation (m) and rotation (rad), of errors (M, 6)."""
    errors = errors * mask
    return np.asarray(np.linalg.norm(errors.reshape(-1, 2, 3), axis=-1).max(axis=-1), np.float64)


def moved_back(robot: CalibratedRobot, targets: Array, reading: Array) -> Array:
    """Targets at which the table without bending has the errors of the bent robot.

    Shapes: targets (M, 4, 4), reading (M, n) -> (M, 4, 4).
    """
    rigid = dgm(robot.model, robot.joint_errors.actual(reading))
    bent = calibrated_pose(robot, reading)
    moved = np.zeros_like(rigid)
    moved[:, 3, 3] = 1.0
    moved[:, :3, 3] = targets[:, :3, 3] + rigid[:, :3, 3] - bent[:, :3, 3]
    turn = bent[:, :3, :3].swapaxes(1, 2) @ rigid[:, :3, :3]
    moved[:, :3, :3] = targets[:, :3, :3] @ turn
    return moved


def settled_readings(task: Task, reading: Array) -> Array:
    """Newton's method in the readings, with exact derivatives of joint errors and bending.

    Shapes: reading (M, n) -> (M, n).
    """
    best = reading.copy()
    error = sizes(reading_errors(task, best), task.mask)
    going = np.arange(len(best))
    for _ in range(NEWTON_STEPS):
        going = going[error[going] > ROUNDED]
        if not going.size:
            break
        part = task.at(going)
        step = _step(part, best[going])
        scale = np.ones(len(going))
        open_ = np.ones(len(going), np.bool_)
        for _ in range(6):
            trial = best[going] + scale[:, None] * step
            size = sizes(reading_errors(part, trial), task.mask)
            better = open_ & (size < error[going])
            best[going[better]], error[going[better]] = trial[better], size[better]
            open_ &= ~better
            if not open_.any():
                break
            scale[open_] *= 0.5
        going = going[~open_]
    return best


def _step(task: Task, reading: Array) -> Array:
    T = calibrated_pose(task.robot, reading)
    missing = missing_of_pose(T, task.targets)
    A = _in_axes(task.axes, missing_slope(reading_jacobian(task.robot, reading), missing[:, 3:]))
    e = _in_axes(task.axes, missing[..., None])
    weight = np.repeat([1.0 / task.length, 1.0], 3)[:, None]
    free = np.where(task.held, 0.0, task.unit)
    A, e = (weight * A)[:, task.mask] * free[:, None, :], (weight * e)[:, task.mask]
    step = (np.linalg.pinv(A, DEPENDENT) @ e)[..., 0]
    largest = np.abs(step).max(axis=-1, initial=0.0)
    step *= np.minimum(1.0, LONGEST / np.maximum(largest, LONGEST))[:, None]
    return np.asarray(step * free, np.float64)


def _in_axes(axes: Array, columns: Array) -> Array:
    """Both halves of columns (M, 6, k) along axes (M, 3, 3)."""
    turned = axes.swapaxes(1, 2)
    return np.concatenate([turned @ columns[:, :3], turned @ columns[:, 3:]], axis=1)
