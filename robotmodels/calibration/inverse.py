"""Inverse kinematics of a calibrated robot: each nominal solution is refined by Newton steps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import se3
from .._arrays import Array, Rebuilt, as_mask, as_vector, batch_rows, read_only
from .._outcomes import Outcome
from ..geometry import PRISMATIC
from ..igm import igm
from ..igm.known import known_arm
from ..igm.request import above_zero, locks_of
from ..igm.solutions import IGMSolutions, posture_distance
from ..igm.status import IGMStatus
from ..kinematics import dgm
from ..model import RobotModel
from .refinement import Flags, Postures, Refinement
from .robot import CalibratedRobot, as_calibrated, calibrated_pose

SAMPLES = 32  # configurations at which calibrated and nominal poses are compared
NEAR_SINGULAR = 3.0  # differences of these poses up to which a singular value may hide postures
CALIBRATED_ONLY = "of the calibrated robot only"
MERGE = 1e-6
"""Postures closer than this are merged [rad, m], as in `igm`."""


class CorrectionStatus(Outcome):
    """Outcome of the refinement of a posture of the nominal robot; fits int8."""

    ARRIVED = 0, "It converges to a posture of the calibrated robot."
    MERGED = 1, "It converges to the same posture as another nominal one before it."
    VANISHED = (
        2,
        "Newton refinement from it fails: the calibrated robot has no such posture.",
    )
    OUTSIDE_LIMITS = 3, "It converges to a posture outside the joint limits."
    NO_READING = 4, "It converges to a posture that no readings of the joints lead to."
    NO_POSTURE = 5, "The nominal robot has no more postures for the pose."


@dataclass(frozen=True, slots=True, eq=False)
class CorrectedSolutions(Rebuilt):
    """Readings that bring a calibrated robot to the poses of one call.

    Parameters
    ----------
    solutions : IGMSolutions
        ``q (..., S, n)`` are the readings of the joints; ``residual`` is that of the calibrated
        robot at these readings.
    actual : ndarray, shape (..., S, n)
        Variables of the calibrated table there, rad or m; NaN where there is no solution.
    nominal : ndarray, shape (..., C, n)
        Postures of the nominal robot that were refined, rad or m; NaN where there are none.
    correction : ndarray of int8, shape (..., C)
        Codes of `CorrectionStatus`, one for each nominal posture.
    row : ndarray of int, shape (..., C)
        Which of the S rows a nominal posture became; -1 if none.
    """

    solutions: IGMSolutions
    actual: Array
    nominal: Array
    correction: NDArray[np.int8]
    row: NDArray[np.int64]

    def __post_init__(self) -> None:
        kinds = {
            "actual": np.float64,
            "nominal": np.float64,
            "correction": np.int8,
            "row": np.int64,
        }
        for name, kind in kinds.items():
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
        """The larger of the pose errors in metres and in radians, shape (..., S)."""
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
        """Outcome of one pose in a sentence; see `IGMSolutions.reason`."""
        return self.solutions.reason(i)

    def nearest(self, q: ArrayLike) -> Array:
        """Readings of the solution nearest to a posture; see `IGMSolutions.nearest`."""
        return self.solutions.nearest(q)


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
    """Inverse geometric model of a calibrated robot: the readings of its joints.

    The closed form of the nominal table (at the calibrated base and tool) gives its postures;
    Newton's method refines each on the calibrated table and in the readings. Poses where that may
    miss a posture (one vanished or was merged, the Jacobian is nearly singular, the nominal arm
    has fewer postures than it can have, or no closed form) are solved by `igm` of the calibrated
    table as well.

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
    complete : bool
        False skips the inverse geometric model of the calibrated table: faster, but postures that
        only the calibrated robot has are not found.

    Returns
    -------
    CorrectedSolutions
        Readings, and the outcome for every nominal posture.

    Raises
    ------
    ShapeError, InvalidValueError, NotARotationError
        As `igm`.

    Notes
    -----
    For a redundant arm the free joints are those of the nominal model and keep the readings of
    ``q_ref``. Postures at the choice of the calibrated table's own inverse model are added
    (``free_joints``).

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
    requested, locks = as_mask(mask), locks_of(model, lock)
    poses = se3.as_pose(T)
    reference = np.zeros(n) if q_ref is None else as_vector(q_ref, n, "q_ref")
    flat = poses.reshape(*poses.shape[:-2], 16)
    batch, (rows, references) = batch_rows((flat, reference), ("T", "q_ref"))
    targets = np.ascontiguousarray(rows.reshape(-1, 4, 4))
    N, locked = len(targets), [column for column, _ in locks]
    newton = Refinement(robot, requested, mask_axes == "tool", locked, tolerance)
    shift = _variable_offsets(robot)
    options: dict[str, Any] = {
        "mask": None if requested.all() else requested,
        "mask_axes": mask_axes,
        "position_tolerance": max(1e-9, tolerance),
        "orientation_tolerance": max(1e-9, tolerance),
    }
    # the nominal postures, in the variables of the calibrated table
    starts = igm(
        robot.structured, targets, None if q_ref is None else references + shift,
        lock={c: value + shift[c] for c, value in locks} or None, **options,
    )  # fmt: skip
    nominal = starts.q - shift
    held = (starts.free_joints & newton.is_redundant) | newton.locked
    first = newton.refine(targets, nominal, starts.valid, held, nominal)
    more = Postures.none(N, n)
    reached = starts.valid.any(axis=1)
    status = np.where(reached, int(IGMStatus.NOT_CONVERGED), starts.status).astype(np.int8)
    closest, missing = np.full((N, n), np.nan), np.full((N, 6), np.nan)
    again = np.flatnonzero(_may_be_incomplete(robot, starts, first, newton) & complete)
    if again.size:
        actual = robot.joint_errors.actual(references[again])
        extra = igm(
            model, newton.rigid_targets(targets[again], first, again),
            None if q_ref is None else actual, lock=dict(locks) or None, **options,
        )  # fmt: skip
        held = (extra.free_joints & newton.is_redundant) | newton.locked
        # free joints have the variable, not the reading, of the reference
        apart = (references[again] - actual)[:, None] * (held & ~newton.locked)
        refined = newton.refine(targets[again], extra.q, extra.valid, held, extra.q + apart)
        more = refined.spread(again, N, extra)
        status[again] = extra.status
        if extra.closest is not None and extra.missing is not None:
            closest[again], missing[again] = extra.closest, extra.missing
    every = first.joined(more)
    every.free[:, : nominal.shape[1]] |= starts.free_joints & newton.is_redundant
    every.family[:, : nominal.shape[1]] |= starts.family_joints & newton.is_redundant
    aim = references if q_ref is not None else None
    return _merged(
        newton, batch, targets, starts, nominal, first, every, references, aim, limits,
        (status, closest, missing),
    )  # fmt: skip


