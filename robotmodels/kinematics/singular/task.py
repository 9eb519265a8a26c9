"""The task of a rank: frame, components, and the units in which they compare.

Rows of a Jacobian are in metres and radians per unit of a joint, and joints turn or slide. Singular
values mean something only once they are numbers without a unit: linear rows are divided by a
characteristic length L, and a prismatic joint counts its stroke in units of L.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._arrays import Array, as_count, as_mask, read_only
from ...errors import InvalidValueError
from ...geometry import PRISMATIC
from ...model import RobotModel, check_model
from ..jacobians import COMPONENTS, Reference, jacobian, jacobian_rate
from ..lengths import length_of
from .events import random_postures

MaskAxes = Literal["world", "tool"]

_REFERENCES: dict[MaskAxes, Reference] = {"world": "world_aligned", "tool": "local"}
_SEED = 20


@dataclass(frozen=True, slots=True, eq=False)
class SingularTask:
    """A frame of a robot and the components of its motion that count, with their scales."""

    model: RobotModel
    frame: str | int | None
    mask: NDArray[np.bool_]
    mask_axes: MaskAxes
    length: float
    moving: NDArray[np.bool_]
    row_scale: Array
    joint_scale: Array

    @property
    def is_whole(self) -> bool:
        """Whether all six components count."""
        return bool(self.mask.all())

    @property
    def rows(self) -> int:
        """Number of components that count."""
        return int(self.mask.sum())


def singular_task(
    model: RobotModel,
    frame: str | int | None = None,
    mask: ArrayLike | str | None = None,
    mask_axes: MaskAxes = "world",
    length: float | None = None,
) -> SingularTask:
    """Check the frame and the components of a task and scale their units."""
    check_model(model)
    path = model.twin.frame(frame).path
    if mask_axes not in _REFERENCES:
        raise InvalidValueError(f"mask_axes: expected 'world' or 'tool', got {mask_axes!r}.")
    keep = as_mask(mask, COMPONENTS)
    length = length_of(model, frame, length)
    on_path = np.zeros(model.f + 1, dtype=bool)
    on_path[path] = True
    scale = np.repeat([1.0 / length, 1.0], 3)[keep]
    kinds = model.table.sigma[model.table.joint_rows]
    return SingularTask(
        model=model,
        frame=frame,
        mask=read_only(keep, np.bool_),
        mask_axes=mask_axes,
        length=length,
        moving=read_only(on_path[1:][model.table.joint_rows], np.bool_),
        row_scale=read_only(scale),
        joint_scale=read_only(np.where(kinds == PRISMATIC, length, 1.0)),
    )


def position_decides(model: RobotModel, frame: str | int | None = None) -> bool:
    """Whether the joints of a frame determine its position only (at most three joints)."""
    check_model(model)
    path = model.twin.frame(frame).path
    columns = np.isin(model.table.joint_rows + 1, path)
    count = int(columns.sum())
    if not 1 <= count <= 3:
        return False
    # anywhere, not only inside the limits: the rank in general is the same
    J = jacobian(model, random_postures(model, 4, seed=3), frame)[:, :3, columns]
    sigma = np.linalg.svd(J, compute_uv=False)
    return bool((sigma > 1e-9 * np.maximum(sigma[:, :1], 1e-9)).sum(axis=1).max() == count)


def deciding_mask(
    model: RobotModel, frame: str | int | None, mask: ArrayLike | str | None
) -> ArrayLike | str | None:
    """The mask that was given, or that of the position where `position_decides`."""
    if mask is None and position_decides(model, frame):
        return (1, 1, 1, 0, 0, 0)
    return mask


def counting_lines(mask: NDArray[np.bool_], frame: str) -> list[str]:
    """Line that names the components of the task, where it is not the whole twist."""
    if mask.all():
        return []
    names = ", ".join(n for n, on in zip(COMPONENTS, mask, strict=True) if on)
    what = "the motion"
    if not mask[3:].any():
        what = "the position"
    elif not mask[:3].any():
        what = "the orientation"
    return [f"What counts is {what} of {frame} ({names})"]


def task_jacobians(task: SingularTask, q: Array) -> Array:
    """Jacobians of a task without units. Shapes: q (..., n) -> (..., m, n)."""
    J = jacobian(task.model, q, task.frame, _REFERENCES[task.mask_axes])
    return J[..., task.mask, :] * (task.row_scale[:, None] * task.joint_scale)


def task_derivatives(task: SingularTask, q: Array) -> Array:
    """Derivatives of `task_jacobians` with respect to the joints, in joint units.

    Shapes: q (..., n) -> (..., n, m, n).
    """
    along = np.diag(task.joint_scale)
    reference = _REFERENCES[task.mask_axes]
    rates = jacobian_rate(task.model, q[..., None, :], along, task.frame, reference)
    return rates[..., task.mask, :] * (task.row_scale[:, None] * task.joint_scale)


def outside(space: Array, part: Array) -> Array:
    """Orthonormal basis of the part of a space (columns) that is orthogonal to another one."""
    U, sigma, _ = np.linalg.svd(space - part @ (part.T @ space), full_matrices=False)
    return U[:, sigma > 0.5]


def generator_of(rng: np.random.Generator | int | None) -> np.random.Generator:
    """A generator: itself, of a seed, or of a fixed seed."""
    if isinstance(rng, np.random.Generator):
        return rng
    return np.random.default_rng(_SEED if rng is None else as_count(rng, "rng", 0))
