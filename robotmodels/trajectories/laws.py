"""Time laws from rest to rest along one coordinate, and their least durations.

Book sections 4.2.1 (fifth-order polynomial), 4.2.2 (trapezoidal velocity) and 4.2.3 (smoothed
trapezoidal velocity). A law moves ``s`` from 0 to a distance; whatever follows it, joints on a
straight line or a pose on a path, keeps its shape.

References
----------
Khalil and Dombre, Modeling, identification and control of robots, section 13.3.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from math import cbrt, inf, sqrt
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
    """Laws of time of a motion; the value describes the law."""

    LINEAR = "constant velocity: starts and stops with a jump of velocity"
    CUBIC = "third-order polynomial: starts and stops with a jump of acceleration"
    QUINTIC = "fifth-order polynomial: starts and stops with zero acceleration"
    BANG_BANG = "full acceleration, then full deceleration"
    TRAPEZOIDAL = "constant acceleration, constant velocity, constant deceleration"
    SMOOTHED_TRAPEZOIDAL = "trapezoid whose accelerations are parabolas of time, continuous"
    JERK_LIMITED = "constant jerk in each of seven phases, the quickest under a limit of jerk"


class LineLimits(NamedTuple):
    """Limits along the coordinate of the law; infinity means no limit."""

    velocity: float
    acceleration: float
    deceleration: float
    jerk: float
    jerk_down: float
    back: float


class Pieces(NamedTuple):
    """Polynomials of normalised time: durations (K,), coefficients (K, d + 1)."""

    durations: Array
    coefficients: Array


def law_of_limits(law: TimeLaw, L: float, limits: LineLimits) -> Pieces:
    """The quickest motion of a law over a distance L that keeps limits."""
    if L == 0.0:
        return Pieces(np.zeros(1), np.zeros((1, 1)))
    V, A, B, J, K, _ = limits
    if law in (TimeLaw.BANG_BANG, TimeLaw.TRAPEZOIDAL) and min(J, K) < inf:
        raise InvalidValueError(
            f"limits: the acceleration of {law.name} jumps, which keeps no limit of jerk; pass "
            "limits.without_jerk(), or take SMOOTHED_TRAPEZOIDAL or JERK_LIMITED."
        )
    what, limit = {
        TimeLaw.LINEAR: ("velocity", V),
        TimeLaw.BANG_BANG: ("velocity or acceleration", min(V, max(A, B))),
        TimeLaw.TRAPEZOIDAL: ("acceleration and deceleration", max(A, B)),
        TimeLaw.SMOOTHED_TRAPEZOIDAL: (
            "jerk, or of acceleration and deceleration",
            min(max(A, B), J, K),
        ),
        TimeLaw.JERK_LIMITED: ("jerk", min(J, K)),
    }.get(law, ("velocity, acceleration or jerk", min(V, A, B, J, K)))
    if limit == inf:
        raise InvalidValueError(f"limits: {law.name} needs a limit of {what}.")
    h, c = _quickest(law, L, V, A, B, J, K)
    return Pieces(h * _MARGIN, c)


def law_of_duration(law: TimeLaw, L: float, T: float) -> Pieces:
    """A law of a given duration: equal ramps of one third of it (one half for BANG_BANG)."""
    if law is TimeLaw.JERK_LIMITED:
        raise InvalidValueError("JERK_LIMITED has no shape without limits; give limits.")
    if law in _POLYNOMIALS:
        return Pieces(np.array([T]), L * np.array([_POLYNOMIALS[law]]))
    part = 0.5 if law is TimeLaw.BANG_BANG else _PHASE
    return _ramped(law, L, L / (1.0 - part), T, part, part)


_POLYNOMIALS = {
    TimeLaw.LINEAR: (0.0, 1.0),
    TimeLaw.CUBIC: (0.0, 0.0, 3.0, -2.0),
    TimeLaw.QUINTIC: (0.0, 0.0, 0.0, 10.0, -15.0, 6.0),
}


def _quickest(law: TimeLaw, L: float, V: float, A: float, B: float, J: float, K: float) -> Pieces:
    """The law with the least duration under the limits."""
    if law is TimeLaw.LINEAR:
        return law_of_duration(law, L, L / V)
    if law is TimeLaw.CUBIC:  # its jerk is constant, and downwards
        T = max(1.5 * L / V, sqrt(6.0 * L / min(A, B)), cbrt(12.0 * L / K))
        return law_of_duration(law, L, T)
    if law is TimeLaw.QUINTIC:  # its jerk is upwards at the ends, half as much downwards between
        T = max(1.875 * L / V, sqrt(10.0 / sqrt(3.0) * L / min(A, B)))
        return law_of_duration(law, L, max(T, cbrt(60.0 * L / J), cbrt(30.0 * L / K)))
    if law is TimeLaw.BANG_BANG:
        up, down = 1.0 / A, 1.0 / B
        T = max(2.0 * L / V, sqrt(2.0 * L * (up + down)))
        share = up / (up + down) if up + down > 0.0 else 0.5
        return _ramped(law, L, 2.0 * L, T, share, 1.0 - share)
    smooth, up, down = law is TimeLaw.SMOOTHED_TRAPEZOIDAL, 1.0 / J, 1.0 / K
    of = _smooth_ramp if smooth else ramp
    # ramps limited by acceleration alone, and by jerk alone: each bounds V from above
    by_a = of(1.0, A, 0.0, 0.0).distance + of(1.0, B, 0.0, 0.0).distance
    by_j = of(1.0, inf, up, down).distance
    full = sqrt(L / by_a) if by_a > 0.0 else inf
    full = min(full, cbrt(0.5 * L / by_j) ** 2) if by_j > 0.0 else full
    V = _cruise(L, V, full, lambda v: (of(v, A, up, down), of(v, B, up, down)))
    first, last = of(V, A, up, down), of(V, B, up, down)
    ramps = first.distance + last.distance
    cruise = (L - ramps) / V
    if cruise <= 1e-14 * (first.time + last.time):
        # without a cruise the ramps alone cover the distance, to the last digit
        cruise, V = 0.0, V * (L / ramps) if ramps > 0.0 else V
    if smooth:
        return _three_phases(law, L, V, first.time, cruise, last.time)
    h, c = _phases(L, V, first, cruise, last)  # a trapezoid is what no limit of jerk leaves
    return Pieces(h[1::2], c[1::2, :3]) if law is TimeLaw.TRAPEZOIDAL else Pieces(h, c)


def _ramped(law: TimeLaw, L: float, VT: float, T: float, up: float, down: float) -> Pieces:
    """Trapezoidal laws whose ramps take given parts of the duration."""
    h, c = _three_phases(law, L, VT, up, 1.0 - up - down, down)
    return Pieces(h * T, c)


def _three_phases(
    law: TimeLaw, L: float, V: float, up: float, cruise: float, down: float
) -> Pieces:
    """Ramp, cruise and ramp. The ramps are symmetric, so each covers half of V times its time."""
    smooth = law is TimeLaw.SMOOTHED_TRAPEZOIDAL
    c = np.zeros((3, 5 if smooth else 3))
    rise, fall = V * up, V * down
    c[1, :2] = 0.5 * rise, V * cruise
    c[2, :2] = L - 0.5 * fall, fall
    if smooth:  # the velocity of the ramp is the smooth step 3 x^2 - 2 x^3
        c[0, 3:], c[2, 3:] = (rise, -0.5 * rise), (-fall, 0.5 * fall)
    else:
        c[0, 2], c[2, 2] = 0.5 * rise, -0.5 * fall
    return Pieces(np.array([up, cruise, down]), c)


# With limits of jerk a ramp from rest bends up with the greatest jerk, may go on with the greatest
# acceleration, and bends down with the least jerk to the velocity of the cruise. The ramp back to
# rest is such a ramp run backwards, so the same formulas serve, with J and K in the same roles.


class Ramp(NamedTuple):
    """From rest to a velocity: times of its parts, distance, slope of that by the velocity."""

    rise: float
    level: float
    fall: float
    distance: float
    slope: float

    @property
    def time(self) -> float:
        """Seconds of the whole ramp."""
        return self.rise + self.level + self.fall


def _smooth_ramp(V: float, A: float, up: float, down: float) -> Ramp:
    """The quickest ramp from rest to a velocity whose acceleration is a parabola of time."""
    # it peaks at 1.5 V / time and starts with the jerk 6 V / time^2
    by_a, by_j = 1.5 * V / A, sqrt(6.0 * V * max(up, down))
    time, rise = max(by_a, by_j), by_a if by_a >= by_j else 0.5 * by_j
    return Ramp(time, 0.0, 0.0, 0.5 * V * time, 0.5 * (time + rise))


def ramp(V: float, A: float, up: float, down: float) -> Ramp:
    """The quickest ramp from rest to a velocity; up, down: inverses of the limits of jerk."""
    bends = up + down  # time of both bends for each unit of acceleration
    short = sqrt(2.0 * V / bends) if bends > 0.0 else inf  # acceleration of a ramp never level
    a = min(A, short)
    level = max(V / A - 0.5 * A * bends, 0.0) if short > A else 0.0
    rise, fall = (a * bend if bend > 0.0 else 0.0 for bend in (up, down))
    # what the middle of the acceleration lacks of the whole time, times the velocity
    distance = rise * (rise / 6.0 + 0.5 * level + 0.5 * fall)
    distance += level * (0.5 * level + fall) + fall * fall / 3.0
    distance = a * distance if distance > 0.0 else 0.0
    slope = 0.5 * rise + level + fall if level > 0.0 else 1.5 * distance / V
    return Ramp(rise, level, fall, distance, slope)


def _phases(L: float, V: float, first: Ramp, cruise: float, last: Ramp) -> tuple[Array, Array]:
    """Durations (7,) and coefficients (7, 4) of two ramps and the cruise between them."""
    h = (first.rise, first.level, first.fall, cruise, last.fall, last.level, last.rise)
    c = np.zeros((7, 4))
    c[:3] = _on_ramp(first, V)
    c[3, :2] = c[2].sum(), V * cruise
    c[6:3:-1] = _on_ramp(last, V) @ _BACK
    c[4:, 0] += L
    return np.array(h), c


def _on_ramp(r: Ramp, V: float) -> Array:
    """Coefficients (3, 4) of the phases of a ramp that reaches V."""
    bends = 0.5 * (r.rise + r.fall) + r.level
    a = V / bends if bends > 0.0 else 0.0
    v1, v2 = 0.5 * a * r.rise, V - 0.5 * a * r.fall
    p1 = a * r.rise**2 / 6.0
    p2 = p1 + 0.5 * (v1 + v2) * r.level
    return np.array(
        [
            [0.0, 0.0, 0.0, p1],
            [p1, v1 * r.level, 0.5 * a * r.level**2, 0.0],
            [p2, v2 * r.fall, 0.5 * a * r.fall**2, -a * r.fall**2 / 6.0],
        ]
    )


def _cruise(L: float, V: float, full: float, ramps: Callable[[float], tuple[Ramp, Ramp]]) -> float:
    """Greatest useful velocity, at most V and the bound ``full`` from above.

    The quickest motion cruises as fast as it may, as long as its ramps fit into the distance. That
    of the ramps is convex in the velocity: Newton's method comes down to its root and stays.
    """
    for _ in range(60):
        first, last = ramps(full)
        step = (first.distance + last.distance - L) / (first.slope + last.slope)
        full -= step
        if abs(step) <= 1e-10 * full:
            break  # the next step would be nothing: convergence is quadratic
    return min(V, full)
