"""What is asked of an inverse kinematic model, and the secondary motions in it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol, TypeAlias, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from ..._arrays import Array, as_vector, batch_shape
from ...errors import InvalidValueError
from ...model import RobotModel

if TYPE_CHECKING:
    from .bounds import JointBounds
    from .tasks import Task


@runtime_checkable
class HasGradient(Protocol):
    """A criterion: anything with a gradient, its gain and sign included."""

    def gradient(self, model: RobotModel, q: ArrayLike) -> Array:
        """Joint velocities that improve the criterion, shape (..., n)."""
        ...


Secondary: TypeAlias = "ArrayLike | HasGradient | Sequence[ArrayLike | HasGradient]"


class Request(NamedTuple):
    """Arguments of a call, ``q``, ``rate`` and ``v`` checked."""

    q: Array
    rate: Array
    v: Array | None
    frame: str | int | None
    reference: str
    mask: ArrayLike | None
    method: Any
    joint_weights: ArrayLike | None
    length: float | None
    secondary: Secondary | None
    augmented: Sequence[Task]
    tasks: Sequence[Task]
    limits: JointBounds | bool | None

    @property
    def rate_name(self) -> str:
        """Name of the argument that holds the rates."""
        return "twist" if self.v is None else "acceleration"


def secondary_motion(model: RobotModel, q: Array, secondary: Secondary) -> Array:
    """Joint motion wanted beside the task: an array, a gradient, or the sum of several."""
    if isinstance(secondary, type):
        raise InvalidValueError(
            f"secondary: expected an array or a criterion, got the class {secondary.__name__}; a "
            f"class needs its parentheses, {secondary.__name__}(...)."
        )
    if isinstance(secondary, HasGradient):
        return as_vector(secondary.gradient(model, q), model.n, "secondary.gradient(model, q)")
    if isinstance(secondary, (list, tuple)) and any(isinstance(s, HasGradient) for s in secondary):
        parts = tuple(secondary_motion(model, q, part) for part in secondary)
        batch_shape(parts, tuple(f"secondary[{i}]" for i in range(len(parts))))
        return np.asarray(sum(parts[1:], parts[0]))
    return as_vector(secondary, model.n, "secondary")  # type: ignore[arg-type]
