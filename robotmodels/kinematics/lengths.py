"""Characteristic lengths of a robot, and configurations spread over its joint ranges.

Jacobians mix metres and radians. Where their rows are compared, linear ones are divided by a
length of the robot: one for each frame, found once and kept.
"""

from __future__ import annotations

import weakref
from collections.abc import Callable
from math import pi, tau
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array, as_floats, as_number
from ..geometry import PRISMATIC, REVOLUTE
from ..model import RobotModel, check_model
from .jacobians import jacobian

_SEED = 20
_SAMPLES = 64


class ModelCache:
    """Values that belong to a model, kept for its lifetime."""

    def __init__(self) -> None:
        # by identity: a model's hash reads all of its numbers
        self._kept: dict[int, tuple[weakref.ref[RobotModel], dict[Any, Any]]] = {}

    def __call__(self, model: RobotModel, key: Any, make: Callable[[], Any]) -> Any:
        """Value of a key, made where there is none."""
        place = id(model)
        entry = self._kept.get(place)
        if entry is None or entry[0]() is not model:
            entry = (weakref.ref(model, lambda _: self._kept.pop(place, None)), {})
            self._kept[place] = entry
        if key not in entry[1]:
            entry[1][key] = make()
        return entry[1][key]


_LENGTHS = ModelCache()


def spread_configurations(model: RobotModel, count: int, rng: np.random.Generator) -> Array:
    """Configurations spread over the joint ranges. Shapes: -> (count, n)."""
    width = np.where(_kinds(model) == PRISMATIC, 2.0 * _table_size(model), tau)
    lower, upper = _finite_range(model.lower, model.upper, width)
    return lower + (upper - lower) * rng.random((count, model.n))


def characteristic_length(model: RobotModel, frame: str | int | None = None) -> float:
    """Reach of a frame: its largest distance from a revolute axis that moves it."""
    check_model(model)
    key = model.twin.frame(frame).pin_id
    return float(_LENGTHS(model, key, lambda: _reach(model, frame)))


def length_of(model: RobotModel, frame: str | int | None, length: float | None) -> float:
    """The length a caller gave, or the characteristic one."""
    if length is None:
        return characteristic_length(model, frame)
    return as_number(length, "length", above=0.0)


def _reach(model: RobotModel, frame: str | int | None) -> float:
    path = model.twin.frame(frame).path - 1
    columns = model.chain.joint[path]
    columns = columns[columns >= 0]
    size = _table_size(model, path)
    kinds = _kinds(model)[columns]
    turning = kinds == REVOLUTE
    lower, upper = _finite_range(
        np.where(turning, -pi, model.lower[columns]), np.where(turning, pi, model.upper[columns]),
        np.where(kinds == PRISMATIC, 2.0 * size, tau),
    )  # fmt: skip
    rng = np.random.default_rng(_SEED)
    q = np.zeros((_SAMPLES, model.n))
    q[:, columns] = lower + (upper - lower) * rng.random((_SAMPLES, columns.size))
    levers = np.linalg.norm(jacobian(model, q, frame)[:, :3, columns[turning]], axis=1)
    reach = float(levers.max(initial=0.0))
    # a lever of rounding size beside the lengths of the table is no lever
    if reach <= 1e-12 * size:
        return 1.0
    # few digits: a number to read, and the same one whatever rounding the samples bring
    unit = 10.0 ** (np.floor(np.log10(reach)) - 1)
    return float(f"{np.ceil(reach / unit - 1e-6) * unit:.2g}")


def _kinds(model: RobotModel) -> NDArray[np.int64]:
    return model.table.sigma[model.table.joint_rows]


def _table_size(model: RobotModel, path: Any = slice(None)) -> float:
    lengths = np.linalg.norm(model.chain.position[path], axis=1).sum()
    return float(lengths + np.linalg.norm(model.tool[:3, 3])) or 1.0


def _finite_range(lower: Array, upper: Array, width: Array) -> tuple[Array, Array]:
    low, high = np.isfinite(lower), np.isfinite(upper)
    first = np.where(low, lower, np.where(high, upper - width, -0.5 * width))
    last = np.where(high, upper, np.where(low, lower + width, 0.5 * width))
    return as_floats(first, "lower"), as_floats(last, "upper")