def _may_be_incomplete(
    robot: CalibratedRobot, starts: IGMSolutions, first: Postures, newton: Refinement
) -> Flags:
    """Poses where the nominal postures may not be all, or not lead to all."""
    present = starts.valid
    failed = present & ~(first.met & first.readable)
    near_singular = first.least < NEAR_SINGULAR * _pose_difference(robot)
    doubtful = failed | (present & (near_singular | starts.double))
    if not newton.is_redundant:
        doubtful |= present & starts.free_joints.any(axis=-1)
    plan = known_arm(robot.structured)
    if plan.plan is None or starts.method != plan.method:
        return np.ones(len(present), np.bool_)  # the greatest number of postures is unknown
    few = (present.sum(axis=1) < plan.most) | ~present.any(axis=1)
    return np.asarray(few | doubtful.any(axis=1) | same_as(first, newton).any(axis=(1, 2)))


def _pose_difference(robot: CalibratedRobot) -> float:
    """Largest difference of nominal and calibrated poses, in lengths of the arm and radians."""
    readings = np.random.default_rng(0).uniform(-pi, pi, size=(SAMPLES, robot.model.n))
    actual = robot.joint_errors.actual(readings)
    a, b = (
        dgm(robot.structured, actual + _variable_offsets(robot)),
        calibrated_pose(robot, readings),
    )
    size = max(float(np.abs(b[:, :3, 3]).max()), 1e-9)
    turn = np.abs(a[:, :3, :3] - b[:, :3, :3]).max()
    return float(max(turn, np.abs(a[:, :3, 3] - b[:, :3, 3]).max() / size))


