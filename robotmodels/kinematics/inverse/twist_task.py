"""A twist, or some of its components, of any frame of the robot."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..._arrays import Array, Rebuilt, as_core, as_exact, read_only
from ...errors import InvalidValueError
from ...model import RobotModel
from ..jacobians import Reference, jacobian, jacobian_rate, reference_of
from .levels import Level
from .tasks import rates_of_rows, rows_of, task_length


@dataclass(frozen=True, slots=True, eq=False)
class TwistTask(Rebuilt):
    """Twist of a frame: components of ``J v``, or of its rate where accelerations are asked.

    Parameters
    ----------
    rate : array_like, shape (..., 6)
        Twist ``[v; w]`` wanted, m/s and rad/s; where accelerations are asked for, its rate. What
        the mask leaves out is not read.
    frame : str or int, optional
        Name or number of a frame; default the tool.
    reference : {"world_aligned", "local", "world"}
        Axes and point of the twist, as in `jacobian`.
    mask : array_like, shape (6,), optional
        Ones for the components that are asked for. Default all.
    length : float, optional
        Metres that count as one radian; default the robot's, as in `ikm`.

    Raises
    ------
    ShapeError, InvalidValueError
        Numbers of the wrong shape, not finite, or no mask; an unknown reference.

    References
    ----------
    Seed book eq. [1.18] and section 1.3.2.4.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> task = TwistTask([0, 0, 0.1, 0, 0, 0], frame=3, mask=[1, 1, 1, 0, 0, 0])
    >>> task.level(load("rx90"), [0.1] * 6).J.shape
    (1, 3, 6)
    """

    rate: Array
    frame: str | int | None = None
    reference: Reference = "world_aligned"
    mask: Array | None = None
    length: float | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "rate", read_only(as_core(self.rate, (6,), "rate")))
        reference_of(self.reference)
        mask = np.ones(6) if self.mask is None else np.asarray(self.mask)
        mask = as_exact(mask.astype(float) if mask.dtype == bool else mask, (6,), "mask")
        if not np.isin(mask, (0.0, 1.0)).all() or not mask.any():
            raise InvalidValueError(
                "mask: expected six zeros or ones for vx vy vz wx wy wz, at least one of them a "
                f"one, got {self.mask!r}."
            )
        object.__setattr__(self, "mask", read_only(mask))

    def level(self, model: RobotModel, q: ArrayLike) -> Level:
        """Rows that ask for velocities, see `Task.level`."""
        batch, q, _ = rows_of(model, q)
        J = jacobian(model, q, self.frame, self.reference)
        return self._level(model, J, batch, None)

    def acceleration_level(self, model: RobotModel, q: ArrayLike, v: ArrayLike) -> Level:
        """Rows that ask for accelerations, see `Task.acceleration_level`.

        The rate is that of the twist's components: ``J a + dJ/dt v``.
        """
        batch, q, v = rows_of(model, q, v)
        J = jacobian(model, q, self.frame, self.reference)
        drift = np.einsum("kij,kj->ki", jacobian_rate(model, q, v, self.frame, self.reference), v)
        return self._level(model, J, batch, drift)

    def _level(
        self, model: RobotModel, J: Array, batch: tuple[int, ...], drift: Array | None
    ) -> Level:
        asked = np.flatnonzero(np.asarray(self.mask))
        weights = np.ones(6)
        weights[:3] = 1.0 / task_length(model, self.frame, self.length)
        return Level(
            J=J[:, asked],
            rate=rates_of_rows(self.rate, batch, 6)[:, asked],
            drift=None if drift is None else drift[:, asked],
            weights=weights[asked],
        )
