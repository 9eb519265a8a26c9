"""The first argument of every model: a robot, and not its name or its table."""

from __future__ import annotations

from pathlib import Path

import pinocchio as pin

from ..errors import InvalidValueError
from ..geometry import DHTable
from .robot_model import RobotModel


def check_model(model: object) -> None:
    """Refuse what is not a model, with a hint for what it is.

    Parameters
    ----------
    model : object
        First argument of a public function.

    Raises
    ------
    InvalidValueError
        It is a name, a table, a Pinocchio model or something else.

    Examples
    --------
    >>> check_model(RobotModel.from_table(DHTable(antecedent=[0], sigma=[0])))
    """
    if isinstance(model, RobotModel):
        return
    hint = "build one with RobotModel.from_table(...), RobotModel.from_urdf(...) or load(...)"
    if isinstance(model, (str, Path)):
        hint = f"load it first: load({str(model)!r}), or RobotModel.from_urdf(path) for a file"
    elif isinstance(model, DHTable):
        hint = "make one of the table: RobotModel.from_table(table)"
    elif isinstance(model, pin.Model):
        hint = "Pinocchio's models are no input; RobotModel.from_urdf(...) reads their URDF"
    raise InvalidValueError(f"model: expected a RobotModel, got {type(model).__name__}; {hint}.")