def _variable_offsets(robot: CalibratedRobot) -> Array:
    """Constant offsets of the joint variables, calibrated minus nominal, shape (n,)."""

    def constants(model: RobotModel) -> Array:
        table = model.table
        return np.where(table.sigma == PRISMATIC, table.r, table.theta)[table.joint_rows]

    return constants(robot.model) - constants(robot.structured)


def same_as(postures: Postures, newton: Refinement) -> NDArray[np.bool_]:
    """Whether a candidate converged to the same posture as an earlier one. Shapes: -> (N, C, C)."""
    C = postures.met.shape[1]
    same = postures.met[:, :, None] & postures.met[:, None] & np.tri(C, k=-1, dtype=np.bool_)
    # joint by joint: few are left after the first
    i, c, k = np.nonzero(same)
    for joint, turn in enumerate(newton.turns):
        way = np.abs(postures.q[i, c, joint] - postures.q[i, k, joint])
        if turn:
            way = np.minimum(way, 2.0 * pi - way)
        close = way < MERGE
        i, c, k = i[close], c[close], k[close]
    same[:] = False
    same[i, c, k] = True
    return same


def _merged(
    newton: Refinement,
    batch: tuple[int, ...],
    targets: Array,
    starts: IGMSolutions,
    nominal: Array,
    first: Postures,
    every: Postures,
    references: Array,
    aim: Array | None,
    limits: bool,
    failed: tuple[NDArray[np.int8], Array, Array],
) -> CorrectedSolutions:
    """Merge the candidates of all poses, order them, and give the outcome of each start.

    Shapes: nominal (N, C, n); references, aim (N, n); failed: status, closest and missing of
    poses without a solution.
    """
    model, N, C = newton.robot.model, len(targets), nominal.shape[1]
    same = same_as(every, newton)
    merged = np.asarray(same.any(axis=-1))
    readable = every.readable
    reading = np.where(readable[..., None], every.reading, 0.0)
    reading = _turned(newton, every.q, reading, aim, limits)
    residual, kept = every.residual, every.met & ~merged
    if newton.bends:
        # with gains, a whole turn of a joint is no whole turn of its reading: bending differs
        rows, held = kept & readable, every.free | newton.locked
        reading, size = newton.refined_readings(targets, reading, rows, held, rows)
        residual = np.where(rows, size, residual)
        kept &= residual <= newton.tolerance
    within = (reading >= model.lower) & (reading <= model.upper)
    inside = np.asarray(within.all(axis=-1))
    chosen = kept & readable & (inside | (not limits))
    into = np.broadcast_to(np.arange(same.shape[1]), merged.shape)
    if same.size:
        into = np.where(merged, same.argmax(axis=-1), into)
    # the flags of a posture hold for the one it is merged into
    for values in (every.double, every.free, every.family):
        for c in range(C, into.shape[1]):
            at = np.flatnonzero(merged[:, c])
            values[at, into[at, c]] |= values[at, c]

    correction = np.full((N, C), int(CorrectionStatus.NO_POSTURE), np.int8)
    for code, where in (
        (CorrectionStatus.VANISHED, starts.valid),
        (CorrectionStatus.ARRIVED, first.met),
        (CorrectionStatus.NO_READING, first.met & ~readable[:, :C]),
        (CorrectionStatus.OUTSIDE_LIMITS, first.met & ~inside[:, :C] & limits),
        (CorrectionStatus.MERGED, merged[:, :C]),
    ):
        correction[where & starts.valid] = int(code)

    distance = posture_distance(reading, references[:, None], newton.turns & (not limits))
    key = np.broadcast_to(np.arange(float(into.shape[1])), distance.shape)
    key = np.where(chosen, key if aim is None else distance, np.inf)
    order = np.argsort(key, axis=1, kind="stable")
    S = int(chosen.sum(axis=1).max(initial=0))
    rank = np.argsort(order, axis=1)
    row = np.where(np.take_along_axis(chosen, into, 1), np.take_along_axis(rank, into, 1), -1)

    def packed(values: NDArray[Any], empty: Any) -> NDArray[Any]:
        at = order[:, :S].reshape(N, S, *(1,) * (values.ndim - 2))
        rows = np.take_along_axis(values, at, axis=1)
        rows[~np.take_along_axis(chosen, order[:, :S], axis=1)] = empty
        return rows.reshape(*batch, *rows.shape[1:])

    codes = np.full(into.shape, len(starts.labels), np.int16)
    codes[:, :C] = starts.code
    status, closest, missing = failed
    solved = np.asarray(chosen.any(axis=1))
    family = (every.free & chosen[..., None]).any(axis=(1, 2)) | newton.is_redundant
    # the inverse model of the calibrated table may meet a pose less closely than requested
    status = np.where(
        np.isin(status, (IGMStatus.REACHED, IGMStatus.REACHED_FAMILY)),
        IGMStatus.NOT_CONVERGED, status,
    )  # fmt: skip
    status = np.where((kept & readable).any(axis=1), IGMStatus.OUTSIDE_LIMITS, status)
    reached = np.where(family, IGMStatus.REACHED_FAMILY, IGMStatus.REACHED)
    solutions = IGMSolutions(
        q=packed(reading, np.nan),
        valid=packed(chosen, False),
        residual=packed(residual, np.nan),
        within_limits=packed(inside & chosen, False),
        code=packed(codes, -1),
        labels=(*starts.labels, CALIBRATED_ONLY),
        status=np.where(solved, reached, status).astype(np.int8).reshape(batch),
        double=packed(every.double, False),
        free_joints=packed(every.free, False),
        family_joints=packed(every.family, False),
        method=f"{starts.method}; refined on the calibrated table by Newton steps",
        periodic=newton.turns & (not limits),
        mask=newton.mask,
        closest=np.where(solved[:, None], np.nan, closest).reshape(*batch, model.n),
        missing=np.where(solved[:, None], np.nan, missing).reshape(*batch, 6),
    )
    return CorrectedSolutions(
        solutions,
        packed(newton.errors.actual(reading), np.nan),
        nominal.reshape(*batch, C, model.n),
        correction.reshape(*batch, C),
        row[:, :C].reshape(*batch, C),
    )


def _turned(newton: Refinement, q: Array, reading: Array, aim: Array | None, limits: bool) -> Array:
    """Readings with whole turns of the joints added, in (-pi, pi], or with limits inside them.

    Then nearest to the aim (N, n), or to mid-range without one.
    """
    turns, errors = newton.turns, newton.errors
    low, high = np.full(len(turns), -pi), np.full(len(turns), pi)
    middle = np.zeros(len(turns))
    if limits:
        low, high = newton.robot.model.lower, newton.robot.model.upper
        both = np.isfinite(low) & np.isfinite(high)
        middle[both] = 0.5 * (low[both] + high[both])
    goal = aim[:, None] if limits and aim is not None else middle
    count = np.zeros(q.shape)
    turned = reading
    for _ in range(4):
        # the turn nearest to the goal; inside the limits if one is
        step = np.round((goal - turned) / (2.0 * pi))
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
