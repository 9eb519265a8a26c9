"""Motions of constant jerk by phases, the quickest under limits of jerk, between any two states.

From rest to rest the closed form of `laws` serves, other states go through ruckig.
"""

from __future__ import annotations

from typing import Any

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
    limits : MotionLimits
        All but that of jerk may be infinite. Where an end moves, the smaller limit of jerk counts
        both ways.

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
    how = chosen(Synchronisation, synchronisation, "synchronisation")
    given, scalar = joint_vectors(q0=q0, q1=q1, v0=v0, v1=v1, a0=a0, a1=a1)
    rates = np.stack([given[name] for name in ("v0", "a0", "v1", "a1")])
    if not rates.any():
        return law_motion(TimeLaw.JERK_LIMITED, given, scalar, duration, limits, how)
    T, bounds = checked_request(given, duration, limits)
    assert bounds is not None
    way = given["q1"] - given["q0"]
    states = np.stack((0.0 * way, *rates[:2], way, *rates[2:]))
    if how is Synchronisation.COORDINATED:
        breaks, c, lengths = _on_line(states, bounds, T)
    else:
        breaks, c, lengths = _of_joints(states, bounds, T, how is Synchronisation.INDEPENDENT)
    c[:, 0] += given["q0"]
    motion = PiecewisePolynomial(breaks, c, lengths)
    if np.isinf([bounds.lower, bounds.upper]).all():
        return Trajectory(motion, scalar)
    low, high = motion.extremes(0)
    outside = (low < bounds.lower - 1e-9) | (high > bounds.upper + 1e-9)
    if outside.any():
        j = int(outside.argmax())
        raise InvalidValueError(
            f"limits: between these states joint {j + 1} moves from {low[j]:.6g} to {high[j]:.6g}, "
            "outside its limits; give slower states at the ends."
        )
    return Trajectory(motion, scalar)


# Below, states (6, k) are position, velocity, acceleration at the start, then at the end, and
# limits (5, k) are velocity, least velocity, acceleration, least acceleration, jerk.


def _on_line(states: Array, limits: MotionLimits, T: float | None) -> Any:
    """Coordinated joints: one coordinate along their common direction."""
    size = np.abs(states).max(axis=-1)
    u = states[3] if size[3] > 0.0 else states[int((size > 0.0).argmax())]
    u = u / np.abs(u).max()
    along = states @ u / (u @ u)
    if (np.abs(states - along[:, None] * u).max(axis=-1) > 1e-9 * size).any():
        raise InvalidValueError(
            "The velocities and accelerations at the ends are not along the line from q0 to q1, "
            "so the joints cannot stay on it; pass synchronisation=Synchronisation.SAME_TIME."
        )
    V, A, B, J, K, back = limits_along(limits, u)
    box = np.array([[V], [-back], [A], [-B], [min(J, K)]])
    breaks, c, lengths = _by_ruckig(along[:, None], box, T, False)
    return breaks, c * u, lengths


def _of_joints(states: Array, limits: MotionLimits, T: float | None, alone: bool) -> Any:
    """Joints that have only their time in common, or that wait where they arrive."""
    if alone and states[4:].any():
        raise InvalidValueError(
            "Independent joints wait where they arrive, so v1 and a1 must be 0; pass "
            "synchronisation=Synchronisation.SAME_TIME."
        )
    n, moves = states.shape[1], states.any(axis=0)
    box = [limits.velocity, limits.velocity_lower, limits.acceleration, limits.acceleration_lower]
    box = np.stack((*box, np.minimum(limits.jerk, -limits.jerk_lower)))
    breaks, c = np.zeros((n, _PHASES + 2)), np.zeros((_PHASES + 1, 4, n))
    lengths = np.zeros((n, _PHASES + 1))
    found = _by_ruckig(states[:, moves], box[:, moves], T, alone and T is None)
    breaks[moves], c[..., moves], lengths[moves] = found
    breaks[~moves, 1:] = lengths[~moves, 0] = breaks.max()
    return breaks, c, lengths


