"""Splines through points: every point is met, at its time.

Parameters
----------
points : array_like, shape (m,) or (m, n)
    Positions, rad or m, at least two.
times : array_like, shape (m,), optional
    Times of the points, s, ascending from 0. Without them each interval is in proportion to the
    time that its slowest joint needs at full velocity, and the whole is as quick as the limits
    allow.
limits : MotionLimits, optional
    Kept everywhere on the motion.
v0, v1, a0, a1 : array_like, shape () or (n,)
    Velocities and accelerations at the ends, rad or m, per s and s^2. Other than zero, they need
    times.
ends : SplineEnds or str
    Conditions at the ends of a cubic spline (``v0`` and ``v1`` of a clamped one); a member or its
    name.

Returns
-------
Trajectory
    Of n joints, or scalar.

Raises
------
ShapeError, InvalidValueError
    Fewer than two points, times that do not ascend from 0, limits that the times do not keep (the
    message has the least factor that keeps them) or that no times keep.

References
----------
Khalil and Dombre, Modeling, identification and control of robots, section 13.5.
"""

from __future__ import annotations

from enum import Enum
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_floats
from .._choices import chosen
from ..errors import InvalidValueError, ShapeError
from .checks import (
    ROUNDING,
    checked_limits,
    checked_request,
    least_shown,
    refuse_jointless,
    refuse_short,
)
from .limits import MotionLimits, ranges_of
from .motions import PiecewisePolynomial
from .trajectory import Trajectory

_ROUNDED = 1e-14  # relative excess that rounding alone makes
_TRIALS = 2000  # durations of the grid


class SplineEnds(Enum):
    """What is asked of a cubic spline at its ends."""

    CLAMPED = "given velocities at the ends"
    NATURAL = "no acceleration at the ends"
    NOT_A_KNOT = "one polynomial on the first two intervals, and one on the last two"
    PERIODIC = "velocity and acceleration go on from the last point at the first"


def cubic_spline(
    points: ArrayLike,
    times: ArrayLike | None = None,
    limits: MotionLimits | None = None,
    v0: ArrayLike = 0.0,
    v1: ArrayLike = 0.0,
    ends: SplineEnds | str = SplineEnds.CLAMPED,
) -> Trajectory:
    """Third-order spline through points, with continuous acceleration.

    Examples
    --------
    >>> path = cubic_spline([[0.0, 0.0], [1.0, 0.5], [0.0, 1.0]], times=[0.0, 1.0, 2.0])
    >>> path.q(1.0), path.v([0.0, 2.0]).round(12)
    (array([1. , 0.5]), array([[0., 0.],
           [0., 0.]]))
    """
    from scipy.interpolate import CubicSpline

    ends = chosen(SplineEnds, ends, "ends")
    knots = _Knots(points, times, limits, {"v0": v0, "v1": v1})
    if ends is not SplineEnds.CLAMPED and knots.moving:
        raise InvalidValueError("v0, v1: only a clamped spline takes velocities at its ends.")
    q = knots.points
    if ends is SplineEnds.PERIODIC:
        gap = np.abs(q[0] - q[-1])
        open_ = gap > 1e-9 * np.ptp(q[:-1], axis=0) + 4.0 * np.finfo(float).eps * np.abs(q[0])
        if open_.any():
            j = int(open_.argmax())
            raise InvalidValueError(
                f"points: a periodic spline ends where it began; joint {j + 1} ends {gap[j]:.3g} "
                "beside its start. Give the first point again as the last."
            )
        q = knots.points = np.vstack((q[:-1], q[:1]))
    condition: Any = {
        SplineEnds.CLAMPED: ((1, knots.rates["v0"]), (1, knots.rates["v1"])),
        SplineEnds.NATURAL: "natural",
        SplineEnds.NOT_A_KNOT: "not-a-knot",
        SplineEnds.PERIODIC: "periodic",
    }[ends]
    return knots.finished(3, v=CubicSpline(knots.times, q, bc_type=condition)(knots.times, 1))


