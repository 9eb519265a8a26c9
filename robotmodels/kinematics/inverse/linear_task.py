"""A task given by its own Jacobian."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..._arrays import Array, Rebuilt, as_core, as_exact, as_floats, read_only
from ...errors import ShapeError
from ...model import RobotModel
from .levels import Level
from .tasks import rates_of_rows, rows_of


@dataclass(frozen=True, slots=True, eq=False)
class LinearTask(Rebuilt):
    """Rows ``J v = rate`` given as arrays; where accelerations are asked, ``J a = rate - drift``.

    Parameters
    ----------
    J : array_like, shape (..., m, n)
        Jacobian of the task at each configuration, or one for all.
    rate : array_like, shape (..., m)
        Velocities wanted of the task; where accelerations are asked for, accelerations.
    drift : array_like, shape (..., m), optional
        ``dJ/dt v``, read where accelerations are asked for. Default zero.
    weights : array_like, shape (m,), optional
        Factors that make the rows comparable, see `Level`.

    Raises
    ------
    ShapeError, InvalidValueError
        Arrays that do not fit each other or the robot, or are not finite.

    References
    ----------
    Seed book section 1.3.2.4.

    Examples
    --------
    Two joints that move alike:

    >>> from robotmodels.robots import load
    >>> task = LinearTask(J=[[0, 1, 1, 0, 0, 0]], rate=[0.0])
    >>> task.level(load("rx90"), [0.0] * 6).rate
    array([[0.]])
    """

    J: Array
    rate: Array
    drift: Array | None = None
    weights: Array | None = None

    def __post_init__(self) -> None:
        J = as_floats(self.J, "J")
        if J.ndim < 2:
            raise ShapeError(f"J: expected shape (..., m, n), got {J.shape}.")
        m = J.shape[-2]
        set_ = object.__setattr__
        set_(self, "J", read_only(J))
        set_(self, "rate", read_only(as_core(self.rate, (m,), "rate")))
        if self.drift is not None:
            set_(self, "drift", read_only(as_core(self.drift, (m,), "drift")))
        if self.weights is not None:
            set_(self, "weights", read_only(as_exact(self.weights, (m,), "weights")))

    def level(self, model: RobotModel, q: ArrayLike) -> Level:
        """Rows that ask for velocities, see `Task.level`."""
        batch, q, _ = rows_of(model, q)
        m, n = self.J.shape[-2:]
        if n != model.n:
            raise ShapeError(f"J: expected {model.n} columns, one for each joint, got {n}.")
        try:
            J = np.broadcast_to(self.J, (*batch, m, n)).reshape(len(q), m, n)
        except ValueError:
            raise ShapeError(
                f"J: its shape {self.J.shape} does not broadcast to {(*batch, m, n)}, the leading "
                "axes of the configurations and its own rows and columns."
            ) from None
        return Level(J=J, rate=rates_of_rows(self.rate, batch, m), weights=self.weights)

    def acceleration_level(self, model: RobotModel, q: ArrayLike, v: ArrayLike) -> Level:
        """Rows that ask for accelerations, see `Task.acceleration_level`."""
        batch, _, _ = rows_of(model, q, v)
        level = self.level(model, q)
        drift = None if self.drift is None else rates_of_rows(self.drift, batch, level.m)
        return Level(J=level.J, rate=level.rate, drift=drift, weights=level.weights)
