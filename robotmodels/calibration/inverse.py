"""Inverse model of a calibrated robot: solutions of its table, refined in the joint readings."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from math import pi
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import se3
from .._arrays import Array, as_mask, as_vector, batch_rows
from ..geometry import REVOLUTE
from ..igm import igm
from ..igm.request import above_zero, locks_of
from ..igm.solutions import IGMSolutions, posture_distance
from ..igm.status import IGMStatus
from ..kinematics import dgm
from ..se3.orientation import rotation_vectors_of
from .measurements.motions import inverse_left_jacobians
from .robot import CalibratedRobot, as_calibrated, calibrated_pose, reading_jacobian

STEPS, HALVINGS = 20, 6
LONGEST = 0.5  # step of a joint [rad, or the length of the arm]
SINGULAR = 1e-7  # singular value below which the pseudo-inverse replaces the inverse
ROUNDED = 1e-14  # pose error that is rounding
MERGE = 1e-6  # solutions closer than this are one [rad, m], as in `igm`
_RANK_TOLERANCE = 1e-10  # singular values beside the largest that count as zero

Flags = NDArray[np.bool_]


def corrected_igm(
    robot: CalibratedRobot,
    T: ArrayLike,
    q_ref: ArrayLike | None = None,
    mask: ArrayLike | None = None,
    mask_axes: str = "world",
    limits: bool = False,
    lock: Mapping[int | str, float] | None = None,
    tolerance: float = 1e-12,
) -> IGMSolutions:
    """Inverse geometric model of a calibrated robot: the readings of its joints.

    `igm` of the calibrated table gives the solutions; Newton's method refines each in the readings,
    where gains, eccentricity, compliance of the joints and bending of the links act. At the edge of
    its reach a robot that bends may have solutions that its rigid table does not lead to.

    Parameters
    ----------
    robot : CalibratedRobot
        The robot, n joints.
    T : array_like, shape (..., 4, 4)
        World poses of the tool, metres.
    q_ref : array_like, shape (..., n), optional
        Reference readings, rad or m: order of the solutions, and the choice of redundant arms.
    mask : array_like, shape (6,), optional
        Components ``x y z rx ry rz`` requested, see `igm`.
    mask_axes : {"world", "tool"}
        Axes of the components.
    limits : bool
        Whether readings must lie within the joint limits, whole turns of the joints added.
    lock : mapping, optional
        Joints (column of q, from 0, or name) that keep a reading, rad or m.
    tolerance : float
        Largest pose error of a solution, metres and radians.

    Returns
    -------
    IGMSolutions
        ``q (..., S, n)`` are readings, ``residual`` is that of the calibrated robot at them.

    Raises
    ------
    ShapeError, InvalidValueError, NotARotationError
        As `igm`.

    Notes
    -----
    The free joints of a redundant arm keep the readings of ``q_ref``.

    References
    ----------
    Seed book section 1.4.6.

    Examples
    --------
    >>> from robotmodels.calibration import calibrated_model, candidate_parameters
    >>> from robotmodels.robots import load
    >>> parameters = candidate_parameters(load("rx90"), gains=True)
    >>> xi = 1e-3 * np.random.default_rng(0).normal(size=len(parameters))
    >>> robot, q = calibrated_model(parameters, xi), [0.1, 0.2, 1.3, 0.4, 0.5, 0.6]
    >>> found = corrected_igm(robot, calibrated_pose(robot, q))
    >>> int(found.count), bool(found.residual.max() < 1e-12)
    (8, True)
    >>> found.nearest(q).round(9)
    array([0.1, 0.2, 1.3, 0.4, 0.5, 0.6])
    """
    robot = as_calibrated(robot)
    model, n = robot.model, robot.model.n
    tolerance = above_zero(tolerance, "tolerance")
    requested, locks = as_mask(mask), dict(locks_of(model, lock))
    poses = se3.as_pose(T)
    reference = np.zeros(n) if q_ref is None else as_vector(q_ref, n, "q_ref")
    flat = poses.reshape(*poses.shape[:-2], 16)
    batch, (rows, references) = batch_rows((flat, reference), ("T", "q_ref"))
    targets = np.ascontiguousarray(rows.reshape(-1, 4, 4))
    options: dict[str, Any] = {
        "q_ref": None if q_ref is None else robot.joint_errors.actual(references),
        "mask": None if requested.all() else requested,
        "mask_axes": mask_axes,
        "lock": locks or None,
        "position_tolerance": max(1e-9, tolerance),
        "orientation_tolerance": max(1e-9, tolerance),
    }
    found = igm(model, targets, **options)
    if robot.bent_rows and len(targets):
        # at the edge of reach, bending decides whether there is a solution
        found = igm(model, _unbent(robot, targets, found, references), **options)
    newton = _Newton(robot, requested, mask_axes == "tool", list(locks))
    reading, residual = newton.readings(targets, found, references, q_ref is not None, limits)
    kept = found.valid & (residual <= tolerance)
    kept &= ~_repeated(reading, kept, newton.turns)
    return _arranged(
        found, newton, (reading, residual, kept), references, q_ref is not None, limits, batch
    )


def _unbent(
    robot: CalibratedRobot, targets: Array, found: IGMSolutions, references: Array
) -> Array:
    """Poses (N, 4, 4) of the rigid arm that its bending at the first solution takes to the targets.

    At the references where there is no solution.
    """
    q = robot.joint_errors.actual(references)
    if found.q.shape[1]:
        q = np.where(found.valid[:, :1], found.q[:, 0], q)
    reading = robot.joint_errors.reading(q)
    reading = np.where(np.isfinite(reading), reading, references)
    return dgm(robot.model, q) @ se3.inverse(calibrated_pose(robot, reading)) @ targets


def _repeated(q: Array, kept: Flags, turns: Flags) -> Flags:
    """Solutions that are an earlier one of the same pose. Shapes: q (N, S, n), kept (N, S)."""
    same = kept[:, :, None] & kept[:, None] & np.tri(kept.shape[1], k=-1, dtype=np.bool_)
    for joint, turn in enumerate(turns):
        distance = np.abs(q[:, :, None, joint] - q[:, None, :, joint])
        same &= (np.minimum(distance, np.abs(2.0 * pi - distance)) if turn else distance) < MERGE
    return np.asarray(same.any(axis=-1))


def _arranged(
    found: IGMSolutions,
    newton: _Newton,
    rows: tuple[Array, Array, Flags],
    references: Array,
    given: bool,
    limits: bool,
    batch: tuple[int, ...],
) -> IGMSolutions:
    """The kept rows in order: by their distance to the reference if one is given."""
    model, (reading, residual, kept) = newton.robot.model, rows
    inside = ((reading >= model.lower) & (reading <= model.upper)).all(axis=-1)
    chosen = kept & (inside | (not limits))
    periodic = newton.turns & (not limits)
    key = np.broadcast_to(np.arange(float(kept.shape[1])), kept.shape)
    if given:
        key = posture_distance(reading, references[:, None], periodic)
    order = np.argsort(np.where(chosen, key, np.inf), axis=1, kind="stable")
    order = order[:, : int(chosen.sum(axis=1).max(initial=0))]
    there = np.take_along_axis(chosen, order, axis=1)

    def packed(values: NDArray[Any], empty: Any) -> NDArray[Any]:
        places = order if values.ndim == 2 else order[..., None]
        out = np.take_along_axis(values, places, axis=1)
        out[~there] = empty
        return shaped(out)

    def shaped(values: NDArray[Any]) -> NDArray[Any]:
        return values.reshape((*batch, *values.shape[1:]))

    solved = chosen.any(axis=1)
    status = np.where(found.count > 0, int(IGMStatus.NOT_CONVERGED), found.status)
    status = np.where(kept.any(axis=1), int(IGMStatus.OUTSIDE_LIMITS), status)
    status = np.where(solved, found.status, status).astype(np.int8)
    unsolved: dict[str, Array | None] = {"closest": found.closest, "missing": found.missing}
    for name, values in unsolved.items():
        if values is not None:
            unsolved[name] = shaped(np.where(solved.reshape(-1, 1), np.nan, values))
    return IGMSolutions(
        q=packed(reading, np.nan),
        valid=shaped(there),
        residual=packed(residual, np.nan),
        within_limits=packed(inside & chosen, False),
        code=packed(found.code, -1),
        labels=found.labels,
        status=shaped(status),
        double=packed(found.double, False),
        free_joints=packed(found.free_joints, False),
        family_joints=packed(found.family_joints, False),
        method=f"{found.method}; of the calibrated table, refined in the readings",
        periodic=periodic,
        mask=newton.mask,
        **unsolved,
    )


class _Newton:
    """Newton refinement of readings for one robot and request (mask, axes, locked joints)."""

    def __init__(
        self, robot: CalibratedRobot, mask: Flags, in_tool_axes: bool, locked: list[int]
    ) -> None:
        model = robot.model
        tool = model.twin.frame(None)
        joints = model.chain.joint[tool.path - 1]
        on_path = np.zeros(model.n, np.bool_)
        on_path[joints[joints >= 0]] = True
        lengths = np.linalg.norm(model.chain.position[tool.path[1:] - 1], axis=-1).sum()
        self.length = float(lengths + np.linalg.norm(tool.position)) or 1.0
        self.turns: Flags = np.asarray(model.table.sigma[model.table.joint_rows] == REVOLUTE)
        self.unit = np.where(on_path, np.where(self.turns, 1.0, self.length), 0.0)
        self.locked = np.isin(np.arange(model.n), locked)
        self.robot, self.mask, self.in_tool_axes = robot, mask, in_tool_axes
        self.is_redundant = int((on_path & ~self.locked).sum()) > int(mask.sum())

    def readings(
        self, targets: Array, found: IGMSolutions, references: Array, given: bool, limits: bool
    ) -> tuple[Array, Array]:
        """Readings (N, S, n) of solutions, and their pose errors (N, S), infinite without one."""
        errors, held = self.robot.joint_errors, self.locked | found.free_joints & self.is_redundant
        q = np.where(found.valid[..., None], found.q, 0.0)
        reading = q if errors.is_zero or not q.size else errors.reading(q)
        there = found.valid & np.isfinite(reading).all(axis=-1)
        reading = np.where(there[..., None], reading, 0.0)
        fixed = held & there[..., None]
        off = np.where(fixed, references[:, None] - reading, 0.0)
        off[..., self.turns] -= 2.0 * pi * np.round(off[..., self.turns] / (2.0 * pi))
        reading, residual = self.refined(targets, reading + off, there, fixed)
        aim = references[:, None] if given else None
        turned = self._turned(reading, aim, limits)
        moved = there & (turned != reading).any(axis=-1)
        again, after = self.refined(targets, turned, moved, fixed)
        return again, np.where(moved, after, residual)

    def _turned(self, reading: Array, aim: Array | None, limits: bool) -> Array:
        """Readings with whole turns added: in (-pi, pi], or with limits inside them if possible.

        With limits nearest to the aim (N, 1, n), without one to mid-range.
        """
        low, high = np.full(len(self.turns), -pi), np.full(len(self.turns), pi)
        goal: Any = np.zeros(len(self.turns))
        if limits:
            low, high = self.robot.model.lower, self.robot.model.upper
            both = np.isfinite(low) & np.isfinite(high)
            goal = np.where(both, 0.5 * (low + high), 0.0) if aim is None else aim
            goal = np.where(np.isfinite(goal), goal, 0.0)
        step = np.round((goal - reading) / (2.0 * pi))
        least = np.ceil((low - reading) / (2.0 * pi) - 1e-15)
        most = np.floor((high - reading) / (2.0 * pi) + 1e-15)
        step = np.where(least <= most, np.clip(step, least, most), 0.0) * self.turns
        # a whole turn of the joint, not of its reading
        errors, turned = self.robot.joint_errors, reading + 2.0 * pi * step
        if errors.is_zero or not step.any():
            return turned
        known = errors.reading(errors.actual(reading) + 2.0 * pi * step)
        return np.where(np.isfinite(known) & (step != 0).any(axis=-1, keepdims=True), known, turned)

    def refined(
        self, targets: Array, reading: Array, rows: Flags, held: Flags
    ) -> tuple[Array, Array]:
        """Readings and pose errors after Newton's method in some rows.

        Shapes: reading, held (N, S, n); rows (N, S) -> (N, S, n), (N, S).
        """
        pose, solution = np.nonzero(rows)
        goals, fixed, q = targets[pose], held[pose, solution], reading[pose, solution]
        size = self._sizes(goals, q)
        going = np.flatnonzero(size > ROUNDED)
        for _ in range(STEPS):
            if not going.size:
                break
            step, better_rows = self._step(goals[going], q[going], fixed[going]), []
            for _ in range(HALVINGS):
                trial = q[going] + step
                after = self._sizes(goals[going], trial)
                better = after < size[going]
                q[going[better]], size[going[better]] = trial[better], after[better]
                better_rows.append(going[better])
                going, step = going[~better], 0.5 * step[~better]
                if not going.size:
                    break
            going = np.concatenate(better_rows)
            going = going[size[going] > ROUNDED]
        out, error = reading.copy(), np.full(rows.shape, np.inf)
        out[pose, solution], error[pose, solution] = q, size
        return out, error

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

    def _step(self, targets: Array, reading: Array, held: Flags) -> Array:
        """Newton steps of readings (M, n), the shortest."""
        errors = pose_errors(calibrated_pose(self.robot, reading), targets)
        slope = pose_error_slope(reading_jacobian(self.robot, reading), errors[:, 3:])
        weight = np.repeat([1.0 / self.length, 1.0], 3)[:, None]
        free = np.where(held, 0.0, self.unit)
        A = (weight * self._in_axes(targets, slope))[:, self.mask] * free[:, None, :]
        e = (weight * self._in_axes(targets, errors[..., None]))[:, self.mask]
        step = (_inverses(A) @ e)[..., 0]
        largest = np.abs(step).max(axis=-1, initial=0.0)
        step *= np.minimum(1.0, LONGEST / np.maximum(largest, LONGEST))[:, None]
        return step * free


def _inverses(A: Array) -> Array:
    """Inverses of regular square matrices, pseudo-inverses of all others, (M, m, n)."""
    if A.shape[1] == A.shape[2]:
        with suppress(np.linalg.LinAlgError):  # one of them is singular to the last digit
            inverse = np.asarray(np.linalg.inv(A), np.float64)
            rows = np.flatnonzero(~(np.linalg.norm(inverse, axis=(1, 2)) < 1.0 / SINGULAR))
            inverse[rows] = np.linalg.pinv(A[rows], _RANK_TOLERANCE)
            return inverse
    return np.asarray(np.linalg.pinv(A, _RANK_TOLERANCE), np.float64)


def pose_errors(T: Array, wanted: Array) -> Array:
    """Translation (m) and rotation vector (rad) from poses to the wanted ones, (N, 6), world."""
    turn = wanted[:, :3, :3] @ T[:, :3, :3].swapaxes(-1, -2)
    return np.concatenate([wanted[:, :3, 3] - T[:, :3, 3], rotation_vectors_of(turn)], axis=1)


def pose_error_slope(J: Array, phi: Array) -> Array:
    """Minus the derivative of `pose_errors` at rotation errors phi (N, 3): (N, 6, n)."""
    return np.concatenate([J[:, :3], inverse_left_jacobians(-phi) @ J[:, 3:]], axis=1)
