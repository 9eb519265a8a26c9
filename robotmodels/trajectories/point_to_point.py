"""Joint motions from rest to rest on the straight line between two postures."""

from __future__ import annotations

from enum import Enum

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array
from .._choices import chosen
from ..errors import InvalidValueError
from .asked import (
    checked_limits,
    given_durations,
    joint_vectors,
    limits_along,
    refuse_rates,
    refuse_short,
)
from .laws import LineLimits, Pieces, TimeLaw, law_of_duration, law_of_limits
from .limits import MotionLimits
from .piecewise import PiecewisePolynomial
from .trajectory import Trajectory

_LONGEST = 1e300
"""Of a way, so that ten times its polynomial's largest coefficient is a number."""


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
    """Constant velocity. It jumps at both ends: no acceleration limit holds there.

    Parameters
    ----------
    q0, q1 : array_like, shape () or (..., n)
        Postures, rad or m; leading axes are motions of their own.
    duration : array_like, shape () or (...), optional
        Seconds; default the least that the limits allow.
    limits : MotionLimits, optional
        Kept inside the motion, so that of velocity alone tells here.
    synchronisation : Synchronisation or str
        How the joints are kept in step; a member or its name.

    Returns
    -------
    Trajectory
        Of n joints, or scalar.

    Raises
    ------
    ShapeError, InvalidValueError
        Vectors that do not fit, NaN; neither duration nor limits; a duration below the least,
        which the message tells; a limit of zero for a joint that has to move.

    References
    ----------
    Khalil and Dombre, Modeling, identification and control of robots, section 13.3.1.

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
    """Constant acceleration, then constant deceleration, with no cruise between them.

    Parameters, errors and result as `linear`. With asymmetric limits the two parts share the
    time so that both accelerations are used in full; without limits they are equal. A limit of
    velocity slows the whole motion down; one of jerk is refused.

    Parameters
    ----------
    q0, q1 : array_like, shape () or (..., n)
        Postures, rad or m.
    duration : array_like, shape () or (...), optional
        Seconds; default the least that the limits allow.
    limits : MotionLimits, optional
        Of velocity and acceleration.
    synchronisation : Synchronisation or str
        How the joints are kept in step; a member or its name.

    Returns
    -------
    Trajectory
        Of n joints, or scalar.

    Raises
    ------
    ShapeError, InvalidValueError
        As `linear`; a limit of jerk.

    References
    ----------
    Khalil and Dombre, section 13.3.3.

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

    Also called linear segment with parabolic blends, ``lspb``, ``trapezoidal``. A duration
    longer than the least slows the quickest motion down evenly. Without limits the ramps take a
    third of the duration each.

    Parameters
    ----------
    q0, q1 : array_like, shape () or (..., n)
        Postures, rad or m; leading axes are motions of their own.
    duration : array_like, shape () or (...), optional
        Seconds; default the least that the limits allow.
    limits : MotionLimits, optional
        Of velocity and acceleration, which may be asymmetric. Coordinated joints share the law
        that none of them exceeds.
    synchronisation : Synchronisation or str
        How the joints are kept in step; a member or its name.

    Returns
    -------
    Trajectory
        Of n joints, or scalar.

    Raises
    ------
    ShapeError, InvalidValueError
        Vectors that do not fit, NaN; neither duration nor limits; a duration below the least,
        which the message tells; a limit of zero for a joint that has to move; a limit of jerk,
        which no jump of acceleration keeps.

    References
    ----------
    Seed book section 4.2.2. Khalil and Dombre, section 13.3.4.

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
    ``1.5 V / acceleration``, or longer where a limit of jerk asks for it.

    Parameters
    ----------
    q0, q1 : array_like, shape () or (..., n)
        Postures, rad or m; leading axes are motions of their own.
    duration : array_like, shape () or (...), optional
        Seconds; default the least that the limits allow with this law.
    limits : MotionLimits, optional
        Of velocity, acceleration and jerk.
    synchronisation : Synchronisation or str
        How the joints are kept in step; a member or its name.

    Returns
    -------
    Trajectory
        Of n joints, or scalar.

    Raises
    ------
    ShapeError, InvalidValueError
        As `trapezoidal`, but limits of jerk are kept.

    References
    ----------
    Seed book section 4.2.3. Khalil and Dombre, section 13.3.5.

    Examples
    --------
    >>> limits = MotionLimits(velocity=1.0, acceleration=1.5)
    >>> smoothed_trapezoidal(0.0, 3.0, limits=limits).duration
    4.00...
    """
    return along_line(TimeLaw.SMOOTHED_TRAPEZOIDAL, q0, q1, duration, limits, synchronisation)


def along_line(
    law: TimeLaw | str,
    q0: ArrayLike,
    q1: ArrayLike,
    duration: ArrayLike | None,
    limits: MotionLimits | None,
    synchronisation: Synchronisation | str = Synchronisation.COORDINATED,
) -> Trajectory:
    """Motion from rest to rest by any law, for programs that choose it.

    Parameters
    ----------
    law : TimeLaw or str
        How the motion is distributed over the time; a member or its name.
    q0, q1 : array_like, shape () or (..., n)
        Postures, rad or m.
    duration : array_like, shape () or (...), or None
        Seconds.
    limits : MotionLimits or None
        Kept inside the motion. Independent joints that arrive early have the end of their law
        inside it, with the jump that a linear, cubic, bang-bang or trapezoidal law ends with:
        limits that the jump does not keep are refused there.
    synchronisation : Synchronisation or str
        How the joints are kept in step; a member or its name.

    Returns
    -------
    Trajectory
        Of n joints, or scalar.

    Raises
    ------
    ShapeError, InvalidValueError
        As `trapezoidal`.

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
    with np.errstate(over="ignore"):  # refused below
        difference = end - start
    way = difference[:, None, :] if together else difference[:, :, None]
    laws = 1 if together else n  # of each motion
    length = np.abs(way).max(axis=-1, initial=0.0).reshape(-1)
    if (length > _LONGEST).any():
        raise InvalidValueError(
            f"q0, q1: a way of {length.max():.3g} is too long for its polynomial to have numbers."
        )
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
    refuse_rates(length.reshape(R, laws), least if T is None else T)
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
