"""Polynomials between two states, and the durations with which they keep limits.

The durations that do are intervals. The first of a fine grid of durations that keeps the limits is
refined by bisection; an interval that is narrower than the grid (1 % of its durations) is missed.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array
from ..errors import InvalidValueError
from .checks import (
    ROUNDING,
    checked_limits,
    given_durations,
    refuse_extremes,
    refuse_short,
)
from .limits import MotionLimits
from .number_text import least_shown
from .piecewise import PiecewisePolynomial
from .trajectory import Trajectory

_KEPT = 1e-14
"""Relative excess that rounding alone makes."""
_TRIALS = 2000
"""Durations of the grid."""


def motion_between(
    order: int,
    states: dict[str, Array],
    batch: tuple[int, ...],
    scalar: bool,
    duration: ArrayLike | None,
    limits: MotionLimits | None,
) -> Trajectory:
    """Motion by polynomials of an order between states (R, n), checked against the limits."""
    T = given_durations(duration, batch)
    if T is None and limits is None:
        raise InvalidValueError("Give duration, limits or both.")
    R, n = states["q0"].shape
    bounds = checked_limits(limits, n, states["q0"], states["q1"])
    if T is not None:
        refuse_short(T, np.zeros(R), np.ones((R, 1)))
    refuse_extremes(states if T is None else states | {"duration": T}, bounds)
    if bounds is not None:
        rows = [{name: value[i] for name, value in states.items()} for i in range(R)]
        if T is None:
            T = np.array([_least(order, row, bounds) for row in rows])
        for row, time in zip(rows, T, strict=True):
            if excess(order, row, np.array([time]), bounds)[0] > ROUNDING:
                _refuse(order, row, bounds, float(time))
    assert T is not None
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


def between_states(order: int, states: dict[str, Array], T: Array) -> Array:
    """Coefficients of normalised time of the polynomials between two states.

    Shapes: states (R, n) or (n,) -> (order + 1, ...).
    """
    q0, D = states["q0"], states["q1"] - states["q0"]
    v0, v1 = T * states["v0"], T * states["v1"]
    if order == 3:
        rows = (q0 + 0.0 * T, v0, 3.0 * D - 2.0 * v0 - v1, v0 + v1 - 2.0 * D)
    else:
        a0, a1 = T * T * states["a0"], T * T * states["a1"]
        rows = (
            q0 + 0.0 * T,
            v0,
            0.5 * a0,
            10.0 * D - 6.0 * v0 - 4.0 * v1 - 1.5 * a0 + 0.5 * a1,
            -15.0 * D + 8.0 * v0 + 7.0 * v1 + 1.5 * a0 - a1,
            6.0 * D - 3.0 * (v0 + v1) - 0.5 * (a0 - a1),
        )
    return np.stack(rows)


def excess(order: int, state: dict[str, Array], T: Array, limits: MotionLimits) -> Array:
    """Relative excess over the worst limit for given durations."""
    c = np.moveaxis(between_states(order, state, T[:, None]), 0, -2)[:, None]
    motion = PiecewisePolynomial(np.stack((np.zeros_like(T), T), axis=-1)[:, None], c)
    worst = np.full(T.shape, -np.inf)
    for k, (least, most) in enumerate(_bounds(limits)):
        if not (np.isfinite(least).any() or np.isfinite(most).any()):
            continue
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
    D = np.abs(state["q1"] - state["q0"])
    if not (D.any() or any(state[name].any() for name in ("v0", "v1", "a0", "a1"))):
        return 0.0
    scales = _scales(state, limits)
    trials = np.geomspace(scales.min() / 1e3, scales.max() * 1e3, _TRIALS)
    trials = trials[trials > after]
    if after > 0.0:
        trials = np.concatenate(([after], trials))
    kept = excess(order, state, trials, limits) <= _KEPT
    if not kept.any():
        return None
    k = int(kept.argmax())
    if k == 0 and after > 0.0:
        return after
    if k == 0:
        raise InvalidValueError(
            "limits: between these states they are kept in any time, however short; give duration."
        )
    below, T = float(trials[k - 1]), float(trials[k])
    while np.nextafter(below, T) < T:
        finer = np.linspace(below, T, 18)
        kept = excess(order, state, finer[1:-1], limits) <= _KEPT
        k = int(kept.argmax()) + 1 if kept.any() else 17
        if (below, T) == (finer[k - 1], finer[k]):
            break
        below, T = float(finer[k - 1]), float(finer[k])
    return T


def _bounds(limits: MotionLimits) -> tuple[tuple[Array, Array], ...]:
    return (
        (limits.lower, limits.upper),
        (limits.velocity_lower, limits.velocity),
        (limits.acceleration_lower, limits.acceleration),
        (limits.jerk_lower, limits.jerk),
    )


def _scales(state: dict[str, Array], limits: MotionLimits) -> Array:
    """Times that the states and limits make: the durations sought are of their size."""
    D = np.abs(state["q1"] - state["q0"])
    v = np.maximum(np.abs(state["v0"]), np.abs(state["v1"]))
    a = np.maximum(np.abs(state["a0"]), np.abs(state["a1"]))
    V = np.minimum(limits.velocity, -limits.velocity_lower)
    A = np.minimum(limits.acceleration, -limits.acceleration_lower)
    J = np.minimum(limits.jerk, -limits.jerk_lower)
    room = np.minimum(
        np.maximum(limits.upper - np.maximum(state["q0"], state["q1"]), 0.0),
        np.maximum(np.minimum(state["q0"], state["q1"]) - limits.lower, 0.0),
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        times = np.concatenate(
            (D / V, np.sqrt(D / A), np.cbrt(D / J), v / A, np.sqrt(v / J),
             a / J, D / v, np.sqrt(D / a), v / a, V / a, room / v, np.sqrt(room / a))
        )  # fmt: skip
    times = times[np.isfinite(times) & (times > 0.0)]
    return times if times.size else np.ones(1)
