"""Tasks of a redundant robot: what is asked of its joint velocities beside the main twist.

A task is a value with two methods, `Task.level` and `Task.acceleration_level`, that give its rows
at configurations. Seed book section 1.3.2.4.
"""

from __future__ import annotations

from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from ..._arrays import Array, as_floats, as_vector
from ...errors import InvalidValueError, ShapeError
from ...model import RobotModel, check_model
from .levels import Level

__all__ = ["Task", "rates_of_rows", "rows_of", "task_length"]


@runtime_checkable
class Task(Protocol):
    """Anything that gives rows of a level. Its rates broadcast against the configurations.

    Examples
    --------
    >>> from robotmodels.kinematics.inverse.joint_task import JointTask
    >>> isinstance(JointTask([0.0], joints=[0]), Task)
    True
    """

    def level(self, model: RobotModel, q: ArrayLike) -> Level:
        """Rows that ask for velocities.

        Parameters
        ----------
        model : RobotModel
            The robot, n joints.
        q : array_like, shape (..., n)
            Joint variables, rad or m.

        Returns
        -------
        Level
            N rows, the product of the leading axes of q; a single configuration is one row.
        """
        ...

    def acceleration_level(self, model: RobotModel, q: ArrayLike, v: ArrayLike) -> Level:
        """Rows that ask for accelerations: the task's rates are those, the drift is ``dJ/dt v``.

        Parameters
        ----------
        model : RobotModel
            The robot, n joints.
        q, v : array_like, shape (..., n)
            Joint variables (rad or m) and velocities, of the same shape.

        Returns
        -------
        Level
            N rows, the product of the leading axes of q.
        """
        ...


def rows_of(
    model: RobotModel, q: ArrayLike, v: ArrayLike | None = None
) -> tuple[tuple[int, ...], Array, Array]:
    """Configurations and velocities as rows, with the leading axes that they had.

    Shapes: q, v (..., n) -> q, v (N, n).
    """
    check_model(model)
    q = as_vector(q, model.n, "q")
    v = np.zeros_like(q) if v is None else as_vector(v, model.n, "v")
    if q.shape != v.shape:
        raise ShapeError(
            f"v: expected the shape of q, {q.shape}, got {v.shape}; broadcast them before."
        )
    size = (int(np.prod(q.shape[:-1], dtype=np.int64)), model.n)
    return (
        q.shape[:-1],
        np.ascontiguousarray(q).reshape(size),
        np.ascontiguousarray(v).reshape(size),
    )


def rates_of_rows(rate: Array, batch: tuple[int, ...], m: int) -> Array:
    """Rates of a task at the rows of `rows_of`. Shapes: rate (..., m) -> (N, m)."""
    try:
        return np.broadcast_to(rate, (*batch, m)).reshape(int(np.prod(batch, dtype=np.int64)), m)
    except ValueError:
        raise ShapeError(
            f"rate: its shape {rate.shape} does not broadcast to {(*batch, m)}: the leading "
            f"axes of the configurations and the {m} components of the task."
        ) from None


def task_length(model: RobotModel, frame: str | int | None, length: float | None) -> float:
    """The length that makes metres comparable with radians in a task."""
    from ..lengths import characteristic_length

    if length is None:
        return characteristic_length(model, frame)
    value = as_floats(length, "length")
    if value.ndim or not value > 0.0:
        raise InvalidValueError(f"length: expected a positive number of metres, got {length!r}.")
    return float(value)
