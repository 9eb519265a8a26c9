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
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_floats
from .._choices import chosen
from ..errors import InvalidValueError, ShapeError
from .between_states import between_states
from .checks import ROUNDING, checked_limits, refuse_jointless
from .limits import MotionLimits
from .number_text import least_shown
from .piecewise import PiecewisePolynomial
from .trajectory import Trajectory


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

    Examples
    --------
    >>> path = quintic_spline([0.0, 1.0, 0.5], times=[0.0, 1.0, 2.0])
    >>> path.q([0.0, 1.0, 2.0]).round(12), path.a([0.0, 2.0]).round(9) + 0.0
    (array([0. , 1. , 0.5]), array([0., 0.]))
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

    __slots__ = ("chosen", "limits", "moving", "points", "rates", "scalar", "times")

    def __init__(
        self,
        points: ArrayLike,
        times: ArrayLike | None,
        limits: MotionLimits | None,
        rates: dict[str, ArrayLike],
    ) -> None:
        q = as_floats(points, "points")
        if q.ndim not in (1, 2) or len(q) < 2:
            raise ShapeError(f"points: expected at least two, shape (m, n), got shape {q.shape}.")
        self.scalar = q.ndim == 1
        self.points = q[:, None] if self.scalar else q
        n = self.points.shape[1]
        refuse_jointless(n, "points")
        try:
            self.rates = {k: np.broadcast_to(as_floats(v, k), n) for k, v in rates.items()}
        except ValueError as error:
            raise ShapeError(f"Expected rates of {n} joints at the ends: {error}.") from None
        self.moving = any(rate.any() for rate in self.rates.values())
        self.limits = checked_limits(limits, n, self.points)
        self.chosen = times is None
        self.times = _chosen_times(self) if times is None else _given_times(times, len(q))

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
            sentences = "; ".join(report.violations())
            advice = "Choose other points or times."
            if report.stretch > 1.0 and not self.moving:
                advice = f"The least factor on the times is {least_shown(report.stretch)}."
            raise InvalidValueError(f"The limits are not kept: {sentences}. {advice}")
        return trajectory


def _given_times(times: ArrayLike, m: int) -> Array:
    t = as_floats(times, "times")
    if t.shape != (m,):
        raise ShapeError(f"times: expected one per point, shape ({m},), got {t.shape}.")
    if t[0] != 0.0 or (np.diff(t) <= 0.0).any():
        raise InvalidValueError(
            "times: expected times that ascend from 0, each later than the last."
        )
    return t


def _chosen_times(knots: _Knots) -> Array:
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
