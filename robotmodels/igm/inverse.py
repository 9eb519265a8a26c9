"""The inverse geometric model: every posture of a pose, for every arm that has a closed form."""

from __future__ import annotations

import weakref
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import se3
from .._arrays import Array, as_core, as_vector, batch_rows, read_only
from ..errors import InvalidValueError
from ..geometry import FIXED, PRISMATIC, REVOLUTE
from ..model import RobotModel
from .arm_angle import ArmAngle, arm_angle_postures
from .asked import WHOLE_POSE, Task, above_zero, locks_of, mask_of
from .branches import branches
from .families import prepare_task
from .loop import joint_chain
from .numeric import igm_numeric
from .self_motion import Settled, double_roots, settle_families
from .solutions import IGMSolutions
from .solver import Found, Solver, Tolerances, nothing_found, postures
from .status import IGMStatus

SEARCH_STARTS, SEARCH_STEPS = 4, 60
"""How long the search looks that says why a pose has no posture."""


def igm(
    model: RobotModel,
    T: ArrayLike,
    q_ref: ArrayLike | None = None,
    mask: ArrayLike | None = None,
    mask_axes: str = "world",
    limits: bool = False,
    lock: Mapping[int | str, float] | None = None,
    arm_angle: ArrayLike | None = None,
    position_tolerance: float = 1e-9,
    orientation_tolerance: float = 1e-9,
) -> IGMSolutions:
    """Inverse geometric model (inverse kinematics): all postures that bring the tool to a pose.

    Looks at the table once, picks the family of the arm and keeps what it prepared for the next
    call with the same model: Paul's equations where they suffice; three axes that meet or three
    that are parallel, wherever they stand in the chain; three or two prismatic joints; arms that
    are one of these up to calibration errors; elimination to up to 16 postures for other six-joint
    arms; virtual joints for arms of fewer joints and for masks; the arm angle or locked joints
    for seven joints and more. ``print(found.method)`` says which.

    Parameters
    ----------
    model : RobotModel
        The robot.
    T : array_like, shape (..., 4, 4)
        World poses of the tool [m]. A rotation that is off by no more than 1e-6 is projected onto
        a proper one.
    q_ref : array_like, shape (..., n), optional
        Reference postures [rad or m]; the leading axes broadcast with those of ``T``. Solutions
        are ordered by their distance to it, and joints that a pose leaves free take its value
        (0 without it; where no posture exists at that value, the nearest one where one does).
    mask : array_like, shape (6,), optional
        Ones for the components ``x y z rx ry rz`` that are asked for, zeros for the others;
        default all. Rotations are the components of ``log(R_desired R^T)``.
    mask_axes : {"world", "tool"}
        Axes of the components: the world's, or those of the tool at the desired pose. Pointing
        the tool's z axis is ``[1, 1, 1, 1, 1, 0]`` in tool axes.
    limits : bool
        Whether solutions must lie within the joint limits. Angles are then shifted by whole turns
        to be nearest to ``q_ref`` (else to mid-range) inside the limits, and postures that cannot
        are dropped; otherwise angles are in (-pi, pi] and ``within_limits`` tells.
    lock : mapping, optional
        Joints (column of q, from 0, or name) that keep a value [rad or m].
    arm_angle : array_like, shape (...), optional
        Arms with three axes that meet in a shoulder, an elbow, and three that meet in a wrist: the
        angle of the elbow about the line from shoulder to wrist [rad], see `ArmAngle`. The axes of
        an array are added behind those of ``T``. Without it the angle of ``q_ref`` is taken.
    position_tolerance : float
        Metres. What is missing of the position may be as long as this. For poses given with few
        digits take wider tolerances.
    orientation_tolerance : float
        Radians, on the rotation that is missing.

    Returns
    -------
    IGMSolutions
        All postures of each pose, with a status for each pose.

    Raises
    ------
    ShapeError, InvalidValueError, NotARotationError
        ``T`` that are not poses; arguments of the wrong length, with NaN or infinity; a mask that
        leaves nothing or asks for what is no mask; locked joints that do not exist; an arm angle
        for an arm without one.

    Notes
    -----
    A posture is returned after a forward pass over the table; ``residual`` is what that found.
    Poses without one are given to a short numeric search, `igm_numeric`, which says why: too far,
    too near, or the orientation not available there. An arm outside every family (more joints
    than can be solved, or a degenerate one) gets the single posture of that search, and
    ``method`` says so.

    References
    ----------
    Section 1.2.3 of the book; Pieper 1968, Raghavan and Roth 1990.

    Examples
    --------
    >>> import numpy as np
    >>> from robotmodels.igm import igm
    >>> from robotmodels.kinematics import dgm
    >>> from robotmodels.robots import load
    >>> arm = load("rx90")
    >>> found = igm(arm, dgm(arm, [0.1, 0.2, 1.3, 0.4, 0.5, 0.6]))
    >>> int(found.count), bool(found.residual.max() < 1e-12)
    (8, True)
    >>> found.nearest([0.1, 0.2, 1.3, 0.4, 0.5, 0.6]).round(6)
    array([0.1, 0.2, 1.3, 0.4, 0.5, 0.6])
    """
    if not isinstance(model, RobotModel):
        raise InvalidValueError(f"model: expected a RobotModel, got {type(model).__name__}.")
    T = se3.as_pose(T)
    tolerances = Tolerances(
        above_zero(position_tolerance, "position_tolerance"),
        above_zero(orientation_tolerance, "orientation_tolerance"),
    )
    if not isinstance(limits, (bool, np.bool_)):
        raise InvalidValueError(f"limits: expected True or False, got {limits!r}.")
    if mask_axes not in ("world", "tool"):
        raise InvalidValueError(f"mask_axes: expected 'world' or 'tool', got {mask_axes!r}.")
    asked = mask_of(mask)
    task = Task(
        mask=tuple(asked.tolist()),
        in_tool_axes=mask_axes == "tool",
        locks=locks_of(model, lock),
        by_arm_angle=arm_angle is not None,
    )
    arm = _known(model)
    solver = arm.solver(model, task)
    reference = np.zeros(model.n) if q_ref is None else as_vector(q_ref, model.n, "q_ref")
    flat = T.reshape(*T.shape[:-2], 16)
    batch, (rows, references) = batch_rows((flat, reference), ("T", "q_ref"))
    poses = rows.reshape(-1, 4, 4)
    if limits:
        references = np.clip(references, model.lower, model.upper)
    psi = None
    if arm_angle is not None:
        # every pose once for every angle, the angles behind
        angles = as_core(arm_angle, (), "arm_angle")
        poses, references = (np.repeat(a, angles.size, axis=0) for a in (poses, references))
        psi = np.tile(angles.ravel(), rows.shape[0])
        batch = (*batch, *angles.shape)
    U = np.ascontiguousarray(arm.to_base @ poses)
    # locked joints are not solved for: like joints off the path they keep their reference
    if task.locks:
        references = references.copy()
    for column, value in task.locks:
        references[:, column] = value
    columns = np.setdiff1d(arm.columns, [column for column, _ in task.locks], assume_unique=True)
    wanted = np.ascontiguousarray(references[:, columns])
    found = _found(solver, task, U, psi, wanted, tolerances)
    return _result(
        model, arm, task, solver, columns, poses, references, q_ref is not None, bool(limits),
        tolerances, found, batch,
    )  # fmt: skip


