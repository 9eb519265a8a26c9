"""A task given by the gradients of functions of the configuration."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..._arrays import Array, Rebuilt, as_exact, as_floats, read_only
from ...errors import InvalidValueError, ShapeError
from ...model import RobotModel
from .levels import Level
from .tasks import rates_of_rows, rows_of

_STEP = 1e-3
"""Step of the differences of fourth order, rad or m: truncation and rounding are near 1e-13."""


@dataclass(frozen=True, slots=True, eq=False)
class FunctionTask(Rebuilt):
    """Rates of m functions of the configuration, such as an elbow angle, by their gradients.

    Parameters
    ----------
    gradient : callable
        ``gradient(q)`` with q of shape (N, n) gives the derivatives of the functions with respect
        to the joints, shape (N, m, n), or (N, n) for a single function.
    rate : array_like, shape (..., m)
        Rates of the functions wanted; where accelerations are asked for, second derivatives.
    gradient_rate : callable, optional
        ``gradient_rate(q, v)`` gives the time derivatives of the gradients along a motion, of the
        same shape; for accelerations. Default: differences of the gradient along the motion, over
        1e-3 of joint travel.
    weights : array_like, shape (m,), optional
        Factors that make the rows comparable, see `Level`.

    Raises
    ------
    ShapeError, InvalidValueError
        Rates of the wrong shape or not finite, something that cannot be called; gradients of the
        wrong shape when they are first asked for.

    References
    ----------
    Seed book section 1.3.2.4; J. Baillieul 1985.

    Examples
    --------
    Keep the sum of two joints:

    >>> from robotmodels.robots import load
    >>> task = FunctionTask(lambda q: np.broadcast_to([0.0, 1, 1, 0, 0, 0], q.shape), rate=[0.0])
    >>> task.level(load("rx90"), np.zeros((4, 6))).J.shape
    (4, 1, 6)
    """

    gradient: Callable[[Array], ArrayLike]
    rate: Array
    gradient_rate: Callable[[Array, Array], ArrayLike] | None = None
    weights: Array | None = None

    def __post_init__(self) -> None:
        if not callable(self.gradient):
            raise InvalidValueError(
                f"gradient: expected a function of q, got {type(self.gradient).__name__}; arrays "
                "are what LinearTask takes."
            )
        if self.gradient_rate is not None and not callable(self.gradient_rate):
            raise InvalidValueError(
                "gradient_rate: expected a function of q and v, got "
                f"{type(self.gradient_rate).__name__}."
            )
        rate = as_floats(self.rate, "rate")
        if rate.ndim == 0:
            raise ShapeError("rate: expected shape (..., m), got (); one function is [rate].")
        object.__setattr__(self, "rate", read_only(rate))
        if self.weights is not None:
            weights = as_exact(self.weights, (rate.shape[-1],), "weights")
            object.__setattr__(self, "weights", read_only(weights))

    def level(self, model: RobotModel, q: ArrayLike) -> Level:
        """Rows that ask for velocities, see `Task.level`."""
        batch, q, _ = rows_of(model, q)
        rate = rates_of_rows(self.rate, batch, self.rate.shape[-1])
        return Level(J=self._gradients(q), rate=rate, weights=self.weights)

    def acceleration_level(self, model: RobotModel, q: ArrayLike, v: ArrayLike) -> Level:
        """Rows that ask for accelerations, see `Task.acceleration_level`."""
        batch, q, v = rows_of(model, q, v)
        rate = rates_of_rows(self.rate, batch, self.rate.shape[-1])
        if self.gradient_rate is not None:
            change = self._checked(self.gradient_rate(q, v), q, "gradient_rate")
        else:
            speed = np.linalg.norm(v, axis=-1, keepdims=True)
            h = _STEP * np.divide(v, speed, out=np.zeros_like(v), where=speed > 0.0)
            near = self._gradients(q + h) - self._gradients(q - h)
            far = self._gradients(q + 2 * h) - self._gradients(q - 2 * h)
            change = (8.0 * near - far) * (speed[..., None] / (12.0 * _STEP))
        drift = np.einsum("kij,kj->ki", change, v)
        return Level(J=self._gradients(q), rate=rate, drift=drift, weights=self.weights)

    def _gradients(self, q: Array) -> Array:
        return self._checked(self.gradient(q), q, "gradient")

    def _checked(self, value: ArrayLike, q: Array, name: str) -> Array:
        m = self.rate.shape[-1]
        array = as_floats(value, f"the value of {name}")
        if m == 1 and array.shape == q.shape:
            return array[:, None]
        shape = (len(q), m, q.shape[1])
        if array.shape != shape:
            raise ShapeError(
                f"{name}: expected an array of shape {shape} (configurations, functions, joints) "
                f"from the function, got {array.shape}."
            )
        return array
