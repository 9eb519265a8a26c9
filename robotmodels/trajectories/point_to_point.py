"""Joint motions between two states: six laws of time, coordinated or of the same time.

Every function of this file returns the motion by one law. ``linear``, ``bang_bang``,
``trapezoidal`` and ``smoothed_trapezoidal`` go from rest to rest on the straight line between two
configurations; ``cubic`` and ``quintic`` may have other states at their ends, which give every
joint its own polynomial of the same duration.

Parameters
----------
law : TimeLaw or str
    Of `along_line`: a member or its name.
q0, q1 : array_like, shape () or (..., n)
    Positions at the ends, rad or m; leading axes are motions of their own.
duration : array_like, shape () or (...), optional
    Seconds; default the least with which the law keeps the limits. A longer one slows the quickest
    motion down evenly.
limits : MotionLimits, optional
    Of velocity, acceleration, jerk and position, kept inside the motion; they may be asymmetric.
    Coordinated joints share the law that none of them exceeds. Independent joints that arrive
    early have the end of their law inside the motion: limits that its jump does not keep are
    refused.
synchronisation : Synchronisation or str
    How the joints are kept in step; a member or its name.
v0, v1, a0, a1 : array_like, shape () or (..., n)
    Velocities and accelerations at the ends, rad or m, per s and s^2.

Returns
-------
Trajectory
    Of n joints, or scalar.

Raises
------
ShapeError, InvalidValueError
    Vectors that do not fit, NaN; neither duration nor limits; a duration with which the limits are
    not kept (the message has the least that keeps them, or that none does); a limit of zero for a
    joint that has to move; a limit of jerk for ``bang_bang`` and ``trapezoidal``.

References
----------
Seed book section 4.2. Khalil and Dombre, Modeling, identification and control of robots, section
13.3.
"""

from __future__ import annotations

from enum import Enum

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array
from .._choices import chosen
from ..errors import InvalidValueError
from .between_states import motion_between
from .checks import (
    checked_limits,
    given_durations,
    joint_vectors,
    limits_along,
    refuse_extremes,
    refuse_short,
)
from .laws import LineLimits, Pieces, TimeLaw, law_of_duration, law_of_limits
from .limits import MotionLimits
from .piecewise import PiecewisePolynomial
from .trajectory import Trajectory


class Synchronisation(Enum):
    """How joints that move together are kept in step; the value says what is common to them.

    Examples
    --------
    >>> Synchronisation.SAME_TIME.value
    'start and end: each joint has its own quickest law, slowed down to the slowest joint'
    """

    COORDINATED = "one law: the ratio of the joints' motions is kept along the whole path"
    SAME_TIME = (
        "start and end: each joint has its own quickest law, slowed down to the slowest joint"
    )
    INDEPENDENT = "the start only: each joint arrives as soon as it can and waits"


def linear(
    q0: ArrayLike,
    q1: ArrayLike,
    duration: ArrayLike | None = None,
    limits: MotionLimits | None = None,
    synchronisation: Synchronisation | str = Synchronisation.COORDINATED,
) -> Trajectory:
    """Constant velocity; it jumps at both ends, so that no acceleration limit holds there.

    Examples
    --------
    >>> linear([0.0, 0.0], [1.0, 4.0], limits=MotionLimits(velocity=2.0)).duration
    2.00...
    """
    return along_line(TimeLaw.LINEAR, q0, q1, duration, limits, synchronisation)


def bang_bang(
    q0: ArrayLike,
    q1: ArrayLike,
    duration: ArrayLike | None = None,
    limits: MotionLimits | None = None,
    synchronisation: Synchronisation | str = Synchronisation.COORDINATED,
) -> Trajectory:
    """Constant acceleration, then constant deceleration, without a cruise between them.

    With asymmetric limits the two parts share the time so that both accelerations are used in
    full; without limits they are equal.

    Examples
    --------
    >>> bang_bang(0.0, 1.0, limits=MotionLimits(acceleration=4.0)).duration
    1.00...
    """
    return along_line(TimeLaw.BANG_BANG, q0, q1, duration, limits, synchronisation)