NO_FAMILY = "numeric search for one posture: no family of closed forms serves this arm"


@dataclass(slots=True, eq=False)
class _Arm:
    """What is kept of a model between calls."""

    columns: NDArray[np.int64]
    to_base: Array
    turns: NDArray[np.int64]
    solvers: dict[Task, Solver | None]

    def solver(self, model: RobotModel, task: Task) -> Solver | None:
        """The family prepared for a task, from the last call that asked for it if any."""
        if task not in self.solvers:
            if len(self.solvers) >= KEPT_TASKS:
                self.solvers.pop(next(iter(self.solvers)))
            self.solvers[task] = prepare_task(joint_chain(model), task)
        return self.solvers[task]


KEPT_TASKS = 32
"""Tasks (masks, locked values) prepared for one model that are remembered."""

# by identity: a model's hash reads all of its numbers
_ARMS: dict[int, tuple[weakref.ref[RobotModel], _Arm]] = {}


def _known(model: RobotModel) -> _Arm:
    """What earlier calls prepared for a model."""
    key = id(model)
    entry = _ARMS.get(key)
    if entry is None or entry[0]() is not model:
        sigma = model.table.sigma[model.table.joint_rows]
        arm = _Arm(
            columns=joint_chain(model).columns,
            to_base=read_only(se3.inverse(model.base)),
            turns=read_only(sigma == REVOLUTE, np.int64),
            solvers={},
        )
        entry = (weakref.ref(model, lambda _: _ARMS.pop(key, None)), arm)
        _ARMS[key] = entry
    return entry[1]


