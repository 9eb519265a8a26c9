"""Postures of a chain as rows of a result: ordered, labelled, in the model's columns."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from ..errors import InvalidValueError
from ..model import RobotModel
from .arm_angle import ArmAngle, arm_angle_postures
from .asked import IMPROPER, WHOLE_POSE, Task
from .branches import branches
from .by_plan import TOLERANCES, plan_kernel
from .chain import far_along_rails
from .check import checked
from .constraints import Components, asked_jacobians, constraints
from .families import may_miss_solutions
from .known import KnownArm
from .loop import JointChain
from .motion import lever
from .postures import Postures
from .redundant import Redundant
from .singular import complete
from .solver import Found, Solver, Tolerances, nothing_found, postures
from .status import IGMStatus
from .unreachable import diagnose


@dataclass(frozen=True, slots=True, eq=False)
class Call:
    """Checked request of one call."""

    model: RobotModel
    arm: KnownArm
    task: Task
    solver: Solver | None
    given: bool
    limits: bool
    tolerances: Tolerances


class Rows(NamedTuple):
    """Fields of an `IGMSolutions` for N poses, S rows a pose of which ``most`` are in use.

    ``double``, ``free`` and ``family`` are None where no row has any.
    """

    q: Array
    valid: NDArray[np.bool_]
    residual: Array
    inside: NDArray[np.bool_]
    code: NDArray[np.int16]
    status: NDArray[np.int8]
    labels: tuple[str, ...]
    most: int
    double: NDArray[np.bool_] | None = None
    free: NDArray[np.bool_] | None = None
    family: NDArray[np.bool_] | None = None
    closest: Array | None = None
    missing: Array | None = None


def rows_by_family(call: Call, poses: Array, references: Array, psi: Array | None = None) -> Rows:
    """IK solutions by the arm's solver; a numeric search says why poses have none.

    Shapes: poses (N, 4, 4), references (N, n), psi (N,).
    """
    model, arm, task = call.model, call.arm, call.task
    U = np.ascontiguousarray(arm.to_base @ poses)
    # locked joints are not solved for: like joints off the path they keep their reference
    locked = [column for column, _ in task.locks]
    if locked:
        references = references.copy()
        references[:, locked] = [value for _, value in task.locks]
    columns = arm.columns[~np.isin(arm.columns, locked)]
    found = _solved(call, U, psi, np.ascontiguousarray(references[:, columns]))
    rows = _laid_out(call, found, references, columns)
    if call.solver is not None:
        missing = may_miss_solutions(call.solver, U, found, references[:, columns])
        reached = rows.status <= IGMStatus.REACHED_FAMILY
        rows.status[missing & reached] = IGMStatus.INCOMPLETE
    reasons = diagnose(
        model, task, call.solver is None, poses, references, call.limits, call.tolerances,
        rows.status,
    )  # fmt: skip
    if reasons is None:
        return rows
    whole = call.solver is not None and task == Task(locks=task.locks)
    members = reasons.met & reasons.family.any(axis=1)
    if whole and psi is None and not call.limits and members.any():
        # the search came upon members of families: they are settled like others
        at = reasons.rows[members]
        part = _settled_members(
            call, U[at], reasons.closest[np.ix_(at, columns)], references[np.ix_(at, columns)]
        )
        found = found.put(at, part)
        rows = _laid_out(call, found, references, columns)
    q, residual, valid, codes = rows.q, rows.residual, rows.valid, rows.code
    assert rows.family is not None
    there = valid[reasons.rows].any(axis=1)
    rows.status[reasons.rows[~there]] = reasons.status[~there]
    # a posture that the search came upon all the same
    chosen = reasons.met & ~there
    met = reasons.rows[chosen]
    closest = reasons.closest
    q[met, 0], residual[met, 0] = closest[met], reasons.residual[chosen]
    valid[met, 0], codes[met, 0] = True, 0
    rows.family[met, 0] = reasons.family[chosen]
    low, high = model.lower <= closest[met], closest[met] <= model.upper
    rows.inside[met, 0] = np.all(low & high, axis=-1)
    return rows._replace(
        most=max(rows.most, int(met.size > 0)), closest=closest, missing=reasons.missing
    )


def _laid_out(call: Call, found: Postures, references: Array, columns: NDArray[np.int64]) -> Rows:
    """Postures of a chain as rows of a result, in the columns of the model."""
    from ._arrange import arranged

    arm = call.arm
    code, labels = branches(call.solver, found)
    N, S, _ = found.q.shape
    S, n = max(S, 1), call.model.n
    q, residual = np.full((N, S, n), np.nan), np.full((N, S), np.nan)
    valid, inside, double = np.zeros((3, N, S), np.bool_)
    codes, status = np.full((N, S), -1, np.int16), np.empty(N, np.int8)
    free, family = np.zeros((2, N, S, n), np.bool_)
    most = arranged(
        found.q, found.valid, found.residual, found.double, found.free,
        np.ascontiguousarray(found.moving), code, columns, references, int(call.given),
        arm.joints, int(call.limits), q, valid, residual, inside, codes, double, free, family,
        status,
    )  # fmt: skip
    return Rows(q, valid, residual, inside, codes, status, labels, most, double, free, family)


def _settled_members(call: Call, U: Array, q: Array, references: Array) -> Postures:
    """The postures at the reference, of the families that some postures ``(m, k)`` belong to."""
    assert call.solver is not None
    chain, there = call.solver.chain, np.ones((len(U), 1), np.bool_)
    found = checked(chain, U, q[:, None], there, call.tolerances)
    found.family[...] = found.valid
    return complete(chain, U, found, references, call.tolerances)


def rows_by_plan(
    arm: KnownArm, poses: Array, references: Array, given: bool, limits: bool
) -> Rows | None:
    """Postures by Paul's plan. Shapes: poses (N, 4, 4), references (N, n)."""
    plan, numbers = arm.plan, arm.numbers
    assert plan is not None
    S = plan.most
    N, n = references.shape
    q, residual = np.empty((N, S, n)), np.empty((N, S))
    flags, code = np.empty((2, N, S), np.bool_), np.empty((N, S), np.int16)
    status = np.empty(N, np.int8)
    most = plan_kernel()(
        plan.instructions, numbers, TOLERANCES, poses, references, given, plan.branch_of_way,
        arm.joints, limits, q, residual, flags, code, status,
    )  # fmt: skip
    if most == IMPROPER:
        return None
    return Rows(q, flags[0], residual, flags[1], code, status, plan.labels, most)


