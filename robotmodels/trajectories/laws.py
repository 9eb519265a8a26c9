"""Time laws from rest to rest along one coordinate, and their least durations.

Seed book sections 4.2.1 (fifth-order polynomial), 4.2.2 (trapezoidal velocity) and 4.2.3 (smoothed
trapezoidal velocity). A law moves ``s`` from 0 to a distance; whatever follows it, joints on a
straight line or a pose on a path, keeps its shape. Everything here works on rows, one per motion.
"""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

import numpy as np

from .._arrays import Array
from ..errors import InvalidValueError

_MARGIN = 1.0 + 1e-14
"""Durations are this much above the least, so that rounding does not exceed a limit."""

_PHASE = 1.0 / 3.0
"""Part of the duration that each ramp takes when no limits are given, as in ``ctraj``."""


class TimeLaw(Enum):
    """How the motion is distributed over its time; the value says which derivatives are limited.

    Examples
    --------
    >>> TimeLaw.QUINTIC.value
    'fifth-order polynomial: starts and stops with zero acceleration'
    """

    LINEAR = "constant velocity: starts and stops with a jump of velocity"
    CUBIC = "third-order polynomial: starts and stops with a jump of acceleration"
    QUINTIC = "fifth-order polynomial: starts and stops with zero acceleration"
    BANG_BANG = "full acceleration, then full deceleration"
    TRAPEZOIDAL = "constant acceleration, constant velocity, constant deceleration"
    SMOOTHED_TRAPEZOIDAL = "trapezoid whose accelerations are parabolas of time, continuous"
    JERK_LIMITED = "constant jerk in each of seven phases, the quickest under a limit of jerk"


class LineLimits(NamedTuple):
    """Limits along the coordinate of the law, each shape (R,); infinity is none.

    Attributes
    ----------
    velocity : ndarray
        Greatest ``s'``.
    acceleration, deceleration : ndarray
        Greatest ``s''`` and ``-s''``.
    jerk : ndarray
        Greatest absolute ``s'''``.
    back : ndarray
        Greatest ``-s'``, which motions from rest to rest never need.
    """

    velocity: Array
    acceleration: Array
    deceleration: Array
    jerk: Array
    back: Array


class Pieces(NamedTuple):
    """A law as polynomials of normalised time, as in `PiecewisePolynomial`.

    Attributes
    ----------
    durations : ndarray, shape (R, K)
        Of the pieces, s; 0 for those that are left out.
    coefficients : ndarray, shape (R, K, d + 1)
        Of ``s``, lowest power first.
    """

    durations: Array
    coefficients: Array


def law_of_limits(law: TimeLaw, distance: Array, limits: LineLimits) -> Pieces:
    """The quickest motion of a law that keeps limits.

    Parameters
    ----------
    law : TimeLaw
        The shape.
    distance : ndarray, shape (R,)
        Lengths of the motions, not negative. No distance takes no time.
    limits : LineLimits
        Positive; those a law cannot keep inside the motion must be infinite.

    Returns
    -------
    Pieces
        Of each row.

    Raises
    ------
    InvalidValueError
        A limit that the law needs is missing, or one is given that no motion of it can keep.

    References
    ----------
    Khalil and Dombre, Modeling, identification and control of robots, section 13.3.

    Examples
    --------
    >>> one, none = np.ones(1), np.full(1, np.inf)
    >>> law_of_limits(TimeLaw.TRAPEZOIDAL, 2 * one, LineLimits(one, one, one, none, one)).durations
    array([[1., 1., 1.]])
    """
    moves = distance > 0.0
    V, A, B, J, _ = (np.where(moves, limit, np.inf) for limit in limits)
    L = np.where(moves, distance, 0.0)
    if law in (TimeLaw.BANG_BANG, TimeLaw.TRAPEZOIDAL) and np.isfinite(J).any():
        raise InvalidValueError(
            f"limits: the acceleration of {law.name} jumps, which keeps no limit of jerk; leave "
            "jerk out, or take SMOOTHED_TRAPEZOIDAL or JERK_LIMITED."
        )
    needed = {
        TimeLaw.LINEAR: ("velocity", V),
        TimeLaw.CUBIC: ("velocity, acceleration or jerk", np.minimum.reduce([V, A, B, J])),
        TimeLaw.QUINTIC: ("velocity, acceleration or jerk", np.minimum.reduce([V, A, B, J])),
        TimeLaw.BANG_BANG: ("velocity or acceleration", np.minimum(V, np.maximum(A, B))),
        TimeLaw.TRAPEZOIDAL: ("acceleration, both ways", np.maximum(A, B)),
        TimeLaw.SMOOTHED_TRAPEZOIDAL: (
            "jerk, or of acceleration both ways", np.minimum(np.maximum(A, B), J),
        ),
        TimeLaw.JERK_LIMITED: ("jerk", J),
    }  # fmt: skip
    what, limit = needed[law]
    if np.isinf(limit[moves]).any():
        raise InvalidValueError(f"limits: {law.name} needs a limit of {what}.")
    pieces = _quickest(law, L, V, A, B, J)
    return Pieces(pieces.durations * _MARGIN, pieces.coefficients)


