"""Splines through points: every point is met, at its time."""

from __future__ import annotations

from enum import Enum
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_floats
from .._choices import chosen
from ..errors import InvalidValueError, ShapeError
from .asked import ROUNDING, checked_limits, refuse_jointless
from .limits import MotionLimits
from .piecewise import PiecewisePolynomial
from .shown import least_shown
from .trajectory import Trajectory


class SplineEnds(Enum):
    """What is asked of a cubic spline at its ends.

    Examples
    --------
    >>> SplineEnds.NATURAL.value
    'no acceleration at the ends'
    """

    CLAMPED = "given velocities at the ends"
    NATURAL = "no acceleration at the ends"
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

    Parameters
    ----------
    points : array_like, shape (m,) or (m, n)
        Positions, rad or m, at least two.
    times : array_like, shape (m,), optional
        When, s, ascending from 0. Without them each interval is in proportion to the time that its
        slowest joint needs at full velocity, and the whole is as quick as the limits allow.
    limits : MotionLimits, optional
        Kept everywhere on the motion.
    v0, v1 : array_like, shape () or (n,)
        Velocities at the ends of a clamped spline, rad/s or m/s. Other than zero, they need times.
    ends : SplineEnds or str
        What is asked at the ends; a member or its name.

    Returns
    -------
    Trajectory
        Of n joints, or scalar.

    Raises
    ------
    ShapeError, InvalidValueError
        Fewer than two points, times that do not ascend from 0, limits that the times do not keep
        (the message tells by how much to slow down) or that no times keep.

    References
    ----------
    Khalil and Dombre, Modeling, identification and control of robots, section 13.5.

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
        q = q.copy()
        q[-1] = q[0]
    condition: Any = {
        SplineEnds.CLAMPED: ((1, knots.rates["v0"]), (1, knots.rates["v1"])),
        SplineEnds.NATURAL: "natural",
        SplineEnds.PERIODIC: "periodic",
    }[ends]
    spline = CubicSpline(knots.times, q, bc_type=condition)
    # highest power of the time first
    c = np.moveaxis(np.asarray(spline.c)[::-1], 0, 1)
    c = c * np.diff(knots.times)[:, None, None] ** np.arange(4.0)[:, None]
    trajectory = knots.finished(c, knots.times)
    if ends is SplineEnds.PERIODIC:
        return Trajectory(trajectory.motion, trajectory.scalar)
    return trajectory


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

    Parameters
    ----------
    points : array_like, shape (m,) or (m, n)
        Positions, rad or m, at least two.
    times : array_like, shape (m,), optional
        When, s, ascending from 0; without them as in `cubic_spline`.
    limits : MotionLimits, optional
        Kept everywhere on the motion.
    v0, v1, a0, a1 : array_like, shape () or (n,)
        Velocities and accelerations at the ends. Other than zero, they need times.

    Returns
    -------
    Trajectory
        Of n joints, or scalar.

    Raises
    ------
    ShapeError, InvalidValueError
        As `cubic_spline`.

    Examples
    --------
    >>> path = quintic_spline([0.0, 1.0, 0.5], times=[0.0, 1.0, 2.0])
    >>> path.q([0.0, 1.0, 2.0]).round(12), path.a([0.0, 2.0]).round(9) + 0.0
    (array([0. , 1. , 0.5]), array([0., 0.]))
    """
    knots = _Knots(points, times, limits, {"v0": v0, "v1": v1, "a0": a0, "a1": a1})
    rates = knots.rates
    h = np.diff(knots.times)[:, None]
    v, a = _quintic_rates(knots.points, h, rates)
    # between two states: points are met and the acceleration goes on however uneven the times are
    q, d = knots.points[:-1], np.diff(knots.points, axis=0)
    V0, V1, A0, A1 = h * v[:-1], h * v[1:], h * h * a[:-1], h * h * a[1:]
    cubed = 10.0 * d - 6.0 * V0 - 4.0 * V1 - 1.5 * A0 + 0.5 * A1
    fourth = -15.0 * d + 8.0 * V0 + 7.0 * V1 + 1.5 * A0 - A1
    fifth = 6.0 * d - 3.0 * (V0 + V1) - 0.5 * (A0 - A1)
    return knots.finished(np.stack((q, V0, 0.5 * A0, cubed, fourth, fifth), axis=1), knots.times)


def _quintic_rates(q: Array, h: Array, ends: dict[str, Array]) -> tuple[Array, Array]:
    """Velocities and accelerations (m, n) at the points of a fifth-order spline.

    Between two states a piece is known; that the jerk and its derivative go on at the inner
    points makes a banded system for the states.
    """
    from scipy.linalg import solve_banded
    from scipy.sparse import dia_array

    m, n = q.shape
    # in units of the mean interval the equations are well scaled
    unit = float(h.mean())
    h = h / unit
    d = np.diff(q, axis=0) / h**3
    before, after = h[:-1, 0], h[1:, 0]
    band, right = np.zeros((7, 2 * m)), np.zeros((2 * m, n))
    band[3, [0, 1, -2, -1]] = 1.0
    right[[0, 1, -2, -1]] = (
        ends["v0"] * unit, ends["a0"] * unit**2, ends["v1"] * unit, ends["a1"] * unit**2,
    )  # fmt: skip
    inner = 2 * np.arange(1, m - 1)
    one, two, three = (
        (before**-p, after**-p, np.minimum(before, after) ** p) for p in (1.0, 2.0, 3.0)
    )

    def put(row: Array, column: int, value: Array) -> None:
        """Entries of the equations at the inner points, ``column`` from their own velocity."""
        place = inner + column
        band[3 + row - place, place] = value

    # jerk before less jerk after, v and a of the point before, of this one and of the next
    jerk, u = inner, two[2]
    put(jerk, -2, -24.0 * two[0] * u)
    put(jerk, -1, -3.0 * one[0] * u)
    put(jerk, 0, 36.0 * (two[1] - two[0]) * u)
    put(jerk, 1, 9.0 * (one[0] + one[1]) * u)
    put(jerk, 2, 24.0 * two[1] * u)
    put(jerk, 3, -3.0 * one[1] * u)
    right[jerk] = 60.0 * np.diff(d, axis=0) * u[:, None]
    # and the same of the derivative of the jerk
    snap, u = inner + 1, three[2]
    put(snap, -2, -168.0 * three[0] * u)
    put(snap, -1, -24.0 * two[0] * u)
    put(snap, 0, -192.0 * (three[0] + three[1]) * u)
    put(snap, 1, 36.0 * (two[0] - two[1]) * u)
    put(snap, 2, -168.0 * three[1] * u)
    put(snap, 3, 24.0 * two[1] * u)
    right[snap] = -360.0 * (d[:-1] / h[:-1] + d[1:] / h[1:]) * u[:, None]
    x = solve_banded((3, 3), band, right)
    # one iterative refinement: each equation is met to the rounding of its own terms
    x += solve_banded((3, 3), band, right - dia_array((band, range(3, -4, -1)), (2 * m,) * 2) @ x)
    v, a = x[::2] / unit, x[1::2] / unit**2
    v[0], v[-1], a[0], a[-1] = ends["v0"], ends["v1"], ends["a0"], ends["a1"]
    return v, a


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

    def finished(self, c: Array, x: Array) -> Trajectory:
        """The trajectory of coefficients (K, d + 1, n) of normalised time, and its limits."""
        h = np.diff(x)
        motion = PiecewisePolynomial(x[None], c)
        trajectory = Trajectory(motion, self.scalar)
        if self.limits is None:
            return trajectory
        report = trajectory.check(self.limits, ROUNDING)
        if self.chosen:
            factor = report.stretch * (1.0 + 1e-14)
            motion = PiecewisePolynomial(x[None] * factor, c, h[None] * factor)
            trajectory = Trajectory(motion, self.scalar)
            report = trajectory.check(self.limits, ROUNDING)
        if not report.kept:
            sentences = "; ".join(report.violations())
            advice = (
                f"The least factor on the times is {least_shown(report.stretch)}."
                if report.stretch > 1.0 and not self.moving
                else "Choose other points or times."
            )
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
