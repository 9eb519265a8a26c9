"""Limits that an exciting trajectory keeps where the robot's own table has none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from ..._arrays import Array, as_reals, read_only
from ...errors import InvalidValueError, ShapeError
from ...geometry import REVOLUTE
from ...model import RobotModel
from ...trajectories import MotionLimits

_RANGE = {True: 2.0 * np.pi, False: 1.0}  # rad, m: of joints without limits of position
_SPEED = {True: np.pi, False: 1.0}  # rad/s, m/s
_RISE = 0.25  # seconds from rest to full velocity where no acceleration is given


def excitation_limits(
    model: RobotModel, limits: MotionLimits | None = None
) -> tuple[MotionLimits, tuple[str, ...]]:
    """Finite limits of position, velocity and acceleration of every joint.

    What neither the argument nor the table bounds is bounded here, since a motion without bounds
    has no best: half a turn to each side of zero (0.5 m), half a turn a second (1 m/s), and the
    acceleration that reaches the limit of velocity in 0.25 s.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints.
    limits : MotionLimits, optional
        Default those of the model's table.

    Returns
    -------
    limits : MotionLimits
        Of n joints.
    notes : tuple of str
        Which were taken from here, in sentences.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> limits, notes = excitation_limits(load("ur10e"))
    >>> round(float(limits.acceleration[0]), 2), len(notes)
    (8.38, 1)
    """
    own = MotionLimits.of_model(model) if limits is None else limits
    own = own.for_joints(model.n)
    turns = model.table.sigma[model.table.joint_rows] == REVOLUTE
    wide = np.where(turns, _RANGE[True], _RANGE[False])
    fast = np.where(turns, _SPEED[True], _SPEED[False])
    notes: list[str] = []

    def said(name: str, missing: np.ndarray, values: Array) -> None:
        if missing.any():
            joints = ", ".join(str(j + 1) for j in np.flatnonzero(missing))
            taken = ", ".join(f"{x:.4g}" for x in np.unique(values[missing]))
            notes.append(f"No limit of {name} is given for joint {joints}; {taken} is taken.")

    lower, upper = own.lower.copy(), own.upper.copy()
    none = np.isinf(lower) & np.isinf(upper)
    lower, upper = np.where(none, -0.5 * wide, lower), np.where(none, 0.5 * wide, upper)
    lower = np.where(np.isinf(lower), upper - wide, lower)
    upper = np.where(np.isinf(upper), lower + wide, upper)
    said("position", np.isinf(own.lower) | np.isinf(own.upper), 0.5 * (upper - lower))
    v, v_least = _both(own.velocity, own.velocity_lower, fast)
    said("velocity", np.isinf(own.velocity) | np.isinf(own.velocity_lower), v)
    a, a_least = _both(own.acceleration, own.acceleration_lower, np.maximum(v, -v_least) / _RISE)
    said("acceleration", np.isinf(own.acceleration) | np.isinf(own.acceleration_lower), a)
    for name, low, high in (("position", lower, upper), ("velocity", v_least, v),
                            ("acceleration", a_least, a)):  # fmt: skip
        if (low >= high).any():
            j = int((low >= high).argmax())
            raise InvalidValueError(
                f"limits: the {name} of joint {j + 1} has no room, from {low[j]:g} to {high[j]:g}; "
                "a joint that does not move is not excited. Give it room, or lock it in the model."
            )
    full = replace(
        own, lower=lower, upper=upper, velocity=v, velocity_lower=v_least, acceleration=a,
        acceleration_lower=a_least,
    )  # fmt: skip
    return full, tuple(notes)


def excitation_torques(
    model: RobotModel, torque_limits: ArrayLike | None
) -> tuple[Array, tuple[str, ...]]:
    """Greatest torques, infinite where there is no limit."""
    massive = bool(np.any(model.inertia.values))
    if torque_limits is None:
        effort = np.asarray(model.table.effort, dtype=float)
        if np.isfinite(effort).any() and not massive:
            return np.full(model.n, np.inf), (
                f"{model.name} has no inertial parameters, so that its limits of torque are not "
                "looked at; give it rough ones with with_inertia.",
            )
        return read_only(effort), ()
    given = as_reals(torque_limits, "torque_limits")
    if given.shape not in ((), (model.n,)):
        raise ShapeError(f"torque_limits: expected shape ({model.n},), got {given.shape}.")
    if not (given > 0.0).all():
        raise InvalidValueError(f"torque_limits: expected positive numbers, got {given}.")
    if not massive and np.isfinite(given).any():
        raise InvalidValueError(
            f"torque_limits: {model.name} has no inertial parameters that tell its torques; give "
            "it some with with_inertia, or no limits of torque."
        )
    return read_only(np.broadcast_to(given, (model.n,))), ()


def _both(most: Array, least: Array, size: Array) -> tuple[Array, Array]:
    return np.where(np.isinf(most), size, most), np.where(np.isinf(least), -size, least)
