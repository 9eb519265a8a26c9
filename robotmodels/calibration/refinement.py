"""Newton refinement of the readings of a calibrated robot's joints to given poses."""

from __future__ import annotations

from contextlib import suppress
from math import pi
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from ..geometry import REVOLUTE
from ..igm.solutions import IGMSolutions
from ..se3.orientation import rotation_vectors_of
from .measurements.motions import inverse_left_jacobians
from .robot import CalibratedRobot, calibrated_pose, reading_jacobian

STEPS = 20
HALVINGS = 6
LONGEST = 0.5  # step of a joint [rad, or the length of the arm]
_RANK_TOLERANCE = 1e-10  # singular values beside the largest that count as zero
SINGULAR = 1e-7  # singular value below which the pseudo-inverse replaces the inverse
ROUNDED = 1e-14  # pose error that is rounding

Flags = NDArray[np.bool_]


class Candidates(NamedTuple):
    """Candidate solutions of N poses after refinement, C of each.

    Shapes: q (joint variables), reading, free, family (N, C, n); the others (N, C).
    """

    q: Array
    reading: Array
    residual: Array
    least: Array
    readable: Flags
    double: Flags
    free: Flags
    family: Flags
    code: NDArray[np.int16]

    def with_some(self, rows: NDArray[np.int64], more: Candidates) -> Candidates:
        """These and more candidates of some of the poses."""

        def joined(values: NDArray[Any], others: NDArray[Any]) -> NDArray[Any]:
            spread = np.zeros((len(values), *others.shape[1:]), others.dtype)
            spread[rows] = others
            return np.concatenate([values, spread], axis=1)

        return Candidates(*map(joined, self, more))


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

    def held(self, solutions: IGMSolutions) -> Flags:
        """Joints that keep their readings: locked ones and free ones of redundant arms."""
        return np.asarray((solutions.free_joints & self.is_redundant) | self.locked)

    def met(self, found: Candidates) -> Flags:
        """Candidates that meet their pose, shape (N, C)."""
        return np.asarray(found.readable & (found.residual <= self.tolerance))

    def refine(
        self, targets: Array, solutions: IGMSolutions, q: Array, wanted: Array, code: NDArray[Any]
    ) -> Candidates:
        """Newton refinement from solutions at joint variables q; held joints read ``wanted``.

        Shapes: targets (N, 4, 4); q, wanted (N, C, n); code (N, C).
        """
        present, held = solutions.valid, self.held(solutions)
        reading = np.where(present[..., None], q, 0.0)
        if reading.size and not self.errors.is_zero:
            reading = self.errors.reading(reading)
        readable = present & np.isfinite(reading).all(axis=-1)
        reading[~readable] = 0.0
        off = np.where(held & readable[..., None], wanted - reading, 0.0)
        off[..., self.turns] = wrapped(off[..., self.turns])
        reading, residual, least = self.newton(targets, reading + off, readable, held)
        q = self.errors.actual(reading) if reading.size else reading.copy()
        q[..., self.turns] = wrapped(q[..., self.turns])
        free, family = solutions.free_joints, solutions.family_joints
        free, family = (np.asarray(flags & self.is_redundant) for flags in (free, family))
        return Candidates(
            q,
            reading,
            residual,
            least,
            readable,
            np.array(solutions.double),
            free,
            family,
            np.asarray(code, np.int16),
        )

    def newton(
        self, targets: Array, reading: Array, rows: Flags, held: Flags
    ) -> tuple[Array, Array, Array]:
        """Readings, pose errors and least singular values after Newton's method in some rows.

        Shapes: reading, held (N, C, n); rows (N, C) -> (N, C, n), (N, C), (N, C).
        """
        pose, candidate = np.nonzero(rows)
        goals, fixed, q = targets[pose], held[pose, candidate], reading[pose, candidate]
        size, least = self._sizes(goals, q), np.zeros(len(q))
        searched = np.ones(len(q), np.bool_)
        for _ in range(STEPS):
            going = np.flatnonzero(searched)
            if not going.size:
                break
            step, least[going] = self._step(goals[going], q[going], fixed[going])
            searched[going] = False
            rough = size[going] > ROUNDED
            going, step = going[rough], step[rough]
            for _ in range(HALVINGS):
                trial = q[going] + step
                after = self._sizes(goals[going], trial)
                better = after < size[going]
                q[going[better]], size[going[better]] = trial[better], after[better]
                searched[going[better]] = True
                going, step = going[~better], 0.5 * step[~better]
                if not going.size:
                    break
        every = reading.copy(), np.full(rows.shape, np.inf), np.zeros(rows.shape)
        for array, values in zip(every, (q, size, least), strict=True):
            array[pose, candidate] = values
        return every

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

    def _step(self, targets: Array, reading: Array, held: Flags) -> tuple[Array, Array]:
        """Newton steps of readings (M, n), the shortest; least singular values without units."""
        errors = pose_errors(calibrated_pose(self.robot, reading), targets)
        slope = pose_error_slope(reading_jacobian(self.robot, reading), errors[:, 3:])
        weight = np.repeat([1.0 / self.length, 1.0], 3)[:, None]
        free = np.where(held, 0.0, self.unit)
        A = (weight * self._in_axes(targets, slope))[:, self.mask] * free[:, None, :]
        e = (weight * self._in_axes(targets, errors[..., None]))[:, self.mask]
        inverse, least = _inverses(A)
        step = (inverse @ e)[..., 0]
        largest = np.abs(step).max(axis=-1, initial=0.0)
        step *= np.minimum(1.0, LONGEST / np.maximum(largest, LONGEST))[:, None]
        return step * free, least


def _inverses(A: Array) -> tuple[Array, Array]:
    """Inverses or pseudo-inverses of matrices, and least singular values up to a factor of 3."""
    inverse, least = None, np.zeros(len(A))
    if A.shape[1] == A.shape[2]:
        with suppress(np.linalg.LinAlgError):  # one of them is singular to the last digit
            inverse = np.asarray(np.linalg.inv(A), np.float64)
            least = np.asarray(1.0 / np.linalg.norm(inverse, axis=(1, 2)))
    if inverse is None:
        inverse = np.asarray(np.linalg.pinv(A, _RANK_TOLERANCE), np.float64)
        sizes = np.linalg.norm(inverse, axis=(1, 2))
        return inverse, np.asarray(1.0 / np.maximum(sizes, 1e-300))
    rows = np.flatnonzero(~(least > SINGULAR))
    inverse[rows] = np.linalg.pinv(A[rows], _RANK_TOLERANCE)
    return inverse, least


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
