"""The first arguments of every model, checked: a robot, and its joint positions.

Parameters
----------
model : RobotModel
    The robot.
q : array_like, shape (..., n)
    Joint positions, rad or m.

Returns
-------
ndarray, shape (..., n)
    Joint positions as floats.
"""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from .._arrays import Array, as_vector
from ..errors import InvalidValueError, RobotModelsWarning
from ..geometry import FIXED, PRISMATIC, DHTable
from .robot_model import RobotModel

_TWO_TURNS = 4.0 * np.pi


def as_positions(model: RobotModel, q: ArrayLike) -> Array:
    """Check joint positions (..., n).

    A RobotModelsWarning, once for a robot, where one of the first hundred calls has a revolute
    joint more than two turns away from zero and beyond its limits: angles may be degrees.
    """
    q = as_vector(q, model.n, "q")
    twin = model.twin
    if twin.angles_to_check:  # degrees are met at once: later calls do not pay for the check
        twin.angles_to_check -= 1
        if max(q.max(initial=0.0), -q.min(initial=0.0)) > _TWO_TURNS:
            _warn_of_degrees(model, q)
    return q


def _warn_of_degrees(model: RobotModel, q: Array) -> None:
    """Warn where an angle is larger than two turns and than its finite limits."""
    limits = np.abs([model.lower, model.upper])
    largest = np.maximum(_TWO_TURNS, np.where(np.isfinite(limits), limits, 0.0).max(axis=0))
    kinds = model.table.sigma[model.table.sigma != FIXED]
    largest[kinds == PRISMATIC] = np.inf
    beyond = np.argwhere(np.abs(q) > largest)
    if len(beyond):
        model.twin.angles_to_check = 0
        warnings.warn(
            f"q: joint {beyond[0][-1] + 1} is at {q[tuple(beyond[0])]:.6g} rad, more than two "
            "turns. For degrees, pass np.deg2rad(q). This warning is given once.",
            RobotModelsWarning,
            stacklevel=4,
        )


def check_model(model: object) -> None:
    """Refuse anything but a model, with a hint that depends on its type."""
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