def trapezoidal(
    q0: ArrayLike,
    q1: ArrayLike,
    duration: ArrayLike | None = None,
    limits: MotionLimits | None = None,
    synchronisation: Synchronisation | str = Synchronisation.COORDINATED,
) -> Trajectory:
    """Trapezoidal velocity: the quickest motion under limits of velocity and acceleration.

    Also called linear segment with parabolic blends, ``lspb``. Without limits the ramps take a
    third of the duration each.

    Examples
    --------
    >>> limits = MotionLimits(velocity=[1.0, 2.0], acceleration=2.0)
    >>> move = trapezoidal([0.0, 0.0], [1.0, -1.0], limits=limits)
    >>> move.duration, move.v(0.75)
    (1.50..., array([ 1., -1.]))
    """
    return along_line(TimeLaw.TRAPEZOIDAL, q0, q1, duration, limits, synchronisation)


def smoothed_trapezoidal(
    q0: ArrayLike,
    q1: ArrayLike,
    duration: ArrayLike | None = None,
    limits: MotionLimits | None = None,
    synchronisation: Synchronisation | str = Synchronisation.COORDINATED,
) -> Trajectory:
    """Smoothed trapezoidal velocity: ramps whose acceleration is a parabola of time.

    The acceleration is continuous, also at the ends. A ramp to the velocity V takes
    ``1.5 V / acceleration``, or longer where a limit of jerk needs it.

    Examples
    --------
    >>> limits = MotionLimits(velocity=1.0, acceleration=1.5)
    >>> smoothed_trapezoidal(0.0, 3.0, limits=limits).duration
    4.00...
    """
    return along_line(TimeLaw.SMOOTHED_TRAPEZOIDAL, q0, q1, duration, limits, synchronisation)