def quintic_spline(
    points: ArrayLike,
    times: ArrayLike | None = None,
    limits: MotionLimits | None = None,
    v0: ArrayLike = 0.0,
    v1: ArrayLike = 0.0,
    a0: ArrayLike = 0.0,
    a1: ArrayLike = 0.0,
) -> Trajectory:
    """Fifth-order spline through points, with continuous jerk and its derivative.

    The continuity of these two loses digits where intervals of time differ by more than a factor
    of 1000.
    """
    from scipy.interpolate import make_interp_spline

    knots = _Knots(points, times, limits, {"v0": v0, "v1": v1, "a0": a0, "a1": a1})
    rates = knots.rates
    ends: Any = tuple([(1, rates["v" + end]), (2, rates["a" + end])] for end in "01")
    spline = make_interp_spline(knots.times, knots.points, k=5, bc_type=ends)
    v, a = spline(knots.times, 1), spline(knots.times, 2)
    v[[0, -1]], a[[0, -1]] = (rates["v0"], rates["v1"]), (rates["a0"], rates["a1"])
    return knots.finished(5, v=v, a=a)


class _Knots:
    """Points, times and rates as given, checked; and the end of the work, common to all splines."""

    def __init__(
        self,
        points: ArrayLike,
        times: ArrayLike | None,
        limits: MotionLimits | None,
        rates: dict[str, ArrayLike],
    ) -> None:
        self.points, self.scalar = as_points(points)
        m, n = self.points.shape
        try:
            self.rates = {k: np.broadcast_to(as_floats(v, k), n) for k, v in rates.items()}
        except ValueError as error:
            raise ShapeError(f"Expected rates of {n} joints at the ends: {error}.") from None
        self.moving = any(rate.any() for rate in self.rates.values())
        self.limits = checked_limits(limits, n, self.points)
        self.chosen = times is None
        self.times = _chosen_times(self) if times is None else as_floats(times, "times")
        if self.times.shape != (m,):
            raise ShapeError(
                f"times: expected one per point, shape ({m},), got {self.times.shape}."
            )
        if self.times[0] != 0.0 or (np.diff(self.times) <= 0.0).any():
            raise InvalidValueError(
                "times: expected times that ascend from 0, each later than the last."
            )

    def finished(self, order: int, **rates: Array) -> Trajectory:
        """Polynomials between the states at the knots, each (m, n), and the check of the limits.

        Points are met and the derivatives go on however uneven the times are.
        """
        states = {"q": self.points} | rates
        ends = {name + "0": x[:-1] for name, x in states.items()}
        ends |= {name + "1": x[1:] for name, x in states.items()}
        h = np.diff(self.times)
        c = np.swapaxes(between_states(order, ends, h[:, None]), 0, 1)
        trajectory = Trajectory(PiecewisePolynomial(self.times[None], c), self.scalar)
        if self.limits is None:
            return trajectory
        report = trajectory.check(self.limits, ROUNDING)
        if self.chosen:
            factor = report.stretch * (1.0 + 1e-14)
            motion = PiecewisePolynomial(self.times[None] * factor, c, h[None] * factor)
            trajectory = Trajectory(motion, self.scalar)
            report = trajectory.check(self.limits, ROUNDING)
        if not report.kept:
            advice = "Choose other points or times."
            if report.stretch > 1.0 and not self.moving:
                advice = f"The least factor on the times is {least_shown(report.stretch)}."
            raise InvalidValueError(
                f"The limits are not kept: {'; '.join(report.violations())}. {advice}"
            )
        return trajectory


def as_points(points: ArrayLike) -> tuple[Array, bool]:
    """At least two points (m, n), and whether they are scalar."""
    q = as_floats(points, "points")
    if q.ndim not in (1, 2) or len(q) < 2:
        raise ShapeError(f"points: expected at least two, shape (m, n), got shape {q.shape}.")
    scalar = q.ndim == 1
    q = q[:, None] if scalar else q
    refuse_jointless(q.shape[1], "points")
    return q, scalar


