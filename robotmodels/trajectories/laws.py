"""Time laws from rest to rest along one coordinate, and their least durations.

Seed book sections 4.2.1 (fifth-order polynomial), 4.2.2 (trapezoidal velocity) and 4.2.3 (smoothed
trapezoidal velocity). A law moves ``s`` from 0 to a distance; whatever follows it, joints on a
straight line or a pose on a path, keeps its shape. Everything here works on rows, one per motion.

References
----------
Khalil and Dombre, Modeling, identification and control of robots, section 13.3.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from typing import NamedTuple

import numpy as np

from .._arrays import Array
from ..errors import InvalidValueError

_MARGIN = 1.0 + 1e-14
"""Durations are this much above the least, so that rounding does not exceed a limit."""
_PHASE = 1.0 / 3.0
"""Part of the duration of each ramp without limits, as in the Robotics Toolbox's ``ctraj``."""
_BACK = np.array([[-1, 0, 0, 0], [-1, 1, 0, 0], [-1, 2, -1, 0], [-1, 3, -3, 1.0]])
"""Coefficients of p(x) times this are those of -p(1 - x)."""


class TimeLaw(Enum):
    """How the motion is distributed over its time; the value describes the law."""

    LINEAR = "constant velocity: starts and stops with a jump of velocity"
    CUBIC = "third-order polynomial: starts and stops with a jump of acceleration"
    QUINTIC = "fifth-order polynomial: starts and stops with zero acceleration"
    BANG_BANG = "full acceleration, then full deceleration"
    TRAPEZOIDAL = "constant acceleration, constant velocity, constant deceleration"
    SMOOTHED_TRAPEZOIDAL = "trapezoid whose accelerations are parabolas of time, continuous"
    JERK_LIMITED = "constant jerk in each of seven phases, the quickest under a limit of jerk"


class LineLimits(NamedTuple):
    """Limits along the coordinate of the law, each shape (R,); infinity means no limit."""

    velocity: Array
    acceleration: Array
    deceleration: Array
    jerk: Array
    jerk_down: Array
    back: Array


class Pieces(NamedTuple):
    """A law as polynomials of normalised time, as in `PiecewisePolynomial`.

    Shapes: durations (R, K), coefficients (R, K, d + 1).
    """

    durations: Array
    coefficients: Array


def law_of_limits(law: TimeLaw, distance: Array, limits: LineLimits) -> Pieces:
    """The quickest motion of a law that keeps limits. Shapes: distance (R,)."""
    moves = distance > 0.0
    V, A, B, J, K, _ = (np.where(moves, limit, np.inf) for limit in limits)
    any_jerk = np.minimum(J, K)
    if law in (TimeLaw.BANG_BANG, TimeLaw.TRAPEZOIDAL) and np.isfinite(any_jerk).any():
        raise InvalidValueError(
            f"limits: the acceleration of {law.name} jumps, which keeps no limit of jerk; pass "
            "limits.without_jerk(), or take SMOOTHED_TRAPEZOIDAL or JERK_LIMITED."
        )
    both = np.maximum(A, B)
    any_limit = ("velocity, acceleration or jerk", np.minimum.reduce([V, A, B, any_jerk]))
    what, limit = {
        TimeLaw.LINEAR: ("velocity", V),
        TimeLaw.BANG_BANG: ("velocity or acceleration", np.minimum(V, both)),
        TimeLaw.TRAPEZOIDAL: ("acceleration and deceleration", both),
        TimeLaw.SMOOTHED_TRAPEZOIDAL: (
            "jerk, or of acceleration and deceleration", np.minimum(both, any_jerk)
        ),
        TimeLaw.JERK_LIMITED: ("jerk", any_jerk),
    }.get(law, any_limit)  # fmt: skip
    if np.isinf(limit[moves]).any():
        raise InvalidValueError(f"limits: {law.name} needs a limit of {what}.")
    pieces = _quickest(law, np.where(moves, distance, 0.0), V, A, B, J, K)
    return Pieces(pieces.durations * _MARGIN, pieces.coefficients)


def law_of_duration(law: TimeLaw, distance: Array, duration: Array) -> Pieces:
    """A law of a given duration: equal ramps of one third of it (one half for BANG_BANG)."""
    if law is TimeLaw.JERK_LIMITED:
        raise InvalidValueError("JERK_LIMITED has no shape without limits; give limits.")
    if law in _POLYNOMIALS:
        c = distance[:, None, None] * np.array([[_POLYNOMIALS[law]]])
        return Pieces(duration[:, None], c)
    part = np.full(distance.shape, 0.5 if law is TimeLaw.BANG_BANG else _PHASE)
    return ramped(law, distance, distance / (1.0 - part), duration, part, part)


