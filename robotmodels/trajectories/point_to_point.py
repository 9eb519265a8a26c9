"""Joint motions between two states: six laws of time, coordinated or of the same time.

Every function of this file returns the motion by one law. ``linear``, ``bang_bang``,
``trapezoidal`` and ``smoothed_trapezoidal`` go from rest to rest on the straight line between two
configurations; ``cubic`` and ``quintic`` may have other states at their ends, which give every
joint its own polynomial of the same duration.

Limits may be asymmetric. Coordinated joints share the law that none of them exceeds; where
independent joints arrive early the end of their law is inside the motion.

References
----------
Book section 4.2; Khalil and Dombre, Modeling, identification and control of robots, 13.3.
"""

from __future__ import annotations

from dataclasses import replace
from enum import Enum

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_count, as_floats
from .._choices import chosen
from ..errors import InvalidValueError
from .laws import Pieces, TimeLaw, law_of_duration, law_of_limits
from .limits import (
    MotionLimits,
    checked_request,
    joint_vectors,
    limits_along,
    refuse_short,
)
from .motions import PiecewisePolynomial
from .splines import motion_between
from .trajectory import Samples, Trajectory


class Synchronisation(Enum):
    """Synchronisation of joints that move together; the value describes what they share."""

    COORDINATED = "one law: the ratio of the joints' motions is kept along the whole path"
    SAME_TIME = (
        "start and end: each joint has its own quickest law, slowed down to the slowest joint"
    )
    INDEPENDENT = "the start only: each joint arrives as soon as it can and waits"


def along_line(
    law: TimeLaw | str,
    q0: ArrayLike,
    q1: ArrayLike,
    duration: float | None,
    limits: MotionLimits | None,
    synchronisation: Synchronisation | str = Synchronisation.COORDINATED,
) -> Trajectory:
    """Motion from rest to rest by any law, for programs that choose it."""
    law = chosen(TimeLaw, law, "law")
    how = chosen(Synchronisation, synchronisation, "synchronisation")
    return law_motion(law, *joint_vectors(q0=q0, q1=q1), duration, limits, how)


def linear(
    q0: ArrayLike,
    q1: ArrayLike,
    duration: float | None = None,
    limits: MotionLimits | None = None,
    synchronisation: Synchronisation | str = Synchronisation.COORDINATED,
) -> Trajectory:
    """Constant velocity; it jumps at both ends, so that no acceleration limit holds there."""
    return along_line(TimeLaw.LINEAR, q0, q1, duration, limits, synchronisation)


def bang_bang(
    q0: ArrayLike,
    q1: ArrayLike,
    duration: float | None = None,
    limits: MotionLimits | None = None,
    synchronisation: Synchronisation | str = Synchronisation.COORDINATED,
) -> Trajectory:
    """Constant acceleration, then constant deceleration, without a cruise between them.

    With asymmetric limits the two parts share the time so that both accelerations are used in
    full; without limits they are equal.
    """
    return along_line(TimeLaw.BANG_BANG, q0, q1, duration, limits, synchronisation)


def trapezoidal(
    q0: ArrayLike,
    q1: ArrayLike,
    duration: float | None = None,
    limits: MotionLimits | None = None,
    synchronisation: Synchronisation | str = Synchronisation.COORDINATED,
) -> Trajectory:
    """Trapezoidal velocity: the quickest motion under limits of velocity and acceleration.

    Also called linear segment with parabolic blends, ``lspb``. Without limits the ramps take a
    third of the duration each.

    Examples
    --------
    >>> limits = MotionLimits(velocity=[1.0, 2.0], acceleration=2.0)
    >>> move = trapezoidal([0.0, 0.0], [1.0, -1.0], limits=limits)
    >>> move.duration, move.v(0.75)
    (1.50..., array([ 1., -1.]))
    """
    return along_line(TimeLaw.TRAPEZOIDAL, q0, q1, duration, limits, synchronisation)


def smoothed_trapezoidal(
    q0: ArrayLike,
    q1: ArrayLike,
    duration: float | None = None,
    limits: MotionLimits | None = None,
    synchronisation: Synchronisation | str = Synchronisation.COORDINATED,
) -> Trajectory:
    """Smoothed trapezoidal velocity: ramps whose acceleration is a parabola of time.

    The acceleration is continuous, also at the ends. A ramp to the velocity V takes
    ``1.5 V / acceleration``, or longer where a limit of jerk needs it.
    """
    return along_line(TimeLaw.SMOOTHED_TRAPEZOIDAL, q0, q1, duration, limits, synchronisation)


def cubic(
    q0: ArrayLike,
    q1: ArrayLike,
    duration: float | None = None,
    limits: MotionLimits | None = None,
    v0: ArrayLike = 0.0,
    v1: ArrayLike = 0.0,
) -> Trajectory:
    """Third-order polynomials with given velocities at the ends."""
    states, scalar = joint_vectors(q0=q0, q1=q1, v0=v0, v1=v1)
    return _polynomial(TimeLaw.CUBIC, states, scalar, duration, limits)


def quintic(
    q0: ArrayLike,
    q1: ArrayLike,
    duration: float | None = None,
    limits: MotionLimits | None = None,
    v0: ArrayLike = 0.0,
    v1: ArrayLike = 0.0,
    a0: ArrayLike = 0.0,
    a1: ArrayLike = 0.0,
) -> Trajectory:
    """Fifth-order polynomials with given velocities and accelerations at the ends.

    Examples
    --------
    >>> move = quintic([0.0, 0.0], [1.0, 2.0], duration=2.0)
    >>> move.v(1.0), move.a(2.0)
    (array([0.9375, 1.875 ]), array([0., 0.]))
    >>> quintic(0.0, 1.0, limits=MotionLimits(velocity=1.875, acceleration=5.0)).duration
    1.0745...
    """
    states, scalar = joint_vectors(q0=q0, q1=q1, v0=v0, v1=v1, a0=a0, a1=a1)
    return _polynomial(TimeLaw.QUINTIC, states, scalar, duration, limits)


