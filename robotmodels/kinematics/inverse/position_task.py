"""The velocity of a point of any link."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..._arrays import Array, Rebuilt, as_core, as_exact, read_only
from ...errors import InvalidValueError
from ...model import RobotModel
from .levels import Level
from .tasks import rates_of_rows, rows_of, task_length


@dataclass(frozen=True, slots=True, eq=False)
class PositionTask(Rebuilt):
    """Velocity of a point fixed to a frame, in world axes.

    Parameters
    ----------
    rate : array_like, shape (..., 3)
        Velocity wanted, m/s; where accelerations are asked for, acceleration. What the mask
        leaves out is not read.
    frame : str or int, optional
        Name or number of the frame that carries the point; default the tool.
    point : array_like, shape (3,), optional
        Coordinates of the point in that frame, m. Default its origin.
    mask : array_like, shape (3,), optional
        Ones for the components x y z that are asked for. Default all.
    length : float, optional
        Metres that count as one radian; default the robot's, as in `ikm`.

    Raises
    ------
    ShapeError, InvalidValueError
        Numbers of the wrong shape, not finite, or no mask.

    References
    ----------
    Seed book sections 1.3.1.2 and 1.3.2.4.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> elbow = PositionTask([0, 0, 0.1], frame=4, mask=[0, 0, 1])
    >>> elbow.level(load("panda"), np.zeros((5, 7))).J.shape
    (5, 1, 7)
    """

    rate: Array
    frame: str | int | None = None
    point: Array | None = None
    mask: Array | None = None
    length: float | None = None

    def __post_init__(self) -> None:
        set_ = object.__setattr__
        set_(self, "rate", read_only(as_core(self.rate, (3,), "rate")))
        point = np.zeros(3) if self.point is None else as_exact(self.point, (3,), "point")
        set_(self, "point", read_only(point))
        mask = np.ones(3) if self.mask is None else np.asarray(self.mask)
        mask = as_exact(mask.astype(float) if mask.dtype == bool else mask, (3,), "mask")
        if not np.isin(mask, (0.0, 1.0)).all() or not mask.any():
            raise InvalidValueError(
                "mask: expected three zeros or ones for x y z, at least one of them a one, got "
                f"{self.mask!r}."
            )
        set_(self, "mask", read_only(mask))

    def level(self, model: RobotModel, q: ArrayLike) -> Level:
        """Rows that ask for velocities, see `Task.level`."""
        from ...kernels.poses import jacobians

        batch, q, _ = rows_of(model, q)
        J = np.empty((len(q), 6, model.n))
        jacobians(q, model.chain, *self._place(model), 0, J)
        return self._level(model, J, batch, None)

    def acceleration_level(self, model: RobotModel, q: ArrayLike, v: ArrayLike) -> Level:
        """Rows that ask for accelerations, see `Task.acceleration_level`."""
        from ...kernels.poses import jacobian_rates, jacobians

        batch, q, v = rows_of(model, q, v)
        J, rate = np.empty((2, len(q), 6, model.n))
        jacobians(q, model.chain, *self._place(model), 0, J)
        jacobian_rates(q, v, model.chain, *self._place(model), 0, rate)
        return self._level(model, J, batch, np.einsum("kij,kj->ki", rate[:, :3], v))

    def _place(self, model: RobotModel) -> tuple[Array, Array, Array]:
        path, rotation, position = model.twin.frame(self.frame).kernel_arguments
        return path, rotation, position + rotation @ self.point  # type: ignore[return-value]

    def _level(
        self, model: RobotModel, J: Array, batch: tuple[int, ...], drift: Array | None
    ) -> Level:
        asked = np.flatnonzero(np.asarray(self.mask))
        length = task_length(model, self.frame, self.length)
        return Level(
            J=J[:, asked],
            rate=rates_of_rows(self.rate, batch, 3)[:, asked],
            drift=None if drift is None else drift[:, asked],
            weights=np.full(len(asked), 1.0 / length),
        )
