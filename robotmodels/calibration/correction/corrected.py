"""The inverse geometric model of a calibrated robot: every nominal posture brought home."""

from __future__ import annotations

from collections.abc import Mapping
from math import pi
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ... import se3
from ..._arrays import Array, as_vector, batch_rows
from ...geometry import PRISMATIC
from ...igm import igm
from ...igm.asked import above_zero, locks_of, mask_of
from ...igm.known import known_arm
from ...igm.solutions import IGMSolutions
from ...igm.status import IGMStatus
from ...kinematics import dgm
from ...model import RobotModel
from ..calibrated_robot.calibrated import CalibratedRobot, as_calibrated
from ..calibrated_robot.calibrated_pose import tip_of
from .corrected_rows import put_together, same_as
from .corrected_solutions import CorrectedSolutions, CorrectionStatus
from .homing import Flags, Home, Postures

__all__ = ["CorrectedSolutions", "CorrectionStatus", "corrected_igm"]

SAMPLES = 32  # configurations at which calibrated and nominal poses are compared
BESIDE = 3.0  # deviations up to which a singular value may hide more postures


def corrected_igm(
    robot: CalibratedRobot,
    T: ArrayLike,
    q_ref: ArrayLike | None = None,
    mask: ArrayLike | None = None,
    mask_axes: str = "world",
    limits: bool = False,
    lock: Mapping[int | str, float] | None = None,
    tolerance: float = 1e-12,
    complete: bool = True,
) -> CorrectedSolutions:
    """Inverse geometric model of a calibrated robot: what its joints must read.

    The closed form of the nominal table (at the calibrated base and tool) gives its postures;
    Newton's method brings each to the calibrated table, and the errors of the joints are taken
    back to readings. Poses where that may miss a posture (one vanished or met another, the
    Jacobian is nearly singular, the nominal arm has fewer postures than it can have, or no
    closed form) are asked of `igm` for the calibrated table as well, which follows such postures.

    Parameters
    ----------
    robot : CalibratedRobot
        The robot, n joints.
    T : array_like, shape (..., 4, 4)
        World poses of the tool, metres.
    q_ref : array_like, shape (..., n), optional
        Reference readings, rad or m: order of the solutions, and the choice of redundant arms.
    mask : array_like, shape (6,), optional
        Components ``x y z rx ry rz`` asked for, see `igm`.
    mask_axes : {"world", "tool"}
        Axes of the components.
    limits : bool
        Whether readings must lie within the joint limits, whole turns of the joints added.
    lock : mapping, optional
        Joints (column of q, from 0, or name) that keep a reading, rad or m.
    tolerance : float
        Metres and radians: more is missing of no solution.
    complete : bool
        False leaves the calibrated table's own inverse model out: quicker, but postures that only
        the calibrated robot has are not found.

    Returns
    -------
    CorrectedSolutions
        Readings, and what became of every nominal posture.

    Raises
    ------
    ShapeError, InvalidValueError, NotARotationError
        As `igm`.

    Notes
    -----
    A redundant arm keeps the choice the nominal model makes: the same joints read what they read
    in ``q_ref``. Postures at the choice of the calibrated table's own inverse model are added;
    ``free_joints`` tells. Without joint errors and where `igm` of the calibrated table serves,
    both give the same postures; what is added here are the readings, their limits and locks, the
    speed of
    ordinary poses, and the outcome of each nominal posture.

    References
    ----------
    Seed book section 1.4.6.

    Examples
    --------
    >>> from robotmodels.calibration import candidate_parameters
    >>> from robotmodels.calibration.calibrated_robot.calibrated import calibrated_model
    >>> from robotmodels.calibration.calibrated_robot.calibrated_pose import calibrated_pose
    >>> from robotmodels.robots import load
    >>> parameters = candidate_parameters(load("rx90"), gains=True)
    >>> xi = 1e-3 * np.random.default_rng(0).normal(size=len(parameters))
    >>> robot = calibrated_model(parameters, xi)
    >>> q = [0.1, 0.2, 1.3, 0.4, 0.5, 0.6]
    >>> found = corrected_igm(robot, calibrated_pose(robot, q))
    >>> int(found.count), bool(found.residual.max() < 1e-12)
    (8, True)
    >>> found.nearest(q).round(9)
    array([0.1, 0.2, 1.3, 0.4, 0.5, 0.6])
    """
    robot = as_calibrated(robot)
    model, n = robot.model, robot.model.n
    tolerance = above_zero(tolerance, "tolerance")
    asked, locks = mask_of(mask), locks_of(model, lock)
    poses = se3.as_pose(T)
    reference = np.zeros(n) if q_ref is None else as_vector(q_ref, n, "q_ref")
    flat = poses.reshape(*poses.shape[:-2], 16)
    batch, (rows, references) = batch_rows((flat, reference), ("T", "q_ref"))
    targets = np.ascontiguousarray(rows.reshape(-1, 4, 4))
    home = Home(robot, asked, mask_axes == "tool", [column for column, _ in locks], tolerance)
    shift = _own_offsets(robot)
    asking: dict[str, Any] = {
        "mask": None if asked.all() else asked, "mask_axes": mask_axes,
        "position_tolerance": max(1e-9, tolerance), "orientation_tolerance": max(1e-9, tolerance),
    }  # fmt: skip

    # the nominal postures, in the variables of the calibrated table
    starts = igm(
        robot.structured, targets, None if q_ref is None else references + shift,
        lock={c: value + shift[c] for c, value in locks} or None, **asking,
    )  # fmt: skip
    nominal = starts.q - shift
    redundant = home.is_redundant
    held = (starts.free_joints & redundant) | home.locked
    first = home.bring(targets, nominal, starts.valid, held, nominal)

    more = Postures.none(len(targets), n)
    lost = starts.valid.any(axis=1)
    status = np.where(lost, int(IGMStatus.NOT_CONVERGED), starts.status).astype(np.int8)
    closest = np.full((len(targets), n), np.nan)
    missing = np.full((len(targets), 6), np.nan)
    doubt = _doubtful(robot, starts, first, redundant)
    chosen = np.flatnonzero(doubt & complete)
    if chosen.size:
        aims = home.aimed(targets[chosen], first, chosen)
        there = robot.joint_errors.actual(references[chosen])
        own = igm(
            model, aims, None if q_ref is None else there,
            lock=dict(locks) or None, **asking,
        )  # fmt: skip
        own_held = (own.free_joints & redundant) | home.locked
        # what is free was put where the reference is, not where it reads
        apart = (references[chosen] - there)[:, None] * (own_held & ~home.locked)
        found = home.bring(targets[chosen], own.q, own.valid, own_held, own.q + apart)
        more = found.spread(chosen, len(targets), own)
        status[chosen] = own.status
        if own.closest is not None and own.missing is not None:
            closest[chosen], missing[chosen] = own.closest, own.missing
    return put_together(
        robot, batch, starts, first, more, nominal, targets, references, q_ref is not None,
        bool(limits), home, status, closest, missing,
    )  # fmt: skip


