"""Inverse model of a calibrated robot, and corrections for controllers with the nominal one.

Solutions of the calibrated table are refined in the joint readings.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import least_squares

from .. import se3
from .._arrays import Array, Frozen, as_mask, as_number, as_vector, batch_rows
from ..errors import InvalidValueError
from ..geometry import REVOLUTE
from ..igm import igm
from ..igm.arrange import arranged, result_fields, turned_inside
from ..igm.postures import MERGE, Postures, difference
from ..igm.request import locks_of
from ..igm.solutions import IGMSolutions, of_fields
from ..kinematics import dgm, jacobian
from ..kinematics.lengths import characteristic_length
from ..se3.orientation import rotation_vectors_of
from .robot import CalibratedRobot, as_calibrated, calibrated_pose

if TYPE_CHECKING:
    from .result import CalibrationResult

_STEPS = 30
_LONGEST = 0.5  # step of a joint [rad, or the length of the arm]
_ROUNDED = 1e-14  # pose error that is rounding
_RANK_TOLERANCE = 1e-10  # singular values beside the largest that count as zero


def corrected_igm(
    robot: CalibratedRobot | CalibrationResult,
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
    tolerance = as_number(tolerance, "tolerance", above=0.0)
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


# --- controllers that keep their nominal model ----------------------------------------------------


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
    length = as_number(length, "length", above=0.0)
    weight = np.where(requested, np.repeat([1.0, length], 3), 0.0)
    revolute = robot.model.table.sigma[robot.model.table.joint_rows] == REVOLUTE
    unit = np.where(revolute, 1.0, length)

    def errors(offset: Array) -> Array:
        return pose_errors(calibrated_pose(robot, commanded + unit * offset), wanted)

    close = dict.fromkeys(("xtol", "ftol", "gtol"), 1e-15)
    fit = least_squares(lambda x: (weight * errors(x)).ravel(), np.zeros(n), "3-point", **close)
    # singular values beside the largest below which offsets are dependent
    rank = np.linalg.matrix_rank(fit.jac, rtol=1e-8)
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
