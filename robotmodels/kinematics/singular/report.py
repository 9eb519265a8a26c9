"""Singular configurations: lost directions, self-motions and names.

Book sections 1.3.1.3, 1.3.1.4 and 1.3.2.3. D. Oblak and D. Kohli, Boundary surfaces, limit
surfaces, crossable and noncrossable surfaces in workspace of mechanical manipulators, ASME J.
Mechanisms 110, 1988, for the second-order test of a boundary.

Parameters
----------
tolerance : float
    Singular values below this fraction of the largest are zero. A wider one classifies a
    configuration near a singular one as if it were there: the components that are then small are
    given as they are.
near : float
    Fraction below which a singular value that is not zero is called weak.
mask : array_like, shape (6,), optional
    Components that count. Default all; of a frame that at most three joints move the position
    alone, where it has as many freedoms, as in `explain_singularities`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._arrays import Array, Rebuilt, as_exact, as_floats, as_number, as_vector, read_only
from ..._outcomes import Outcome, Result
from ...model import RobotModel
from ...table_text import length_text
from .events import SingularityKind
from .frames import LostDirections, check_frames, frame_words, lost_in_task_axes, simplest_frame
from .names import arm_geometry, names_at, names_near, singular_sets
from .rank import TOLERANCE, OperationalDimension, operational_dimension, task_rank
from .self_motion import SelfMotion, WorkspaceSide, self_motions, workspace_side
from .task import (
    MaskAxes,
    SingularTask,
    counting_lines,
    deciding_mask,
    outside,
    singular_task,
    task_jacobians,
)

SMALL = 0.02
"""Parts of a weak direction below this are left out of its words."""


class SingularityStatus(Outcome):
    """Status of a configuration; fits int8. Each member has a ``sentence``."""

    REGULAR = 0, "Regular: no degree of freedom is lost."
    NEAR_SINGULAR = 1, "Near a singular configuration: a degree of freedom is nearly lost."
    SINGULAR = 2, "Singular: the robot has lost degrees of freedom."


@dataclass(frozen=True, slots=True, eq=False)
class SingularityFlags(Result):
    """Statuses of the configurations of one call. Read-only.

    Parameters
    ----------
    status : ndarray of int8, shape (...)
        Codes of `SingularityStatus`.
    rank, order : ndarray of int, shape (...)
        Local number of degrees of freedom r, and ``M - r``.
    weakest : ndarray, shape (...)
        The M-th singular value over the first, the distance from singular; no unit.
    dimension : int
        M, the global number of degrees of freedom.
    mask : ndarray of bool, shape (6,)
        Components that count.
    frame : str
        Name of the frame in sentences, such as ``"the tool"``.
    """

    status: NDArray[np.int8]
    rank: NDArray[np.int64]
    order: NDArray[np.int64]
    weakest: Array
    dimension: int
    mask: NDArray[np.bool_]
    frame: str
    outcomes = SingularityStatus


@dataclass(frozen=True, slots=True, eq=False)
class SingularityReport(Rebuilt):
    """One configuration: lost directions and self-motions. Read-only; `print` it.

    Parameters
    ----------
    status : SingularityStatus
        Regular, near singular or singular.
    q : ndarray, shape (n,)
        The configuration, rad or m.
    dimension, rank, order : int
        M, local rank r, and M - r.
    singular_values : ndarray, shape (k,)
        Descending, no unit.
    weakest, gap : float
        The M-th of them over the first, the distance from singular; and the smallest that counts
        over the largest that does not.
    kinds, words : tuples of SingularityKind and str
        Shoulder, elbow, wrist or other, and the same as sentences.
    near_kinds, near_words : tuples of SingularityKind and str
        Nearby singular sets that explain the nearly lost directions.
    weak : LostDirections
        Combinations that are nearly lost, of singular values between ``tolerance`` and ``near``.
    side : WorkspaceSide
        Boundary or interior, of the poses reached near this configuration.
    lost, lost_in_world : LostDirections
        Combinations that cannot be produced, where they have the most zeros, and in the axes of
        the task (world axes unless the mask's are the tool's) at the frame's origin.
    open_twist : ndarray, shape (6,), or None
        At a boundary: the lost direction towards the side that is open, ``[v; w]`` in the axes of
        ``lost_in_world``, unit length when metres are divided by ``length``.
    self_motions : tuple of SelfMotion
        Joint motions without velocity of the frame; ``gained`` is how many more of them than at
        regular configurations.
    mask : ndarray of bool, shape (6,)
        Components that count.
    length, tolerance : float
        Characteristic length in metres, and the relative size of zero.
    """

    status: SingularityStatus
    q: Array
    dimension: int
    rank: int
    order: int
    singular_values: Array
    weakest: float
    gap: float
    kinds: tuple[SingularityKind, ...]
    words: tuple[str, ...]
    near_kinds: tuple[SingularityKind, ...]
    near_words: tuple[str, ...]
    weak: LostDirections
    side: WorkspaceSide
    lost: LostDirections
    lost_in_world: LostDirections
    open_twist: Array | None
    self_motions: tuple[SelfMotion, ...]
    gained: int
    mask: NDArray[np.bool_]
    length: float
    tolerance: float

    def __str__(self) -> str:
        """Describe it in sentences."""
        lines = [
            self.status.sentence,
            *counting_lines(self.mask, self.lost.frame),
            f"Rank {self.rank} of {self.dimension}, weakest singular value "
            f"{self.weakest:.3g} of the largest (length {length_text(self.length)} m)",
            *self.words,
            *(f"near {text}" for text in self.near_words),
        ]
        if len(self.weak.wrenches):
            lines.append(f"Hardly produced, {self.weak.where} (parts below {SMALL:g} left out):")
            lines += [f"  {text}" for text in self.weak.rounded(SMALL)]
        if self.lost.combinations:
            lines.append(f"Cannot be produced, {self.lost.where}:")
            lines += [f"  {text} = 0 whatever the joints do" for text in self.lost.combinations]
            lines += [f"  carried without torque: {text}" for text in self.lost.carried]
            lines.append(self.side.sentence)
        for motion in self.self_motions:
            names = ", ".join(map(str, motion.joints))
            rates = ", ".join(length_text(float(x)) for x in motion.velocity)
            lines.append(f"Self-motion of joints {names}: ({rates}). {motion.kind.sentence}")
        if self.self_motions:
            lines.append(f"Self-motions gained beside a regular configuration: {self.gained}")
        return "\n".join(lines)


def singularity_flags(
    model: RobotModel,
    q: ArrayLike,
    frame: str | int | None = None,
    length: float | None = None,
    tolerance: float = TOLERANCE,
    near: float = 1e-2,
    mask: ArrayLike | str | None = None,
    mask_axes: MaskAxes = "world",
) -> SingularityFlags:
    """Status of configurations in batch: regular, near singular, singular.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> q = [[0.1, 0.2, 0.3, 0.4, x, 0.6] for x in (0.5, 1e-3, 0.0)]
    >>> singularity_flags(load("rx90"), q).status
    array([0, 1, 2], dtype=int8)
    """
    mask = deciding_mask(model, frame, mask)
    task = singular_task(model, frame, mask, mask_axes, length)
    q = as_vector(q, model.n, "q")
    tolerance, near = as_number(tolerance, "tolerance", above=0.0), as_number(near, "near", 0.0)
    M = operational_dimension(model, frame, None, task.length, TOLERANCE, mask, mask_axes).dimension
    found = task_rank(task, q, tolerance)
    rank = np.minimum(found.rank, M)
    weakest = np.zeros(rank.shape)
    if M:
        sigma = found.singular_values
        top = sigma[..., 0]
        weakest = np.divide(sigma[..., M - 1], top, out=weakest, where=top > 0.0)
    status = np.where(weakest < near, SingularityStatus.NEAR_SINGULAR, SingularityStatus.REGULAR)
    status = np.where(rank < M, SingularityStatus.SINGULAR, status if M else 0)
    return SingularityFlags(
        status=read_only(status, np.int8),
        rank=read_only(rank, np.int64),
        order=read_only(M - rank, np.int64),
        weakest=read_only(weakest),
        dimension=M,
        mask=task.mask,
        frame=frame_words(frame),
    )


def classify_singularity(
    model: RobotModel,
    q: ArrayLike,
    frame: str | int | None = None,
    length: float | None = None,
    tolerance: float = TOLERANCE,
    near: float = 1e-2,
    mask: ArrayLike | str | None = None,
    mask_axes: MaskAxes = "world",
    axes: int | None = None,
    point: int | None = None,
) -> SingularityReport:
    """Degrees of freedom lost and gained at a configuration, in numbers and in words.

    Book sections 1.3.1.3, 1.3.1.4 and 1.3.2.3; Oblak and Kohli 1988.

    Parameters
    ----------
    q : array_like, shape (n,)
        One configuration, rad or m.
    axes, point : int, optional
        Numbers of the frames in whose axes and at whose origin the lost directions are
        given, the projection and the intermediate frame of the book; 0 is R_0. Default: where
        they have the most zeros.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> print(classify_singularity(load("rx90"), [0.1, 0.2, -np.pi / 2, 0.4, 0.5, 0.6]))
    Singular: the robot has lost degrees of freedom.
    Rank 5 of 6, weakest singular value ... of the largest (length 0.9 m)
    elbow: the wrist centre is in the plane of axes 2 and 3: the arm is stretched or folded
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
    flags = singularity_flags(model, q, frame, task.length, tolerance, near, mask, mask_axes)
    whole = operational_dimension(model, frame, None, task.length, TOLERANCE, mask, mask_axes)
    M, r = whole.dimension, int(flags.rank)
    U, values, Vt = np.linalg.svd(task_jacobians(task, q))
    sigma = as_floats(values, "sigma")
    top = float(sigma.max(initial=0.0))
    strong = int((sigma[:M] > near * top).sum())
    zero = max(1e-9, 10.0 * float(sigma[r]) / top) if r < min(M, len(sigma)) and top else 1e-9
    missing = _missing(task, whole)
    lost, weak = (
        outside(U[:, a:b], missing) if a < min(b, M) else np.zeros((task.rows, 0))
        for a, b in ((r, task.rows), (strong, r))
    )
    null = outside(Vt[r:].T, np.eye(model.n)[:, ~task.moving])
    motions = self_motions(task, q, lost, null, zero)
    side, opening = workspace_side(task, q, lost, null)
    sets = singular_sets(task, q, M, arm_geometry(task)) if min(r, strong) < M else ()
    named = names_at(sets, tolerance) if r < M else ()
    nearby = names_near(sets, named, tolerance, near) if strong < r else ()
    open_twist = None
    if opening is not None:
        open_twist = np.zeros(6)
        open_twist[task.mask] = opening / task.row_scale
    nothing = lost_in_task_axes(task, np.zeros((task.rows, 0)))
    return SingularityReport(
        status=SingularityStatus(int(flags.status)),
        q=read_only(q),
        dimension=M,
        rank=r,
        order=M - r,
        singular_values=read_only(sigma),
        weakest=float(flags.weakest),
        gap=float(task_rank(task, q, tolerance).gap),
        kinds=tuple(dict.fromkeys(kind for kind, _ in named)),
        words=tuple(text for _, text in named),
        near_kinds=tuple(dict.fromkeys(kind for kind, _ in nearby)),
        near_words=tuple(text for _, text in nearby),
        weak=simplest_frame(task, q, weak, missing, SMALL, axes, point) if strong < r else nothing,
        side=side,
        lost=simplest_frame(task, q, lost, missing, zero, axes, point) if r < M else nothing,
        lost_in_world=lost_in_task_axes(task, lost),
        open_twist=None if open_twist is None else read_only(open_twist),
        self_motions=motions,
        gained=M - r,
        mask=task.mask,
        length=task.length,
        tolerance=float(tolerance),
    )


def _missing(task: SingularTask, whole: OperationalDimension) -> Array:
    """Orthonormal directions without units that no configuration has, shape (m, s)."""
    rows = whole.missing_in_frame if task.mask_axes == "tool" else whole.missing_in_world
    return np.linalg.qr((rows[:, task.mask] / task.row_scale).T)[0]
