"""Newton refinement of postures of a calibrated robot: joint variables first, then readings."""

from __future__ import annotations

from dataclasses import dataclass, fields
from math import pi
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from ..geometry import REVOLUTE
from ..igm.solutions import IGMSolutions
from ..kinematics import dgm
from ..se3.orientation import rotation_vectors_of
from .measurements.motions import inverse_left_jacobians
from .robot import CalibratedRobot, calibrated_pose, reading_jacobian

STEPS = 15  # in the joint variables
READING_STEPS = 20
HALVINGS = 6
LONGEST = 0.5  # step of a joint [rad, or the length of the arm]
_RANK_TOLERANCE = 1e-10  # singular values beside the largest that count as zero
ROUNDED = 1e-14  # pose error that is rounding

Flags = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Postures:
    """Candidate postures of N poses with their readings and residuals.

    Shapes: q, reading, free, family (N, C, n); met, residual, least, double (N, C).
    """

    q: Array
    reading: Array
    met: Flags
    residual: Array
    least: Array
    double: Flags
    free: Flags
    family: Flags

    @staticmethod
    def none(N: int, n: int) -> Postures:
        """No candidates."""
        rows, flags = np.empty((N, 0, n)), np.zeros((N, 0, n), np.bool_)
        return Postures(
            rows, rows, flags[..., 0], rows[..., 0], rows[..., 0], flags[..., 0], flags, flags
        )

    @property
    def readable(self) -> Flags:
        """Whether readings lead there, shape (N, C)."""
        return np.asarray(np.isfinite(self.reading).all(axis=-1), np.bool_)

    def spread(self, rows: NDArray[np.int64], N: int, solutions: IGMSolutions) -> Postures:
        """The same as those of some of N poses, with the flags of the solutions refined."""

        def put(values: NDArray[Any]) -> NDArray[Any]:
            all_rows = np.zeros((N, *values.shape[1:]), values.dtype)
            all_rows[rows] = values
            return all_rows

        flags = (solutions.double, solutions.free_joints, solutions.family_joints)
        values = (self.q, self.reading, self.met, self.residual, self.least, *flags)
        return Postures(*map(put, values))

    def joined(self, more: Postures) -> Postures:
        """Both, the others behind."""
        parts = ((getattr(self, f.name), getattr(more, f.name)) for f in fields(Postures))
        return Postures(*(np.concatenate(pair, axis=1) for pair in parts))


