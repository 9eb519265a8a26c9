"""Targets, errors and Newton's steps of a robot whose links bend, in the readings of its joints."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from math import pi
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from ..geometry import REVOLUTE
from ..igm.solutions import IGMSolutions
from ..kinematics import dgm
from .robot import (
    CalibratedRobot,
    calibrated_pose,
    missing_of_pose,
    missing_slope,
    reading_jacobian,
)

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


STEPS = 15
ROUNDS = 12  # of bringing the readings of held joints to their values
BENT_ROUNDS = 12  # of moving targets back by what bends
SETTLING = 0.3  # of an error that a round leaves: if more, exact slopes are quicker
BENT_ROUNDED = 1e-14  # error that is rounding

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
        rows, flags = np.empty((N, 0, n)), np.zeros((N, 0), np.bool_)
        loose = np.zeros((N, 0, n), np.bool_)
        return Postures(rows, rows, flags, rows[..., 0], rows[..., 0], flags, loose, loose)

    @property
    def readable(self) -> Flags:
        """Whether readings lead there, shape (N, C)."""
        return np.asarray(np.isfinite(self.reading).all(axis=-1), np.bool_)

    def spread(
        self, chosen: NDArray[np.int64], N: int, own: IGMSolutions | None = None
    ) -> Postures:
        """The same among N poses, with what `igm` says of them."""

        def put(values: NDArray[Any]) -> NDArray[Any]:
            all_rows = np.zeros((N, *values.shape[1:]), values.dtype)
            all_rows[chosen] = values
            return all_rows

        told = (self.double, self.free, self.family)
        if own is not None:
            told = (own.double, own.free_joints, own.family_joints)
        return Postures(*map(
            put, (self.q, self.reading, self.met, self.residual, self.least, *told)
        ))  # fmt: skip

    def and_also(self, more: Postures) -> Postures:
        """Both, the others behind."""
        return Postures(*(
            np.concatenate([getattr(self, f.name), getattr(more, f.name)], axis=1)
            for f in fields(Postures)
        ))  # fmt: skip


class Home:
    """Newton refinement of postures for one robot and task."""

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
        links = np.linalg.norm(model.chain.position[tool.path[1:] - 1], axis=-1).sum()
        self.length = float(links + np.linalg.norm(tool.position)) or 1.0
        self.turns: Flags = np.asarray(
            model.table.sigma[model.table.joint_rows] == REVOLUTE, np.bool_
        )
        self.unit = np.where(on_path, np.where(self.turns, 1.0, self.length), 0.0)
        self.locked = np.zeros(model.n, np.bool_)
        self.locked[locked] = True
        self.robot, self.errors = robot, robot.joint_errors
        self.mask, self.in_tool_axes, self.tolerance = mask, in_tool_axes, tolerance
        self.is_redundant = int((on_path & ~self.locked).sum()) > int(mask.sum())
        self._arm = (model.chain, *tool.kernel_arguments)

    def bring(
        self, targets: Array, starts: Array, there: Flags, held: Flags, wanted: Array
    ) -> Postures:
        """Refine candidates by Newton's method until they meet their poses.

        Shapes: targets (N, 4, 4); starts, held, wanted (N, C, n); there (N, C).
        """
        axes = self.axes_of(targets)
        found = self._rigid(targets, axes, starts, there, held, wanted)
        if self.robot.bending.is_zero or not there.any():
            return found
        return self._bent(targets, axes, found, there, held, wanted)

    def axes_of(self, targets: Array) -> Array:
        """Axes of the components, shape (N, 3, 3)."""
        if self.in_tool_axes:
            return np.ascontiguousarray(targets[:, :3, :3])
        return np.broadcast_to(np.eye(3), (len(targets), 3, 3)).copy()

    def task(self, targets: Array, held: Flags) -> Task:
        """What is asked of M postures: ``targets (M, 4, 4)``, ``held (M, n)``."""
        return Task(
            self.robot, targets, self.axes_of(targets), self.mask, held, self.unit, self.length
        )

    def aimed(self, targets: Array, tried: Postures, rows: NDArray[np.int64]) -> Array:
        """Targets for the inverse model of the table without bending.

        Shapes: targets (M, 4, 4), rows (M,) -> (M, 4, 4).
        """
        if self.robot.bending.is_zero or not tried.met.shape[1]:
            return targets
        residual = np.where(tried.readable, tried.residual, np.inf)[rows]
        best = residual.argmin(axis=1)
        some = np.flatnonzero(np.isfinite(residual.min(axis=1)))
        aims = targets.copy()
        reading = tried.reading[rows[some], best[some]]
        aims[some] = moved_back(self.robot, targets[some], reading)
        return aims

    def settled(
        self, targets: Array, reading: Array, residual: Array, rows: Flags, held: Flags
    ) -> tuple[Array, Array]:
        """Refine postures again after a small change of readings under bending.

        Shapes: targets (N, 4, 4); reading, held (N, C, n); residual, rows (N, C) -> reading
        (N, C, n), residual (N, C).
        """
        pose, candidate = np.nonzero(rows)
        task = self.task(targets[pose], held[pose, candidate])
        there = reading[pose, candidate]
        size = sizes(reading_errors(task, there), self.mask)
        left = np.flatnonzero(size > np.maximum(10.0 * residual[pose, candidate], BENT_ROUNDED))
        if left.size:
            some = task.at(left)
            there[left] = settled_readings(some, there[left])
            size[left] = sizes(reading_errors(some, there[left]), self.mask)
        reading, residual = reading.copy(), residual.copy()
        reading[pose, candidate], residual[pose, candidate] = there, size
        return reading, residual

    def _rigid(
        self, targets: Array, axes: Array, starts: Array, there: Flags, held: Flags, wanted: Array
    ) -> Postures:
        """With nothing bent."""
        q = np.array(starts, np.float64, order="C")
        there, held = np.ascontiguousarray(there), np.ascontiguousarray(held)
        q[~there] = 0.0
        residual, least = self._steps(targets, axes, q, there, held, STEPS)
        turns = self.turns
        q[..., turns] = wrapped(q[..., turns])
        reading = q.copy()
        if not self.errors.is_zero and q.size:
            wanted = np.where(there[..., None], wanted, 0.0)
            for _ in range(ROUNDS):
                reading = self.errors.reading(q)
                if not held.any():
                    break
                off = np.where(held & there[..., None], wanted - reading, 0.0)
                off[..., turns] = wrapped(off[..., turns])
                rows = np.asarray((np.abs(off) > 1e-15 * (1.0 + np.abs(wanted))).any(axis=-1))
                rows &= np.isfinite(reading).all(axis=-1)
                if not rows.any():
                    break
                q[rows] += off[rows]
                some, value = self._steps(targets, axes, q, rows, held, STEPS)
                residual[rows], least[rows] = some[rows], value[rows]
                q[..., turns] = wrapped(q[..., turns])
            known = there & np.isfinite(reading).all(axis=-1)
            # what the readings lead to is what counts
            actual = q.copy()
            actual[known] = self.errors.actual(reading[known])
            residual[known] = self._steps(targets, axes, actual, known, held, 0)[0][known]
            off = np.where(held & known[..., None], wanted - reading, 0.0)
            off[..., turns] = wrapped(off[..., turns])
            residual[~(np.abs(off) <= 1e-12).all(axis=-1)] = np.inf
        flags = np.zeros(there.shape, np.bool_)
        loose = np.zeros(held.shape, np.bool_)
        met = there & (residual <= self.tolerance)
        return Postures(q, reading, met, residual, least, flags, loose, loose)

    def _bent(
        self, targets: Array, axes: Array, found: Postures, there: Flags, held: Flags, wanted: Array
    ) -> Postures:
        """Fixed-point iteration of targets moved back by the bending at the posture.

        Where it does not converge, near singular postures, Newton's method takes over.
        """
        pose, candidate = np.nonzero(there & found.readable)
        goals, held, wanted = targets[pose], held[pose, candidate], wanted[pose, candidate]
        axes, held_one = axes[pose], held[:, None]
        q, reading = found.q[pose, candidate], found.reading[pose, candidate]
        task = self.task(goals, held)
        residual = sizes(reading_errors(task, reading), self.mask)
        going = np.arange(len(pose))
        for _ in range(BENT_ROUNDS):
            if not going.size:
                break
            moved = moved_back(self.robot, goals[going], reading[going])
            some = self._rigid(
                moved, axes[going], q[going, None], np.ones((going.size, 1), np.bool_),
                held_one[going], wanted[going, None],
            )  # fmt: skip
            # a posture that does not arrive leads on all the same, but without readings none does
            led = some.readable[:, 0] & np.isfinite(some.residual[:, 0])
            going, there_q, there_r = going[led], some.q[led, 0], some.reading[led, 0]
            now = sizes(reading_errors(task.at(going), there_r), self.mask)
            better = now < residual[going]
            settles = better & (now < SETTLING * residual[going]) & (now > BENT_ROUNDED)
            at = going[better]
            q[at], reading[at], residual[at] = there_q[better], there_r[better], now[better]
            going = going[settles]
        left = np.flatnonzero(residual > min(self.tolerance, 1e-12))
        if left.size:
            there_r = settled_readings(task.at(left), reading[left])
            now = sizes(reading_errors(task.at(left), there_r), self.mask)
            better = now < residual[left]
            at = left[better]
            reading[at], residual[at] = there_r[better], now[better]
            q[at] = self.errors.actual(reading[at])
        off = np.where(held, wanted - reading, 0.0)
        off[:, self.turns] = wrapped(off[:, self.turns])
        residual[(np.abs(off) > 1e-12).any(axis=-1)] = np.inf
        at = (pose, candidate)
        every_q, every_reading = found.q.copy(), found.reading.copy()
        every_residual, least = found.residual.copy(), found.least
        every_q[at], every_reading[at], every_residual[at] = q, reading, residual
        met = there & (every_residual <= self.tolerance)
        return Postures(every_q, every_reading, met, every_residual, least, found.double,
                        found.free, found.family)  # fmt: skip

    def _steps(
        self, targets: Array, axes: Array, q: Array, there: Flags, held: Flags, most: int
    ) -> tuple[Array, Array]:
        from ..igm._homing import brought_home

        residual, least = np.empty(there.shape), np.empty(there.shape)
        brought_home(
            targets, axes, q, there, held, *self._arm, self.mask.astype(np.int64), self.unit,
            self.length, most, residual, least,
        )  # fmt: skip
        return residual, least


def wrapped(angle: Array) -> Array:
    """Angles into (-pi, pi], those inside to the last digit as they are."""
    if not ((angle > pi) | (angle <= -pi)).any():
        return angle
    inside = np.abs(angle) <= pi
    return np.where(inside & (angle > -pi), angle, pi - np.mod(pi - angle, 2.0 * pi))