def _by_ruckig(states: Array, box: Array, T: float | None, waits: bool) -> Any:
    """Breaks (k, K + 1), coefficients (K, 4, k) and lengths (k, K) of k joints."""
    import ruckig

    from ..kernels.jerk_phases import polished_phases

    _refuse_states(states, box)
    k = states.shape[1]
    s, unit = _units(states, box)
    scales = s * unit ** -np.arange(4.0)[:, None]
    scaled = np.concatenate((states / scales[[0, 1, 2, 0, 1, 2]], box / scales[[1, 1, 2, 2, 3]]))
    joints, found, common = [], [ruckig.Trajectory(1) for _ in range(k)], T
    for column in scaled.T.tolist():
        joints.append(ruckig.InputParameter(1))
        for name, value in zip(_GIVEN, column, strict=True):
            setattr(joints[-1], name, [value])
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
                    least = least_shown(_by_ruckig(states, box, None, waits)[0].max())
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
    # with a given duration ruckig meets positions to 1e-8 only
    polished_phases(h, jerk, scaled[:3].T.copy(), scaled[3:6].T.copy(), polished, phases)
    breaks, lengths = np.zeros((k, _PHASES + 2)), np.zeros((k, _PHASES + 1))
    lengths[:, :-1] = polished * unit[:, None]
    breaks[:, 1:-1] = lengths[:, :-1].cumsum(axis=-1)
    c = np.zeros((_PHASES + 1, 4, k))
    c[:-1], c[-1, 0] = phases.transpose(1, 2, 0) * s, states[3]
    breaks[:, -1] = breaks.max() if T is None else T
    if waits:
        lengths[:, -1] = breaks[:, -1] - breaks[:, -2]
    else:  # all joints end together, to the last digit
        late = breaks[:, :-1] >= breaks[:, -2:-1]
        breaks[:, :-1] = np.where(late, breaks[:, -1:], breaks[:, :-1])
    return breaks, c, lengths


def _units(states: Array, box: Array) -> tuple[Array, Array]:
    """Units of length and of time (k,): powers of two, numbers near 1 for ruckig."""
    v, a = (np.abs(states[[i, i + 3]]).max(axis=0) for i in (1, 2))
    V, A, J = np.minimum(box[0], -box[1]), np.minimum(box[2], -box[3]), box[4]
    ends = a / J + v / A + np.sqrt(v / J)  # until they have come to rest
    size = np.abs(states[3]) + v * ends + a * ends * ends
    longest = ends + size / V + np.sqrt(size / A) + np.cbrt(size / J)
    s, unit = (np.exp2(np.round(np.log2(np.where(x > 0.0, x, 1.0)))) for x in (size, longest))
    return s, unit


def _refuse_states(states: Array, box: Array) -> None:
    """States at the ends that no motion within the limits has."""
    if np.isinf(box[4]).any():
        raise InvalidValueError("limits: JERK_LIMITED needs a limit of jerk.")
    if not box[::2].all():
        raise InvalidValueError("limits: a limit of a joint that has to move is 0.")
    v, a = states[[1, 4]], states[[2, 5]]
    # the velocity after the acceleration is taken away as fast as may be, forth or back
    after = v + [[1.0], [-1.0]] * a * np.abs(a) / (2.0 * box[4])
    values = {"velocity": np.concatenate((v, after)), "acceleration": a}
    for (what, need), upper, lower in zip(values.items(), box[:3:2], box[1:4:2], strict=True):
        bad = need[(need > upper * (1.0 + 1e-12)) | (need < lower * (1.0 + 1e-12))]
        if bad.size:
            raise InvalidValueError(
                f"limits: the states at the ends need a {what} of {bad[0]:.9g}; the least limit "
                f"that will do is {least_shown(abs(bad[0]), 9)}."
            )