class Refinement:
    """Newton refinement of postures for one robot and request (mask, axes, locked joints)."""

    def __init__(
        self,
        robot: CalibratedRobot,
        mask: Flags,
        in_tool_axes: bool,
        locked: list[int],
        tolerance: float,
    ) -> None:
        model = robot.model
        tool = model.twin.frame(None)
        joints = model.chain.joint[tool.path - 1]
        on_path = np.zeros(model.n, np.bool_)
        on_path[joints[joints >= 0]] = True
        lengths = np.linalg.norm(model.chain.position[tool.path[1:] - 1], axis=-1).sum()
        self.length = float(lengths + np.linalg.norm(tool.position)) or 1.0
        self.turns: Flags = np.asarray(
            model.table.sigma[model.table.joint_rows] == REVOLUTE, np.bool_
        )
        self.unit = np.where(on_path, np.where(self.turns, 1.0, self.length), 0.0)
        self.locked = np.zeros(model.n, np.bool_)
        self.locked[locked] = True
        self.robot, self.errors = robot, robot.joint_errors
        self.bends = bool(robot.bent_rows)
        self.mask, self.in_tool_axes, self.tolerance = mask, in_tool_axes, tolerance
        self.is_redundant = int((on_path & ~self.locked).sum()) > int(mask.sum())
        self._arm = (model.chain, *tool.kernel_arguments)

    def refine(
        self, targets: Array, starts: Array, present: Flags, held: Flags, wanted: Array
    ) -> Postures:
        """Newton refinement of candidates to their poses; held joints keep the readings ``wanted``.

        Shapes: targets (N, 4, 4); starts, held, wanted (N, C, n); present (N, C).
        """
        q = np.where(present[..., None], starts, 0.0)
        present, held = np.ascontiguousarray(present), np.ascontiguousarray(held)
        residual, least = self._steps(targets, q, present, held)
        q[..., self.turns] = wrapped(q[..., self.turns])
        reading = q.copy()
        if (self.bends or not self.errors.is_zero) and q.size:
            reading = self.errors.reading(q)
            off = np.where(held & present[..., None], wanted - reading, 0.0)
            off[..., self.turns] = wrapped(off[..., self.turns])
            reading += off
            rows = present & np.isfinite(reading).all(axis=-1)
            search = rows & (self.bends | held.any(axis=-1))
            reading, size = self.refined_readings(targets, reading, rows, held, search)
            residual = np.where(rows, size, residual)
            q[rows] = self.errors.actual(reading[rows])
        flags, loose = np.zeros(present.shape, np.bool_), np.zeros(held.shape, np.bool_)
        met = present & (residual <= self.tolerance)
        return Postures(q, reading, met, residual, least, flags, loose, loose)

    def refined_readings(
        self, targets: Array, reading: Array, rows: Flags, held: Flags, search: Flags
    ) -> tuple[Array, Array]:
        """Readings of some candidates after Newton steps of those searched, and all errors.

        Shapes: reading, held (N, C, n); rows, search (N, C) -> (N, C, n), (N, C).
        """
        pose, candidate = np.nonzero(rows)
        goals, fixed = targets[pose], held[pose, candidate]
        q, searched = reading[pose, candidate], search[pose, candidate]
        size = self._sizes(goals, q)
        for _ in range(READING_STEPS):
            going = np.flatnonzero(searched & (size > ROUNDED))
            if not going.size:
                break
            step = self._reading_step(goals[going], q[going], fixed[going])
            for _ in range(HALVINGS):
                trial = q[going] + step
                after = self._sizes(goals[going], trial)
                better = after < size[going]
                q[going[better]], size[going[better]] = trial[better], after[better]
                going, step = going[~better], 0.5 * step[~better]
                if not going.size:
                    break
            searched[going] = False
        every, sizes = reading.copy(), np.full(rows.shape, np.inf)
        every[pose, candidate], sizes[pose, candidate] = q, size
        return every, sizes

    def rigid_targets(self, targets: Array, tried: Postures, rows: NDArray[np.int64]) -> Array:
        """Targets at which the table without bending has the pose errors of the bent robot.

        Shapes: targets (M, 4, 4), rows (M,) of the best candidate tried -> (M, 4, 4).
        """
        if not self.bends or not tried.met.shape[1]:
            return targets
        residual = np.where(tried.readable, tried.residual, np.inf)[rows]
        some = np.flatnonzero(np.isfinite(residual.min(axis=1)))
        reading = tried.reading[rows[some], residual[some].argmin(axis=1)]
        rigid = dgm(self.robot.model, self.errors.actual(reading))
        bent = calibrated_pose(self.robot, reading)
        moved = targets.copy()
        moved[some, :3, 3] += rigid[:, :3, 3] - bent[:, :3, 3]
        turn = bent[:, :3, :3].swapaxes(1, 2) @ rigid[:, :3, :3]
        moved[some, :3, :3] = targets[some, :3, :3] @ turn
        return moved

    def _axes(self, targets: Array) -> Array:
        """Axes of the components, shape (N, 3, 3)."""
        if self.in_tool_axes:
            return np.ascontiguousarray(targets[:, :3, :3])
        return np.broadcast_to(np.eye(3), (len(targets), 3, 3)).copy()

    def _in_axes(self, targets: Array, columns: Array) -> Array:
        """Both halves of columns (M, 6, k) along the axes of the components."""
        if not self.in_tool_axes:
            return columns
        turned = targets[:, :3, :3].swapaxes(1, 2)
        return np.concatenate([turned @ columns[:, :3], turned @ columns[:, 3:]], axis=1)

    def _sizes(self, targets: Array, reading: Array) -> Array:
        """The larger of the missing translation (m) and rotation (rad), shape (M,)."""
        errors = pose_errors(calibrated_pose(self.robot, reading), targets)
        asked = self._in_axes(targets, errors[..., None])[..., 0] * self.mask
        return np.asarray(np.linalg.norm(asked.reshape(-1, 2, 3), axis=-1).max(axis=-1))

    def _reading_step(self, targets: Array, reading: Array, held: Flags) -> Array:
        """Newton step of readings (M, n): the shortest one that removes the pose error."""
        errors = pose_errors(calibrated_pose(self.robot, reading), targets)
        slope = pose_error_slope(reading_jacobian(self.robot, reading), errors[:, 3:])
        A = self._in_axes(targets, slope)
        e = self._in_axes(targets, errors[..., None])
        weight = np.repeat([1.0 / self.length, 1.0], 3)[:, None]
        free = np.where(held, 0.0, self.unit)
        A, e = (weight * A)[:, self.mask] * free[:, None, :], (weight * e)[:, self.mask]
        step = (np.linalg.pinv(A, _RANK_TOLERANCE) @ e)[..., 0]
        largest = np.abs(step).max(axis=-1, initial=0.0)
        step *= np.minimum(1.0, LONGEST / np.maximum(largest, LONGEST))[:, None]
        return np.asarray(step * free, np.float64)

    def _steps(self, targets: Array, q: Array, present: Flags, held: Flags) -> tuple[Array, Array]:
        """Newton steps of joint variables in place; residuals and least singular values."""
        from ..igm._homing import brought_home

        residual, least = np.empty(present.shape), np.empty(present.shape)
        brought_home(
            targets, self._axes(targets), q, present, held, *self._arm,
            self.mask.astype(np.int64), self.unit, self.length, STEPS, residual, least,
        )  # fmt: skip
        return residual, least


def pose_errors(T: Array, wanted: Array) -> Array:
    """Translation (m) and rotation vector (rad) from poses to the wanted ones, (N, 6), world."""
    turn = wanted[:, :3, :3] @ T[:, :3, :3].swapaxes(-1, -2)
    return np.concatenate([wanted[:, :3, 3] - T[:, :3, 3], rotation_vectors_of(turn)], axis=1)


def pose_error_slope(J: Array, phi: Array) -> Array:
    """Minus the derivative of `pose_errors` at rotation errors phi (N, 3): (N, 6, n)."""
    return np.concatenate([J[:, :3], inverse_left_jacobians(-phi) @ J[:, 3:]], axis=1)


def wrapped(angle: Array) -> Array:
    """Angles into (-pi, pi], those inside to the last digit as they are."""
    if not ((angle > pi) | (angle <= -pi)).any():
        return angle
    inside = np.abs(angle) <= pi
    return np.where(inside & (angle > -pi), angle, pi - np.mod(pi - angle, 2.0 * pi))