def _doubtful(
    robot: CalibratedRobot, starts: IGMSolutions, first: Postures, redundant: bool
) -> NDArray[np.bool_]:
    """Poses where the nominal postures may not be all, or not lead to all."""
    there = starts.valid
    lost = there & ~(first.met & first.readable)
    doubted = lost | (there & ((first.least < BESIDE * _deviation(robot)) | starts.double))
    if not redundant:
        doubted |= there & starts.free_joints.any(axis=-1)
    doubt: Flags = np.asarray(doubted.any(axis=1) | ~there.any(axis=1), np.bool_)
    plan = known_arm(robot.structured)
    if plan.plan is None or starts.method != plan.method:
        # nothing says how many postures there can be
        doubt[:] = True
    else:
        doubt |= there.sum(axis=1) < plan.most
    return doubt | np.asarray(same_as(first, robot).any(axis=(1, 2)), np.bool_)


def _deviation(robot: CalibratedRobot) -> float:
    """Largest difference of nominal and calibrated poses, in lengths of the arm and radians."""
    model = robot.model
    rng = np.random.default_rng(0)
    span = rng.uniform(-pi, pi, size=(SAMPLES, model.n))
    a = dgm(robot.structured, span + _own_offsets(robot))
    b = dgm(model, span)
    if not robot.bending.is_zero:
        b = robot.bending.poses(span, span, *tip_of(robot))
    size = max(float(np.abs(b[:, :3, 3]).max()), 1e-9)
    turn = np.abs(a[:, :3, :3] - b[:, :3, :3]).max()
    return float(max(turn, np.abs(a[:, :3, 3] - b[:, :3, 3]).max() / size))


def _own_offsets(robot: CalibratedRobot) -> Array:
    """Constant offsets of the joints' own variables, calibrated minus nominal, shape (n,)."""

    def own(model: RobotModel) -> Array:
        table = model.table
        column = np.where(table.sigma == PRISMATIC, table.r, table.theta)
        return column[table.joint_rows]

    return own(robot.model) - own(robot.structured)
