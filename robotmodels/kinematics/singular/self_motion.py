"""Self-motions at a configuration, and whether they free a lost direction.

A velocity v of the null space, ``J v = 0``, continues to a motion that keeps the pose of the tool
only if the second order allows it: ``u^T (dJ/dt) v = 0`` for every lost direction u, ``J^T u = 0``.
The same form gives the side of a singular pose to which the tool can move along u.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..._arrays import Array, Rebuilt, read_only
from ..._outcomes import Outcome
from ..poses import dgm
from .rank import sparse_basis
from .task import SingularTask, task_derivatives, task_jacobians

_ZERO_FORM = 1e-6
_STEP = 0.01
_MET = 1e-11


class SelfMotionKind(Outcome):
    """Extent of a self-motion; each member has a ``sentence``."""

    FINITE = 0, "The joints can move by a finite amount while the tool stays at rest."
    INFINITESIMAL = (
        1, "The joints can move to first order only: at second order the tool moves, too.",
    )  # fmt: skip
    UNDECIDED = 2, "The second order allows it, but no such motion was found along it."


class WorkspaceSide(Outcome):
    """Place of a singular pose among the poses reached near that configuration.

    Each member has a ``sentence``. UNDECIDED also where several directions are lost.
    """

    REGULAR = 0, "No direction is lost."
    INTERIOR = 1, "Inside the workspace: the lost direction is open to both sides."
    BOUNDARY = 2, "On a boundary: along the lost direction the tool can move to one side only."
    UNDECIDED = 3, "The second order does not decide between boundary and interior."


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
        elif all(_continues(task, q, s * unit, rank) for s in (1.0, -1.0)):
            kind, obstruction = SelfMotionKind.FINITE, 0.0
        joints = tuple(int(j) for j in numbers[np.abs(row) > zero])
        found.append(SelfMotion(read_only(row * task.joint_scale), joints, kind, obstruction))
    return tuple(found)


def workspace_side(
    task: SingularTask, q: Array, lost: Array, null: Array
) -> tuple[WorkspaceSide, Array | None]:
    """Boundary or interior by the second order, and the open side of a boundary.

    Shapes: q (n,), lost (m, p), null (n, k) -> open side (m,).
    """
    if lost.shape[1] != 1:
        return WorkspaceSide.UNDECIDED if lost.shape[1] else WorkspaceSide.REGULAR, None
    values = np.linalg.eigvalsh(_forms(task, q, lost, null)[0])
    up, down = int((values > _ZERO_FORM).sum()), int((values < -_ZERO_FORM).sum())
    if up and down:
        return WorkspaceSide.INTERIOR, None
    if (up or down) and up + down == len(values):
        return WorkspaceSide.BOUNDARY, (1.0 if up else -1.0) * lost[:, 0]
    return WorkspaceSide.UNDECIDED, None


def _forms(task: SingularTask, q: Array, lost: Array, null: Array) -> Array:
    """Quadratic forms ``u^T (dJ/dt) v`` on the null space: q (n,), lost (m, p), null (n, k)."""
    forms = np.einsum("ma,imj,ib,jc->abc", lost, task_derivatives(task, q), null, null)
    return 0.5 * (forms + forms.transpose(0, 2, 1))


def _continues(task: SingularTask, start: Array, unit: Array, rank: int) -> bool:
    """Whether a configuration a short step along a direction has the pose of the start."""
    goal = dgm(task.model, start, task.frame)
    there = start + _STEP * unit * task.joint_scale
    for _ in range(20):
        moved = (there - start) / task.joint_scale
        wrong = np.append(_pose_error(task, goal, there), unit @ moved - _STEP)
        if np.abs(wrong).max() < _MET:
            return bool(np.linalg.norm(moved - _STEP * unit) < 0.25 * _STEP)
        U, sigma, Vt = np.linalg.svd(
            np.vstack([task_jacobians(task, there), unit]), full_matrices=False
        )
        keep = sigma > 1e-3 * sigma[0]
        keep[: rank + 1] = sigma[: rank + 1] > 1e-9 * sigma[0]
        correction = Vt[keep].T @ ((U[:, keep].T @ wrong) / sigma[keep])
        if np.linalg.norm(correction) > 1.0:
            return False
        there = there - correction * task.joint_scale
    return False


def _pose_error(task: SingularTask, goal: Array, q: Array) -> Array:
    """Difference of a pose from another, in the components and units of a task."""
    T = dgm(task.model, q, task.frame)
    R = T[:3, :3] @ goal[:3, :3].T
    turn = 0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    twist = np.concatenate([T[:3, 3] - goal[:3, 3], turn])
    if task.mask_axes == "tool":
        twist = (twist.reshape(2, 3) @ goal[:3, :3]).ravel()
    return twist[task.mask] * task.row_scale
