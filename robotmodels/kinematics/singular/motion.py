"""Self-motions at a configuration: which are finite, and whether they free a lost direction.

A velocity v of the null space, ``J v = 0``, is the start of a motion that leaves the tool where it
is only if the second order allows it: ``J a + (dJ/dt) v = 0`` must have a solution a, that is
``u^T (dJ/dt) v = 0`` for every u with ``J^T u = 0``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..._arrays import Array, Rebuilt, read_only
from ..._outcomes import Outcome
from ..poses import dgm
from .bases import normalised, sparse_basis
from .task import SingularTask, task_derivatives, task_jacobians

_ZERO_FORM = 1e-6
_SHORT = 0.01
_MET = 1e-11


class SelfMotionKind(Outcome):
    """How far a self-motion goes.

    Attributes
    ----------
    sentence : str
        What a person reads.

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


@dataclass(frozen=True, slots=True, eq=False)
class SelfMotion(Rebuilt):
    """One joint motion that leaves the tool still, to first order. Read-only.

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
    """Basis of the null space with few joints in each vector, and what each is worth.

    Shapes: q (n,), lost (m, p), null (n, k).
    """
    basis = sparse_basis(null.T, zero)
    forms = second_order_forms(task, q, lost, null)
    if len(basis) == 2:
        basis = _aligned(basis, null, forms, zero)
    numbers = task.model.table.joint_rows + 1
    rank = null.shape[0] - null.shape[1]
    found = []
    for row in basis:
        unit = row / np.linalg.norm(row)
        along = null.T @ unit
        obstruction = float(np.abs(np.einsum("pij,i,j->p", forms, along, along)).max(initial=0.0))
        if obstruction > max(_ZERO_FORM, 10.0 * zero):
            kind = SelfMotionKind.INFINITESIMAL
        elif all(_begins(task, q, unit, s * _SHORT, rank) for s in (1.0, -1.0)):
            kind, obstruction = SelfMotionKind.FINITE, 0.0
        else:
            kind = SelfMotionKind.UNDECIDED
        taking = np.abs(row) > zero
        found.append(
            SelfMotion(
                velocity=read_only(row * task.joint_scale),
                joints=tuple(int(j) for j in numbers[taking]),
                kind=kind,
                obstruction=obstruction,
            )
        )
    return tuple(found)


def second_order_forms(task: SingularTask, q: Array, lost: Array, null: Array) -> Array:
    """Quadratic forms ``u^T (dJ/dt) v`` on the null space.

    Shapes: q (n,), lost (m, p), null (n, k) -> (p, k, k).
    """
    derivatives = task_derivatives(task, q)
    forms = np.einsum("ma,imj,ib,jc->abc", lost, derivatives, null, null)
    return 0.5 * (forms + forms.transpose(0, 2, 1))


def _begins(task: SingularTask, q: Array, unit: Array, step: float, rank: int) -> bool:
    there = moved_on(task, q, q, unit, step, rank)
    if there is None:
        return False
    return bool(np.linalg.norm((there - q) / task.joint_scale - step * unit) < 0.25 * abs(step))


def moved_on(
    task: SingularTask, home: Array, q: Array, unit: Array, step: float, rank: int | None = None
) -> Array | None:
    """Configuration a step along a direction that keeps the frame's pose."""
    goal = dgm(task.model, home, task.frame)
    there = q + step * unit * task.joint_scale
    for _ in range(20):
        error = _off(task, goal, dgm(task.model, there, task.frame))
        ahead = float(unit @ ((there - q) / task.joint_scale)) - step
        wrong = np.append(error, ahead)
        if np.abs(wrong).max() < _MET:
            return there
        A = np.vstack([task_jacobians(task, there), unit])
        U, sigma, Vt = np.linalg.svd(A, full_matrices=False)
        keep = sigma > 1e-3 * sigma[0]
        if rank is not None:
            keep[: rank + 1] = sigma[: rank + 1] > 1e-9 * sigma[0]
        correction = Vt[keep].T @ ((U[:, keep].T @ wrong) / sigma[keep])
        if np.linalg.norm(correction) > 1.0:
            return None
        there = there - correction * task.joint_scale
    return None


def _off(task: SingularTask, goal: Array, T: Array) -> Array:
    """How far a pose is from another, in the components and units of a task."""
    turn = T[:3, :3] @ goal[:3, :3].T
    twist = np.empty(6)
    twist[:3] = T[:3, 3] - goal[:3, 3]
    twist[3:] = 0.5 * np.array(
        [turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]
    )
    if task.mask_axes == "tool":
        twist = (twist.reshape(2, 3) @ goal[:3, :3]).ravel()
    return twist[task.mask] * task.row_scale


def _aligned(basis: Array, null: Array, forms: Array, zero: float) -> Array:
    """Of a plane of self-motions, those on which all forms vanish, if there are such."""
    if not len(forms):
        return basis
    main = forms[np.abs(forms).max(axis=(1, 2)).argmax()]
    if np.abs(main).max() < _ZERO_FORM:
        return basis
    a, b, c = main[0, 0], 2.0 * main[0, 1], main[1, 1]
    # a cos^2 + b cos sin + c sin^2 = 0 as one sinusoid of twice the angle
    size, phase = np.hypot(a - c, b), np.arctan2(b, a - c)
    ratio = -(a + c) / size if size else np.inf
    if abs(ratio) > 1.0 + 1e-9:
        return basis
    half = np.arccos(np.clip(ratio, -1.0, 1.0))
    allowed: list[Array] = []
    for angle in (0.5 * (phase + half), 0.5 * (phase - half)):
        along = np.array([np.cos(angle), np.sin(angle)])
        worst = np.abs(np.einsum("pij,i,j->p", forms, along, along)).max()
        row = normalised(null @ along, max(1e-13, 0.1 * zero))
        if worst < _ZERO_FORM and not (
            allowed and min(np.abs(row - allowed[0]).max(), np.abs(row + allowed[0]).max()) < 1e-5
        ):
            allowed.append(row)
    for row in basis:  # completed by what it was
        if len(allowed) == 1:
            both = np.array([allowed[0] / np.linalg.norm(allowed[0]), row / np.linalg.norm(row)])
            if np.linalg.svd(both, compute_uv=False)[1] > 0.1:
                allowed.append(row)
    return np.array(allowed) if len(allowed) == 2 else basis