def law_of_duration(law: TimeLaw, distance: Array, duration: Array) -> Pieces:
    """A law of a given duration, in its usual shape: ramps of one third, equal on both sides.

    Parameters
    ----------
    law : TimeLaw
        The shape.
    distance : ndarray, shape (R,)
        Lengths of the motions, not negative.
    duration : ndarray, shape (R,)
        Seconds.

    Returns
    -------
    Pieces
        Of each row.

    Raises
    ------
    InvalidValueError
        `TimeLaw.JERK_LIMITED`, whose shape only its limits tell.

    Examples
    --------
    >>> law_of_duration(TimeLaw.CUBIC, np.ones(1), np.ones(1)).coefficients
    array([[[ 0.,  0.,  3., -2.]]])
    """
    L, T = distance, duration
    if law is TimeLaw.JERK_LIMITED:
        raise InvalidValueError("JERK_LIMITED has no shape without limits; give limits.")
    if law in _POLYNOMIALS:
        return Pieces(T[:, None], L[:, None, None] * np.array([[_POLYNOMIALS[law]]]))
    phase = 0.5 if law is TimeLaw.BANG_BANG else _PHASE
    part = np.full(L.shape, phase)
    return _ramped(law, L, L / (1.0 - phase), T, part, part)


_POLYNOMIALS = {
    TimeLaw.LINEAR: (0.0, 1.0),
    TimeLaw.CUBIC: (0.0, 0.0, 3.0, -2.0),
    TimeLaw.QUINTIC: (0.0, 0.0, 0.0, 10.0, -15.0, 6.0),
}


def _quickest(law: TimeLaw, L: Array, V: Array, A: Array, B: Array, J: Array) -> Pieces:
    """The law with the least duration that real numbers allow."""
    if law is TimeLaw.LINEAR:
        return law_of_duration(law, L, L / V)
    if law is TimeLaw.CUBIC:
        T = np.maximum(1.5 * L / V, np.sqrt(6.0 * L / np.minimum(A, B)))
        return law_of_duration(law, L, np.maximum(T, np.cbrt(12.0 * L / J)))
    if law is TimeLaw.QUINTIC:
        peak = 10.0 / np.sqrt(3.0)
        T = np.maximum(1.875 * L / V, np.sqrt(peak * L / np.minimum(A, B)))
        return law_of_duration(law, L, np.maximum(T, np.cbrt(60.0 * L / J)))
    if law is TimeLaw.BANG_BANG:
        up, down = 1.0 / A, 1.0 / B
        T = np.maximum(2.0 * L / V, np.sqrt(2.0 * L * (up + down)))
        both = np.where(up + down > 0.0, up + down, 1.0)
        share = np.where(up + down > 0.0, up / both, 0.5)
        return _ramped(law, L, 2.0 * L, T, share, 1.0 - share)
    V, up, down = _fastest(law, L, V, A, B, J)
    ramps = up + down
    with np.errstate(divide="ignore", invalid="ignore"):
        cruise = np.where(L > 0.0, L / V - 0.5 * ramps, 0.0)
        none = cruise <= 1e-14 * ramps
        # without a cruise the ramps alone cover the distance, to the last digit
        V = np.where(L > 0.0, np.where(none, 2.0 * L / ramps, V), 0.0)
    cruise = np.where(none, 0.0, cruise)
    if law is TimeLaw.JERK_LIMITED:
        return _seven_phases(L, V, A, B, J, up, cruise, down)
    return _three_phases(law, L, V, up, cruise, down)


def _ramped(law: TimeLaw, L: Array, VT: Array, T: Array, up: Array, down: Array) -> Pieces:
    """Ramps that take given parts of the duration; ``VT`` is the cruise velocity times it."""
    pieces = _three_phases(law, L, VT, up, 1.0 - up - down, down)
    return Pieces(pieces.durations * T[:, None], pieces.coefficients)


def _three_phases(
    law: TimeLaw, L: Array, V: Array, up: Array, cruise: Array, down: Array
) -> Pieces:
    """Ramp, cruise and ramp. The ramps are symmetric, so each covers half of V times its time."""
    smooth = law is TimeLaw.SMOOTHED_TRAPEZOIDAL
    c = np.zeros((L.size, 3, 5 if smooth else 3))
    rise, fall = V * up, V * down
    c[:, 1, 0], c[:, 1, 1] = 0.5 * rise, V * cruise
    c[:, 2, 0], c[:, 2, 1] = L - 0.5 * fall, fall
    if smooth:
        # the velocity of the ramp is the smooth step 3 x^2 - 2 x^3
        c[:, 0, 3], c[:, 0, 4] = rise, -0.5 * rise
        c[:, 2, 3], c[:, 2, 4] = -fall, 0.5 * fall
    else:
        c[:, 0, 2], c[:, 2, 2] = 0.5 * rise, -0.5 * fall
    return Pieces(np.stack((up, cruise, down), axis=-1), c)