_POLYNOMIALS = {
    TimeLaw.LINEAR: (0.0, 1.0),
    TimeLaw.CUBIC: (0.0, 0.0, 3.0, -2.0),
    TimeLaw.QUINTIC: (0.0, 0.0, 0.0, 10.0, -15.0, 6.0),
}


def _quickest(law: TimeLaw, L: Array, V: Array, A: Array, B: Array, J: Array, K: Array) -> Pieces:
    """The law with the least duration under the limits."""
    if law is TimeLaw.LINEAR:
        return law_of_duration(law, L, L / V)
    if law is TimeLaw.CUBIC:
        T = np.maximum(1.5 * L / V, np.sqrt(6.0 * L / np.minimum(A, B)))
        # its jerk is constant, and downwards
        return law_of_duration(law, L, np.maximum(T, np.cbrt(12.0 * L / K)))
    if law is TimeLaw.QUINTIC:
        T = np.maximum(1.875 * L / V, np.sqrt(10.0 / np.sqrt(3.0) * L / np.minimum(A, B)))
        # upwards at the ends, half as much downwards in the middle
        by_jerk = np.cbrt(np.maximum(60.0 * L / J, 30.0 * L / K))
        return law_of_duration(law, L, np.maximum(T, by_jerk))
    if law is TimeLaw.BANG_BANG:
        up, down = 1.0 / A, 1.0 / B
        T = np.maximum(2.0 * L / V, np.sqrt(2.0 * L * (up + down)))
        both = np.where(up + down > 0.0, up + down, 1.0)
        share = np.where(up + down > 0.0, up / both, 0.5)
        return ramped(law, L, 2.0 * L, T, share, 1.0 - share)
    smooth, up, down = law is TimeLaw.SMOOTHED_TRAPEZOIDAL, 1.0 / J, 1.0 / K
    of, one, zero = _smooth_ramp if smooth else ramp, np.ones_like(L), np.zeros_like(L)
    with np.errstate(divide="ignore", invalid="ignore"):
        # ramps limited by acceleration alone, and by jerk alone: each bounds V from above
        by_a = of(one, A, zero, zero).distance + of(one, B, zero, zero).distance
        by_j = of(one, one / zero, up, down).distance
        full = np.minimum(np.sqrt(L / by_a), np.cbrt(0.5 * L / by_j) ** 2)
        V = _cruise(L, V, full, lambda v: (of(v, A, up, down), of(v, B, up, down)))
        first, last = of(V, A, up, down), of(V, B, up, down)
        ramps = first.distance + last.distance
        cruise = np.where(L > 0.0, (L - ramps) / V, 0.0)
        none = cruise <= 1e-14 * (first.time + last.time)
        # without a cruise the ramps alone cover the distance, to the last digit
        V = np.where(none & (ramps > 0.0), V * (L / ramps), V)
    cruise = np.where(none, 0.0, cruise)
    if smooth:
        return _three_phases(law, L, V, first.time, cruise, last.time)
    h, c = phases(L, V, first, cruise, last)  # a trapezoid is what no limit of jerk leaves
    return Pieces(h[:, 1::2], c[:, 1::2, :3]) if law is TimeLaw.TRAPEZOIDAL else Pieces(h, c)


def ramped(law: TimeLaw, L: Array, VT: Array, T: Array, up: Array, down: Array) -> Pieces:
    """Trapezoidal laws whose ramps take given parts of the duration."""
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


# With limits of jerk a ramp from rest bends up with the greatest jerk, may go on with the greatest
# acceleration, and bends down with the least jerk to the velocity of the cruise. The ramp back to
# rest is such a ramp run backwards, so the same formulas serve, with J and K in the same roles.


class Ramp(NamedTuple):
    """From rest to a velocity: times of its parts, distance, slope of that by the velocity (R,)."""

    rise: Array
    level: Array
    fall: Array
    distance: Array
    slope: Array

    @property
    def time(self) -> Array:
        """Seconds of the whole ramp."""
        return self.rise + self.level + self.fall