def _chosen_times(knots: _Knots) -> Array:
    """Times in proportion to the time of the slowest joint of each interval."""
    if knots.limits is None:
        raise InvalidValueError("Give times, limits or both.")
    if knots.moving:
        raise InvalidValueError("times: velocities or accelerations at the ends need given times.")
    step = np.diff(knots.points, axis=0)
    forward = np.where(step > 0.0, knots.limits.velocity, -knots.limits.velocity_lower)
    if ((step != 0.0) & (forward == 0.0)).any():
        raise InvalidValueError("limits: a limit of velocity of a joint that has to move is 0.")
    with np.errstate(divide="ignore", invalid="ignore"):
        needs = np.where(step != 0.0, np.abs(step) / forward, 0.0).max(axis=-1)
    if not needs.any():  # no limit of velocity
        needs = np.linalg.norm(step, axis=-1)
    if (needs == 0.0).any():
        k = int((needs == 0.0).argmax())
        raise InvalidValueError(
            f"points: {k} and {k + 1} are the same, which leaves no time between them; drop one or "
            "give times."
        )
    return np.concatenate(((0.0,), np.cumsum(needs)))


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
        given = np.full(R, np.nan) if T is None else T
        T = np.array([_kept(order, *row, bounds) for row in zip(rows, given, strict=True)])
    assert T is not None
    c = np.moveaxis(between_states(order, states, T[:, None]), 0, -2)
    breaks = np.stack((np.zeros(R), T), axis=-1).reshape(*batch, 1, 2)
    return Trajectory(PiecewisePolynomial(breaks, c.reshape(*batch, 1, order + 1, n)), scalar)


def _kept(order: int, state: dict[str, Array], T: float, limits: MotionLimits) -> float:
    """The duration T if it keeps the limits, or for NaN the least that does."""
    if not np.isnan(T) and excess(order, state, np.array([T]), limits)[0] <= ROUNDING:
        return T
    for rate, (_, low, high) in zip("va", ranges_of(limits)[1:3], strict=True):
        for name in (f"{rate}0", f"{rate}1") if f"{rate}0" in state else ():
            wrong = (state[name] > high) | (state[name] < low)
            if wrong.any():
                j = int(wrong.argmax())
                raise InvalidValueError(
                    f"limits: {name} of joint {j + 1} is {state[name][j]:.9g}, outside its limits "
                    f"{low[j]:.9g} to {high[j]:.9g}; the least limit that will do is "
                    f"{least_shown(abs(state[name][j]))}."
                )
    least = least_duration(order, state, limits)
    if least is None:
        raise InvalidValueError(
            "limits: no duration keeps them with these states at the ends; give slower states or "
            "greater limits, or take jerk_limited, which finds a motion between any states."
        )
    if np.isnan(T):
        return least
    more = ""
    if least < T:
        longer = least_duration(order, state, limits, T)
        more = f" The least that is longer than that given is {least_shown(longer or T)} s."
        more = more if longer else " No longer one does."
    raise InvalidValueError(
        f"duration: with {T:.9g} s the limits are not kept; the least duration that keeps them is "
        f"{least_shown(least)} s.{more}"
    )


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
    worst = np.full(T.shape, -np.inf)
    motion = PiecewisePolynomial(np.stack((np.zeros_like(T), T), axis=-1)[:, None], c)
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
    """Least duration with which the polynomials keep the limits: trials, finer and finer."""
    q0, q1 = state["q0"], state["q1"]
    room = np.minimum(limits.upper - np.maximum(q0, q1), np.minimum(q0, q1) - limits.lower)
    sizes = [(0, np.abs(q1 - q0))]
    sizes += [("qva".index(name[0]), np.abs(x)) for name, x in state.items() if name[0] != "q"]
    if not any(size.any() for _, size in sizes):
        return 0.0
    # times that states and limits make: the durations sought are of their size
    sizes += [(0, np.maximum(room, 0.0))]
    sizes += [(k, np.minimum(m, -x)) for k, (_, x, m) in enumerate(ranges_of(limits)) if k]
    with np.errstate(divide="ignore", invalid="ignore"):
        pairs = combinations(sorted(sizes, key=lambda size: size[0]), 2)
        scales = np.concatenate([(x / y) ** (1.0 / (k - i)) for (i, x), (k, y) in pairs if k > i])
    scales = scales[np.isfinite(scales) & (scales > 0.0)]
    ends = (1e-3 * scales.min(), 1e3 * scales.max()) if scales.size else (1e-3, 1e3)
    trials = np.geomspace(*ends, _TRIALS)
    trials = np.append(after, trials[trials > after]) if after > 0.0 else trials
    kept = excess(order, state, trials, limits) <= _ROUNDED
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
        inner = np.append(excess(order, state, finer[1:-1], limits) <= _ROUNDED, True)
        k = int(inner.argmax()) + 1
        if (below, T) == (finer[k - 1], finer[k]):
            break
        below, T = float(finer[k - 1]), float(finer[k])
    return T
