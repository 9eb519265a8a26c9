"""References of control laws: trajectories, constants and functions, as functions of time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from .._arrays import Array, as_exact, as_floats, as_reals, read_only
from ..errors import InvalidValueError, ShapeError
from ..se3 import as_single_pose
from ..trajectories import PoseTrajectory, Trajectory

Desired = Callable[[float], tuple[Array, Array, Array]]
"""Value, rate and second rate at a time."""


def as_reference(reference: Any) -> Any:
    """Motions and functions as they are; constants as arrays that nobody changes."""
    if callable(reference) or isinstance(reference, (Trajectory, PoseTrajectory)):
        return reference
    return read_only(as_floats(getattr(reference, "homogeneous", reference), "reference"))


def joint_reference(reference: Any, n: int | None = None) -> tuple[Desired, int]:
    """Positions, velocities and accelerations (n,), and n, of what a user gave as reference."""
    if isinstance(reference, Trajectory):
        if reference.motion.batch:
            raise ShapeError(f"reference: expected one motion, got {reference.motion.batch}.")
        desired, size = _followed(reference), reference.n
    elif callable(reference):
        size = np.size(_answers(reference, 0.0)[0])
        desired = _function(reference, ((size,),) * 3)
    else:
        q = as_reference(reference)
        if q.ndim != 1:
            raise ShapeError(f"reference: expected positions of shape (n,), got {q.shape}.")
        size, desired = q.size, _constant(q, q.size)
    if n is not None and size != n:
        raise ShapeError(f"reference: expected {n} joints, those of the model, got {size}.")
    return desired, size


def pose_reference(reference: Any) -> Desired:
    """World pose (4, 4), twist and acceleration (6,) of the tool that a user wants."""
    if isinstance(reference, PoseTrajectory):

        def at(t: float) -> tuple[Array, Array, Array]:
            there = reference.at(np.array([t]))
            return there.T[0], there.twist[0], there.acceleration[0]

        return at
    if callable(reference):
        as_single_pose(_answers(reference, 0.0)[0], "reference(0)")
        return _function(reference, ((4, 4), (6,), (6,)))
    return _constant(as_single_pose(reference, "reference").copy(), 6)


def wrench_reference(reference: Any) -> Desired:
    """Wrench, its rate and second rate, each (6,), world axes."""
    if callable(reference):
        return _function(reference, ((6,),) * 3)
    return _constant(as_exact(reference, (6,), "force reference").copy(), 6)


def _constant(value: Array, size: int) -> Desired:
    rest = np.zeros(size)
    return lambda t: (value, rest, rest)


def _followed(trajectory: Trajectory) -> Desired:
    """A trajectory at single times, without its checks inside of its duration."""
    motion, end, n = trajectory.motion, float(trajectory.duration), trajectory.n

    def at(t: float) -> tuple[Array, Array, Array]:
        if 0.0 <= t <= end:
            q, v, a = motion.derivatives(np.array([t]), (0, 1, 2))
        else:
            q, v, a = trajectory.q(t), trajectory.v(t), trajectory.a(t)
        return q.reshape(n), v.reshape(n), a.reshape(n)

    return at


def _function(law: Callable[[float], Any], shapes: tuple[Any, ...]) -> Desired:
    """A function of the user with checks of its values; it is called once here."""

    def at(t: float) -> tuple[Array, Array, Array]:
        value, rate, second = _answers(law, t)
        if (value.shape, rate.shape, second.shape) != shapes:
            got = f"{value.shape}, {rate.shape}, {second.shape}"
            raise ShapeError(f"reference({t:g}): expected shapes {shapes}, got {got}.")
        if not np.isfinite(value.sum() + rate.sum() + second.sum()):
            raise InvalidValueError(f"reference({t:g}): expected finite numbers.")
        return value, rate, second

    at(0.0)
    return at


def _answers(law: Callable[[float], Any], t: float) -> tuple[Array, Array, Array]:
    answer = law(t)
    if not isinstance(answer, (tuple, list)) or len(answer) != 3:
        raise InvalidValueError(
            f"reference({t:g}): expected three arrays, the value with its first and second "
            f"derivative, got {type(answer).__name__}."
        )
    value, rate, second = (as_reals(x, f"reference({t:g})") for x in answer)
    return value, rate, second