def _smooth_ramp(V: Array, A: Array, up: Array, down: Array) -> Ramp:
    """The quickest ramp from rest to a velocity whose acceleration is a parabola of time."""
    # it peaks at 1.5 V / time and starts with the jerk 6 V / time^2
    by_a, by_j = 1.5 * V / A, np.sqrt(6.0 * V * np.maximum(up, down))
    time, rise = np.maximum(by_a, by_j), np.where(by_a >= by_j, by_a, 0.5 * by_j)
    return Ramp(time, 0.0 * time, 0.0 * time, 0.5 * V * time, 0.5 * (time + rise))


def ramp(V: Array, A: Array, up: Array, down: Array) -> Ramp:
    """The quickest ramp from rest to a velocity; up, down: inverses of the limits of jerk."""
    bends = up + down  # time of both bends for each unit of acceleration
    with np.errstate(divide="ignore", invalid="ignore"):
        # the acceleration of a ramp that is never level
        short = np.where(V > 0.0, np.sqrt(2.0 * V / bends), 0.0)
        a = np.minimum(A, short)
        level = np.where(short > A, np.maximum(V / A - 0.5 * A * bends, 0.0), 0.0)
        rise, fall = (np.where(bend > 0.0, a * bend, 0.0) for bend in (up, down))
        # what the middle of the acceleration lacks of the whole time, times the velocity
        distance = rise * (rise / 6.0 + 0.5 * level + 0.5 * fall)
        distance = distance + level * (0.5 * level + fall) + fall * fall / 3.0
        distance = np.where(distance > 0.0, a * distance, 0.0)
        slope = np.where(level > 0.0, 0.5 * rise + level + fall, 1.5 * distance / V)
    return Ramp(rise, level, fall, distance, np.where(V > 0.0, slope, 0.0))


def phases(L: Array, V: Array, first: Ramp, cruise: Array, last: Ramp) -> tuple[Array, Array]:
    """Durations and coefficients of the phases of two ramps and the cruise between them.

    Shapes: L, V, cruise (R,) -> durations (R, 7), coefficients (R, 7, 4).
    """
    c = np.zeros((L.size, 7, 4))
    h = (first.rise, first.level, first.fall, cruise, last.fall, last.level, last.rise)
    c[:, :3], end = _on_ramp(first, V)
    c[:, 3, 0], c[:, 3, 1] = end, V * cruise
    c[:, 6:3:-1] = _on_ramp(last, V)[0] @ _BACK
    c[:, 4:, 0] += L[:, None]
    return np.array(h).T, c


def _on_ramp(r: Ramp, V: Array) -> tuple[Array, Array]:
    """Coefficients (R, 3, 4) of the phases of a ramp that reaches V, and the distance."""
    bends = 0.5 * (r.rise + r.fall) + r.level
    a = V / np.where(bends > 0.0, bends, 1.0)
    v1 = 0.5 * a * r.rise
    v2 = V - 0.5 * a * r.fall
    p1 = a * r.rise**2 / 6.0
    p2 = p1 + 0.5 * (v1 + v2) * r.level
    c = np.zeros((V.size, 3, 4))
    c[:, 0, 3] = p1
    c[:, 1, 0], c[:, 1, 1], c[:, 1, 2] = p1, v1 * r.level, 0.5 * a * r.level**2
    c[:, 2, 0], c[:, 2, 1] = p2, v2 * r.fall
    c[:, 2, 2], c[:, 2, 3] = 0.5 * a * r.fall**2, -a * r.fall**2 / 6.0
    return c, c[:, 2].sum(axis=-1)


def _cruise(L: Array, V: Array, full: Array, ramps: Callable[[Array], tuple[Ramp, Ramp]]) -> Array:
    """Greatest useful velocity, at most V and the bound ``full`` from above.

    The quickest motion cruises as fast as it may, as long as its ramps fit into the distance. That
    of the ramps is convex in the velocity: Newton's method comes down to its root and stays.
    """
    moves = L > 0.0
    full = np.where(moves, full, 0.0)
    for _ in range(60):
        first, last = ramps(full)
        slope = np.where(moves, first.slope + last.slope, 1.0)
        step = np.where(moves, (first.distance + last.distance - L) / slope, 0.0)
        full = full - step
        if (np.abs(step) <= 1e-10 * full).all():
            break  # the next step would be nothing: convergence is quadratic
    return np.where(moves, np.minimum(V, full), 0.0)
