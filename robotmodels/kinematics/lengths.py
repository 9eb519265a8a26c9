"""How large a robot is, and configurations spread over its ranges.

Jacobians mix metres and radians. Where their rows are compared, linear ones are divided by a
length of the robot: one for each frame, found once and kept.
"""

from __future__ import annotations

import weakref
from math import pi, tau

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array, as_exact, as_floats
from ..errors import InvalidValueError
from ..geometry import PRISMATIC, REVOLUTE
from ..model import RobotModel, check_model
from .jacobians import jacobian

_SEED = 20
_SAMPLES = 64
# by identity: a model's hash reads all of its numbers
_KNOWN: dict[int, tuple[weakref.ref[RobotModel], dict[int, float]]] = {}


def spread_configurations(model: RobotModel, count: int, rng: np.random.Generator) -> Array:
    """Configurations spread over the joint ranges.

    Ranges are the limits; where these are infinite, one turn, or a stroke of the robot's size.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    count : int
        How many.
    rng : numpy.random.Generator
        Where chance comes from.

    Returns
    -------
    ndarray, shape (count, n)
        Joint variables, rad or m.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> spread_configurations(load("rx90"), 5, np.random.default_rng(0)).shape
    (5, 6)
    """
    width = np.where(_kinds(model) == PRISMATIC, 2.0 * _table_size(model), tau)
    lower, upper = _finite_range(model.lower, model.upper, width)
    return lower + (upper - lower) * rng.random((count, model.n))


def characteristic_length(model: RobotModel, frame: str | int | None = None) -> float:
    """Reach of a frame: its greatest distance from a revolute axis that moves it.

    It depends neither on where the robot stands, nor on joints that do not move the frame, nor on
    where along its axis each frame of the table is placed, and it does not see the limits of
    revolute joints.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    frame : str or int, optional
        Name or number of a frame; default the tool.

    Returns
    -------
    float
        Metres, rounded up to two significant digits; 1 where no axis is at a distance, as for a
        gantry with a wrist: its rank and singular values do not depend on a length.

    Raises
    ------
    InvalidValueError, FrameNotFoundError
        Not a model; no such frame.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> characteristic_length(load("rx90"))
    0.9
    """
    check_model(model)
    point = model.twin.frame(frame)
    key = id(model)
    entry = _KNOWN.get(key)
    if entry is None or entry[0]() is not model:
        entry = (weakref.ref(model, lambda _: _KNOWN.pop(key, None)), {})
        _KNOWN[key] = entry
    length = entry[1].get(point.pin_id)
    if length is None:
        length = entry[1][point.pin_id] = _reach(model, frame)
    return length


def length_of(model: RobotModel, frame: str | int | None, length: float | None) -> float:
    """The length a caller gave, or the characteristic one.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    frame : str or int, optional
        Name or number of a frame; None is the tool.
    length : float or None
        What the caller passed, metres.

    Returns
    -------
    float
        Metres.

    Raises
    ------
    ShapeError, InvalidValueError
        No positive number.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> length_of(load("rx90"), None, None), length_of(load("rx90"), None, 2)
    (0.9, 2.0)
    """
    if length is None:
        return characteristic_length(model, frame)
    value = float(as_exact(length, (), "length"))
    if not value > 0:
        raise InvalidValueError(f"length: expected metres above 0, got {value:g}.")
    return value


def _reach(model: RobotModel, frame: str | int | None) -> float:
    path = model.twin.frame(frame).path - 1
    columns = model.chain.joint[path]
    columns = columns[columns >= 0]
    size = np.linalg.norm(model.chain.position[path], axis=1).sum()
    size = float(size + np.linalg.norm(model.tool[:3, 3])) or 1.0
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


def _table_size(model: RobotModel) -> float:
    lengths = np.linalg.norm(model.chain.position, axis=1).sum()
    return float(lengths + np.linalg.norm(model.tool[:3, 3])) or 1.0


def _finite_range(lower: Array, upper: Array, width: Array) -> tuple[Array, Array]:
    low, high = np.isfinite(lower), np.isfinite(upper)
    first = np.where(low, lower, np.where(high, upper - width, -0.5 * width))
    last = np.where(high, upper, np.where(low, lower + width, 0.5 * width))
    return as_floats(first, "lower"), as_floats(last, "upper")