def _seven_phases(
    L: Array, V: Array, A: Array, B: Array, J: Array, up: Array, cruise: Array, down: Array
) -> Pieces:
    """Ramps of constant jerk, none, and its opposite; cruise between them."""
    R = L.size
    h, c = np.zeros((R, 7)), np.zeros((R, 7, 4))
    h[:, 3] = cruise
    c[:, 3, 0], c[:, 3, 1] = 0.5 * V * up, V * cruise
    for first, limit, ramp in ((0, A, up), (4, B, down)):
        # time of one jerk: half of a ramp that never reaches its greatest acceleration
        with np.errstate(divide="ignore", invalid="ignore"):
            bend = np.where(ramp > 0.0, np.minimum(limit / J, 0.5 * ramp), 0.0)
        level = np.maximum(ramp - 2.0 * bend, 0.0)
        # the acceleration that makes the ramp reach V exactly
        a = V / np.where(ramp > bend, ramp - bend, 1.0)
        h[:, first], h[:, first + 1], h[:, first + 2] = bend, level, bend
        up_ramp = first == 0
        sign = 1.0 if up_ramp else -1.0
        v1, v2 = 0.5 * a * bend, V - 0.5 * a * bend
        if not up_ramp:
            v1, v2 = v2, v1
        start = np.zeros(R) if up_ramp else L - 0.5 * V * ramp
        v0 = np.zeros(R) if up_ramp else V
        p1 = start + v0 * bend + sign * a * bend**2 / 6.0
        p2 = p1 + 0.5 * (v1 + v2) * level
        c[:, first, 0], c[:, first, 1], c[:, first, 3] = start, v0 * bend, sign * a * bend**2 / 6.0
        c[:, first + 1, 0], c[:, first + 1, 1] = p1, v1 * level
        c[:, first + 1, 2] = 0.5 * sign * a * level**2
        c[:, first + 2, 0], c[:, first + 2, 1] = p2, v2 * bend
        c[:, first + 2, 2] = 0.5 * sign * a * bend**2
        c[:, first + 2, 3] = -sign * a * bend**2 / 6.0
    return Pieces(h, c)


def _ramp_time(law: TimeLaw, V: Array, A: Array, J: Array) -> tuple[Array, Array]:
    """Least time of a ramp from rest to a velocity, and V times its derivative."""
    if law is TimeLaw.TRAPEZOIDAL:
        return V / A, V / A
    if law is TimeLaw.SMOOTHED_TRAPEZOIDAL:
        # a parabola of acceleration peaks at 1.5 V / time and starts with the jerk 6 V / time^2
        by_a, by_j = 1.5 * V / A, np.sqrt(6.0 * V / J)
        return np.maximum(by_a, by_j), np.where(by_a >= by_j, by_a, 0.5 * by_j)
    with np.errstate(invalid="ignore"):
        reached = V * J >= A * A
        short = 2.0 * np.sqrt(V / J)
        return np.where(reached, V / A + A / J, short), np.where(reached, V / A, 0.5 * short)


def _fastest(
    law: TimeLaw, L: Array, V: Array, A: Array, B: Array, J: Array
) -> tuple[Array, Array, Array]:
    """Greatest useful cruise velocity and the times of its ramps.

    The quickest motion cruises as fast as it may: the time ``L / V + (up + down) / 2`` falls with
    V as long as the ramps, which cover ``V (up + down) / 2``, fit into the distance.
    """
    at_rest = L == 0.0
    a, j = (1.5, 6.0) if law is TimeLaw.SMOOTHED_TRAPEZOIDAL else (1.0, 4.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        # ramps limited by acceleration alone, and by jerk alone: each bounds V from above
        full = np.sqrt(2.0 * L / (a / A + a / B))
        if law is not TimeLaw.TRAPEZOIDAL:
            full = np.minimum(full, np.cbrt(L) ** 2 * np.cbrt(J / j))
    full = np.where(at_rest, 0.0, full)
    # V (up + down) is convex in V, so Newton's method comes down from there to its root and stays
    for _ in range(60 if law is not TimeLaw.TRAPEZOIDAL else 0):
        up, rise = _ramp_time(law, full, A, J)
        down, fall = _ramp_time(law, full, B, J)
        slope = np.where(at_rest, 1.0, up + down + rise + fall)
        step = np.where(at_rest, 0.0, (full * (up + down) - 2.0 * L) / slope)
        full = full - step
        if (np.abs(step) <= 4e-16 * full).all():
            break
    V = np.where(at_rest, 0.0, np.minimum(V, full))
    return V, _ramp_time(law, V, A, J)[0], _ramp_time(law, V, B, J)[0]
