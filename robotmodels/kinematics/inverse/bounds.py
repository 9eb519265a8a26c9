"""Limits of the joints as bounds of their velocities or accelerations at a configuration.

A joint may move as long as it can still stop before its limit. With commands that are
held for a step h and a deceleration of at most A, a joint that starts with ``v = m A h + r``
(m whole, 0 <= r < A h) needs ``A h^2 m (m + 1) / 2 + h (m + 1) r`` to stop, the step that it moves
with v included. For small steps this is ``v^2 / (2 A)``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._arrays import (
    Array,
    Rebuilt,
    as_number,
    as_reals,
    as_vector,
    batch_rows,
    batch_shape,
    read_only,
)
from ...errors import InvalidValueError, ShapeError
from ...model import RobotModel, check_model

_ROUNDING = 1e-6
"""Part of the width of bounds by which others may miss them before that is a conflict."""


@dataclass(frozen=True, slots=True, eq=False)
class JointBounds(Rebuilt):
    """Velocity, position and acceleration limits of the joints.

    F. Flacco, A. De Luca and O. Khatib 2015 (bounds of velocities from all limits); A. Del Prete
    2018 (bounds of accelerations that can be kept ever after).

    Parameters
    ----------
    velocity : array_like, shape (n,) or (), optional
        Largest speeds, rad/s or m/s. Default the robot's.
    lower, upper : array_like, shape (n,) or (), optional
        Position limits, rad or m. Default the robot's.
    acceleration : array_like, shape (n,) or (), optional
        Largest accelerations, rad/s^2 or m/s^2: a joint near a limit is only as fast as lets it
        brake before it. Default none: it may stop at once.
    step : float, optional
        Time for which a command is held, s: positions after it are inside the limits. Default
        none: a joint may move towards its limit until it is there (with ``acceleration``: as fast
        as it can brake in time). Bounds of accelerations need a step.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> arm = load("panda")
    >>> q = 0.5 * (arm.lower + arm.upper)
    >>> q[0] = arm.upper[0] - 0.001
    >>> JointBounds(step=0.01).velocity_bounds(arm, q)[1].round(3)
    array([0.1  , 2.175, 2.175, 2.175, 2.61 , 2.61 , 2.61 ])
    """

    velocity: Array | None = None
    lower: Array | None = None
    upper: Array | None = None
    acceleration: Array | None = None
    step: float | None = None

    def __post_init__(self) -> None:
        for name in ("velocity", "lower", "upper", "acceleration"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, as_limit(getattr(self, name), name))
        if self.velocity is not None and not (self.velocity >= 0.0).all():
            raise InvalidValueError(f"velocity: expected speeds, got {self.velocity}.")
        if self.acceleration is not None and not (self.acceleration > 0.0).all():
            raise InvalidValueError(
                f"acceleration: expected positive numbers, got {self.acceleration}."
            )
        if self.step is not None:
            object.__setattr__(self, "step", as_number(self.step, "step", above=0.0))

    def velocity_bounds(
        self, model: RobotModel, q: ArrayLike, v: ArrayLike | None = None
    ) -> tuple[Array, Array]:
        """Bounds of the velocities (..., n), rad/s or m/s, infinite where there are none.

        A joint outside its position limits may only move back, and with a step it has to: to the
        limit in one step, or at its largest speed. A present velocity ``v (..., n)`` adds what
        ``acceleration`` allows in one step. Speeds take precedence over positions, accelerations
        over both: see `conflicts`.
        """
        return self._velocities(model, q, v)[:2]

    def acceleration_bounds(
        self, model: RobotModel, q: ArrayLike, v: ArrayLike
    ) -> tuple[Array, Array]:
        """Bounds of the accelerations (..., n), held for one step, rad/s^2 or m/s^2.

        They leave the joint inside its limits at the end of the step, slow enough to stop before
        its position limits with the same bounds ever after. Accelerations take precedence over all
        others: see `conflicts`.
        """
        return self._accelerations(model, q, v)[:2]

    def outside(self, model: RobotModel, q: ArrayLike) -> NDArray[np.bool_]:
        """Joints outside their position limits (..., n)."""
        _, lower, upper, _ = self._limits(model)
        q = as_vector(q, model.n, "q")
        return (q < lower) | (q > upper)

    def conflicts(
        self,
        model: RobotModel,
        q: ArrayLike,
        v: ArrayLike | None = None,
        *,
        accelerations: bool = False,
    ) -> NDArray[np.bool_]:
        """Joints (..., n) whose limits cannot all be kept, of velocities or of accelerations."""
        if not accelerations:
            return self._velocities(model, q, v)[2]
        if v is None:
            raise InvalidValueError("v: bounds of accelerations need the velocities.")
        return self._accelerations(model, q, v)[2]

    def _velocities(
        self, model: RobotModel, q: ArrayLike, v: ArrayLike | None
    ) -> tuple[Array, Array, NDArray[np.bool_]]:
        speed, lower, upper, acceleration = self._limits(model)
        q = as_vector(q, model.n, "q")
        high = _fastest(upper - q, acceleration, self.step, 1.0)
        low = -_fastest(q - lower, acceleration, self.step, 1.0)
        low, high, conflict = _agreed(low, high, -speed, speed)
        if v is None:
            return low, high, conflict
        if self.acceleration is None or self.step is None:
            raise InvalidValueError(
                "v: the velocities that can be reached from these depend on an acceleration and a "
                "step; give JointBounds both, or leave v out."
            )
        v = as_vector(v, model.n, "v")
        batch_shape((q, v), ("q", "v"))
        reach = acceleration * self.step
        low, high, beyond = _agreed(low, high, v - reach, v + reach)
        return low, high, conflict | beyond

    def _accelerations(
        self, model: RobotModel, q: ArrayLike, v: ArrayLike
    ) -> tuple[Array, Array, NDArray[np.bool_]]:
        if self.step is None:
            raise InvalidValueError(
                "step: bounds of accelerations need the time for which one is held; give "
                "JointBounds(step=...)."
            )
        speed, lower, upper, acceleration = self._limits(model)
        batch, rows = batch_rows(
            (as_vector(q, model.n, "q"), as_vector(v, model.n, "v")), ("q", "v")
        )
        q, v = (row.reshape(*batch, model.n) for row in rows)
        # half of the step's way is made by the velocity at its start
        ahead = q + 0.5 * self.step * v
        high = _fastest(upper - ahead, acceleration, self.step, 2.0)
        low = -_fastest(ahead - lower, acceleration, self.step, 2.0)
        low, high, conflict = _agreed(low, high, -speed, speed)
        low, high, beyond = _agreed(
            (low - v) / self.step, (high - v) / self.step, -acceleration, acceleration
        )
        return low, high, conflict | beyond

    def _limits(self, model: RobotModel) -> tuple[Array, Array, Array, Array]:
        """Speeds, lower and upper positions, accelerations of the n joints."""
        check_model(model)
        given = {
            "velocity": (self.velocity, model.table.velocity),
            "lower": (self.lower, model.lower),
            "upper": (self.upper, model.upper),
            "acceleration": (self.acceleration, np.inf),
        }
        speed, lower, upper, acceleration = (
            for_joints(model, usual if own is None else own, name)
            for name, (own, usual) in given.items()
        )
        check_order(model, lower, upper, ~((lower <= upper) & (lower < np.inf) & (upper > -np.inf)))
        return speed, lower, upper, acceleration


def as_limit(value: ArrayLike, name: str) -> Array:
    """A limit of the joints: a number or a vector, maybe infinite."""
    array = as_reals(value, name)
    if array.ndim > 1:
        raise ShapeError(f"{name}: expected shape (n,) or a number, got {array.shape}.")
    if np.isnan(array).any():
        raise InvalidValueError(f"{name}: NaN is no limit; give infinity where there is none.")
    return read_only(array)


def for_joints(model: RobotModel, limit: ArrayLike, name: str) -> Array:
    """One value of a limit for each joint of a robot."""
    array = np.asarray(limit, dtype=np.float64)
    if array.shape not in ((), (model.n,)):
        raise ShapeError(
            f"{name}: expected shape ({model.n},), one for each joint of the robot, got "
            f"{array.shape}."
        )
    return np.broadcast_to(array, (model.n,))


def check_order(model: RobotModel, low: Array, high: Array, wrong: NDArray[np.bool_]) -> None:
    """Refuse limits of the joints marked as wrong."""
    if wrong.any():
        j = int(wrong.argmax())
        raise InvalidValueError(
            f"lower, upper: expected lower <= upper with a range between them, got [{low[j]}, "
            f"{high[j]}] for joint {j} ({model.table.joint_names[j]!r})."
        )


def _fastest(room: Array, acceleration: Array, step: float | None, back: float) -> Array:
    """Largest velocity with which a joint can stop before its limit.

    ``back`` is 2 where the velocity is reached linearly during the step, 1 where it is held: a
    joint beyond its limit is at it after one step with ``back * room / step``.
    """
    ahead = np.maximum(room, 0.0)
    if step is None:
        # at the limit zero, even where the acceleration is infinite
        return np.sqrt(np.multiply(2.0 * acceleration, ahead, out=np.zeros_like(ahead),
                                   where=ahead > 0.0))  # fmt: skip
    once = ahead / step
    slowing = np.broadcast_to(np.isfinite(acceleration) & np.isfinite(ahead), ahead.shape)
    # whole steps of full braking, and the rest of the room
    unit = np.where(np.isfinite(acceleration), acceleration, 1.0) * step
    steps = np.where(slowing, ahead, 0.0) / (unit * step)
    m = np.floor(0.5 * (np.sqrt(1.0 + 8.0 * steps) - 1.0))
    rest = (steps - 0.5 * m * (m + 1.0)) / (m + 1.0)
    fastest = np.where(slowing, unit * (m + rest), once)
    return np.where(room < 0.0, back * room / step, fastest)


def _agreed(
    low: Array, high: Array, least: Array, most: Array
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Bounds within bounds that hold before them, and where these exclude them."""
    # outside on one side, with a way back that would be too fast to stop on the other
    crossed = low > high
    apart = np.subtract(low, high, out=np.zeros_like(low), where=crossed)
    conflict = apart > _ROUNDING * np.where(crossed, np.abs(low) + np.abs(high), 1.0)
    low, high = (
        np.where(crossed & (high >= 0.0), high, low),
        np.where(crossed & (high < 0.0), low, high),
    )
    # infinite bounds exclude nothing
    width = np.where(np.isfinite(least) & np.isfinite(most), most, 0.0) - np.where(
        np.isfinite(least) & np.isfinite(most), least, 0.0
    )
    conflict |= (low > most + _ROUNDING * width) | (high < least - _ROUNDING * width)
    return np.clip(low, least, most), np.clip(high, least, most), conflict
