"""The rate of the distance between two frames."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..._arrays import Array, Rebuilt, as_floats, read_only
from ...model import RobotModel
from ..jacobians import jacobian, jacobian_rate
from ..poses import dgm
from .levels import Level
from .tasks import rates_of_rows, rows_of, task_length


@dataclass(frozen=True, slots=True, eq=False)
class DistanceTask(Rebuilt):
    """Rate of the distance between the origins of two frames, such as the hands of two arms.

    Where the origins coincide the distance has no derivative: the row of J is zero there, and the
    rate that was asked for stands in the error of the level.

    Parameters
    ----------
    rate : array_like, shape (...)
        Rate of the distance wanted, m/s; where accelerations are asked for, its second derivative.
    first, second : str or int, optional
        Names or numbers of the frames; default the base (``first``) and the tool (``second``).
    length : float, optional
        Metres that count as one radian; default the robot's, as in `ikm`.

    Raises
    ------
    InvalidValueError
        A rate that is not finite.

    References
    ----------
    Seed book section 1.3.2.4.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> DistanceTask(0.1).level(load("planar_2r"), [0.3, 0.0]).J.round(12)
    array([[[0., 0.]]])
    """

    rate: Array
    first: str | int = 0
    second: str | int | None = None
    length: float | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "rate", read_only(as_floats(self.rate, "rate")))

    def level(self, model: RobotModel, q: ArrayLike) -> Level:
        """Rows that ask for velocities, see `Task.level`."""
        batch, q, _ = rows_of(model, q)
        unit, _ = self._direction(model, q)
        J = jacobian(model, q, self.second)[:, :3] - jacobian(model, q, self.first)[:, :3]
        return self._level(model, np.einsum("ki,kij->kj", unit, J), batch, None)

    def acceleration_level(self, model: RobotModel, q: ArrayLike, v: ArrayLike) -> Level:
        """Rows that ask for accelerations, see `Task.acceleration_level`."""
        batch, q, v = rows_of(model, q, v)
        unit, inverse = self._direction(model, q)
        J = jacobian(model, q, self.second)[:, :3] - jacobian(model, q, self.first)[:, :3]
        rate = jacobian_rate(model, q, v, self.second) - jacobian_rate(model, q, v, self.first)
        velocity = np.einsum("kij,kj->ki", J, v)
        along = np.einsum("ki,ki->k", unit, velocity)
        drift = np.einsum("ki,kij,kj->k", unit, rate[:, :3], v)
        drift += inverse * (np.einsum("ki,ki->k", velocity, velocity) - along**2)
        return self._level(model, np.einsum("ki,kij->kj", unit, J), batch, drift)

    def _direction(self, model: RobotModel, q: Array) -> tuple[Array, Array]:
        """Unit vector from the first to the second frame, and the inverse of the distance."""
        apart = dgm(model, q, self.second)[:, :3, 3] - dgm(model, q, self.first)[:, :3, 3]
        distance = np.linalg.norm(apart, axis=-1)
        apart_at_all = distance > 0.0
        inverse = np.divide(1.0, distance, out=np.zeros_like(distance), where=apart_at_all)
        return apart * inverse[:, None], inverse

    def _level(
        self, model: RobotModel, J: Array, batch: tuple[int, ...], drift: Array | None
    ) -> Level:
        length = task_length(model, self.second, self.length)
        return Level(
            J=J[:, None],
            rate=rates_of_rows(self.rate[..., None], batch, 1),
            drift=None if drift is None else drift[:, None],
            weights=np.array([1.0 / length]),
        )
