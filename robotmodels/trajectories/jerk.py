"""Motions of constant jerk by phases, the quickest under limits of jerk, between any two states.

From rest to rest the closed form of `laws` serves, other states go through ruckig.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array
from .._choices import chosen
from ..errors import InvalidValueError
from .laws import TimeLaw
from .limits import (
    ROUNDING,
    MotionLimits,
    checked_request,
    joint_vectors,
    least_shown,
    limits_along,
)
from .motions import PiecewisePolynomial
from .point_to_point import Synchronisation, law_motion
from .trajectory import Trajectory

_PHASES = 9  # two that bring a start back inside the limits, and seven
_STATES = ("q0", "q1", "v0", "v1", "a0", "a1")
_GIVEN = (
    *("current_position", "current_velocity", "current_acceleration"),
    *("target_position", "target_velocity", "target_acceleration"),
    *("max_velocity", "min_velocity", "max_acceleration", "min_acceleration", "max_jerk"),
)  # as ruckig calls them


def jerk_limited(
    q0: ArrayLike,
    q1: ArrayLike,
    duration: float | None = None,
    limits: MotionLimits | None = None,
    v0: ArrayLike = 0.0,
    v1: ArrayLike = 0.0,
    a0: ArrayLike = 0.0,
    a1: ArrayLike = 0.0,
    synchronisation: Synchronisation | str = Synchronisation.COORDINATED,
) -> Trajectory:
    """The quickest motion under limits of velocity, acceleration and jerk, between any states.

    Also called double S, seven-phase profile, online trajectory generation. Coordinated joints stay
    on the straight line between the postures, along which their states at the ends must be.

    Parameters
    ----------
    q0, q1, v0, v1, a0, a1 : array_like, shape () or (n,)
        Positions, velocities and accelerations at the ends, rad or m, per s and s^2.
    limits : MotionLimits
        All but that of jerk may be infinite. Where an end moves, the smaller limit of jerk counts
        both ways.
    duration, synchronisation
        See the head of the room.

    Returns
    -------
    Trajectory
        Of n joints, or scalar.

    References
    ----------
    L. Berscheid, T. Kroeger, Jerk-limited real-time trajectory generation with arbitrary target
    states, Robotics: Science and Systems, 2021.

    Examples
    --------
    >>> limits = MotionLimits(velocity=1.0, acceleration=1.0, jerk=2.0)
    >>> move = jerk_limited([0.0, 0.0], [2.0, 1.0], limits=limits, v0=[0.0, 0.5],
    ...                     synchronisation=Synchronisation.SAME_TIME)
    >>> move.duration, move.v(0.0)
    (3.50..., array([0. , 0.5]))
    """
    if limits is None:
        raise InvalidValueError("limits: JERK_LIMITED has no shape without limits; give limits.")
    synchronisation = chosen(Synchronisation, synchronisation, "synchronisation")
    states, scalar = joint_vectors(q0=q0, q1=q1, v0=v0, v1=v1, a0=a0, a1=a1)
    if not any(states[name].any() for name in _STATES[2:]):
        law = TimeLaw.JERK_LIMITED
        return law_motion(law, states, scalar, duration, limits, synchronisation)
    T, bounds = checked_request(states, duration, limits)
    assert bounds is not None
    find = _on_line if synchronisation is Synchronisation.COORDINATED else _of_joints
    motion = PiecewisePolynomial(*find(states, bounds, T, synchronisation))
    if np.isinf([bounds.lower, bounds.upper]).all():
        return Trajectory(motion, scalar)
    low, high = motion.extremes(0)
    outside = (low < bounds.lower - 1e-9) | (high > bounds.upper + 1e-9)
    if outside.any():
        j = int(outside.argmax())
        raise InvalidValueError(
            f"limits: between these states joint {j + 1} moves from {low[j]:.6g} to {high[j]:.6g}, "
            f"outside its limits {bounds.lower[j]:.6g} to {bounds.upper[j]:.6g}; give slower "
            "states at the ends."
        )
    return Trajectory(motion, scalar)


class _Box(NamedTuple):
    """Limits of the joints that move, each shape (k,)."""

    velocity: Array
    velocity_lower: Array
    acceleration: Array
    acceleration_lower: Array
    jerk: Array


def _on_line(
    state: dict[str, Array], limits: MotionLimits, T: float | None, how: Synchronisation
) -> Any:
    """Coordinated joints: one coordinate along their common direction."""
    rows = np.stack((state["q1"] - state["q0"], *(state[name] for name in _STATES[2:])))
    size = np.abs(rows).max(axis=-1)
    u = rows[int((size > 0.0).argmax())]
    u = u / np.abs(u).max()
    along = rows @ u / (u @ u)
    if (np.abs(rows - along[:, None] * u).max(axis=-1) > 1e-9 * size).any():
        raise InvalidValueError(
            "The velocities and accelerations at the ends are not along the line from q0 to q1, "
            "so the joints cannot stay on it; pass synchronisation=Synchronisation.SAME_TIME."
        )
    V, A, B, J, K, back = limits_along(limits, u)
    one = dict(zip(("q1", *_STATES[2:]), along[:, None], strict=True)) | {"q0": np.zeros(1)}
    breaks, c, lengths = _by_ruckig(
        one, _Box(*(np.array([x]) for x in (V, -back, A, -B, min(J, K)))), T, how
    )
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
    moves = np.any([state["q1"] != state["q0"], *(state[k] != 0.0 for k in _STATES[2:])], axis=0)
    rows = [getattr(limits, name)[moves] for name in _Box._fields[:4]]
    box = _Box._make((*rows, np.minimum(limits.jerk, -limits.jerk_lower)[moves]))
    breaks, c = np.zeros((n, _PHASES + 2)), np.zeros((_PHASES + 1, 4, n))
    lengths = np.zeros((n, _PHASES + 1))
    active = {name: value[moves] for name, value in state.items()}
    breaks[moves], c[..., moves], lengths[moves] = _by_ruckig(active, box, T, how)
    breaks[~moves, 1:] = lengths[~moves, 0] = breaks.max()
    c[:, 0, ~moves] = state["q0"][~moves]
    return breaks, c, lengths


def _by_ruckig(state: dict[str, Array], box: _Box, T: float | None, how: Synchronisation) -> Any:
    """Breaks (k, K + 1), coefficients (K, 4, k) and lengths (k, K) of k joints."""
    import ruckig

    from ..kernels.jerk_phases import polished_phases

    k = state["q0"].size
    _refuse_states(state, box)
    waits = how is Synchronisation.INDEPENDENT and T is None
    s, unit = _units(state, box)
    scales = s * unit ** -np.arange(4.0)[:, None]
    start = np.stack((np.zeros(k), state["v0"], state["a0"])) / scales[:3]
    goal = np.stack((state["q1"] - state["q0"], state["v1"], state["a1"])) / scales[:3]
    joints = []
    for column in np.concatenate((start, goal, np.stack(box) / scales[[1, 1, 2, 2, 3]])).T.tolist():
        joints.append(ruckig.InputParameter(1))
        for name, value in zip(_GIVEN, column, strict=True):
            setattr(joints[-1], name, [value])
    found, common = [ruckig.Trajectory(1) for _ in joints], T
    for _ in range(50):
        for joint, move, second in zip(joints, found, unit.tolist(), strict=True):
            if common is not None:
                joint.minimum_duration = common / second
            try:
                code = ruckig.Ruckig(1).calculate(joint, move).name
            except (ruckig.RuckigError, ValueError) as error:  # or a number without a name
                code = str(error).strip().partition("\n")[0]
            if code not in ("Working", "Finished"):
                message = f"No motion between these states was found by ruckig: {code}."
                if T is not None:
                    least = least_shown(_by_ruckig(state, box, None, how)[0].max())
                    message = f"duration: {message} The least duration is {least} s."
                raise InvalidValueError(message)
        longest = max(move.duration * second for move, second in zip(found, unit, strict=True))
        if waits or k == 1 or (common is not None and longest <= common * (1.0 + ROUNDING)):
            break
        common = longest  # one joint cannot take the time of the others: all take its next one
    if T is not None and abs(longest - T) > ROUNDING * max(T, longest):
        raise InvalidValueError(
            f"duration: with {T:.9g} s the limits are not kept; the least duration from there on "
            f"with which they are is {least_shown(longest)} s."
        )
    profiles = [move.profiles[0][0] for move in found]
    h, jerk = (
        np.array([[*getattr(x.brake, name), *getattr(x, name)] for x in profiles]) for name in "tj"
    )
    # phases of a brake that is not used hold what was there before
    whole = np.array([[x.brake.duration] for x in profiles])
    h[:, :2] *= h[:, :2].cumsum(axis=-1) <= whole * (1.0 + 1e-12)
    polished, phases = np.empty((k, _PHASES)), np.empty((k, _PHASES, 4))
    # where ruckig is asked for a time it meets positions to 1e-8 only
    polished_phases(h, jerk, start.T.copy(), goal.T.copy(), polished, phases)
    breaks, lengths = np.zeros((k, _PHASES + 2)), np.zeros((k, _PHASES + 1))
    lengths[:, :-1] = polished * unit[:, None]
    breaks[:, 1:-1] = lengths[:, :-1].cumsum(axis=-1)
    c = np.zeros((_PHASES + 1, 4, k))
    c[:-1], c[-1, 0] = phases.transpose(1, 2, 0) * s, state["q1"]
    c[:-1, 0] += state["q0"]
    breaks[:, -1] = breaks.max() if T is None else T
    if waits:
        lengths[:, -1] = breaks[:, -1] - breaks[:, -2]
    else:  # all joints end together, to the last digit
        late = breaks[:, :-1] >= breaks[:, -2:-1]
        breaks[:, :-1] = np.where(late, breaks[:, -1:], breaks[:, :-1])
    return breaks, c, lengths


def _units(state: dict[str, Array], box: _Box) -> tuple[Array, Array]:
    """Units of length and of time (k,): powers of two, numbers near 1 for ruckig."""
    v, a = (np.maximum(np.abs(state[k + "0"]), np.abs(state[k + "1"])) for k in "va")
    V = np.minimum(box.velocity, -box.velocity_lower)
    A = np.minimum(box.acceleration, -box.acceleration_lower)
    ends = a / box.jerk + v / A + np.sqrt(v / box.jerk)  # until they have come to rest
    size = np.abs(state["q1"] - state["q0"]) + v * ends + a * ends * ends
    longest = ends + size / V + np.sqrt(size / A) + np.cbrt(size / box.jerk)
    s, unit = (np.exp2(np.round(np.log2(np.where(x > 0.0, x, 1.0)))) for x in (size, longest))
    return s, unit


def _refuse_states(state: dict[str, Array], box: _Box) -> None:
    """States at the ends that no motion within the limits has."""
    if np.isinf(box.jerk).any():
        raise InvalidValueError("limits: JERK_LIMITED needs a limit of jerk.")
    for name, bound in zip(_Box._fields[::2], box[::2], strict=True):
        if (bound == 0.0).any():
            raise InvalidValueError(
                f"limits: a limit of {name} of a joint that has to move is 0; any other will do."
            )
    slack = 1.0 + 1e-12
    for end, sense in (("0", 1.0), ("1", -1.0)):
        v, a = state["v" + end], state["a" + end]
        # the velocity after the acceleration is taken away as fast as may be, forth or back
        after = v + sense * a * np.abs(a) / (2.0 * box.jerk)
        for what, upper, lower, values in (
            ("velocity", box.velocity, box.velocity_lower, (v, after)),
            ("acceleration", box.acceleration, box.acceleration_lower, (a,)),
        ):
            for value in values:
                bad = (value > upper * slack) | (value < lower * slack)
                if bad.any():
                    j = int(bad.argmax())
                    raise InvalidValueError(
                        f"limits: v{end} and a{end} need a {what} of {value[j]:.9g}, outside "
                        f"{lower[j]:.9g} to {upper[j]:.9g}; the least limit that will do is "
                        f"{least_shown(abs(value[j]), 9)}."
                    )
