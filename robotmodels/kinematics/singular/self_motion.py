"""Self-motions at a configuration, and whether they free a lost direction.

A velocity v of the null space, ``J v = 0``, continues to a motion that keeps the pose of the tool
only if the second order allows it: ``u^T (dJ/dt) v = 0`` for every lost direction u, ``J^T u = 0``.
The same form tells on which side of a singular pose the tool can move along u.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import tau

import numpy as np

from ..._arrays import Array, Rebuilt, read_only
from ..._outcomes import Outcome
from ..poses import dgm
from .rank import sparse_basis
from .task import SingularTask, outside, task_derivatives, task_jacobians

_ZERO_FORM = 1e-6
_SHORT, _STEP = 0.01, 0.15
_MET = 1e-11


class SelfMotionKind(Outcome):
    """Extent of a self-motion; each member has a ``sentence``.

    Examples
    --------
    >>> SelfMotionKind.INFINITESIMAL.sentence
    'The joints can only begin to move: at the second order the tool leaves its place.'
    """

    FINITE = 0, "The joints can move on while the tool stays."
    INFINITESIMAL = (
        1, "The joints can only begin to move: at the second order the tool leaves its place.",
    )  # fmt: skip
    UNDECIDED = 2, "The second order allows it, but no such motion was found along it."


class WorkspaceSide(Outcome):
    """Place of a singular pose among the poses reached near that configuration.

    Each member has a ``sentence``. UNDECIDED also where several directions are lost.

    Examples
    --------
    >>> WorkspaceSide.INTERIOR.name
    'INTERIOR'
    """

    REGULAR = 0, "No direction is lost."
    INTERIOR = 1, "Inside the workspace: the lost direction is open after a self-motion or a turn."
    BOUNDARY = 2, "On a boundary: along the lost direction the tool can move to one side only."
    UNDECIDED = 3, "The second order and the self-motions do not tell boundary from interior."


@dataclass(frozen=True, slots=True, eq=False)
class SelfMotion(Rebuilt):
    """One joint motion without velocity of the tool. Read-only.

    Parameters
    ----------
    velocity : ndarray, shape (n,)
        Joint velocities, rad/s and m/s; in joint units the largest is 1.
    joints : tuple of int
        Numbers of the frames (rows of the table) whose joints take part.
    kind : SelfMotionKind
        Finite, or only infinitesimal.
    obstruction : float
        Largest ``|u^T (dJ/dt) v|`` over the unit vectors u of the lost directions, no unit;
        0 for a finite self-motion.

    Examples
    --------
    >>> SelfMotion(np.array([1.0, -1.0]), (4, 6), SelfMotionKind.FINITE, 0.0).joints
    (4, 6)
    """

    velocity: Array
    joints: tuple[int, ...]
    kind: SelfMotionKind
    obstruction: float


def self_motions(
    task: SingularTask, q: Array, lost: Array, null: Array, zero: float
) -> tuple[SelfMotion, ...]:
    """Basis of the null space with few joints in each vector, and the extent of each.

    Shapes: q (n,), lost (m, p), null (n, k).
    """
    forms = _forms(task, q, lost, null)
    numbers = task.model.table.joint_rows + 1
    rank = null.shape[0] - null.shape[1]
    found = []
    for row in sparse_basis(null.T, zero):
        unit = row / np.linalg.norm(row)
        along = null.T @ unit
        obstruction = float(np.abs(np.einsum("pij,i,j->p", forms, along, along)).max(initial=0.0))
        kind = SelfMotionKind.UNDECIDED
        if obstruction > max(_ZERO_FORM, 10.0 * zero):
            kind = SelfMotionKind.INFINITESIMAL
        elif all(_next(task, q, q, s * unit, _SHORT, rank) is not None for s in (1.0, -1.0)):
            kind, obstruction = SelfMotionKind.FINITE, 0.0
        joints = tuple(int(j) for j in numbers[np.abs(row) > zero])
        found.append(SelfMotion(read_only(row * task.joint_scale), joints, kind, obstruction))
    return tuple(found)


def workspace_side(
    task: SingularTask,
    q: Array,
    lost: Array,
    null: Array,
    motions: tuple[SelfMotion, ...],
    missing: Array,
) -> tuple[WorkspaceSide, Array | None]:
    """Boundary or interior, and the open side of a boundary.

    Shapes: q (n,), lost (m, p), null (n, k), missing (m, s) -> open side (m,).
    """
    if lost.shape[1] != 1:
        return WorkspaceSide.UNDECIDED if lost.shape[1] else WorkspaceSide.REGULAR, None
    values = np.linalg.eigvalsh(_forms(task, q, lost, null)[0])
    up, down = int((values > _ZERO_FORM).sum()), int((values < -_ZERO_FORM).sum())
    if up and down:
        return WorkspaceSide.INTERIOR, None
    finite = [m.velocity / task.joint_scale for m in motions if m.kind is SelfMotionKind.FINITE]
    turns = [_least_cosine(task, q, along, lost[:, 0], missing) for along in finite]
    if any(cosine < 1e-6 for cosine in turns):
        return WorkspaceSide.INTERIOR, None
    # the rest of the null space are self-motions that keep the lost direction
    kept = sum(cosine > 1.0 - 1e-9 for cosine in turns)
    if (up or down) and up + down + kept >= len(values):
        return WorkspaceSide.BOUNDARY, (1.0 if up else -1.0) * lost[:, 0]
    return WorkspaceSide.UNDECIDED, None


def _forms(task: SingularTask, q: Array, lost: Array, null: Array) -> Array:
    """Quadratic forms ``u^T (dJ/dt) v`` on the null space: q (n,), lost (m, p), null (n, k)."""
    forms = np.einsum("ma,imj,ib,jc->abc", lost, task_derivatives(task, q), null, null)
    return 0.5 * (forms + forms.transpose(0, 2, 1))


def _least_cosine(
    task: SingularTask, q: Array, along: Array, direction: Array, missing: Array
) -> float:
    """Least cosine of a lost direction to its place at q, along a self-motion; -1 where free."""
    least = 1.0
    for sign in (1.0, -1.0):
        here, way, before = q, sign * along / np.linalg.norm(along), direction
        for _ in range(int(tau / _STEP) + 1):
            there = _next(task, q, here, way, _STEP)
            if there is None:
                break
            way = (there - here) / task.joint_scale
            here, way = there, way / np.linalg.norm(way)
            U, sigma, _ = np.linalg.svd(task_jacobians(task, here))
            space = outside(U[:, int((sigma > 1e-6).sum()) :], missing)
            if space.shape[1] != 1:
                least = min(least, 1.0 if space.shape[1] else -1.0)
                break
            before = space[:, 0] if space[:, 0] @ before > 0.0 else -space[:, 0]
            least = min(least, float(before @ direction))
    return least


def _next(
    task: SingularTask, start: Array, q: Array, unit: Array, step: float, rank: int | None = None
) -> Array | None:
    """Configuration a step from q along a direction with the pose of start; None: none near."""
    goal = dgm(task.model, start, task.frame)
    there = q + step * unit * task.joint_scale
    for _ in range(20):
        moved = (there - q) / task.joint_scale
        wrong = np.append(_pose_error(task, goal, there), unit @ moved - step)
        if np.abs(wrong).max() < _MET:
            off = float(np.linalg.norm(moved - step * unit))
            return there if off < (0.25 if rank is not None else 0.5) * step else None
        U, sigma, Vt = np.linalg.svd(
            np.vstack([task_jacobians(task, there), unit]), full_matrices=False
        )
        keep = sigma > 1e-3 * sigma[0]
        if rank is not None:
            keep[: rank + 1] = sigma[: rank + 1] > 1e-9 * sigma[0]
        correction = Vt[keep].T @ ((U[:, keep].T @ wrong) / sigma[keep])
        if np.linalg.norm(correction) > 1.0:
            return None
        there = there - correction * task.joint_scale
    return None


def _pose_error(task: SingularTask, goal: Array, q: Array) -> Array:
    """Difference of a pose from another, in the components and units of a task."""
    T = dgm(task.model, q, task.frame)
    R = T[:3, :3] @ goal[:3, :3].T
    turn = 0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    twist = np.concatenate([T[:3, 3] - goal[:3, 3], turn])
    if task.mask_axes == "tool":
        twist = (twist.reshape(2, 3) @ goal[:3, :3]).ravel()
    return twist[task.mask] * task.row_scale
