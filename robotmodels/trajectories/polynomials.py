"""Polynomials of third and fifth order between two states."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array
from ..errors import InvalidValueError
from .asked import (
    ROUNDING,
    checked_limits,
    given_durations,
    joint_vectors,
    refuse_extremes,
    refuse_rates,
    refuse_short,
)
from .laws import TimeLaw
from .limits import MotionLimits
from .piecewise import PiecewisePolynomial
from .point_to_point import along_line
from .polynomial_durations import between_states, excess, least_duration
from .shown import least_shown
from .trajectory import Trajectory


def cubic(
    q0: ArrayLike,
    q1: ArrayLike,
    duration: ArrayLike | None = None,
    limits: MotionLimits | None = None,
    v0: ArrayLike = 0.0,
    v1: ArrayLike = 0.0,
) -> Trajectory:
    """Third-order polynomials with given velocities at the ends.

    From rest to rest the joints are coordinated: they share one law, and the ratio of their
    motions is kept. Other end velocities give every joint its own polynomial of the same duration.

    Parameters
    ----------
    q0, q1 : array_like, shape () or (..., n)
        Positions at the ends, rad or m; leading axes are motions of their own.
    duration : array_like, shape () or (...), optional
        Seconds; default the least with which these polynomials keep the limits.
    limits : MotionLimits, optional
        Kept inside the motion: velocity, acceleration, jerk and position.
    v0, v1 : array_like, shape () or (..., n)
        Velocities at the ends, rad/s or m/s.

    Returns
    -------
    Trajectory
        Of n joints, or scalar.

    Raises
    ------
    ShapeError, InvalidValueError
        Vectors that do not fit, NaN; neither duration nor limits; a duration with which the limits
        are not kept: the message tells the least that will do, or that none does.

    References
    ----------
    Khalil and Dombre, Modeling, identification and control of robots, section 13.3.2.

    Examples
    --------
    >>> cubic([0.0, 1.0], [1.0, 0.0], duration=1.0).v(0.5)
    array([ 1.5, -1.5])
    >>> cubic(0.0, 1.0, limits=MotionLimits(velocity=0.75)).duration
    2.00...
    """
    states, batch, scalar = joint_vectors(q0=q0, q1=q1, v0=v0, v1=v1)
    states |= {"a0": np.zeros_like(states["q0"]), "a1": np.zeros_like(states["q0"])}
    if not (states["v0"].any() or states["v1"].any()):
        return _from_rest(TimeLaw.CUBIC, states, batch, scalar, duration, limits)
    return _between_states(3, states, batch, scalar, duration, limits)


def quintic(
    q0: ArrayLike,
    q1: ArrayLike,
    duration: ArrayLike | None = None,
    limits: MotionLimits | None = None,
    v0: ArrayLike = 0.0,
    v1: ArrayLike = 0.0,
    a0: ArrayLike = 0.0,
    a1: ArrayLike = 0.0,
) -> Trajectory:
    """Fifth-order polynomials with given velocities and accelerations at the ends.

    From rest to rest the joints are coordinated: they share one law, and the ratio of their
    motions is kept. Other end states give every joint its own polynomial of the same duration.

    Parameters
    ----------
    q0, q1 : array_like, shape () or (..., n)
        Positions at the ends, rad or m; leading axes are motions of their own.
    duration : array_like, shape () or (...), optional
        Seconds; default the least with which these polynomials keep the limits.
    limits : MotionLimits, optional
        Kept inside the motion: velocity, acceleration, jerk and position.
    v0, v1 : array_like, shape () or (..., n)
        Velocities at the ends, rad/s or m/s.
    a0, a1 : array_like, shape () or (..., n)
        Accelerations at the ends, rad/s^2 or m/s^2.

    Returns
    -------
    Trajectory
        Of n joints, or scalar.

    Raises
    ------
    ShapeError, InvalidValueError
        As `cubic`.

    References
    ----------
    Seed book section 4.2.1.

    Examples
    --------
    >>> move = quintic([0.0, 0.0], [1.0, 2.0], duration=2.0)
    >>> move.v(1.0), move.a(2.0)
    (array([0.9375, 1.875 ]), array([0., 0.]))
    >>> quintic(0.0, 1.0, limits=MotionLimits(velocity=1.875, acceleration=5.0)).duration
    1.0745...
    """
    states, batch, scalar = joint_vectors(q0=q0, q1=q1, v0=v0, v1=v1, a0=a0, a1=a1)
    if not any(states[name].any() for name in ("v0", "v1", "a0", "a1")):
        return _from_rest(TimeLaw.QUINTIC, states, batch, scalar, duration, limits)
    return _between_states(5, states, batch, scalar, duration, limits)


def _from_rest(
    law: TimeLaw,
    states: dict[str, Array],
    batch: tuple[int, ...],
    scalar: bool,
    duration: ArrayLike | None,
    limits: MotionLimits | None,
) -> Trajectory:
    shape = (*batch, states["q0"].shape[-1])
    q0, q1 = states["q0"].reshape(shape), states["q1"].reshape(shape)
    return Trajectory(along_line(law, q0, q1, duration, limits).motion, scalar)


def _between_states(
    order: int,
    states: dict[str, Array],
    batch: tuple[int, ...],
    scalar: bool,
    duration: ArrayLike | None,
    limits: MotionLimits | None,
) -> Trajectory:
    T = given_durations(duration, batch)
    if T is None and limits is None:
        raise InvalidValueError("Give duration, limits or both.")
    R, n = states["q0"].shape
    bounds = checked_limits(limits, n, states["q0"], states["q1"])
    if T is not None:
        refuse_short(T, np.zeros(R), np.ones((R, 1)))
    if bounds is not None:
        refuse_extremes(states, bounds)
        rows = [{name: value[i] for name, value in states.items()} for i in range(R)]
        if T is None:
            T = np.array([_least(order, row, bounds) for row in rows])
        for row, time in zip(rows, T, strict=True):
            if excess(order, row, np.array([time]), bounds)[0] > ROUNDING:
                _refuse(order, row, bounds, float(time))
    assert T is not None
    refuse_rates(np.abs(states["q1"] - states["q0"]), T)
    c = between_states(order, states, T[:, None])
    motion = PiecewisePolynomial(
        np.stack((np.zeros(R), T), axis=-1).reshape(*batch, 1, 2),
        np.moveaxis(c, 0, -2).reshape(*batch, 1, order + 1, n),
    )
    return Trajectory(motion, scalar)


def _least(order: int, state: dict[str, Array], limits: MotionLimits) -> float:
    for rate, least, most in (("v", limits.velocity_lower, limits.velocity),
                              ("a", limits.acceleration_lower, limits.acceleration)):  # fmt: skip
        for name in (rate + "0", rate + "1"):
            wrong = (state[name] > most) | (state[name] < least)
            if wrong.any():
                j = int(wrong.argmax())
                raise InvalidValueError(
                    f"limits: {name} of joint {j + 1} is {state[name][j]:.9g}, outside its limits "
                    f"{least[j]:.9g} to {most[j]:.9g}; the least limit that will do is "
                    f"{least_shown(abs(state[name][j]))}."
                )
    T = least_duration(order, state, limits)
    if T is None:
        raise InvalidValueError(
            "limits: no duration keeps them with these states at the ends; give slower states or "
            "greater limits, or take jerk_limited, which finds a motion between any states."
        )
    return T


def _refuse(order: int, state: dict[str, Array], limits: MotionLimits, T: float) -> None:
    least = _least(order, state, limits)
    message = f"with {T:.9g} s the limits are not kept; the least duration that keeps them is"
    message = f"duration: {message} {least_shown(least)} s."
    if least < T:
        longer = least_duration(order, state, limits, T)
        message += (
            " No longer one does."
            if longer is None
            else f" The least that is longer than that given is {least_shown(longer)} s."
        )
    raise InvalidValueError(message)