def cubic(
    q0: ArrayLike,
    q1: ArrayLike,
    duration: ArrayLike | None = None,
    limits: MotionLimits | None = None,
    v0: ArrayLike = 0.0,
    v1: ArrayLike = 0.0,
) -> Trajectory:
    """Third-order polynomials with given velocities at the ends.

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
    return motion_between(3, states, batch, scalar, duration, limits)


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
    return motion_between(5, states, batch, scalar, duration, limits)


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


def along_line(
    law: TimeLaw | str,
    q0: ArrayLike,
    q1: ArrayLike,
    duration: ArrayLike | None,
    limits: MotionLimits | None,
    synchronisation: Synchronisation | str = Synchronisation.COORDINATED,
) -> Trajectory:
    """Motion from rest to rest by any law, for programs that choose it.

    Examples
    --------
    >>> along_line(TimeLaw.CUBIC, 0.0, 1.0, None, MotionLimits(velocity=1.5)).duration
    1.00...
    """
    law = chosen(TimeLaw, law, "law")
    synchronisation = chosen(Synchronisation, synchronisation, "synchronisation")
    given, batch, scalar = joint_vectors(q0=q0, q1=q1)
    start, end = given["q0"], given["q1"]
    R, n = start.shape
    T = given_durations(duration, batch)
    if T is None and limits is None:
        raise InvalidValueError("Give duration, limits or both.")
    bounds = checked_limits(limits, n, start, end)
    together = bounds is None or synchronisation is Synchronisation.COORDINATED
    # one law for all joints of a motion, or one law each
    refuse_extremes({"q0": start, "q1": end} | ({} if T is None else {"duration": T}), bounds)
    difference = np.where(np.abs(end - start) < 1e-50, 0.0, end - start)
    way = difference[:, None, :] if together else difference[:, :, None]
    laws = 1 if together else n  # of each motion
    length = np.abs(way).max(axis=-1, initial=0.0).reshape(-1)
    with np.errstate(invalid="ignore", divide="ignore"):
        direction = np.where(way != 0.0, way / length.reshape(*way.shape[:2], 1), 0.0)
    if bounds is None:
        assert T is not None
        pieces = law_of_duration(law, length, np.repeat(T, laws))
        least = np.zeros(R)
    else:
        along = limits_along(bounds, direction)
        pieces = law_of_limits(law, length, along)
        totals = pieces.durations.sum(axis=-1).reshape(R, laws)
        least = totals.max(axis=-1, initial=0.0)
        if T is None and synchronisation is Synchronisation.INDEPENDENT:
            _refuse_waiting(law, along, totals)
    refuse_short(T, least, length.reshape(R, laws))
    pieces = stretched(pieces, T, least, synchronisation, laws)
    return assembled(pieces, laws, start, direction, batch, scalar, T)


def _refuse_waiting(law: TimeLaw, limits: LineLimits, totals: Array) -> None:
    """Jumps at the end of a law, totals (R, n), are inside the motion where a joint waits."""
    if law is TimeLaw.LINEAR:
        jump, kind = "velocity", "acceleration or jerk"
        bound = np.minimum(limits.deceleration, np.minimum(limits.jerk, limits.jerk_down))
        others = "take SAME_TIME, or a law that ends at rest"
    elif law is TimeLaw.CUBIC:
        jump, kind, bound = "acceleration", "jerk", limits.jerk
        others = "pass limits.without_jerk(), or take SAME_TIME or QUINTIC"
    else:  # those of jerk are refused for BANG_BANG and TRAPEZOIDAL anywhere
        return
    early = (totals > 0.0) & (totals < totals.max(axis=-1, keepdims=True, initial=0.0))
    wrong = early & np.isfinite(bound.reshape(totals.shape))
    if wrong.any():
        j = int(np.argwhere(wrong)[0][-1])
        raise InvalidValueError(
            f"limits: joint {j + 1} arrives early and waits, and the {jump} of {law.name} jumps at "
            f"its end, which keeps no limit of {kind}; {others}."
        )


def stretched(
    pieces: Pieces, T: Array | None, least: Array, how: Synchronisation, laws: int
) -> Pieces:
    """Stretch the laws of each motion to its duration, and let those that arrive early wait."""
    total = pieces.durations.sum(axis=-1)
    goal = np.repeat(least if T is None else T, laws)
    if T is None and how is Synchronisation.INDEPENDENT:
        wait = goal - total
    else:
        wait = np.where(total > 0.0, 0.0, goal)
        with np.errstate(divide="ignore", invalid="ignore"):
            factor = np.where(total > 0.0, goal / total, 1.0)
        pieces = Pieces(pieces.durations * factor[:, None], pieces.coefficients)
    if not (wait > 0.0).any():
        return pieces
    rest = np.zeros_like(pieces.coefficients[:, :1])
    rest[:, 0, 0] = pieces.coefficients[:, -1].sum(axis=-1)
    return Pieces(
        np.concatenate((pieces.durations, wait[:, None]), axis=1),
        np.concatenate((pieces.coefficients, rest), axis=1),
    )


def assembled(
    pieces: Pieces, columns: int, start: Array, direction: Array, batch: tuple[int, ...],
    scalar: bool, T: Array | None,
) -> Trajectory:  # fmt: skip
    """Trajectory from motion laws along given directions.

    Shapes: start (R, n), direction (R, 1, n) or (R, n, 1), T (R,).
    """
    R, n = start.shape
    K, powers = pieces.coefficients.shape[1:]
    breaks = np.zeros((R, columns, K + 1))
    breaks[..., 1:] = np.cumsum(pieces.durations, axis=-1).reshape(R, columns, K)
    if T is not None:
        # times of all laws end together to the last digit
        breaks = np.minimum(breaks, T[:, None, None])
        breaks[..., -1] = T[:, None]
    c = pieces.coefficients.reshape(R, columns, K, powers)
    c = np.moveaxis(c, 1, -1) * direction.reshape(R, 1, 1, n)
    c[:, :, 0] += start[:, None, :]
    motion = PiecewisePolynomial(
        breaks.reshape(*batch, columns, K + 1),
        c.reshape(*batch, K, powers, n),
        pieces.durations.reshape(*batch, columns, K),
    )
    return Trajectory(motion, scalar)
