"""Polynomials between two states, and the durations with which they keep limits.

The durations that do are intervals. The first of a fine grid of durations that keeps the limits is
refined by bisection; an interval that is narrower than the grid (1 % of its durations) is missed.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array
from ..errors import InvalidValueError
from .checks import ROUNDING, checked_request, refuse_short
from .limits import MotionLimits, ranges_of
from .number_text import least_shown
from .piecewise import PiecewisePolynomial
from .trajectory import Trajectory

_KEPT = 1e-14  # relative excess that rounding alone makes
_TRIALS = 2000  # durations of the grid


def motion_between(
    order: int, states: dict[str, Array], batch: tuple[int, ...], scalar: bool,
    duration: ArrayLike | None, limits: MotionLimits | None,
) -> Trajectory:  # fmt: skip
    """Motion by polynomials of an order between states (R, n), checked against the limits."""
    T, bounds = checked_request(states, batch, duration, limits)
    R, n = states["q0"].shape
    refuse_short(T, np.zeros(R), np.ones((R, 1)))
    if bounds is not None:
        rows = [{name: value[i] for name, value in states.items()} for i in range(R)]
        if T is None:
            T = np.array([_least(order, row, bounds) for row in rows])
        for row, time in zip(rows, T, strict=True):
            if excess(order, row, np.array([time]), bounds)[0] > ROUNDING:
                _refuse(order, row, bounds, float(time))
    assert T is not None
    c = np.moveaxis(between_states(order, states, T[:, None]), 0, -2)
    breaks = np.stack((np.zeros(R), T), axis=-1).reshape(*batch, 1, 2)
    return Trajectory(PiecewisePolynomial(breaks, c.reshape(*batch, 1, order + 1, n)), scalar)


def _least(order: int, state: dict[str, Array], limits: MotionLimits) -> float:
    """Least duration, or why there is none."""
    for rate, (_, least, most) in zip("va", ranges_of(limits)[1:3], strict=True):
        for name in (f"{rate}0", f"{rate}1") if f"{rate}0" in state else ():
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
    message = (
        f"duration: with {T:.9g} s the limits are not kept; the least duration that keeps them is "
        f"{least_shown(least)} s."
    )
    if least < T:
        longer = least_duration(order, state, limits, T)
        message += (
            " No longer one does."
            if longer is None
            else f" The least that is longer than that given is {least_shown(longer)} s."
        )
    raise InvalidValueError(message)


def between_states(order: int, states: dict[str, Array], T: Array) -> Array:
    """Coefficients of normalised time of the polynomials between two states.

    Shapes: states (R, n) or (n,) -> (order + 1, ...).
    """
    q0, D = states["q0"] + 0.0 * T, states["q1"] - states["q0"]
    v0, v1 = T * states["v0"], T * states["v1"]
    if order == 3:
        return np.stack((q0, v0, 3.0 * D - 2.0 * v0 - v1, v0 + v1 - 2.0 * D))
    a0, a1 = T * T * states["a0"], T * T * states["a1"]
    cubed = 10.0 * D - 6.0 * v0 - 4.0 * v1 - 1.5 * a0 + 0.5 * a1
    fourth = -15.0 * D + 8.0 * v0 + 7.0 * v1 + 1.5 * a0 - a1
    fifth = 6.0 * D - 3.0 * (v0 + v1) - 0.5 * (a0 - a1)
    return np.stack((q0, v0, 0.5 * a0, cubed, fourth, fifth))


def excess(order: int, state: dict[str, Array], T: Array, limits: MotionLimits) -> Array:
    """Relative excess over the worst limit for given durations."""
    c = np.moveaxis(between_states(order, state, T[:, None]), 0, -2)[:, None]
    motion = PiecewisePolynomial(np.stack((np.zeros_like(T), T), axis=-1)[:, None], c)
    worst = np.full(T.shape, -np.inf)
    for k, (_, least, most) in enumerate(ranges_of(limits)):
        if np.isfinite((least, most)).any():
            low, high = motion.extremes(k)
            size = np.maximum(np.abs(least), np.abs(most))
            size = np.where(np.isfinite(size) & (size > 0.0), size, 1.0)
            over = np.maximum((high - most) / size, (least - low) / size)
            worst = np.maximum(worst, over.max(axis=-1))
    return worst


def least_duration(
    order: int, state: dict[str, Array], limits: MotionLimits, after: float = 0.0
) -> float | None:
    """Least duration with which the polynomials keep the limits."""
    scales = _scales(state, limits)
    if not scales.size:
        return 0.0
    trials = np.geomspace(scales.min() / 1e3, scales.max() * 1e3, _TRIALS)
    trials = np.append(after, trials[trials > after]) if after > 0.0 else trials
    kept = excess(order, state, trials, limits) <= _KEPT
    if not kept.any():
        return None
    k = int(kept.argmax())
    if k == 0 and after == 0.0:
        raise InvalidValueError(
            "limits: between these states they are kept in any time, however short; give duration."
        )
    below, T = float(trials[max(k - 1, 0)]), float(trials[k])
    while np.nextafter(below, T) < T:
        finer = np.linspace(below, T, 18)
        inner = np.append(excess(order, state, finer[1:-1], limits) <= _KEPT, True)
        k = int(inner.argmax()) + 1
        if (below, T) == (finer[k - 1], finer[k]):
            break
        below, T = float(finer[k - 1]), float(finer[k])
    return T


def _scales(state: dict[str, Array], limits: MotionLimits) -> Array:
    """Times that the states and limits make: the durations sought are of their size."""
    q0, q1 = state["q0"], state["q1"]
    room = np.minimum(limits.upper - np.maximum(q0, q1), np.minimum(q0, q1) - limits.lower)
    sizes = [(0, np.abs(q1 - q0))]
    sizes += [("qva".index(name[0]), np.abs(x)) for name, x in state.items() if name[0] != "q"]
    if not any(size.any() for _, size in sizes):
        return np.empty(0)
    sizes += [(0, np.maximum(room, 0.0))]
    sizes += [(k, np.minimum(m, -x)) for k, (_, x, m) in enumerate(ranges_of(limits)) if k]
    with np.errstate(divide="ignore", invalid="ignore"):
        pairs = combinations(sorted(sizes, key=lambda size: size[0]), 2)
        times = [(x / y) ** (1.0 / (k - i)) for (i, x), (k, y) in pairs if k > i]
    times = np.concatenate(times)
    times = times[np.isfinite(times) & (times > 0.0)]
    return times if times.size else np.ones(1)
