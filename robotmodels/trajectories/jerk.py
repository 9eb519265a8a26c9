"""Motions of constant jerk by phases, the quickest under limits of jerk, between any two states.

From rest to rest, and on the straight line of coordinated joints, the closed form of `laws` or a
single joint's solution serves. Other states go through ruckig (Berscheid and Kroeger, 2021), of
which only the phases of its profiles are taken.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array
from .._choices import chosen
from ..errors import InvalidValueError
from .checks import (
    ROUNDING,
    checked_limits,
    given_durations,
    joint_vectors,
    limits_along,
    refuse_extremes,
)
from .laws import TimeLaw
from .limits import MotionLimits
from .number_text import least_shown
from .piecewise import PiecewisePolynomial
from .point_to_point import Synchronisation, along_line
from .trajectory import Trajectory

_PHASES = 9  # two that bring a start back inside the limits, and seven
_STATES = ("q0", "q1", "v0", "v1", "a0", "a1")


def jerk_limited(
    q0: ArrayLike,
    q1: ArrayLike,
    duration: ArrayLike | None = None,
    limits: MotionLimits | None = None,
    v0: ArrayLike = 0.0,
    v1: ArrayLike = 0.0,
    a0: ArrayLike = 0.0,
    a1: ArrayLike = 0.0,
    synchronisation: Synchronisation | str = Synchronisation.COORDINATED,
) -> Trajectory:
    """The quickest motion under limits of velocity, acceleration and jerk, between any states.

    Also called double S, seven-phase profile, online trajectory generation. Coordinated joints
    stay on the straight line between the postures, which states at the ends must lie along;
    joints that share the time only may start and end in any state.

    Parameters
    ----------
    q0, q1 : array_like, shape () or (..., n)
        Positions at the ends, rad or m; leading axes are motions of their own.
    duration : array_like, shape () or (...), optional
        Seconds; default the least.
    limits : MotionLimits
        Of velocity, acceleration and jerk, which may be asymmetric; all but that of jerk may be
        infinite. Where a state at an end moves, ruckig keeps the smaller limit of jerk both ways:
        only from rest to rest is the motion then the quickest.
    v0, v1, a0, a1 : array_like, shape () or (..., n)
        Velocities and accelerations at the ends, rad or m, per s and s^2.
    synchronisation : Synchronisation or str
        How the joints are kept in step; a member or its name.

    Returns
    -------
    Trajectory
        Of n joints, or scalar.

    Raises
    ------
    ShapeError, InvalidValueError
        Vectors that do not fit, NaN; no limit of jerk; states that the limits do not allow, or
        not along the line of coordinated joints; a duration that cannot be had, with the least
        that can; a limit of zero for a joint that has to move.

    References
    ----------
    L. Berscheid, T. Kroeger, Jerk-limited real-time trajectory generation with arbitrary target
    states, Robotics: Science and Systems, 2021.

    Examples
    --------
    >>> limits = MotionLimits(velocity=1.0, acceleration=1.0, jerk=2.0)
    >>> jerk_limited([0.0, 0.0], [2.0, 1.0], limits=limits).duration
    3.50...
    >>> move = jerk_limited([0.0, 0.0], [2.0, 1.0], limits=limits, v0=[0.0, 0.5],
    ...                     synchronisation=Synchronisation.SAME_TIME)
    >>> move.duration, move.v(0.0)
    (3.50..., array([0. , 0.5]))
    """
    if limits is None:
        raise InvalidValueError("limits: JERK_LIMITED has no shape without limits; give limits.")
    synchronisation = chosen(Synchronisation, synchronisation, "synchronisation")
    states, batch, scalar = joint_vectors(q0=q0, q1=q1, v0=v0, v1=v1, a0=a0, a1=a1)
    R, n = states["q0"].shape
    if not any(states[name].any() for name in _STATES[2:]):
        start, end = (states[name].reshape(*batch, n) for name in ("q0", "q1"))
        rest = along_line(TimeLaw.JERK_LIMITED, start, end, duration, limits, synchronisation)
        return Trajectory(rest.motion, scalar)
    T = given_durations(duration, batch)
    bounds = checked_limits(limits, n, states["q0"], states["q1"])
    assert bounds is not None
    refuse_extremes(states, bounds)
    breaks, c = np.zeros((R, n, _PHASES + 2)), np.zeros((R, _PHASES + 1, 4, n))
    lengths = np.zeros((R, n, _PHASES + 1))
    for i in range(R):
        state = {name: value[i] for name, value in states.items()}
        asked = None if T is None else float(T[i])
        if synchronisation is Synchronisation.COORDINATED:
            breaks[i], c[i], lengths[i] = _on_line(state, bounds, asked)
        else:
            breaks[i], c[i], lengths[i] = _of_joints(state, bounds, asked, synchronisation)
    motion = PiecewisePolynomial(
        breaks.reshape(*batch, n, _PHASES + 2),
        c.reshape(*batch, _PHASES + 1, 4, n),
        lengths.reshape(*batch, n, _PHASES + 1),
    )
    moves = Trajectory(motion, scalar)
    if np.isinf(bounds.lower).all() and np.isinf(bounds.upper).all():
        return moves
    low, high = motion.extremes(0)
    outside = (low < bounds.lower - 1e-9) | (high > bounds.upper + 1e-9)
    if outside.any():
        j = int(np.argwhere(outside)[0][-1])
        raise InvalidValueError(
            f"limits: between these states joint {j + 1} swings from {low[..., j].min():.6g} to "
            f"{high[..., j].max():.6g}, outside its limits {bounds.lower[j]:.6g} to "
            f"{bounds.upper[j]:.6g}; give states at the ends that are slower."
        )
    return moves


class _Box(NamedTuple):
    """Limits of the joints that move, each shape (k,)."""

    velocity: Array
    velocity_lower: Array
    acceleration: Array
    acceleration_lower: Array
    jerk: Array


def _on_line(state: dict[str, Array], limits: MotionLimits, T: float | None) -> Any:
    """Coordinated joints: one coordinate along their common direction."""
    D = state["q1"] - state["q0"]
    rows = np.stack((D, *(state[name] for name in _STATES[2:])))
    size = np.abs(rows).max(axis=-1)
    u = rows[int((size > 0.0).argmax())]
    u = u / np.abs(u).max()
    along = rows @ u / (u @ u)
    off = np.abs(rows - along[:, None] * u).max(axis=-1)
    if (off > 1e-9 * size).any():
        raise InvalidValueError(
            "The velocities and accelerations at the ends are not along the line from q0 to q1, "
            "so the joints cannot stay on it; pass synchronisation=Synchronisation.SAME_TIME."
        )
    V, A, B, J, K, back = (float(v[0]) for v in limits_along(limits, u[None, None, :]))
    one = {name: along[k : k + 1] for k, name in enumerate(("q1", *_STATES[2:]))}
    one["q0"] = np.zeros(1)
    box = _Box(*(np.array([v]) for v in (V, -back, A, -B, min(J, K))))
    breaks, c, lengths = _ruckig(one, box, T, Synchronisation.SAME_TIME)
    c = c * u
    c[:, 0] += state["q0"]
    return breaks, c, lengths


def _of_joints(
    state: dict[str, Array], limits: MotionLimits, T: float | None, how: Synchronisation
) -> Any:
    """Joints that have only their time in common."""
    n = state["q0"].size
    if how is Synchronisation.INDEPENDENT and (state["v1"].any() or state["a1"].any()):
        raise InvalidValueError(
            "Independent joints wait where they arrive, so v1 and a1 must be 0; pass "
            "synchronisation=Synchronisation.SAME_TIME."
        )
    D = state["q1"] - state["q0"]
    moves = (D != 0.0) | np.any([state[name] != 0.0 for name in _STATES[2:]], axis=0)
    rows = [
        row[moves]
        for row in (
            limits.velocity, limits.velocity_lower, limits.acceleration,
            limits.acceleration_lower, np.minimum(limits.jerk, -limits.jerk_lower),
        )
    ]  # fmt: skip
    breaks, c = np.zeros((n, _PHASES + 2)), np.zeros((_PHASES + 1, 4, n))
    lengths = np.zeros((n, _PHASES + 1))
    active = {name: value[moves] for name, value in state.items()}
    breaks[moves], c[..., moves], lengths[moves] = _ruckig(active, _Box(*rows), T, how)
    breaks[~moves, 1:] = lengths[~moves, 0] = breaks.max()
    c[:, 0, ~moves] = state["q0"][~moves]
    return breaks, c, lengths


def _ruckig(state: dict[str, Array], box: _Box, T: float | None, how: Synchronisation) -> Any:
    """Breaks (k, K + 1), coefficients (K, 4, k) and lengths (k, K) of k joints."""
    k = state["q0"].size
    _refuse_states(state, box)
    independent = how is Synchronisation.INDEPENDENT and T is None
    found = _phases(state, box, T, independent)
    if isinstance(found, str) and k > 1:
        found = _one_by_one(state, box, T, independent)
    if isinstance(found, str):
        message = f"No motion between these states was found by ruckig: {found}."
        if T is not None:
            breaks, _, _ = _ruckig(state, box, None, how)
            message = f"duration: {message} The least duration is {least_shown(breaks.max())} s."
        raise InvalidValueError(message)
    duration, h, phases = found
    if T is not None and abs(duration - T) > ROUNDING * max(T, duration):
        raise InvalidValueError(
            f"duration: with {T:.9g} s the limits are not kept; the least duration from there on "
            f"with which they are is {least_shown(duration)} s."
        )
    breaks, lengths = np.zeros((k, _PHASES + 2)), np.zeros((k, _PHASES + 1))
    lengths[:, :-1], breaks[:, 1:-1] = h, np.cumsum(h, axis=-1)
    c = np.zeros((_PHASES + 1, 4, k))
    c[:-1], c[-1, 0] = np.moveaxis(phases, 0, -1), state["q1"]
    breaks[:, -1] = breaks.max() if T is None else T
    if independent:
        lengths[:, -1] = breaks[:, -1] - breaks[:, -2]
    else:  # all joints end together, to the last digit
        late = breaks[:, :-1] >= breaks[:, -2:-1]
        breaks[:, :-1] = np.where(late, breaks[:, -1:], breaks[:, :-1])
    return breaks, c, lengths


def _phases(
    state: dict[str, Array], box: _Box, T: float | None, independent: bool
) -> tuple[float, Array, Array] | str:
    """Duration, and durations (k, 9) and coefficients (k, 9, 4) of phases; or what ruckig says."""
    import ruckig

    from ..kernels.jerk_phases import polished_phases

    k = state["q0"].size
    s, unit = _units(state, box)  # metres or radians of each joint, and seconds, to the unit
    v, a = unit / s, unit * unit / s
    start = np.stack((np.zeros(k), state["v0"] * v, state["a0"] * a), axis=-1)
    goal = np.stack(((state["q1"] - state["q0"]) / s, state["v1"] * v, state["a1"] * a), axis=-1)
    given = ruckig.InputParameter(k)
    given.current_position, given.current_velocity, given.current_acceleration = start.T.tolist()
    given.target_position, given.target_velocity, given.target_acceleration = goal.T.tolist()
    given.max_velocity = (box.velocity * v).tolist()
    given.min_velocity = (box.velocity_lower * v).tolist()
    given.max_acceleration = (box.acceleration * a).tolist()
    given.min_acceleration = (box.acceleration_lower * a).tolist()
    given.max_jerk = (box.jerk * a * unit).tolist()
    modes = ruckig.Synchronization
    given.synchronization = modes.No if independent else modes.Time
    if T is not None:
        given.minimum_duration = T / unit
    found = ruckig.Trajectory(k)
    try:
        code = ruckig.Ruckig(k).calculate(given, found).name
    except (ruckig.RuckigError, ValueError) as error:  # or a number for which it has no name
        code = str(error).strip().partition("\n")[0]
    if code not in ("Working", "Finished"):
        return code
    h, jerk = np.empty((k, _PHASES)), np.empty((k, _PHASES))
    brakes = np.empty((k, 1))
    for i, profile in enumerate(found.profiles[0]):
        brake = profile.brake
        h[i], jerk[i], brakes[i] = (*brake.t, *profile.t), (*brake.j, *profile.j), brake.duration
    # phases of a brake that is not used hold what was there before
    used = np.cumsum(h[:, :2], axis=-1) <= brakes * (1.0 + 1e-12)
    h[:, :2] = np.where(used, h[:, :2], 0.0)
    # where ruckig is asked for a time it meets positions to 1e-8 only
    polished, phases = np.empty((k, _PHASES)), np.empty((k, _PHASES, 4))
    polished_phases(h, jerk, start, goal, polished, phases)
    phases *= s[:, None, None]
    phases[..., 0] += state["q0"][:, None]
    return found.duration * unit, polished * unit, phases


def _one_by_one(
    state: dict[str, Array], box: _Box, T: float | None, independent: bool
) -> tuple[float, Array, Array] | str:
    """As `_phases`, each joint in units of its own: for joints that have little in common."""
    joints = [
        ({name: value[i : i + 1] for name, value in state.items()},
         _Box(*(bound[i : i + 1] for bound in box)))
        for i in range(state["q0"].size)
    ]  # fmt: skip
    common = T
    for _ in range(50):
        found = [_phases(own, limits, common, independent) for own, limits in joints]
        for one in found:
            if isinstance(one, str):
                return one
        rows = [one for one in found if not isinstance(one, str)]
        longest = max(duration for duration, _, _ in rows)
        if independent or (common is not None and longest <= common * (1.0 + ROUNDING)):
            h, phases = (np.concatenate(parts) for parts in list(zip(*rows, strict=True))[1:])
            return longest, h, phases
        # one joint cannot take the time of the others: all take the next that it can
        common = longest
    return "no duration that all joints can take"


def _units(state: dict[str, Array], box: _Box) -> tuple[Array, float]:
    """Units of length (k,) and time with which numbers are near to 1: ruckig expects such.

    They are powers of two, so that no digit is lost.
    """
    D = np.abs(state["q1"] - state["q0"])
    v = np.maximum(np.abs(state["v0"]), np.abs(state["v1"]))
    a = np.maximum(np.abs(state["a0"]), np.abs(state["a1"]))
    V = np.minimum(box.velocity, -box.velocity_lower)
    A = np.minimum(box.acceleration, -box.acceleration_lower)
    ends = a / box.jerk  # until the states at the ends have come to rest
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = ends + v / A + np.sqrt(v / box.jerk)
        size = D + v * ends + a * ends * ends
        times = ends + np.where(size > 0.0, size / V + np.sqrt(size / A), 0.0)
    times = times + np.cbrt(size / box.jerk)
    times = times[np.isfinite(times)]
    unit = 2.0 ** np.round(np.log2(times.max(initial=0.0) or 1.0))
    s: Array = np.exp2(np.round(np.log2(np.where(size > 0.0, size, 1.0))))
    return s, float(unit)


def _refuse_states(state: dict[str, Array], box: _Box) -> None:
    """States at the ends that no motion within the limits has."""
    if np.isinf(box.jerk).any():
        raise InvalidValueError("limits: JERK_LIMITED needs a limit of jerk.")
    for name, bound in (("velocity", box.velocity), ("acceleration", box.acceleration),
                        ("jerk", box.jerk)):  # fmt: skip
        if (bound == 0.0).any():
            raise InvalidValueError(
                f"limits: a limit of {name} of a joint that has to move is 0; any other will do."
            )
    slack = 1.0 + 1e-12
    for end, sense in (("0", 1.0), ("1", -1.0)):
        v, a = state["v" + end], state["a" + end]
        # the velocity after the acceleration is taken away as fast as may be, forth or back
        swing = v + sense * a * np.abs(a) / (2.0 * box.jerk)
        high, low = np.maximum(v, swing), np.minimum(v, swing)
        for what, most, least, upper, lower in (
            ("velocity", high, low, box.velocity, box.velocity_lower),
            ("acceleration", a, a, box.acceleration, box.acceleration_lower),
        ):
            bad = (most > upper * slack) | (least < lower * slack)
            if bad.any():
                j = int(bad.argmax())
                need = most[j] if most[j] > upper[j] * slack else least[j]
                raise InvalidValueError(
                    f"limits: v{end} and a{end} need a {what} of {need:.9g}, outside "
                    f"{lower[j]:.9g} to {upper[j]:.9g}; the least limit that will do is "
                    f"{least_shown(abs(need), 9)}."
                )
