"""Inverse model of a calibrated robot: solutions of its table, refined in the joint readings."""

from __future__ import annotations

from collections.abc import Mapping
from math import pi
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import se3
from .._arrays import Array, as_mask, as_vector, batch_rows
from ..geometry import REVOLUTE
from ..igm import igm
from ..igm.arrange import arranged, result_fields, turned_inside
from ..igm.postures import MERGE, Postures, difference
from ..igm.request import above_zero, locks_of
from ..igm.solutions import IGMSolutions, of_fields
from ..kinematics import dgm, jacobian
from ..kinematics.lengths import characteristic_length
from ..se3.orientation import rotation_vectors_of
from .robot import CalibratedRobot, as_calibrated, calibrated_pose

_STEPS = 30
_LONGEST = 0.5  # step of a joint [rad, or the length of the arm]
_ROUNDED = 1e-14  # pose error that is rounding
_RANK_TOLERANCE = 1e-10  # singular values beside the largest that count as zero


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

    `igm` of the calibrated table gives the solutions; the laws of the readings are inverted, and
    Newton's method takes account of links that bend and of locked joints. At the edge of its reach
    a robot that bends may have solutions that its rigid table does not lead to.

    Parameters
    ----------
    robot, mask, mask_axes, lock
        See `robotmodels.calibration`; locked joints keep a reading.
    T : array_like, shape (..., 4, 4)
        World poses of the tool, metres.
    q_ref : array_like, shape (..., n), optional
        Reference readings, rad or m: order of the solutions, and free joints of redundant arms.
    limits : bool
        Whether readings must lie within the joint limits, whole turns of the joints added.
    tolerance : float
        Largest pose error of a solution, metres and radians.

    Returns
    -------
    IGMSolutions
        ``q (..., S, n)`` are readings, ``residual`` is that of the calibrated robot at them.

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
    model, n, errors = robot.model, robot.model.n, robot.joint_errors
    tolerance = above_zero(tolerance, "tolerance")
    requested, locks = as_mask(mask), dict(locks_of(model, lock))
    poses, given = se3.as_pose(T), q_ref is not None
    reference = np.zeros(n) if q_ref is None else as_vector(q_ref, n, "q_ref").copy()
    reference[..., [*locks]] = [*locks.values()]
    flat = poses.reshape(*poses.shape[:-2], 16)
    batch, (rows, references) = batch_rows((flat, reference), ("T", "q_ref"))
    targets = np.ascontiguousarray(rows.reshape(-1, 4, 4))
    options: dict[str, Any] = {
        "q_ref": errors.actual(references) if given else None,
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
    sigma = model.table.sigma[model.table.joint_rows]
    turns = sigma == REVOLUTE
    joints = np.array([model.lower, model.upper, turns])
    q = np.where(found.valid[..., None], found.q, 0.0)
    low, high = (model.lower, model.upper) if limits else (np.full(n, -pi), np.full(n, pi))
    bounded = np.isfinite(low) & np.isfinite(high)
    middle = np.where(bounded, 0.5 * low, 0.0) + np.where(bounded, 0.5 * high, 0.0)
    goal = references[:, None] if given and limits else middle
    reading = errors.reading(q)
    whole = np.nan_to_num(np.round((turned_inside(reading, low, high, goal) - reading) / (2 * pi)))
    if whole.any():  # turns of the joints, not of their readings
        reading = errors.reading(q + 2.0 * pi * whole * turns)
    joint = model.chain.joint[model.twin.frame(None).path - 1]
    is_redundant = int((joint >= 0).sum()) - len(locks) > int(requested.sum())
    held = np.isin(np.arange(n), [*locks]) | (found.free_joints & is_redundant)
    off = references[:, None] - reading
    off -= 2.0 * pi * np.round(off / (2.0 * pi)) * turns
    reading = np.where(held, reading + off, reading)
    in_tool = mask_axes == "tool"
    pose, solution = np.nonzero(found.valid & np.isfinite(reading).all(axis=-1))
    residual = np.full(found.valid.shape, np.inf)
    refined = _refined(
        robot, targets[pose], reading[pose, solution], held[pose, solution], requested, in_tool
    )
    reading[pose, solution], residual[pose, solution] = refined
    kept = residual <= tolerance
    reading = np.where(kept[..., None], reading, 0.0)
    gap = np.abs(difference(sigma, reading[:, :, None], reading[:, None]))
    gap = gap.max(axis=-1, initial=0.0)
    kept &= ~((gap < MERGE) & kept[:, None] & np.tri(gap.shape[1], k=-1, dtype=bool)).any(axis=-1)
    postures = Postures(
        reading, kept, residual, found.double, found.free_joints, kept & False, found.family_joints
    )
    out = arranged(
        postures, found.code, found.labels, np.arange(n), references, given, joints, limits
    )
    none = found.count == 0
    missing = {
        name: None if values is None else np.where(none[:, None], values, np.nan)
        for name, values in (("closest", found.closest), ("missing", found.missing))
    }
    out = out._replace(status=np.where(none, found.status, out.status), **missing)
    method = f"{found.method}; of the calibrated table, refined in the readings"
    return of_fields(result_fields(batch, out, method, turns & (not limits), tuple(requested)))


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


def _refined(
    robot: CalibratedRobot,
    targets: Array,
    q: Array,
    held: NDArray[np.bool_],
    mask: NDArray[np.bool_],
    in_tool_axes: bool,
) -> tuple[Array, Array]:
    """Readings (M, n) after Newton steps while these lower the pose errors, and the errors (M,).

    Shapes: targets (M, 4, 4), q and held (M, n).
    """
    model = robot.model
    length = characteristic_length(model)
    axes = np.broadcast_to(np.eye(3), (len(q), 3, 3))
    if in_tool_axes:
        axes = targets[:, :3, :3].swapaxes(1, 2)
    unit = np.where(model.table.sigma[model.table.joint_rows] == REVOLUTE, 1.0, length)
    weight = np.repeat([1.0 / length, 1.0], 3)[:, None]

    def in_axes(rows: NDArray[np.int64], columns: Array) -> Array:
        parts = axes[rows] @ columns[:, :3], axes[rows] @ columns[:, 3:]
        return np.concatenate(parts, axis=1) * mask[:, None]

    def error_at(rows: NDArray[np.int64], q: Array) -> tuple[Array, Array]:
        e = in_axes(rows, pose_errors(calibrated_pose(robot, q), targets[rows])[..., None])
        return e, np.linalg.norm(e.reshape(-1, 2, 3), axis=-1).max(axis=-1)

    going = np.arange(len(q))
    e, size = error_at(going, q)
    for _ in range(_STEPS):
        at = size[going] > _ROUNDED
        going, e = going[at], e[at]
        if not going.size:
            break
        J = jacobian(model, robot.joint_errors.actual(q[going]))
        free = np.where(held[going], 0.0, unit)
        A = weight * in_axes(going, J) * free[:, None]
        step = (np.linalg.pinv(A, _RANK_TOLERANCE) @ (weight * e))[..., 0]
        longest = np.abs(step).max(axis=-1, initial=_LONGEST)
        trial = q[going] + free * step * (_LONGEST / longest)[:, None]
        e, after = error_at(going, trial)
        better = after < size[going]
        going, e = going[better], e[better]
        q[going], size[going] = trial[better], after[better]
    return q, size


def pose_errors(T: Array, wanted: Array) -> Array:
    """Translation (m) and rotation vector (rad) from poses to the wanted ones, (N, 6), world."""
    turn = wanted[:, :3, :3] @ T[:, :3, :3].swapaxes(-1, -2)
    return np.concatenate([wanted[:, :3, 3] - T[:, :3, 3], rotation_vectors_of(turn)], axis=1)