def rows_of_doubtful(call: Call, poses: Array, references: Array, rows: Rows) -> Rows:
    """Solve poses that Paul's plan left in doubt by the arm's other solver.

    Shapes: poses (N, 4, 4), references (N, n).
    """
    doubtful = np.flatnonzero(rows.status == IGMStatus.NOT_CONVERGED)
    part = rows_by_family(call, poses[doubtful], references[doubtful])
    labels, shorter = sorted((rows.labels, part.labels), key=len, reverse=True)
    if labels[: len(shorter)] != shorter:
        # the plan and the family have words of their own
        labels = rows.labels + part.labels
        part = part._replace(code=np.where(part.valid, part.code + len(rows.labels), -1))
    N, S, n = rows.q.shape
    most, wide = max(-1 - rows.most, part.most), max(S, part.most)

    def joined(name: str, nothing: float) -> NDArray[Any]:
        whole, piece = getattr(rows, name), getattr(part, name)
        if whole is None or whole.shape[1] < wide:
            old = whole
            whole = np.full((N, wide, *piece.shape[2:]), nothing, piece.dtype)
            if old is not None:
                whole[:, :S] = old
        keep = min(wide, piece.shape[1])
        whole[doubtful, :keep] = piece[:, :keep]
        return whole

    rows.status[doubtful] = part.status
    closest = missing = None
    if part.closest is not None and part.missing is not None:
        closest, missing = np.full((N, n), np.nan), np.full((N, 6), np.nan)
        closest[doubtful], missing[doubtful] = part.closest, part.missing
    return Rows(
        q=joined("q", np.nan),
        valid=joined("valid", False),
        residual=joined("residual", np.nan),
        inside=joined("inside", False),
        code=joined("code", -1),
        status=rows.status,
        labels=labels,
        most=most,
        double=joined("double", False),
        free=joined("free", False),
        family=joined("family", False),
        closest=closest,
        missing=missing,
    )