def _polynomial(
    law: TimeLaw,
    states: dict[str, Array],
    scalar: bool,
    duration: float | None,
    limits: MotionLimits | None,
) -> Trajectory:
    """From rest to rest the law of its name, else polynomials of its order."""
    if not any(states[name].any() for name in states if name not in ("q0", "q1")):
        return law_motion(law, states, scalar, duration, limits)
    order = 3 if law is TimeLaw.CUBIC else 5
    return Trajectory(motion_between(order, states, duration, limits), scalar)


def joint_trajectory(
    q0: ArrayLike, q1: ArrayLike, N: int | ArrayLike, v0: ArrayLike = 0.0, v1: ArrayLike = 0.0
) -> Samples:
    """Positions, velocities and accelerations between two postures, fifth-order polynomials.

    Also called ``jtraj``. For limits, other laws and continuous time see `quintic`.

    Parameters
    ----------
    N : int or array_like, shape (N,)
        How many samples, equally spaced over one second; or their times, s, ascending.

    Returns
    -------
    Samples
        ``t (N,)`` and ``q, v, a, jerk (N, n)``; as an array its positions.

    Examples
    --------
    >>> path = joint_trajectory([0.0, 1.0], [1.0, -1.0], 5)
    >>> path.q[2], path.q.shape
    (array([0.5, 0. ]), (5, 2))
    """
    if not isinstance(N, (list, tuple)) and np.ndim(N) == 0:  # type: ignore[arg-type]
        t = np.linspace(0.0, 1.0, as_count(N, "N", 0, 10**7))  # type: ignore[arg-type]
    else:
        t = as_floats(N, "N")  # type: ignore[arg-type]
        if t.ndim != 1 or (t[1:] < t[:-1]).any():
            raise InvalidValueError("N: expected a number of samples or times that ascend.")
    rest = t - t[:1]
    motion = quintic(q0, q1, float(rest.max(initial=0.0)) or 1.0, None, v0, v1)
    return replace(motion.at(rest), t=t)


def law_motion(
    law: TimeLaw,
    states: dict[str, Array],
    scalar: bool,
    duration: float | None,
    limits: MotionLimits | None,
    how: Synchronisation = Synchronisation.COORDINATED,
) -> Trajectory:
    """Motion from rest to rest between checked positions q0, q1 (n,)."""
    T, bounds = checked_request(states, duration, limits)
    way = states["q1"] - states["q0"]
    way = np.where(np.abs(way) < 1e-50, 0.0, way)
    # one law for all joints, or one law each
    together = bounds is None or how is Synchronisation.COORDINATED
    laws, turns = [], []
    for row in way[None] if together else np.diag(way):
        length = float(np.abs(row).max())
        turns.append(row / length if length > 0.0 else row)
        if bounds is None:
            assert T is not None
            laws.append(law_of_duration(law, length, T))
        else:
            laws.append(law_of_limits(law, length, limits_along(bounds, turns[-1])))
    least = 0.0 if bounds is None else max(float(one.durations.sum()) for one in laws)
    refuse_short(T, least, bool(way.any()))
    waits = T is None and how is Synchronisation.INDEPENDENT
    moves = Trajectory(_assembled(laws, np.array(turns), states["q0"], T, waits), scalar)
    if waits and bounds is not None and law in (TimeLaw.LINEAR, TimeLaw.CUBIC):
        # jumps at an end are inside the motion
        report = moves.check(bounds)
        if not report.kept:
            raise InvalidValueError(
                f"limits: {law.name} ends with a jump, and where a joint arrives early and waits, "
                f"limits are not kept: {'; '.join(report.violations())}. Take SAME_TIME, or a law "
                "that ends at rest."
            )
    return moves


def _assembled(
    laws: list[Pieces], turns: Array, start: Array, T: float | None, waits: bool
) -> PiecewisePolynomial:
    """Laws along given directions (1 or n, n), stretched to a duration or the longest of them.

    Or each law ``waits`` at its end.
    """
    K, powers = (max(one.coefficients.shape[axis] for one in laws) for axis in range(2))
    totals = [float(one.durations.sum()) for one in laws]
    end = max(totals) if T is None else T
    h, c = np.zeros((len(laws), K + 1)), np.zeros((K + 1, powers, start.size))
    for k, ((durations, of), total, turn) in enumerate(zip(laws, totals, turns, strict=True)):
        m, d = of.shape
        stretch = end / total if total > 0.0 and not waits else 1.0
        h[k, :m], h[k, m:K] = durations * stretch, 0.0
        h[k, K] = max(end - total, 0.0) if waits or not total > 0.0 else 0.0
        c[:m, :d] += of[..., None] * turn
        c[m:, 0] += of[-1].sum() * turn
    c[:, 0] += start
    breaks = np.concatenate((np.zeros((len(laws), 1)), np.cumsum(h, axis=1)), axis=1)
    if not h[:, -1].any():
        h, c, breaks = h[:, :-1], c[:-1], breaks[:, :-1]
    if not waits:  # times of all laws end together to the last digit
        breaks[:, 1:] = np.minimum(breaks[:, 1:], end)
        breaks[:, -1] = end
    return PiecewisePolynomial(breaks, c, h)
