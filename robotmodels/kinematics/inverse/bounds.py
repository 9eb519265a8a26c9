"""Limits of the joints as bounds of their velocities or accelerations at a configuration.

What a joint may do now is what leaves it able to stop before its limit. With commands that are
held for a step h and a deceleration of at most A, a joint that starts with ``v = m A h + r``
(m whole, 0 <= r < A h) needs ``A h^2 m (m + 1) / 2 + h (m + 1) r`` to stop, the step that it moves
with v included. For small steps this is ``v^2 / (2 A)``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._arrays import Array, Rebuilt, as_reals, as_vector, batch_rows, batch_shape, read_only
from ...errors import InvalidValueError, ShapeError
from ...model import RobotModel, check_model

__all__ = ["JointBounds"]

_ROUNDING = 1e-6
"""Part of the width of bounds by which others may miss them before that is a conflict."""


@dataclass(frozen=True, slots=True, eq=False)
class JointBounds(Rebuilt):
    """Velocity, position and acceleration limits of the joints.

    Parameters
    ----------
    velocity : array_like, shape (n,) or (), optional
        Largest speeds, rad/s or m/s. Default the robot's.
    lower, upper : array_like, shape (n,) or (), optional
        Position limits, rad or m. Default the robot's.
    acceleration : array_like, shape (n,) or (), optional
        Largest accelerations, rad/s^2 or m/s^2: joints near a limit are only as fast as lets them
        brake before it. Default none: they may stop at once.
    step : float, optional
        Time for which a command is held, s: positions after it are inside the limits. Default
        none: a joint may move towards its limit until it is there (with ``acceleration``: as fast
        as it can brake in time), and no further. Bounds of accelerations need a step.

    Raises
    ------
    ShapeError, InvalidValueError
        Limits that are no vectors, negative speeds, accelerations or a step that are not positive.

    References
    ----------
    F. Flacco, A. De Luca and O. Khatib 2015 (bounds of velocities from all limits); A. Del Prete
    2018 (bounds of accelerations that can be kept ever after).

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
        set_ = object.__setattr__
        for name in ("velocity", "lower", "upper", "acceleration"):
            value = getattr(self, name)
            if value is None:
                continue
            array = as_reals(value, name)
            if array.ndim > 1:
                raise ShapeError(f"{name}: expected shape (n,) or a number, got {array.shape}.")
            if np.isnan(array).any():
                raise InvalidValueError(f"{name}: NaN is no limit; infinity is none at all.")
            set_(self, name, read_only(array))
        if self.velocity is not None and not (self.velocity >= 0.0).all():
            raise InvalidValueError(f"velocity: expected speeds, got {self.velocity}.")
        if self.acceleration is not None and not (self.acceleration > 0.0).all():
            raise InvalidValueError(
                f"acceleration: expected positive numbers, got {self.acceleration}."
            )
        if self.step is not None:
            step = as_reals(self.step, "step")
            if step.ndim or not 0.0 < step < np.inf:
                raise InvalidValueError(
                    f"step: expected a positive number of seconds, got {self.step!r}."
                )
            set_(self, "step", float(step))

    def velocity_bounds(
        self, model: RobotModel, q: ArrayLike, v: ArrayLike | None = None
    ) -> tuple[Array, Array]:
        """Bounds of the velocities at a configuration.

        A joint outside its position limits may only move back, and with a step it has to: to the
        limit in one step, or at its largest speed. Limits on ``|v|`` hold before all others, the
        acceleration from a given ``v`` even before them: `conflicts` says where they exclude
        others.

        Parameters
        ----------
        model : RobotModel
            The robot, n joints.
        q : array_like, shape (..., n)
            Joint variables, rad or m.
        v : array_like, shape (..., n), optional
            Velocities of the moment, from which ``acceleration`` allows a change in one step.
            Default: any change.

        Returns
        -------
        lower, upper : ndarray, shape (..., n)
            Bounds, rad/s or m/s, infinite where there are none; ``lower <= upper``.

        Raises
        ------
        ShapeError, InvalidValueError
            Limits for another number of joints or in the wrong order; velocities without an
            acceleration and a step.

        Examples
        --------
        A joint 0.02 rad outside has to come back:

        >>> from robotmodels.robots import load
        >>> bounds = JointBounds(velocity=1.0, lower=-2.0, upper=2.0, step=0.1)
        >>> bounds.velocity_bounds(load("planar_2r"), [2.02, 0.0])
        (array([-1., -1.]), array([-0.2,  1. ]))
        """
        low, high, _ = self._velocities(model, q, v)
        return low, high

    def acceleration_bounds(
        self, model: RobotModel, q: ArrayLike, v: ArrayLike
    ) -> tuple[Array, Array]:
        """Bounds of the accelerations, held for one step, at a state.

        They leave the joint inside its limits at the end of the step, slow enough to stop before
        its position limits with the same bounds ever after. Largest accelerations hold before all
        others: `conflicts` says where they exclude others.

        Parameters
        ----------
        model : RobotModel
            The robot, n joints.
        q, v : array_like, shape (..., n)
            Joint variables (rad or m) and velocities; the leading axes broadcast.

        Returns
        -------
        lower, upper : ndarray, shape (..., n)
            Bounds, rad/s^2 or m/s^2, infinite where there are none; ``lower <= upper``.

        Raises
        ------
        ShapeError, InvalidValueError
            Limits for another number of joints or in the wrong order; no step.

        Examples
        --------
        >>> from robotmodels.robots import load
        >>> bounds = JointBounds(velocity=1.0, acceleration=5.0, step=0.1)
        >>> bounds.acceleration_bounds(load("planar_2r"), [0.0, 0.0], [0.8, -1.0])
        (array([-5., 0.]), array([2., 5.]))
        """
        low, high, _ = self._accelerations(model, q, v)
        return low, high

    def outside(self, model: RobotModel, q: ArrayLike) -> NDArray[np.bool_]:
        """Joints that are outside their position limits.

        Parameters
        ----------
        model : RobotModel
            The robot, n joints.
        q : array_like, shape (..., n)
            Joint variables, rad or m.

        Returns
        -------
        ndarray of bool, shape (..., n)
            Whether each is.

        Examples
        --------
        >>> from robotmodels.robots import load
        >>> JointBounds(upper=[1.0, 2.0]).outside(load("planar_2r"), [1.5, 1.5])
        array([ True, False])
        """
        limits = self._limits(model)
        q = as_vector(q, model.n, "q")
        return (q < limits[1]) | (q > limits[2])

    def conflicts(
        self,
        model: RobotModel,
        q: ArrayLike,
        v: ArrayLike | None = None,
        *,
        accelerations: bool = False,
    ) -> NDArray[np.bool_]:
        """Joints whose limits cannot all be kept: those that give way are left.

        Parameters
        ----------
        model : RobotModel
            The robot, n joints.
        q, v : array_like, shape (..., n)
            As in `velocity_bounds` or `acceleration_bounds`.
        accelerations : bool
            Whether the bounds of accelerations are meant, or those of velocities.

        Returns
        -------
        ndarray of bool, shape (..., n)
            Whether position limits give way to speeds or accelerations, or speeds to these.

        Examples
        --------
        Nothing stops a joint from 1 rad/s within 0.01 rad at 5 rad/s^2:

        >>> from robotmodels.robots import load
        >>> bounds = JointBounds(upper=1.0, lower=-1.0, acceleration=5.0, step=0.01)
        >>> bounds.conflicts(load("planar_2r"), [0.99, 0.0], [1.0, 1.0])
        array([ True, False])
        """
        if accelerations:
            if v is None:
                raise InvalidValueError("v: bounds of accelerations need the velocities.")
            return self._accelerations(model, q, v)[2]
        return self._velocities(model, q, v)[2]

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
                "v: what can be reached from these velocities is known only with an acceleration "
                "and a step; give JointBounds both, or leave v out."
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
        arrays = []
        for name, (own, robots) in given.items():
            array = np.asarray(robots if own is None else own, dtype=np.float64)
            if array.shape not in ((), (model.n,)):
                raise ShapeError(
                    f"{name}: expected shape ({model.n},), one for each joint of the robot, got "
                    f"{array.shape}."
                )
            arrays.append(np.broadcast_to(array, (model.n,)))
        speed, lower, upper, acceleration = arrays
        wrong = np.flatnonzero(~((lower <= upper) & (lower < np.inf) & (upper > -np.inf)))
        if wrong.size:
            j = int(wrong[0])
            raise InvalidValueError(
                f"lower, upper: expected lower <= upper with room between them, got "
                f"[{lower[j]}, {upper[j]}] for joint {j} ({model.table.joint_names[j]!r})."
            )
        return speed, lower, upper, acceleration


def _fastest(room: Array, acceleration: Array, step: float | None, back: float) -> Array:
    """Largest velocity with which a joint can stop within the room before its limit.

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
