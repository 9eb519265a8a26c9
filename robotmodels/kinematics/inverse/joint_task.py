"""Velocities of some joints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..._arrays import Array, Rebuilt, as_core, read_only
from ...errors import InvalidValueError
from ...geometry import PRISMATIC
from ...model import RobotModel
from .levels import Level
from .tasks import rates_of_rows, rows_of, task_length


@dataclass(frozen=True, slots=True, eq=False)
class JointTask(Rebuilt):
    """Velocities of named joints.

    Parameters
    ----------
    rate : array_like, shape (..., k)
        Velocities wanted, rad/s or m/s; where accelerations are asked for, accelerations.
    joints : sequence of int or str
        The k joints: columns of q, from 0, or names.
    length : float, optional
        Metres that count as one radian; default the robot's, as in `ikm`.

    Raises
    ------
    ShapeError, InvalidValueError
        Rates of the wrong shape or not finite; joints given twice or not at all. Joints that the
        robot does not have are refused when it is known.

    References
    ----------
    Seed book section 1.3.2.4.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> JointTask([0.1], joints=[2]).level(load("rx90"), [0.0] * 6).J
    array([[[0., 0., 1., 0., 0., 0.]]])
    """

    rate: Array
    joints: Sequence[int | str]
    length: float | None = None

    def __post_init__(self) -> None:
        if isinstance(self.joints, (str, int)):
            raise InvalidValueError(
                f"joints: expected a sequence, got {self.joints!r}; one joint is [{self.joints!r}]."
            )
        joints = tuple(self.joints)
        for joint in joints:
            if isinstance(joint, bool) or not isinstance(joint, (str, int, np.integer)):
                raise InvalidValueError(
                    f"joints: expected columns of q or names of joints, got {joint!r}."
                )
        if not joints or len(set(joints)) < len(joints):
            raise InvalidValueError(f"joints: expected different joints, got {joints}.")
        object.__setattr__(self, "joints", joints)
        object.__setattr__(self, "rate", read_only(as_core(self.rate, (len(joints),), "rate")))

    def level(self, model: RobotModel, q: ArrayLike) -> Level:
        """Rows that ask for velocities, see `Task.level`."""
        batch, q, _ = rows_of(model, q)
        columns = self._columns(model)
        J = np.zeros((len(q), len(columns), model.n))
        J[:, range(len(columns)), columns] = 1.0
        slides = model.table.sigma[model.table.joint_rows][columns] == PRISMATIC
        length = task_length(model, None, self.length)
        return Level(
            J=J,
            rate=rates_of_rows(self.rate, batch, len(columns)),
            weights=np.where(slides, 1.0 / length, 1.0),
        )

    def acceleration_level(self, model: RobotModel, q: ArrayLike, v: ArrayLike) -> Level:
        """Rows that ask for accelerations, see `Task.acceleration_level`."""
        rows_of(model, q, v)
        return self.level(model, q)

    def _columns(self, model: RobotModel) -> list[int]:
        names = model.table.joint_names
        columns = []
        for joint in self.joints:
            column = joint
            if isinstance(joint, str):
                column = names.index(joint) if joint in names else -1
            if not 0 <= int(column) < model.n:
                raise InvalidValueError(
                    f"joints: the robot has no joint {joint!r}; give columns of q, 0 to "
                    f"{model.n - 1}, or names: {', '.join(names)}."
                )
            columns.append(int(column))
        if len(set(columns)) < len(columns):
            raise InvalidValueError(f"joints: {self.joints} names a joint twice.")
        return columns
