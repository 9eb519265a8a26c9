"""Units and names of joints in a figure."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from typing import Any

import numpy as np

from ..errors import InvalidValueError, ShapeError
from ..geometry import PRISMATIC
from ..model import RobotModel
from .figures import texts


class Unit(Enum):
    """Units of a joint in a figure; data are in SI units and radians always.

    Examples
    --------
    >>> Unit.DEGREE.of(2), round(Unit.DEGREE.factor, 3)
    ('deg/s²', 57.296)
    """

    RADIAN = "rad"
    DEGREE = "deg"
    METRE = "m"
    MILLIMETRE = "mm"
    NONE = "1"
    UNSTATED = "rad or m"

    @property
    def factor(self) -> float:
        """What a value in SI units is multiplied by."""
        factors = {Unit.DEGREE: 180.0 / np.pi, Unit.MILLIMETRE: 1e3}
        return factors.get(self, 1.0)

    def of(self, order: int) -> str:
        """Unit of a derivative by time.

        Parameters
        ----------
        order : int
            0 position, 1 velocity, to 3 jerk.

        Returns
        -------
        str
            Such as ``rad/s²``.
        """
        per = ("", "/s", "/s²", "/s³")[order]
        return " or ".join(part + per for part in self.value.split(" or "))


def joint_names(names: Sequence[str] | None, n: int, model: RobotModel | None = None) -> list[str]:
    """Names of joints for a legend."""
    if model is not None:
        _check_model(model, n)
    if names is not None:
        return texts(names, n, "names", "joints")
    if model is None:
        return [f"joint {j + 1}" for j in range(n)]
    return [str(model.table.names[row]) for row in model.table.joint_rows]


def joint_units(
    units: Unit | str | Sequence[Unit | str] | None,
    n: int,
    model: RobotModel | None = None,
) -> list[Unit]:
    """Units of joints for their axes."""
    lengths = None
    if model is not None:
        _check_model(model, n)
        lengths = model.table.sigma[model.table.joint_rows] == PRISMATIC
    if units is None:
        if lengths is None:
            return [Unit.UNSTATED] * n
        return [Unit.METRE if long else Unit.RADIAN for long in lengths]
    if isinstance(units, (Unit, str)):
        given = [as_unit(units)] * n
    else:
        given = [as_unit(unit) for unit in units]
    if len(given) != n:
        raise ShapeError(f"units: expected one for each of the {n} joints, got {len(given)}.")
    for j, unit in enumerate(given):
        wrong = (Unit.RADIAN, Unit.DEGREE) if lengths is not None and lengths[j] else (
            Unit.METRE, Unit.MILLIMETRE)  # fmt: skip
        if lengths is not None and unit in wrong:
            kind = "prismatic" if lengths[j] else "revolute"
            raise InvalidValueError(f"units: joint {j + 1} is {kind}, got {unit.value!r}.")
    return given


def as_unit(unit: Unit | str) -> Unit:
    """A unit from itself or its symbol."""
    try:
        return Unit(unit)
    except ValueError:
        known = ", ".join(repr(each.value) for each in Unit)
        raise InvalidValueError(f"units: expected one of {known}, got {unit!r}.") from None


def _check_model(model: Any, n: int) -> None:
    if not isinstance(model, RobotModel):
        raise InvalidValueError(f"model: expected a RobotModel, got {type(model).__name__}.")
    if model.n != n:
        raise ShapeError(f"model: expected a robot of {n} joints, got {model.name!r} of {model.n}.")
