"""Singular configurations: what is lost there, what is gained, and what they are called.

Seed book sections 1.3.1.4 and 1.3.2.3.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from ..._arrays import Array, as_exact, as_floats, read_only
from ...model import RobotModel
from ..poses import dgm
from ..singularity_kind import SingularityKind
from .boundary import workspace_side
from .causes import Cause, arm_geometry, causes_at
from .events import ArmGeometry
from .flags import SingularityStatus
from .frames import check_frames, lost_in_task_axes, simplest_frame
from .motion import SelfMotion, self_motions
from .rank import TOLERANCE, OperationalDimension, operational_dimension, task_rank
from .report import SMALL, SingularityReport
from .structure import arm_structure
from .task import (
    MaskAxes,
    SingularTask,
    above_zero,
    deciding_mask,
    singular_task,
    task_jacobians,
)
from .words import kinds_in_words

_TWICE = 2.0


def classify_singularity(
    model: RobotModel,
    q: ArrayLike,
    frame: str | int | None = None,
    length: float | None = None,
    tolerance: float = TOLERANCE,
    near: float = 1e-2,
    mask: ArrayLike | None = None,
    mask_axes: MaskAxes = "world",
    axes: int | None = None,
    point: int | None = None,
) -> SingularityReport:
    """What a configuration has lost and gained beside a regular one, in numbers and in words.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    q : array_like, shape (n,)
        One configuration, rad or m.
    frame : str or int, optional
        Name or number of a frame; default the tool.
    length : float, optional
        Characteristic length L in metres: linear rows are divided by it, strokes of prismatic
        joints count in it. Default the reach, `characteristic_length`, which does not depend on
        where the robot stands.
    tolerance : float
        Singular values below this fraction of the largest are zero. A wider one classifies a
        configuration near a singular one as if it were there: the components that are then
        small are given as they are.
    near : float
        Fraction below which a singular value that is not zero is called weak.
    mask : array_like, shape (6,), optional
        Ones for the components ``vx vy vz wx wy wz`` that count. Default all; the position
        alone, ``[1, 1, 1, 0, 0, 0]``, for a frame moved by at most three joints whose position
        has as many freedoms as they are (`deciding_mask`), as in `explain_singularities`.
    mask_axes : {"world", "tool"}
        Axes of the components.
    axes, point : int, optional
        Numbers of the frames in whose axes and at whose origin the lost directions are to be
        given, the projection and the intermediate frame of the book; 0 is R_0. Default: where
        they have the most zeros.

    Returns
    -------
    SingularityReport
        Lost directions, self-motions, kind, side of the workspace.

    Raises
    ------
    ShapeError, InvalidValueError, FrameNotFoundError
        ``q`` of the wrong length; a length, tolerance or mask that cannot be; no such frame.

    References
    ----------
    Seed book sections 1.3.1.3, 1.3.1.4 and 1.3.2.3. D. Oblak and D. Kohli, Boundary surfaces,
    limit surfaces, crossable and noncrossable surfaces in workspace of mechanical manipulators,
    ASME J. Mechanisms 110, 1988, for the second-order test of a boundary.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> print(classify_singularity(load("rx90"), [0.1, 0.2, -np.pi / 2, 0.4, 0.5, 0.6]))
    Singular: the robot has lost freedoms.
    Rank 5 of 6, weakest singular value ... of the largest (length 0.9 m)
    elbow: axes 2 and 3 and the wrist centre lie in one plane, stretched out
    Cannot be produced, axes of R4, at the origin of R4:
      vz = 0 whatever the joints do
      carried without torque: fz
    On a boundary: along the lost direction the tool can move to one side only.
    ...
    """
    mask = deciding_mask(model, frame, mask)
    task = singular_task(model, frame, mask, mask_axes, length)
    check_frames(task, axes, point)
    q = as_exact(q, (model.n,), "q")
    tolerance, near = above_zero(tolerance, "tolerance"), above_zero(near, "near")
    whole = operational_dimension(model, frame, None, task.length, TOLERANCE, mask, mask_axes)
    return report_of(task, q, whole, tolerance, near, axes, point)


def report_of(
    task: SingularTask,
    q: Array,
    whole: OperationalDimension,
    tolerance: float,
    near: float,
    axes: int | None = None,
    point: int | None = None,
    arm: ArmGeometry | None = None,
) -> SingularityReport:
    """`classify_singularity` of a task whose dimension is known."""
    M = whole.dimension
    sigma, lost, null, missing, zero = _spaces(task, q, whole, tolerance)
    top = float(sigma.max(initial=0.0))
    r = min(int((sigma > tolerance * top).sum()), M)
    weakest = float(sigma[M - 1] / top) if M and top > 0.0 else 0.0
    motions = self_motions(task, q, lost, null, zero)
    side, opening = workspace_side(task, q, lost, null, motions, missing, M - r)
    in_task = lost_in_task_axes(task, lost)
    nothing = lost_in_task_axes(task, np.zeros((task.rows, 0)))
    hardly = int((sigma[:M] > near * top).sum())
    causes = _causes(task, q, whole, arm) if min(r, hardly) < M else ()
    named = _named(task, q, whole, motions, lost, zero, tolerance, causes) if r < M else ()
    aside = _nearby(causes, named, tolerance, near) if hardly < r else ()
    weak = _weak(task, q, whole, r, hardly)
    status = SingularityStatus.REGULAR
    if r < M:
        status = SingularityStatus.SINGULAR
    elif weakest < near and M:
        status = SingularityStatus.NEAR_SINGULAR
    open_twist = None
    if opening is not None:
        open_twist = np.zeros(6)
        open_twist[task.mask] = opening / task.row_scale
    return SingularityReport(
        status=status,
        q=read_only(q),
        dimension=M,
        rank=r,
        order=M - r,
        singular_values=read_only(sigma),
        weakest=weakest,
        gap=float(task_rank(task, q, tolerance).gap),
        kinds=tuple(dict.fromkeys(kind for kind, _ in named if kind is not None)),
        words=tuple(text for _, text in named),
        near_kinds=tuple(dict.fromkeys(kind for kind, _ in aside)),
        near_words=tuple(text for _, text in aside),
        weak=simplest_frame(task, q, weak, missing, SMALL, axes, point) if hardly < r else nothing,
        side=side,
        lost=simplest_frame(task, q, lost, missing, zero, axes, point) if r < M else nothing,
        lost_in_world=in_task,
        open_twist=None if open_twist is None else read_only(open_twist),
        self_motions=motions,
        gained=M - r,
        mask=task.mask,
        length=task.length,
        tolerance=tolerance,
    )


def names_of(
    task: SingularTask,
    q: Array,
    whole: OperationalDimension,
    tolerance: float,
    arm: ArmGeometry | None = None,
) -> tuple[tuple[SingularityKind | None, str], ...]:
    """Only the names of a singular configuration, without the rest of its report."""
    _, lost, null, _, zero = _spaces(task, q, whole, tolerance)
    if not lost.shape[1]:
        return ()
    motions = self_motions(task, q, lost, null, zero)
    causes = _causes(task, q, whole, arm)
    return _named(task, q, whole, motions, lost, zero, tolerance, causes)


def _spaces(
    task: SingularTask, q: Array, whole: OperationalDimension, tolerance: float
) -> tuple[Array, Array, Array, Array, float]:
    """Singular values, lost directions, self-motions, what is always missing, what is zero."""
    M = whole.dimension
    U, sigma, Vt = np.linalg.svd(task_jacobians(task, q))
    top = float(sigma.max(initial=0.0))
    r = min(int((sigma > tolerance * top).sum()), M)
    zero = max(1e-9, 10.0 * float(sigma[r]) / top) if r < min(M, len(sigma)) and top else 1e-9
    missing = _missing(task, whole)
    lost = _without(U[:, r:], missing) if r < M else np.zeros((task.rows, 0))
    null = _without(Vt[r:].T, np.eye(task.model.n)[:, ~task.moving])
    return as_floats(sigma, "sigma"), lost, null, missing, zero


def _causes(
    task: SingularTask, q: Array, whole: OperationalDimension, arm: ArmGeometry | None
) -> tuple[Cause, ...]:
    return causes_at(task, q, whole.dimension, arm or arm_geometry(task)) if whole.dimension else ()


def _named(
    task: SingularTask,
    q: Array,
    whole: OperationalDimension,
    motions: tuple[SelfMotion, ...],
    lost: Array,
    zero: float,
    tolerance: float,
    causes: tuple[Cause, ...],
) -> tuple[tuple[SingularityKind | None, str], ...]:
    """Kinds of the singular sets on which q is, in the words for what is seen at q."""
    wrenches = np.zeros((lost.shape[1], 6))
    wrenches[:, task.mask] = (lost * task.row_scale[:, None]).T
    if task.mask_axes == "tool":
        wrenches = _turned(task, q, wrenches)
    seen = kinds_in_words(task, q, arm_structure(task), motions, wrenches, whole.redundancy, zero)
    here = [cause for cause in causes if cause.known and cause.weak <= _there(tolerance)]
    here = here or [cause for cause in causes if not cause.known][:1]
    if not here:
        return seen
    named: list[tuple[SingularityKind | None, str]] = []
    for kind, text in _ordered(here):
        words = [(k, t) for k, t in seen if k is kind]
        named += words or [(kind, f"{kind.value}: {text}")]
    return tuple(dict.fromkeys([*named, *((k, t) for k, t in seen if k is None)]))


def _nearby(
    causes: tuple[Cause, ...],
    named: tuple[tuple[SingularityKind | None, str], ...],
    tolerance: float,
    near: float,
) -> tuple[tuple[SingularityKind, str], ...]:
    """Kinds of the singular sets beside q that make a freedom weak, each with a sentence."""
    lost = {kind for kind, _ in named}
    away = [cause for cause in causes if cause.weak > _there(tolerance)]
    beside = [cause for cause in away if cause.known and cause.weak <= _TWICE * near]
    # where none is that near to first order, the nearest is what makes it weak
    beside = beside or away[:1]
    texts = [(kind, f"{kind.value}: {text}") for kind, text in _ordered(beside)]
    return tuple((kind, text) for kind, text in texts if kind not in lost)


def _ordered(causes: Sequence[Cause]) -> list[tuple[SingularityKind, str]]:
    """Their events, each once, from the shoulder to the wrist."""
    order = list(SingularityKind)
    events = dict.fromkeys(event for cause in causes for event in cause.events)
    return sorted(events, key=lambda event: order.index(event[0]))


def _there(tolerance: float) -> float:
    """First-order estimates below this are zero."""
    return max(10.0 * tolerance, 1e-7)


def _weak(task: SingularTask, q: Array, whole: OperationalDimension, r: int, hardly: int) -> Array:
    """Orthonormal weak directions that are not lost."""
    if hardly >= r:
        return np.zeros((task.rows, 0))
    U = np.linalg.svd(task_jacobians(task, q))[0]
    return _without(as_floats(U[:, hardly:r], "weak"), _missing(task, whole))


def _missing(task: SingularTask, whole: OperationalDimension) -> Array:
    """Orthonormal directions without units that no configuration has, shape (m, s)."""
    rows = whole.missing_in_frame if task.mask_axes == "tool" else whole.missing_in_world
    return np.linalg.qr((rows[:, task.mask] / task.row_scale).T)[0]


def _without(space: Array, part: Array) -> Array:
    """Orthonormal basis of what a space has outside a part of it."""
    U, sigma, _ = np.linalg.svd(space - part @ (part.T @ space), full_matrices=False)
    return U[:, sigma > 0.5]


def _turned(task: SingularTask, q: Array, wrenches: Array) -> Array:
    R = dgm(task.model, q, task.frame)[:3, :3]
    return (wrenches.reshape(-1, 2, 3) @ R.T).reshape(-1, 6)
