"""Splines through points: every point is met, at its time.

Parameters
----------
points : array_like, shape (m,) or (m, n)
    Positions, rad or m, at least two.
times : array_like, shape (m,), optional
    Times of the points, s, ascending from 0; needed with rates at the ends. Without them each
    interval is in proportion to the time that its slowest joint needs at full velocity, and the
    whole is as quick as the limits allow.
ends : SplineEnds or str
    Conditions at the ends of a cubic spline (``v0`` and ``v1`` of a clamped one); a member or its
    name.
"""

from __future__ import annotations

from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_floats
from .._choices import chosen
from ..errors import InvalidValueError, ShapeError
from .limits import (
    ROUNDING,
    MotionLimits,
    checked_limits,
    checked_request,
    least_shown,
    limits_along,
    ranges_of,
    refuse_jointless,
    refuse_short,
)
from .motions import PiecewisePolynomial, ranges_of_pieces
from .trajectory import Trajectory

_ROUNDED = 1e-14  # relative excess that rounding alone makes


class SplineEnds(Enum):
    """End conditions of a cubic spline."""

    CLAMPED = "given velocities at the ends"
    NATURAL = "no acceleration at the ends"
    NOT_A_KNOT = "one polynomial on the first two intervals, and one on the last two"
    PERIODIC = "velocity and acceleration at the last point equal those at the first"


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
        c = np.moveaxis(between_states(order, ends, h[:, None]), 0, 1)
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
    along = [limits_along(knots.limits, row).velocity if row.any() else np.inf for row in step]
    needs = 1.0 / np.array(along)
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
    order: int, states: dict[str, Array], duration: float | None, limits: MotionLimits | None
) -> PiecewisePolynomial:
    """Polynomials of an order between states (n,), in a given duration or the least."""
    T, bounds = checked_request(states, duration, limits)
    refuse_short(T, 0.0)
    if bounds is not None and (T is None or _excess(order, states, [T], bounds)[0] > ROUNDING):
        T = _least_duration(order, states, T, bounds)
    c = between_states(order, states, T)[None]
    return PiecewisePolynomial(np.array([[0.0, T]]), c)


def between_states(order: int, states: dict[str, Array], T: Any) -> Array:
    """Coefficients (order + 1, ...) of normalised time of the polynomials between two states."""
    q0, D = states["q0"] + 0.0 * T, states["q1"] - states["q0"]
    v0, v1 = T * states["v0"], T * states["v1"]
    if order == 3:
        return np.stack((q0, v0, 3.0 * D - 2.0 * v0 - v1, v0 + v1 - 2.0 * D))
    a0, a1 = T * T * states["a0"], T * T * states["a1"]
    cubed = 10.0 * D - 6.0 * v0 - 4.0 * v1 - 1.5 * a0 + 0.5 * a1
    fourth = -15.0 * D + 8.0 * v0 + 7.0 * v1 + 1.5 * a0 - a1
    fifth = 6.0 * D - 3.0 * (v0 + v1) - 0.5 * (a0 - a1)
    return np.stack(np.broadcast_arrays(q0, v0, 0.5 * a0, cubed, fourth, fifth))


def _excess(order: int, states: dict[str, Array], T: Any, limits: MotionLimits) -> Array:
    """Relative excess (N,) over the worst limit for durations (N,)."""
    T = np.asarray(T)[:, None]
    c = np.moveaxis(between_states(order, states, T), 0, 1)
    worst = np.full(len(T), -np.inf)
    for k, (_, least, most) in enumerate(ranges_of(limits)):
        if np.isfinite((least, most)).any():
            low, high = ranges_of_pieces(c, T, k)
            size = np.maximum(np.abs(least), np.abs(most))
            size = np.where(np.isfinite(size) & (size > 0.0), size, 1.0)
            over = np.maximum((high - most) / size, (least - low) / size)
            worst = np.maximum(worst, over.max(axis=-1))
    return worst


def _least_duration(
    order: int, states: dict[str, Array], given: float | None, limits: MotionLimits
) -> float:
    """Least duration with which the limits are kept: trials, finer and finer; refuses the given."""
    ranges = ranges_of(limits)
    for rate, (_, low, high) in zip("va", ranges[1:3], strict=True):
        for name in (f"{rate}0", f"{rate}1") if f"{rate}0" in states else ():
            wrong = (states[name] > high) | (states[name] < low)
            if wrong.any():
                j = int(wrong.argmax())
                raise InvalidValueError(
                    f"limits: {name} of joint {j + 1} is {states[name][j]:.9g}, outside its limits "
                    f"{low[j]:.9g} to {high[j]:.9g}; the least limit that will do is "
                    f"{least_shown(abs(states[name][j]))}."
                )
    # times that the way, the states and the limits make: those sought are of their size
    way = np.abs(states["q1"] - states["q0"]) + np.abs(states["v0"]) + np.abs(states["v1"])
    rows = [np.minimum(most, -least) for _, least, most in ranges[1:]]
    with np.errstate(divide="ignore", invalid="ignore"):
        units = np.stack([(way / row) ** (1.0 / (k + 1)) for k, row in enumerate(rows)])
    unit = units[np.isfinite(units) & (units > 0.0)].max(initial=0.0) or 1.0
    trials = unit * np.geomspace(1e-4, 1e4, 2000)
    for _ in range(8):
        kept = _excess(order, states, trials, limits) <= _ROUNDED
        k = int(kept.argmax())
        if not kept.any() or kept[0]:
            break
        trials = np.linspace(trials[k - 1], trials[k], 100)
    if not kept.any():
        raise InvalidValueError(
            "limits: no duration keeps them with these states at the ends; give slower states or "
            "greater limits, or take jerk_limited, which finds a motion between any states."
        )
    if given is None:
        return float(trials[k])
    raise InvalidValueError(
        f"duration: with {given:.9g} s the limits are not kept; the least duration that keeps them "
        f"is {least_shown(trials[k])} s."
    )