def _solved(call: Call, U: Array, psi: Array | None, references: Array) -> Postures:
    """Postures of a chain; poses far along rails at its base are solved beside the origin."""
    task, solver = call.task, call.solver
    if solver is None or task.relations or not all(task.mask[:3]):
        return _settled(call, U, psi, references)
    chain = solver.chain
    moved, poses = far_along_rails(chain, U)
    if not moved.any():
        return _settled(call, U, psi, references)
    found = _settled(call, poses, psi, references - moved)
    n, s = np.nonzero(found.valid)
    wanted = constraints(chain, Components(task.mask, task.in_tool_axes))
    q, residual, valid = found.q + moved[:, None], found.residual.copy(), found.valid.copy()
    residual[n, s], valid[n, s] = wanted.met(U[n], q[n, s], call.tolerances)
    return replace(found, q=q, residual=residual, valid=valid)


def _settled(call: Call, U: Array, psi: Array | None, references: Array) -> Postures:
    """Postures of a chain, infinite families settled and double roots marked."""
    solver, tolerances = call.solver, call.tolerances
    if solver is None:
        found = nothing_found(len(U), 1, references.shape[1])
    elif psi is not None:
        if not isinstance(solver, ArmAngle):
            if call.task.locks or call.task.mask != WHOLE_POSE:
                raise InvalidValueError(
                    "arm_angle: not together with a locked joint or a mask; each of them already "
                    "says which of the infinitely many postures are meant."
                )
            raise InvalidValueError(
                "arm_angle: this arm has none, which takes seven revolute joints with three axes "
                "that meet in a shoulder and three in a wrist; lock a joint instead, if there are "
                f"seven. It is solved by: {solver.method}."
            )
        found = arm_angle_postures(solver, U, psi, references, tolerances)
        # the angle is given, so that only joints that took a reference are free
        found.family[...] = found.free.any(axis=-1)
    else:
        found = postures(solver, U, references, tolerances)
    whole = call.task.mask == WHOLE_POSE
    if solver is not None and whole and solver.chain.k <= 6 and not isinstance(solver, Redundant):
        return complete(solver.chain, U, found, references, tolerances)
    moving = np.zeros(found.q.shape, np.bool_)
    if solver is not None and psi is None and whole:
        from ._moving import moving_joints

        chain = solver.chain
        length = float(np.linalg.norm(chain.D[:, :3, 3], axis=-1).sum()) or 1.0
        sigma, rows = np.ascontiguousarray(chain.sigma), found.family & found.valid
        moving_joints(sigma, chain.D, length, found.q, rows, moving)
    if solver is not None and not whole:
        moving |= moving_for_mask(solver.chain, call.task, U, found)
    moving |= found.free
    return replace(found, moving=moving)


def moving_for_mask(chain: JointChain, task: Task, U: Array, found: Found) -> NDArray[np.bool_]:
    """Joints that move along the families of a masked task, shape (N, S, k)."""
    moving = np.zeros(found.q.shape, np.bool_)
    n, s = np.nonzero(found.family & found.valid)
    if n.size == 0:
        return moving
    components = Components(task.mask, task.in_tool_axes)
    J = asked_jacobians(chain, U[n], found.q[n, s], components)
    J[:, : sum(task.mask[:3])] /= lever(chain)
    _, sizes, rows = np.linalg.svd(J)
    rank = np.sum(sizes > 1e-6 * sizes[:, :1], axis=1)
    null = np.where((np.arange(chain.k) >= rank[:, None])[..., None], rows, 0.0)
    moving[n, s] = np.abs(null).max(axis=1) > 1e-6
    return moving
