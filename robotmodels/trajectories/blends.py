"""Straight lines between points at constant velocity, joined by blends near the points.

A blend changes the velocity evenly (parabola) or smoothly (quartic) and leaves the corner aside;
the first and the last point are met at rest.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_each
from ..errors import InvalidValueError
from .limits import ROUNDING, MotionLimits, checked_limits, least_shown, limits_along, slowed
from .motions import PiecewisePolynomial
from .splines import as_points
from .trajectory import Trajectory

PARABOLA, QUARTIC = 1.0, 1.5
"""Greatest acceleration of a blend, beside its mean."""


def blended_lines(
    points: ArrayLike,
    duration: float | None = None,
    limits: MotionLimits | None = None,
    segment_times: ArrayLike | None = None,
    blend_times: ArrayLike | None = None,
    smooth: bool = False,
) -> Trajectory:
    """Lines through points with blends: trapezoids of velocity that do not stop at the points.

    Also called linear segments with parabolic blends, ``mstraj``. All joints change velocity
    together, so that the motion is straight between blends. It passes an inner point at a distance
    of ``blend time * change of velocity / 8`` (3/32 of it with smooth blends).

    Parameters
    ----------
    points, duration : array_like, shape (m,) or (m, n), and float, optional
        Positions, rad or m, at least two; the motion is slowed down evenly to a longer duration.
    limits : MotionLimits, optional
        Velocity and acceleration, with smooth blends also jerk. Each line is as quick as it may
        be, or slower where its blends would overlap.
    segment_times, blend_times : array_like, shape () or (m - 1,), and () or (m,), optional
        Seconds from corner to corner instead, and of each blend; default the least ones.
    smooth : bool
        Whether the blends keep the acceleration continuous.

    References
    ----------
    Khalil and Dombre, Modeling, identification and control of robots, section 13.5. J. Craig,
    Introduction to robotics, section 7.3.

    Examples
    --------
    >>> limits = MotionLimits(velocity=1.0, acceleration=2.0)
    >>> path = blended_lines([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0]], limits=limits)
    >>> path.duration, path.q(2.25)
    (3.5..., array([1.9375, 0.0625]))
    """
    q, scalar = as_points(points)
    m, n = q.shape
    bounds = checked_limits(limits, n, q)
    step = np.diff(q, axis=0)
    if segment_times is None:
        if bounds is None or blend_times is not None:
            raise InvalidValueError("Give limits, or segment_times (and then blend_times).")
        T = full_speed(step, bounds)
        T, tb = schedule(T, lambda T: _least_blends(step, T, bounds, smooth))
    else:
        T = as_each(segment_times, m - 1, "segment_times", 0.0, finite=True)
        if blend_times is not None:
            tb = as_each(blend_times, m, "blend_times", 0.0, finite=True)
        elif bounds is not None:
            tb = _least_blends(step, T, bounds, smooth)
        else:
            raise InvalidValueError("blend_times: give them, or limits of acceleration.")
        if ((T == 0.0) & step.any(axis=-1)).any():
            raise InvalidValueError("segment_times: expected a positive time for every line.")
        room = T - 0.5 * (tb[:-1] + tb[1:])
        if (room < -ROUNDING * T).any():
            k = int(room.argmin())
            raise InvalidValueError(
                f"The blends at the ends of line {k + 1} overlap: it needs at least "
                f"{least_shown(0.5 * (tb[k] + tb[k + 1]), 9)} s, and has {T[k]:.9g} s."
            )
    T, tb = slowed(T, tb, duration, bounds is not None)
    trajectory = Trajectory(joined(q, step, T, tb, smooth), scalar)
    if bounds is not None and not (report := trajectory.check(bounds, 1e-9)).kept:
        raise InvalidValueError(
            f"The limits are not kept: {'; '.join(report.violations())}. The least factor on the "
            f"times is {least_shown(report.stretch)}."
        )
    return trajectory


def schedule(T: Array, blends: Callable[[Array], Array]) -> tuple[Array, Array]:
    """Durations of lines that leave time for their blends."""
    still = T == 0.0
    for _ in range(500):
        tb = blends(T)
        halves = 0.5 * (tb[:-1] + tb[1:])
        T = np.where(still & np.isfinite(halves), halves, T)
        need = np.minimum(halves, 4.0 * T)
        if (need <= T * (1.0 + 1e-13)).all():
            break
        # slower lines need shorter blends: the geometric mean is the answer for a line alone
        T = np.where(need > T, np.sqrt(T * need), T)
    else:
        need = 0.5 * (tb[:-1] + tb[1:])
        T = T * float(np.sqrt(max(1.0, (need / np.where(T > 0.0, T, 1.0)).max())))
    return T * (1.0 + 1e-13), blends(T)


def rates_of(step: Array, T: Array) -> Array:
    """Velocities (m - 1, n) of lines, zero where they take no time."""
    return np.where(T[:, None] > 0.0, step / np.where(T > 0.0, T, 1.0)[:, None], 0.0)


def full_speed(step: Array, limits: MotionLimits, names: tuple[str, ...] = ()) -> Array:
    """Times (m - 1,) of lines at the greatest velocity, zero of those that stay."""
    along = [limits_along(limits, row, names) if row.any() else None for row in step]
    if any(one is not None and np.isinf(one.velocity) for one in along):
        raise InvalidValueError("limits: lines with blends need a limit of velocity.")
    return np.array([0.0 if one is None else 1.0 / one.velocity for one in along])


def _least_blends(step: Array, T: Array, limits: MotionLimits, smooth: bool) -> Array:
    """Least times of blends, shape (m,)."""
    J = np.minimum(limits.jerk, -limits.jerk_lower)  # a smooth blend needs both alike
    if not smooth and np.isfinite(J).any():
        raise InvalidValueError(
            "limits: the acceleration of a parabolic blend jumps, which keeps no limit of jerk; "
            "pass limits.without_jerk(), or smooth=True."
        )
    change = np.diff(rates_of(step, T), axis=0, prepend=0.0, append=0.0)
    A = np.where(change > 0.0, limits.acceleration, -limits.acceleration_lower)
    by_j = np.sqrt(6.0 * np.abs(change) / J) if smooth else np.zeros_like(change)
    with np.errstate(divide="ignore", invalid="ignore"):
        by_a = (QUARTIC if smooth else PARABOLA) * np.abs(change) / A
    tb = np.where(change != 0.0, np.maximum(by_a, by_j), 0.0)
    if ((change != 0.0).any(axis=-1) & (tb.max(axis=-1) == 0.0)).any():
        raise InvalidValueError("limits: blends need a limit of acceleration.")
    return tb.max(axis=-1)


def joined(q: Array, step: Array, T: Array, tb: Array, smooth: bool) -> PiecewisePolynomial:
    """Blend, line, blend, and so on to the last blend."""
    m, n = q.shape
    v = rates_of(step, T)
    before, after = np.vstack((np.zeros(n), v)), np.vstack((v, np.zeros(n)))
    c = np.zeros((2 * m - 1, 5 if smooth else 3, n))
    h = np.zeros(2 * m - 1)
    h[::2], h[1::2] = tb, np.maximum(T - 0.5 * (tb[:-1] + tb[1:]), 0.0)
    blend = tb[:, None]
    c[::2, 0], c[::2, 1] = q - 0.5 * before * blend, before * blend
    if smooth:
        c[::2, 3], c[::2, 4] = (after - before) * blend, -0.5 * (after - before) * blend
    else:
        c[::2, 2] = 0.5 * (after - before) * blend
    c[1::2, 0], c[1::2, 1] = q[:-1] + 0.5 * v * blend[:-1], v * h[1::2, None]
    breaks = np.concatenate(((0.0,), np.cumsum(h)))
    return PiecewisePolynomial(breaks[None], c, h[None])