def _found(
    solver: Solver | None,
    task: Task,
    U: Array,
    psi: Array | None,
    references: Array,
    tolerances: Tolerances,
) -> Settled:
    """Postures of a chain, infinite families settled and double roots marked."""
    if solver is None:
        found = nothing_found(len(U), 1, references.shape[1])
    elif psi is not None:
        if not isinstance(solver, ArmAngle):
            raise InvalidValueError(
                "arm_angle: this arm has none, which takes seven revolute joints with three axes "
                "that meet in a shoulder and three in a wrist; lock a joint instead, if there are "
                f"seven. It is solved by: {solver.method}."
            )
        every = arm_angle_postures(solver, U, psi[:, None], references, tolerances)
        rows = (getattr(every, field.name)[:, 0] for field in fields(every))
        found = Found(*rows)
        # the angle is given, so that only joints that took a reference are free
        found.family[...] = found.free.any(axis=-1)
    else:
        found = postures(solver, U, references, tolerances)
    whole = task.mask == WHOLE_POSE
    if solver is not None and whole and solver.chain.k <= 6:
        if solver.chain.k == 6:
            found.double[...] |= double_roots(solver.chain, found)
        return settle_families(solver.chain, U, found, references, tolerances)
    moving = np.zeros(found.q.shape, np.bool_)
    if solver is not None and psi is None and whole:
        from ._moving import moving_joints

        chain = solver.chain
        length = float(np.linalg.norm(chain.D[:, :3, 3], axis=-1).sum()) or 1.0
        sigma, rows = np.ascontiguousarray(chain.sigma), found.family & found.valid
        moving_joints(sigma, chain.D, length, found.q, rows, moving)
    moving |= found.free
    return Settled(*(getattr(found, field.name) for field in fields(Found)), moving=moving)


