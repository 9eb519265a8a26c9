"""Boundary or interior: whether the tool can leave a singular pose along the lost direction.

At the second order, a lost direction u opens as ``u^T (dJ/dt) v`` says for self-motions v: to one
side where this form is definite, to both where it has both signs. Where it vanishes, a finite
self-motion may turn the lost direction until the old one is free.
"""

from __future__ import annotations

from math import tau

import numpy as np

from ..._arrays import Array
from ..._outcomes import Outcome
from .motion import SelfMotion, SelfMotionKind, moved_on, second_order_forms
from .task import SingularTask, task_jacobians

_ZERO_FORM = 1e-6
_STEP = 0.15


class WorkspaceSide(Outcome):
    """Where a singular pose lies in what the robot reaches near that configuration.

    Attributes
    ----------
    sentence : str
        What a person reads.

    Examples
    --------
    >>> WorkspaceSide.INTERIOR.name
    'INTERIOR'
    """

    REGULAR = 0, "No direction is lost."
    INTERIOR = 1, "Inside the workspace: the lost direction is open after a self-motion or a turn."
    BOUNDARY = 2, "On a boundary: along the lost direction the tool can move to one side only."
    UNDECIDED = 3, "The second order and the self-motions do not tell boundary from interior."


def workspace_side(
    task: SingularTask,
    q: Array,
    lost: Array,
    null: Array,
    motions: tuple[SelfMotion, ...],
    missing: Array,
    order: int,
) -> tuple[WorkspaceSide, Array | None]:
    """Whether lost directions end at a boundary.

    Shapes: q (n,), lost (m, p), null (n, k), missing (m, s) -> open_side (m,).
    """
    if lost.shape[1] == 0:
        return WorkspaceSide.REGULAR, None
    forms = second_order_forms(task, q, lost, null)
    if len(forms) == 1:
        values = np.linalg.eigvalsh(forms[0])
        if np.abs(values).min() > _ZERO_FORM:  # the form alone decides
            if values[0] * values[-1] < 0.0:
                return WorkspaceSide.INTERIOR, None
            return WorkspaceSide.BOUNDARY, np.sign(values[0]) * lost[:, 0]
    finite = [m for m in motions if m.kind is SelfMotionKind.FINITE]
    paths = [_followed(task, q, m.velocity / task.joint_scale) for m in finite]
    left = [_left_null_spaces(task, path, missing) for path in paths]
    locked = _always_locked(lost, left)
    regular = lost.shape[1] - order
    sides = []
    for direction in (*locked.T, *_definite_combinations(forms, lost), *lost.T):
        side, sign = _side_of(direction, forms, lost, left, locked, len(finite), regular)
        if side is WorkspaceSide.BOUNDARY:
            return side, sign * direction
        sides.append(side)
    if all(side is WorkspaceSide.INTERIOR for side in sides):
        return WorkspaceSide.INTERIOR, None
    return WorkspaceSide.UNDECIDED, None


def _side_of(
    direction: Array,
    forms: Array,
    lost: Array,
    left: list[list[Array]],
    locked: Array,
    finite: int,
    regular: int,
) -> tuple[WorkspaceSide, float]:
    """One direction: by its form, and by what self-motions make of it."""
    values = np.linalg.eigvalsh(np.tensordot(lost.T @ direction, forms, axes=1))
    positive, negative = int((values > _ZERO_FORM).sum()), int((values < -_ZERO_FORM).sum())
    sign = 1.0 if positive else -1.0
    if positive and negative:
        return WorkspaceSide.INTERIOR, 0.0
    kept = np.linalg.norm(locked.T @ direction) > 1.0 - 1e-9
    # the rest of the null space moves on for ever without opening the direction
    if (positive or negative) and positive + negative + finite * kept >= len(values):
        return WorkspaceSide.BOUNDARY, sign
    if any(_opens(direction, spaces, locked, regular) for spaces in left):
        return WorkspaceSide.INTERIOR, 0.0
    return WorkspaceSide.UNDECIDED, 0.0


def _definite_combinations(forms: Array, lost: Array) -> list[Array]:
    """Combinations of lost directions whose form is definite, found by looking around."""
    p = len(forms)
    if p < 2 or p > 3:
        return []
    rng = np.random.default_rng(0)
    trials = rng.normal(size=(400, p))
    trials /= np.linalg.norm(trials, axis=1, keepdims=True)
    values = np.linalg.eigvalsh(np.tensordot(trials, forms, axes=1))
    least = values[:, 0]
    best = int(least.argmax())
    return [lost @ trials[best]] if least[best] > _ZERO_FORM else []


def _opens(direction: Array, spaces: list[Array], locked: Array, regular: int) -> bool:
    """Whether along a self-motion the tool becomes free to move in a direction."""
    rest = direction - locked @ (locked.T @ direction)
    size = np.linalg.norm(rest)
    if size < 1e-6:
        return False
    before: Array | None = None
    signs = []
    for space in spaces:
        free = space - locked @ (locked.T @ space)
        U, sigma, _ = np.linalg.svd(free, full_matrices=False)
        U = U[:, sigma > 0.5]
        if space.shape[1] <= regular:
            return True  # all freedoms are there
        if U.shape[1] > 1:
            return False
        u = U[:, 0]
        if before is not None and u @ before < 0.0:
            u = -u
        before = u
        signs.append(float(u @ rest) / float(size))
    # it turns from one side of the direction to the other: in between the direction is free
    return min(signs) < 1e-6 and max(signs) > -1e-6


def _always_locked(lost: Array, left: list[list[Array]]) -> Array:
    """Part of the lost directions that no finite self-motion opens."""
    spaces = [space for path in left for space in path]
    if not spaces:
        return lost
    inside = np.mean([lost.T @ s @ s.T @ lost for s in spaces], axis=0)
    values, vectors = np.linalg.eigh(inside)
    return lost @ vectors[:, values > 1.0 - 1e-9]


def _left_null_spaces(task: SingularTask, path: list[Array], missing: Array) -> list[Array]:
    """Orthonormal bases of the lost directions along a path, the always missing ones left out.

    The tool stands still on the path, so that all of them are seen in the same axes.
    """
    U, sigma, _ = np.linalg.svd(task_jacobians(task, np.array(path)), full_matrices=True)
    spaces = []
    for u, values in zip(U, sigma, strict=True):
        space = u[:, int((values > 1e-6).sum()) :]
        W, size, _ = np.linalg.svd(space - missing @ (missing.T @ space), full_matrices=False)
        spaces.append(W[:, size > 0.5])
    return spaces


def _followed(task: SingularTask, q: Array, direction: Array) -> list[Array]:
    """Configurations along a finite self-motion, up to a turn to each side."""
    path = [q]
    for sign in (1.0, -1.0):
        here, along = q, sign * direction / np.linalg.norm(direction)
        for _ in range(int(tau / _STEP) + 1):
            there = moved_on(task, q, here, along, _STEP)
            if there is None:
                break
            step = (there - here) / task.joint_scale
            if np.linalg.norm(step - _STEP * along) > 0.5 * _STEP:
                break
            along = step / np.linalg.norm(step)
            here = there
            path.insert(len(path) if sign > 0.0 else 0, here)
        else:
            break  # all the way round
    return path
