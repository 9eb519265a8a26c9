"""Polynomials of third and fifth order between two states."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array
from ..errors import InvalidValueError
from .asked import ROUNDING, checked_limits, given_durations, joint_vectors, refuse_short
from .laws import TimeLaw
from .limits import MotionLimits
from .piecewise import PiecewisePolynomial
from .point_to_point import along_line
from .trajectory import Trajectory


def cubic(
    q0: ArrayLike,
    q1: ArrayLike,
    duration: ArrayLike | None = None,
    limits: MotionLimits | None = None,
    v0: ArrayLike = 0.0,
    v1: ArrayLike = 0.0,
) -> Trajectory:
    """Third-order polynomials with given velocities at the ends.

    From rest to rest the joints are coordinated: they share one law, and the ratio of their
    motions is kept. Other end velocities give every joint its own polynomial of the same duration.

    Parameters
    ----------
    q0, q1 : array_like, shape () or (..., n)
        Positions at the ends, rad or m; leading axes are motions of their own.
    duration : array_like, shape () or (...), optional
        Seconds; default the least with which these polynomials keep the limits.
    limits : MotionLimits, optional
        Kept inside the motion: velocity, acceleration, jerk and position.
    v0, v1 : array_like, shape () or (..., n)
        Velocities at the ends, rad/s or m/s.

    Returns
    -------
    Trajectory
        Of n joints, or scalar.

    Raises
    ------
    ShapeError, InvalidValueError
        Vectors that do not fit, NaN; neither duration nor limits; a duration with which the limits
        are not kept: the message tells the least that will do, or that none does.

    References
    ----------
    Khalil and Dombre, Modeling, identification and control of robots, section 13.3.2.

    Examples
    --------
    >>> cubic([0.0, 1.0], [1.0, 0.0], duration=1.0).v(0.5)
    array([ 1.5, -1.5])
    >>> cubic(0.0, 1.0, limits=MotionLimits(velocity=0.75)).duration
    2.00...
    """
    states, batch, scalar = joint_vectors(q0=q0, q1=q1, v0=v0, v1=v1)
    states |= {"a0": np.zeros_like(states["q0"]), "a1": np.zeros_like(states["q0"])}
    if not (states["v0"].any() or states["v1"].any()):
        return _from_rest(TimeLaw.CUBIC, states, batch, scalar, duration, limits)
    return _between_states(3, states, batch, scalar, duration, limits)


def quintic(
    q0: ArrayLike,
    q1: ArrayLike,
    duration: ArrayLike | None = None,
    limits: MotionLimits | None = None,
    v0: ArrayLike = 0.0,
    v1: ArrayLike = 0.0,
    a0: ArrayLike = 0.0,
    a1: ArrayLike = 0.0,
) -> Trajectory:
    """Fifth-order polynomials with given velocities and accelerations at the ends.

    From rest to rest the joints are coordinated: they share one law, and the ratio of their
    motions is kept. Other end states give every joint its own polynomial of the same duration.

    Parameters
    ----------
    q0, q1 : array_like, shape () or (..., n)
        Positions at the ends, rad or m; leading axes are motions of their own.
    duration : array_like, shape () or (...), optional
        Seconds; default the least with which these polynomials keep the limits.
    limits : MotionLimits, optional
        Kept inside the motion: velocity, acceleration, jerk and position.
    v0, v1 : array_like, shape () or (..., n)
        Velocities at the ends, rad/s or m/s.
    a0, a1 : array_like, shape () or (..., n)
        Accelerations at the ends, rad/s^2 or m/s^2.

    Returns
    -------
    Trajectory
        Of n joints, or scalar.

    Raises
    ------
    ShapeError, InvalidValueError
        As `cubic`.

    References
    ----------
    Seed book section 4.2.1.

    Examples
    --------
    >>> move = quintic([0.0, 0.0], [1.0, 2.0], duration=2.0)
    >>> move.v(1.0), move.a(2.0)
    (array([0.9375, 1.875 ]), array([0., 0.]))
    >>> quintic(0.0, 1.0, limits=MotionLimits(velocity=1.875, acceleration=5.0)).duration
    1.0745...
    """
    states, batch, scalar = joint_vectors(q0=q0, q1=q1, v0=v0, v1=v1, a0=a0, a1=a1)
    if not any(states[name].any() for name in ("v0", "v1", "a0", "a1")):
        return _from_rest(TimeLaw.QUINTIC, states, batch, scalar, duration, limits)
    return _between_states(5, states, batch, scalar, duration, limits)


def _from_rest(
    law: TimeLaw,
    states: dict[str, Array],
    batch: tuple[int, ...],
    scalar: bool,
    duration: ArrayLike | None,
    limits: MotionLimits | None,
) -> Trajectory:
    shape = (*batch, states["q0"].shape[-1])
    q0, q1 = states["q0"].reshape(shape), states["q1"].reshape(shape)
    return Trajectory(along_line(law, q0, q1, duration, limits).motion, scalar)


def _between_states(
    order: int,
    states: dict[str, Array],
    batch: tuple[int, ...],
    scalar: bool,
    duration: ArrayLike | None,
    limits: MotionLimits | None,
) -> Trajectory:
    T = given_durations(duration, batch)
    if T is None and limits is None:
        raise InvalidValueError("Give duration, limits or both.")
    R, n = states["q0"].shape
    bounds = checked_limits(limits, n, states["q0"], states["q1"])
    if T is not None:
        refuse_short(T, np.zeros(R), np.ones((R, 1)))
    if bounds is not None:
        least = np.array([0.0] * R)
        for i in range(R):
            state = {name: value[i] for name, value in states.items()}
            if T is not None and _excess(order, state, T[i : i + 1], bounds)[0] <= ROUNDING:
                continue
            least[i] = _least_duration(order, state, bounds)
            if T is not None:
                raise InvalidValueError(
                    f"duration: with {T[i]:.9g} s the limits are not kept; the least duration "
                    f"that keeps them is {least[i]:.12g} s."
                )
        T = least if T is None else T
    assert T is not None
    c = _coefficients(order, states, T[:, None])
    motion = PiecewisePolynomial(
        np.stack((np.zeros(R), T), axis=-1).reshape(*batch, 1, 2),
        np.moveaxis(c, 0, -2).reshape(*batch, 1, order + 1, n),
    )
    return Trajectory(motion, scalar)


def _coefficients(order: int, states: dict[str, Array], T: Array) -> Array:
    """Powers of the normalised time, shape (order + 1, R, n), from states (R, n) or (n,)."""
    q0, D = states["q0"], states["q1"] - states["q0"]
    v0, v1 = states["v0"] * T, states["v1"] * T
    a0, a1 = states["a0"] * T * T, states["a1"] * T * T
    if order == 3:
        rows = (q0 + 0.0 * T, v0, 3.0 * D - 2.0 * v0 - v1, -2.0 * D + v0 + v1)
    else:
        rows = (
            q0 + 0.0 * T,
            v0,
            0.5 * a0,
            10.0 * D - 6.0 * v0 - 4.0 * v1 - 1.5 * a0 + 0.5 * a1,
            -15.0 * D + 8.0 * v0 + 7.0 * v1 + 1.5 * a0 - a1,
            6.0 * D - 3.0 * (v0 + v1) - 0.5 * a0 + 0.5 * a1,
        )
    return np.stack(rows)


def _excess(order: int, state: dict[str, Array], T: Array, limits: MotionLimits) -> Array:
    """By how much limits are exceeded at best and worst, relative, for durations (G,)."""
    c = np.moveaxis(_coefficients(order, state, T[:, None]), 0, -2)[:, None]
    motion = PiecewisePolynomial(np.stack((np.zeros_like(T), T), axis=-1)[:, None], c)
    worst = np.full(T.shape, -np.inf)
    for k, (least, most) in enumerate(
        (
            (limits.lower, limits.upper),
            (limits.velocity_lower, limits.velocity),
            (limits.acceleration_lower, limits.acceleration),
            (-limits.jerk, limits.jerk),
        )
    ):
        low, high = motion.extremes(k)
        size = np.maximum(np.abs(least), np.abs(most))
        size = np.where(np.isfinite(size), np.maximum(size, 1e-9), 1.0)
        over = np.maximum((high - most) / size, (least - low) / size)
        worst = np.maximum(worst, over.max(axis=-1))
    return worst


def _least_duration(order: int, state: dict[str, Array], limits: MotionLimits) -> float:
    """Least duration with which the polynomials keep the limits.

    The durations that do need not form one interval, so they are looked for on a grid of times,
    in which every dip of the excess is followed to its bottom, before the least is refined.
    """
    D = np.abs(state["q1"] - state["q0"])
    v = np.maximum(np.abs(state["v0"]), np.abs(state["v1"]))
    a = np.maximum(np.abs(state["a0"]), np.abs(state["a1"]))
    V = np.minimum(limits.velocity, -limits.velocity_lower)
    A = np.minimum(limits.acceleration, -limits.acceleration_lower)
    with np.errstate(divide="ignore", invalid="ignore"):
        scales = np.concatenate(
            (D / V, np.sqrt(D / A), np.cbrt(D / limits.jerk), v / A, np.sqrt(v / limits.jerk),
             a / limits.jerk, D / v, np.sqrt(D / a), v / a)
        )  # fmt: skip
    scales = scales[np.isfinite(scales) & (scales > 0.0)]
    if scales.size == 0:
        return 0.0 if not D.any() else 1.0
    grid = np.geomspace(scales.min() / 30.0, scales.max() * 30.0, 600)
    excess = _excess(order, state, grid, limits)
    for k in range(1, grid.size - 1):
        if excess[k] > 0.0 and excess[k] <= excess[k - 1] and excess[k] <= excess[k + 1]:
            T, bottom = _bottom(order, state, limits, grid[k - 1], grid[k + 1])
            if bottom <= 0.0:
                grid, excess = np.insert(grid, k, T), np.insert(excess, k, bottom)
                break
        elif excess[k] <= 0.0:
            break
    kept = excess <= 0.0
    if not kept.any():
        T = float(grid[excess.argmin()])
        raise InvalidValueError(
            "limits: no duration keeps the limits with these states at the ends; the nearest to "
            f"it, {T:.6g} s, exceeds one by {100.0 * float(excess.min()):.3g} %."
        )
    k = int(kept.argmax())
    if k == 0:
        return float(grid[0])
    below, T = float(grid[k - 1]), float(grid[k])
    while T - below > 1e-15 * T:
        trials = np.linspace(below, T, 18)[1:-1]
        kept = _excess(order, state, trials, limits) <= 0.0
        k = int(kept.argmax()) if kept.any() else len(trials)
        new_T = T if k == len(trials) else float(trials[k])
        below = float(trials[k - 1]) if k else below
        if new_T == T and k != len(trials):
            break
        T = new_T
        if np.nextafter(below, T) >= T:
            break
    return T


def _bottom(
    order: int, state: dict[str, Array], limits: MotionLimits, low: float, high: float
) -> tuple[float, float]:
    """Duration of least excess between two durations."""
    T, best = low, np.inf
    for _ in range(12):
        trials = np.linspace(low, high, 17)
        excess = _excess(order, state, trials, limits)
        k = int(excess.argmin())
        T, best = float(trials[k]), float(excess[k])
        low, high = float(trials[max(k - 1, 0)]), float(trials[min(k + 1, 16)])
        if best <= 0.0:
            break
    return T, best