def _result(
    model: RobotModel,
    arm: _Arm,
    task: Task,
    solver: Solver | None,
    columns: NDArray[np.int64],
    poses: Array,
    references: Array,
    given: bool,
    limits: bool,
    tolerances: Tolerances,
    found: Settled,
    batch: tuple[int, ...],
) -> IGMSolutions:
    """Families settled, rows labelled, ordered and put into the model's columns."""
    from ._arrange import arranged

    code, labels = branches(solver, found)
    N, S, _ = found.q.shape
    S, n = max(S, 1), model.n
    q, residual = np.full((N, S, n), np.nan), np.full((N, S), np.nan)
    valid, inside, double = np.zeros((3, N, S), np.bool_)
    codes, status = np.full((N, S), -1, np.int16), np.empty(N, np.int8)
    free, family = np.zeros((2, N, S, n), np.bool_)
    off_path = np.ones(n, np.int64)
    off_path[arm.columns] = 0
    most = arranged(
        found.q, found.valid, found.residual, found.double, found.free, np.ascontiguousarray(found.moving), code,
        columns, off_path, references, int(given), model.lower, model.upper, int(limits), arm.turns,
        q, valid, residual, inside, codes, double, free, family, status,
    )  # fmt: skip
    search = _search(model, task, solver, poses, references, limits, tolerances, status)
    closest = missing = None
    if search is not None:
        closest, missing = search.closest, search.missing
        status[search.rows] = search.status
        met = search.rows[search.met]
        # a posture that the search came upon all the same
        q[met, 0], residual[met, 0] = closest[met], search.residual[search.met]
        valid[met, 0], codes[met, 0] = True, 0
        inside[met, 0] = np.all(
            (model.lower <= closest[met]) & (closest[met] <= model.upper), axis=-1
        )
        most = max(most, int(met.size > 0))

    def rows(array: NDArray, *core: int) -> NDArray:
        return array[:, :most].reshape(*batch, most, *core)

    return IGMSolutions(
        q=rows(q, n),
        valid=rows(valid),
        residual=rows(residual),
        within_limits=rows(inside),
        code=rows(codes),
        labels=labels,
        status=status.reshape(batch),
        double=rows(double),
        free_joints=rows(free, n),
        family_joints=rows(family, n),
        method=NO_FAMILY if solver is None else solver.method,
        periodic=(arm.turns == 1) & (not limits),
        mask=np.array(task.mask),
        closest=None if closest is None else closest.reshape(*batch, n),
        missing=None if missing is None else missing.reshape(*batch, 6),
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Search:
    """What the numeric search says of poses without a posture."""

    rows: NDArray[np.int64]
    status: NDArray[np.int8]
    met: NDArray[np.bool_]
    residual: Array
    closest: Array
    missing: Array


def _search(
    model: RobotModel,
    task: Task,
    solver: Solver | None,
    poses: Array,
    references: Array,
    limits: bool,
    tolerances: Tolerances,
    status: NDArray[np.int8],
) -> _Search | None:
    """Say why poses have no posture; the posture that comes closest, and what it misses."""
    empty = np.flatnonzero(status == IGMStatus.NOT_CONVERGED)
    if empty.size == 0:
        return None
    free = model if not task.locks else _with_locked_joints(model, task)
    columns = np.setdiff1d(np.arange(model.n), [column for column, _ in task.locks])
    effort = {} if solver is None else {"restarts": SEARCH_STARTS, "iterations": SEARCH_STEPS}
    found = igm_numeric(
        free, poses[empty], references[np.ix_(empty, columns)],
        mask=np.array(task.mask), mask_axes="tool" if task.in_tool_axes else "world",
        position_tolerance=tolerances.position, orientation_tolerance=tolerances.orientation,
        limits=limits, **effort,
    )  # fmt: skip
    assert found.closest is not None
    assert found.error is not None
    closest, missing = np.full((len(poses), model.n), np.nan), np.full((len(poses), 6), np.nan)
    for column, value in task.locks:
        closest[empty, column] = value
    closest[np.ix_(empty, columns)] = found.closest
    missing[empty] = found.error[:, 0]
    return _Search(empty, found.status, found.valid[:, 0], found.residual[:, 0], closest, missing)


def _with_locked_joints(model: RobotModel, task: Task) -> RobotModel:
    """The arm with fixed frames where its joints are locked: geometry only."""
    table = model.table
    sigma, theta, r = table.sigma.copy(), table.theta.copy(), table.r.copy()
    kept = np.ones(model.n, dtype=np.bool_)
    for column, value in task.locks:
        row = table.joint_rows[column]
        (r if sigma[row] == PRISMATIC else theta)[row] += value
        sigma[row], kept[column] = FIXED, False
    fixed = replace(
        table, sigma=sigma, theta=theta, r=r, lower=table.lower[kept], upper=table.upper[kept],
        velocity=table.velocity[kept], effort=table.effort[kept],
    )  # fmt: skip
    return RobotModel.from_table(fixed, base=model.base, tool=model.tool, tip=model.tip)
