"""Postures of a calibrated robot, and what became of those of the nominal one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import se3
from .._arrays import Array, Rebuilt, as_vector, batch_rows, read_only
from .._outcomes import Outcome
from ..geometry import PRISMATIC, REVOLUTE
from ..igm import igm
from ..igm.asked import above_zero, locks_of, mask_of
from ..igm.known import known_arm
from ..igm.solutions import IGMSolutions, posture_distance
from ..igm.status import IGMStatus
from ..kinematics import dgm
from ..model import RobotModel
from .inverse_rows import Flags, Home, Postures
from .robot import CalibratedRobot, as_calibrated, tip_of


class CorrectionStatus(Outcome):
    """What became of a posture of the nominal robot; fits int8.

    Attributes
    ----------
    sentence : str
        What a person reads.

    Examples
    --------
    >>> CorrectionStatus.MERGED.sentence
    'It arrives where another nominal posture arrived already.'
    """

    ARRIVED = 0, "It was brought to a posture of the calibrated robot."
    MERGED = 1, "It arrives where another nominal posture arrived already."
    VANISHED = 2, "Newton steps from it do not meet the pose: the calibrated robot has lost it."
    OUTSIDE_LIMITS = 3, "It was brought to a posture outside the joint limits."
    NO_READING = 4, "It was brought to a posture that no readings of the joints lead to."
    NO_POSTURE = 5, "The nominal robot has no more postures for the pose."


@dataclass(frozen=True, slots=True, eq=False)
class CorrectedSolutions(Rebuilt):
    """Postures that bring a calibrated robot to the poses of one call.

    Parameters
    ----------
    solutions : IGMSolutions
        ``q (..., S, n)`` are what the joints must read; ``residual`` is that of the calibrated
        robot at these readings.
    actual : ndarray, shape (..., S, n)
        Variables of the calibrated table there, rad or m; NaN where there is no solution.
    nominal : ndarray, shape (..., C, n)
        Postures of the nominal robot from which they were found, rad or m; NaN where there are
        none.
    correction : ndarray of int8, shape (..., C)
        Codes of `CorrectionStatus`, one for each nominal posture.
    row : ndarray of int, shape (..., C)
        Which of the S rows a nominal posture became; -1 if none.

    References
    ----------
    Seed book section 1.4.6.

    Examples
    --------
    See `corrected_igm`.
    """

    solutions: IGMSolutions
    actual: Array
    nominal: Array
    correction: NDArray[np.int8]
    row: NDArray[np.int64]

    def __post_init__(self) -> None:
        for name, kind in (("actual", np.float64), ("nominal", np.float64),
                           ("correction", np.int8), ("row", np.int64)):  # fmt: skip
            object.__setattr__(self, name, read_only(getattr(self, name), kind))

    @property
    def q(self) -> Array:
        """Readings, shape (..., S, n), rad or m; NaN where there is no solution."""
        return self.solutions.q

    @property
    def valid(self) -> NDArray[np.bool_]:
        """Whether a row is a solution, shape (..., S)."""
        return self.solutions.valid

    @property
    def residual(self) -> Array:
        """The larger of what is missing in metres and in radians, shape (..., S)."""
        return self.solutions.residual

    @property
    def within_limits(self) -> NDArray[np.bool_]:
        """Whether the readings of a solution are inside the limits, shape (..., S)."""
        return self.solutions.within_limits

    @property
    def status(self) -> NDArray[np.int8]:
        """Codes of `IGMStatus`, one for each pose."""
        return self.solutions.status

    @property
    def count(self) -> NDArray[np.int64]:
        """Number of solutions of each pose."""
        return self.solutions.count

    def reason(self, i: int | tuple[int, ...] = ()) -> str:
        """What became of one pose, in a sentence; see `IGMSolutions.reason`."""
        return self.solutions.reason(i)

    def nearest(self, q: ArrayLike) -> Array:
        """Readings of the solution nearest to a posture; see `IGMSolutions.nearest`."""
        return self.solutions.nearest(q)


CALIBRATED_ONLY = "of the calibrated robot only"
MERGE = 1e-6
"""Postures closer than this are one [rad, m], as in `igm`."""


def same_as(postures: Postures, robot: CalibratedRobot) -> NDArray[np.bool_]:
    """Whether a candidate converged to the same posture as an earlier one. Shapes: -> (N, C, C)."""
    turns = robot.model.table.sigma[robot.model.table.joint_rows] == REVOLUTE
    N, C = postures.met.shape
    # joint by joint: few are left after the first
    near = postures.met[:, :, None] & postures.met[:, None]
    near &= np.tri(C, k=-1, dtype=np.bool_)
    i, c, k = np.nonzero(near)
    for joint, turn in enumerate(turns):
        way = np.abs(postures.q[i, c, joint] - postures.q[i, k, joint])
        if turn:
            way = np.minimum(way, 2.0 * pi - way)
        close = way < MERGE
        i, c, k = i[close], c[close], k[close]
    same = np.zeros((N, C, C), np.bool_)
    same[i, c, k] = True
    return same


def put_together(
    robot: CalibratedRobot,
    batch: tuple[int, ...],
    starts: IGMSolutions,
    first: Postures,
    more: Postures,
    nominal: Array,
    targets: Array,
    references: Array,
    given: bool,
    limits: bool,
    home: Home,
    status: NDArray[np.int8],
    closest: Array,
    missing: Array,
) -> CorrectedSolutions:
    """Merge the candidates of all poses into the result of `corrected_igm`.

    Shapes: nominal (N, C, n); targets (N, 4, 4); references, closest (N, n); status (N,); missing
    (N, 6).
    """
    model, n, N = robot.model, robot.model.n, len(targets)
    C = first.q.shape[1]
    every = first.and_also(more)
    every.free[:, :C] |= starts.free_joints & home.is_redundant
    every.family[:, :C] |= starts.family_joints & home.is_redundant
    same = same_as(every, robot)
    merged: Flags = np.asarray(same.any(axis=-1), np.bool_)
    kept = every.met & ~merged
    readable = every.readable
    reading = np.where(readable[..., None], every.reading, 0.0)
    reading = _turned(home, every.q, reading, references[:, None], given, limits)
    inside = _within(reading, model)
    residual = every.residual
    if not robot.bending.is_zero:
        # a gain makes a turn of a joint no whole turn of its reading, which bends otherwise
        held = every.free | home.locked
        reading, residual = home.settled(targets, reading, residual, kept & readable, held)
        inside = _within(reading, model)
        kept &= residual <= home.tolerance
    chosen = kept & readable & (inside | (not limits))
    into = np.broadcast_to(np.arange(same.shape[1]), merged.shape)
    if same.size:
        into = np.where(merged, same.argmax(axis=-1), into)
    # a double root, or what is free, is known of either of two that are one
    for name in ("double", "free", "family"):
        values = getattr(every, name)
        for c in range(C, into.shape[1]):
            at = np.flatnonzero(merged[:, c])
            values[at, into[at, c]] |= values[at, c]

    correction = np.full((N, C), int(CorrectionStatus.NO_POSTURE), np.int8)
    for code, where in (
        (CorrectionStatus.VANISHED, starts.valid),
        (CorrectionStatus.ARRIVED, first.met),
        (CorrectionStatus.NO_READING, first.met & ~readable[:, :C]),
        (CorrectionStatus.OUTSIDE_LIMITS, (first.met & ~inside[:, :C]) if limits else False),
        (CorrectionStatus.MERGED, merged[:, :C]),
    ):
        correction[where & starts.valid] = int(code)

    distance = posture_distance(reading, references[:, None], home.turns & (not limits))
    key = distance if given else np.broadcast_to(np.arange(float(into.shape[1])), distance.shape)
    order = np.argsort(np.where(chosen, key, np.inf), axis=1, kind="stable")
    S = int(chosen.sum(axis=1).max(initial=0))
    rank = np.argsort(order, axis=1)
    row = np.where(np.take_along_axis(chosen, into, 1), np.take_along_axis(rank, into, 1), -1)

    def packed(values: NDArray[Any], empty: Any) -> NDArray[Any]:
        at = order[:, :S].reshape(N, S, *(1,) * (values.ndim - 2))
        rows = np.take_along_axis(values, at, axis=1)
        absent = ~np.take_along_axis(chosen, order[:, :S], axis=1)
        rows[absent] = empty
        return rows.reshape(*batch, *rows.shape[1:])

    codes = np.full(into.shape, len(starts.labels), np.int16)
    codes[:, :C] = starts.code
    found: Flags = np.asarray(chosen.any(axis=1), np.bool_)
    loose = (every.free & chosen[..., None]).any(axis=(1, 2)) | (found & home.is_redundant)
    beyond = (kept & readable).any(axis=1) & ~found
    # the calibrated table alone may meet a pose less closely than was asked
    wrong = np.isin(status, (IGMStatus.REACHED, IGMStatus.REACHED_FAMILY)) & ~found
    status = np.where(wrong, IGMStatus.NOT_CONVERGED, status)
    status = np.where(beyond, IGMStatus.OUTSIDE_LIMITS, status)
    status = np.where(found, np.where(loose, IGMStatus.REACHED_FAMILY, IGMStatus.REACHED), status)
    solutions = IGMSolutions(
        q=packed(reading, np.nan),
        valid=packed(chosen, False),
        residual=packed(residual, np.nan),
        within_limits=packed(inside & chosen, False),
        code=packed(codes, -1),
        labels=(*starts.labels, CALIBRATED_ONLY),
        status=status.astype(np.int8).reshape(batch),
        double=packed(every.double, False),
        free_joints=packed(every.free, False),
        family_joints=packed(every.family, False),
        method=f"{starts.method}; brought to the calibrated table by Newton steps",
        periodic=home.turns & (not limits),
        mask=home.mask,
        closest=np.where(found[:, None], np.nan, closest).reshape(*batch, n),
        missing=np.where(found[:, None], np.nan, missing).reshape(*batch, 6),
    )
    return CorrectedSolutions(
        solutions,
        packed(home.errors.actual(reading), np.nan),
        nominal.reshape(*batch, C, n),
        correction.reshape(*batch, C),
        row[:, :C].reshape(*batch, C),
    )


def _turned(
    home: Home, q: Array, reading: Array, references: Array, given: bool, limits: bool
) -> Array:
    """Readings with whole turns of the joints added.

    Nearest to the reference (else to mid-range) inside the limits, or in (-pi, pi].
    """
    turns, errors = home.turns, home.errors
    if limits:
        low, high = home.robot.model.lower, home.robot.model.upper
        both = np.isfinite(low) & np.isfinite(high)
        with np.errstate(invalid="ignore"):
            middle = np.where(both, 0.5 * (low + high), 0.0)
        aim = references if given else np.broadcast_to(middle, references.shape)
    else:
        low, high = np.full(len(turns), -pi), np.full(len(turns), pi)
        aim = np.zeros_like(references)
    count = np.zeros(q.shape)
    turned = reading
    for _ in range(4):
        # the turn nearest to the aim; inside the limits if one is
        step = np.round((aim - turned) / (2.0 * pi))
        with np.errstate(invalid="ignore"):
            least = np.ceil((low - turned) / (2.0 * pi) - 1e-15)
            most = np.floor((high - turned) / (2.0 * pi) + 1e-15)
        step = np.where(least <= most, np.clip(step, least, most), 0.0) * turns
        if not step.any():
            break
        count += step
        turned = reading + 2.0 * pi * count
        if not errors.is_zero:
            known = errors.reading(q + 2.0 * pi * count)
            turned = np.where(np.isfinite(known), known, turned)
    return turned


def _within(reading: Array, model: RobotModel) -> Flags:
    """Whether readings are inside the limits, (N, C)."""
    inside = (reading >= model.lower) & (reading <= model.upper)
    return np.asarray(inside.all(axis=-1), np.bool_)


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
    >>> from robotmodels.calibration.robot import calibrated_model
    >>> from robotmodels.calibration.robot import calibrated_pose
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
