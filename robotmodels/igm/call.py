"""The steps of an inverse model: check, solve by the plan or by another method, arrange."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, as_core, as_mask, as_vector, batch_rows
from ..errors import InvalidValueError
from ..model import RobotModel
from .arm_angle import ArmAngle, arm_angle_postures
from .arrange import PlanRows, Rows, arranged, put, result_fields
from .branches import branches
from .chain import far_along_rails
from .check import checked
from .constraints import Components, constraints
from .families import KnownArm, known_arm, may_be_reached, may_miss_solutions, solver_for
from .loop import JointChain
from .paul.layout import GIVEN, NEEDS_CHECK, WITHIN_LIMITS
from .pose_search import Outcome, pose_search, space_of
from .postures import Postures, no_postures
from .redundant import Redundant
from .request import FARTHEST, WHOLE_POSE, Task, locks_of, options_of, poses_of, relations_of
from .singular import complete
from .solutions import IGMSolutions, later, of_fields
from .solver import Solver, Tolerances, postures
from .status import IGMStatus

NO_SOLVER = "numeric search for one posture: no family of closed forms serves this arm"
"""Method of a result where only the search serves the arm."""

REASON = (4, 60)
"""Starts and steps of the search that only looks for the reason why a pose has no solution."""
THOROUGH = (100, 40)
"""The same where no method proves that there is none."""
NEAR = 1e-5
"""Error below which a closest posture is refined before it decides about the reach [m, rad]."""

_FLOAT = np.dtype(np.float64)


@dataclass(frozen=True, slots=True, eq=False)
class Request:
    """Checked request of one call."""

    model: RobotModel
    arm: KnownArm
    task: Task
    solver: Solver | None
    given: bool
    limits: bool
    tolerances: Tolerances


def solved(
    model: RobotModel,
    T: ArrayLike,
    q_ref: ArrayLike | None,
    mask: ArrayLike | str | None,
    mask_axes: str,
    limits: bool,
    lock: Mapping[int | str, float] | None,
    arm_angle: ArrayLike | None,
    position_tolerance: float,
    orientation_tolerance: float,
    relations: tuple[ArrayLike, ArrayLike] | None,
) -> IGMSolutions:
    """The inverse geometric model; see `igm`."""
    quick = None
    if (
        mask is lock is arm_angle is relations is None
        and limits is False
        and mask_axes == "world"
        and position_tolerance == 1e-9 == orientation_tolerance
        and type(T) is np.ndarray
        and type(model) is RobotModel
    ):
        quick = _unchecked(model, T, q_ref)
        if quick is not None and quick.most >= 0:
            return later(quick)
    tolerances = options_of(model, mask_axes, limits, position_tolerance, orientation_tolerance)
    if relations is not None and not mask is lock is arm_angle is None:
        raise InvalidValueError(
            "relations: not together with mask, lock or arm_angle; a locked joint is a "
            "relation too, with a single 1 in its row."
        )
    locks, related = relations_of(model, relations)
    task = Task(
        mask=tuple(as_mask(mask).tolist()),
        in_tool_axes=mask_axes == "tool",
        locks=locks or locks_of(model, lock),
        by_arm_angle=arm_angle is not None,
        relations=related,
    )
    if quick is None or quick.most == NEEDS_CHECK:
        batch, poses, references = _checked(model, T, q_ref, bool(limits))
    else:  # the kernel has found them proper
        batch, poses = quick.batch, np.asarray(T).reshape(-1, 4, 4)
        references = np.zeros((len(poses), model.n))
        references[:] = 0.0 if q_ref is None else q_ref
    arm = known_arm(model, task == Task())
    solver = solver_for(model, arm, task)
    request = Request(model, arm, task, solver, q_ref is not None, bool(limits), tolerances)
    periodic = arm.never if limits else arm.turns
    if arm.plan is solver is not None and tolerances == Tolerances():
        rows = _by_plan(request, poses, references, quick)
    elif arm_angle is None:
        rows = _by_solver(request, poses, references)
    else:
        # every pose once for every angle, the angles behind
        angles = as_core(arm_angle, (), "arm_angle")
        psi = np.tile(angles.ravel(), poses.shape[0])
        poses, references = (np.repeat(a, angles.size, axis=0) for a in (poses, references))
        batch = (*batch, *angles.shape)
        rows = _by_solver(request, poses, references, psi)
    method = NO_SOLVER if solver is None else solver.method
    return of_fields(result_fields(batch, rows, method, periodic, task.mask))


def _unchecked(model: RobotModel, T: Array, q_ref: ArrayLike | None) -> PlanRows | None:
    """Run the plan of the arm on arrays that need no conversion; None for others."""
    arm = known_arm(model)
    if arm.kernel is None or T.dtype is not _FLOAT or not T.flags.c_contiguous:
        return None
    if T.shape == (4, 4):
        batch, poses = (), T.reshape(1, 4, 4)
    elif T.shape[-2:] == (4, 4) and q_ref is None:
        batch, poses = T.shape[:-2], T.reshape(-1, 4, 4)
    else:
        return None
    if q_ref is None:
        references = arm.zero if len(poses) == 1 else np.zeros((len(poses), arm.turns.size))
    elif type(q_ref) is np.ndarray and q_ref.dtype is _FLOAT and q_ref.shape == arm.turns.shape:
        references = np.ascontiguousarray(q_ref).reshape(1, -1)
    else:
        return None
    return _plan_rows(arm, batch, poses, references, 0 if q_ref is None else GIVEN)


def _plan_rows(
    arm: KnownArm, batch: tuple[int, ...], poses: Array, references: Array, mode: int
) -> PlanRows:
    """Run the plan. Shapes: poses (N, 4, 4), references (N, n)."""
    N, S = len(poses), arm.most
    q, residual = np.empty((N, S, arm.turns.size)), np.empty((N, S))
    marks = np.empty((N, 2 + 2 * S), np.int64)
    assert arm.kernel is not None
    most = arm.kernel(arm.instructions, arm.numbers, poses, references, mode, q, residual, marks)
    return PlanRows(arm, batch, q, residual, marks, most, mode)


def _checked(
    model: RobotModel, T: ArrayLike, q_ref: ArrayLike | None, limits: bool
) -> tuple[tuple[int, ...], Array, Array]:
    """Batch shape, poses (N, 4, 4), references (N, n)."""
    poses = poses_of(T)
    flat = poses.reshape(*poses.shape[:-2], 16)
    reference = np.zeros(model.n) if q_ref is None else as_vector(q_ref, model.n, "q_ref")
    if np.abs(reference).max(initial=0.0) > FARTHEST:
        raise InvalidValueError(
            f"q_ref: expected joint values within +-{FARTHEST:g} rad or m, got "
            f"{float(np.abs(reference).max()):g}; reduce angles modulo 2 pi."
        )
    batch, (rows, references) = batch_rows((flat, reference), ("T", "q_ref"))
    if limits:
        references = np.clip(references, model.lower, model.upper)
    return batch, rows.reshape(-1, 4, 4), references


def _by_plan(request: Request, poses: Array, references: Array, quick: PlanRows | None) -> Rows:
    """Solutions by Paul's plan; poses where it is unreliable by the arm's other method."""
    if quick is None or quick.most == NEEDS_CHECK:
        mode = GIVEN * request.given | WITHIN_LIMITS * request.limits
        quick = _plan_rows(request.arm, (), poses, references, mode)
    if quick.most >= 0:
        return quick.rows()
    doubtful = np.flatnonzero(quick.marks[:, 1] == IGMStatus.NOT_CONVERGED)
    if quick.most == NEEDS_CHECK or doubtful.size == len(poses):
        return _by_solver(request, poses, references)
    part = _by_solver(request, poses[doubtful], references[doubtful])
    return put(quick._replace(most=-1 - quick.most).rows(), doubtful, part)


def _by_solver(request: Request, poses: Array, references: Array, psi: Array | None = None) -> Rows:
    """Solutions by the arm's solver; a numeric search gives the reason where there is none.

    Shapes: poses (N, 4, 4), references (N, n), psi (N,).
    """
    arm, task, solver, limits = request.arm, request.task, request.solver, request.limits
    U = np.ascontiguousarray(arm.to_base @ poses)
    # locked joints are not solved for: like joints off the path they keep their reference
    locked = [column for column, _ in task.locks]
    if locked:
        references = references.copy()
        references[:, locked] = [value for _, value in task.locks]
    columns = arm.columns[~np.isin(arm.columns, locked)]
    own = np.ascontiguousarray(references[:, columns])

    def laid_out(found: Postures) -> Rows:
        code, labels = branches(solver, found)
        return arranged(found, code, labels, columns, references, request.given, arm.joints, limits)

    found = _solved_chain(request, U, psi, own)
    rows, solved = laid_out(found), np.asarray(found.valid.any(axis=1))
    status = rows.status
    if solver is not None:
        missing = may_miss_solutions(solver, U, found, own)
        status[missing & (status <= IGMStatus.REACHED_FAMILY)] = IGMStatus.INCOMPLETE
        status[missing & (status == IGMStatus.OUTSIDE_LIMITS)] = IGMStatus.NOT_CONVERGED
    at = np.flatnonzero(status == IGMStatus.NOT_CONVERGED)
    if at.size == 0:
        return rows
    # others of a family, or those that were missed, may lie within the limits
    thorough = solved[at] | may_be_reached(solver, U[at], own[at])
    search = diagnose(
        request.model, task, thorough, U[at], references[at], limits, request.tolerances
    )
    status[at] = search.status
    met = np.flatnonzero(search.valid)
    if met.size:
        # postures that only the search found
        n = at[met]
        part = no_postures(met.size, 1, columns.size)
        part.q[:, 0], part.residual[:, 0] = search.q[np.ix_(met, columns)], search.residual[met]
        part.valid[...], part.moving[:, 0] = True, search.family[np.ix_(met, columns)]
        part.family[...] = part.moving.any(axis=-1)
        if solver is not None and not limits and psi is None and task == Task(locks=task.locks):
            part = complete(solver.chain, U[n], part, own[n], request.tolerances)
        rows = laid_out(found.put(n, part))
        if solver is not None:
            # the solver found no solution of a pose that is reached: it misses solutions
            unproven = ~solved[n] & (status[n] == IGMStatus.REACHED)
            status[n[unproven]] = IGMStatus.INCOMPLETE
    closest, lacking = np.full(references.shape, np.nan), np.full((len(U), 6), np.nan)
    closest[at], lacking[at] = search.q, search.error
    return rows._replace(status=status, closest=closest, missing=lacking)


def _solved_chain(request: Request, U: Array, psi: Array | None, references: Array) -> Postures:
    """Postures of a chain; poses far along rails at its base are solved beside the origin."""
    task, solver = request.task, request.solver
    if solver is None or task.relations or not all(task.mask[:3]):
        return _completed(request, U, psi, references)
    chain = solver.chain
    moved, poses = far_along_rails(chain, U)
    if not moved.any():
        return _completed(request, U, psi, references)
    found = _completed(request, poses, psi, references - moved)
    n, s = np.nonzero(found.valid)
    wanted = constraints(chain, Components(task.mask, task.in_tool_axes))
    q, residual, valid = found.q + moved[:, None], found.residual.copy(), found.valid.copy()
    residual[n, s], valid[n, s] = wanted.met(U[n], q[n, s], request.tolerances)
    return replace(found, q=q, residual=residual, valid=valid)


def _completed(request: Request, U: Array, psi: Array | None, references: Array) -> Postures:
    """Postures of a chain, self-motions brought to the reference, double roots marked."""
    solver, tolerances = request.solver, request.tolerances
    if solver is None:
        found = no_postures(len(U), 1, references.shape[1])
    elif psi is not None:
        if not isinstance(solver, ArmAngle):
            raise InvalidValueError(
                "arm_angle: needs seven revolute joints, the first three axes meeting in a "
                "shoulder and the last three in a wrist, and no locked joint or mask beside it. "
                f"For other arms with seven joints lock a joint. Solver: {solver.method}."
            )
        found = arm_angle_postures(solver, U, psi, references, tolerances)
        # the angle is given, so that only joints that took a reference are free
        found.family[...] = found.free.any(axis=-1)
    else:
        found = postures(solver, U, references, tolerances)
    whole = request.task.mask == WHOLE_POSE
    if solver is not None and whole and solver.chain.k <= 6 and not isinstance(solver, Redundant):
        return complete(solver.chain, U, found, references, tolerances)
    moving = np.zeros(found.q.shape, np.bool_)
    if solver is not None and (psi is None or not whole):
        moving = moving_joints(solver.chain, request.task, U, found)
    moving |= found.free
    return replace(found, moving=moving)


def moving_joints(chain: JointChain, task: Task, U: Array, found: Postures) -> NDArray[np.bool_]:
    """Joints that move along the self-motions of redundant arms and masked tasks (N, S, k)."""
    moving = np.zeros(found.q.shape, np.bool_)
    n, s = np.nonzero(found.family & found.valid)
    if n.size == 0:
        return moving
    wanted = constraints(chain, Components(task.mask, task.in_tool_axes))
    J = wanted.jacobians(U[n], found.q[n, s])
    _, sizes, rows = np.linalg.svd(J)
    rank = np.sum(sizes > 1e-6 * sizes[:, :1], axis=1)
    null = np.where((np.arange(chain.k) >= rank[:, None])[..., None], rows, 0.0)
    moving[n, s] = np.abs(null).max(axis=1) > 1e-6
    return moving


# --- poses without solution ---


def diagnose(
    model: RobotModel,
    task: Task,
    thorough: NDArray[np.bool_],
    U: Array,
    references: Array,
    limits: bool,
    tolerances: Tolerances,
) -> Outcome:
    """Status of poses without IK solution, the closest posture and its error, in columns of q.

    Shapes: thorough (N,); U (N, 4, 4) in R_0, references (N, n). A search that met a pose outside
    the limits, or without the relations or the arm angle, proves nothing: NaN, not converged.
    """
    N, components = len(U), Components(task.mask, task.in_tool_axes)
    q, family = references.copy(), np.zeros(references.shape, np.bool_)
    error, residual = np.empty((N, 6)), np.empty(N)
    met, status = np.empty(N, np.bool_), np.empty(N, np.int8)
    for rows, (starts, steps) in (
        (np.flatnonzero(~thorough), REASON), (np.flatnonzero(thorough), THOROUGH),
    ):  # fmt: skip
        space = space_of(model, limits, starts, None, task.locks)
        chain, columns = space.chain, space.chain.columns
        if rows.size:
            at = np.ix_(rows, columns)
            # closed forms may miss a singular pose: the whole pose is searched before its position
            effort = tolerances, starts, steps
            found = pose_search(space, components, effort, U[rows], q[at], True)
            q[at], family[at], error[rows] = found.q, found.family, found.error
            residual[rows], met[rows], status[rows] = found.residual, found.valid, found.status
    near = np.flatnonzero(thorough & ~met & (residual < NEAR))
    if near.size and not limits and task == Task(locks=task.locks):
        # beside a singular posture the error falls with the square of the distance
        candidates, there = q[np.ix_(near, columns)][:, None], np.ones((near.size, 1), np.bool_)
        found = checked(chain, U[near], candidates, there, tolerances, rough=np.inf)
        hit, row = near[found.valid[:, 0]], found.valid[:, 0]
        q[np.ix_(hit, columns)], residual[hit] = found.q[row, 0], found.residual[row, 0]
        met[hit], error[hit], status[near] = True, 0.0, IGMStatus.NOT_CONVERGED
        status[hit] = IGMStatus.REACHED
    no_reason = status == IGMStatus.OUTSIDE_LIMITS
    if task.relations or task.by_arm_angle:
        no_reason |= met
    q[no_reason], error[no_reason] = np.nan, np.nan
    met[no_reason], status[no_reason] = False, IGMStatus.NOT_CONVERGED
    return Outcome(q, error, residual, met, family, status)
