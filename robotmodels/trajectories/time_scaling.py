"""Least duration of a motion that keeps its profile: windows of the duration at every sample.

Stretched evenly to the duration T, a profile needs the torques ``A / T^2 + B / T + C``: A of
inertia, Coriolis and centrifugal effects, B of viscous friction, C of gravity, offsets and dry
friction (book section 4.4.2.3). Each limit forbids intervals of ``z = 1 / T``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array
from .._choices import as_instance
from .._outcomes import Outcome
from ..errors import InvalidValueError
from ..model import RobotModel, check_model
from .limits import MotionLimits, checked_limits
from .motions import Motion, PiecewisePolynomial, TimedMotion
from .path_limits import PathLimits, at_rest
from .trajectory import TimingResult, Trajectory

_FINE, _SHOWN = 4001, 8  # samples, and which of them have windows
_ZOOM = 41
_ROUNDS = 4
_WORST = 4
"""Samples around which the least duration is refined between samples."""
_MARGIN = 1.0 + 1e-12


class ScalingStatus(Outcome):
    """Outcome of `time_scaled`; fits int8."""

    SCALED = 0, "The duration is the least with which the profile keeps the limits."
    NOT_HELD_STILL = 1, "Gravity exceeds the torques at a sample, in any duration."
    NO_WINDOW = 2, "No duration keeps the limits at all samples."


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ScaledTrajectory(TimingResult):
    """A motion with the least duration that its profile allows.

    Parameters
    ----------
    trajectory, status, explanation : Trajectory or None, ScalingStatus, str
        The motion; outcome and its details.
    fraction : ndarray, shape (N,)
        Samples, as fractions of the duration.
    windows : ndarray, shape (N, 2)
        Least and greatest duration with which each sample keeps the limits, s: of several windows
        that of the shortest, both infinite if there is none.
    """

    trajectory: Trajectory | None
    status: ScalingStatus
    fraction: Array
    windows: Array
    explanation: str = ""


def time_scaled(
    trajectory: Trajectory,
    model: RobotModel,
    torque: ArrayLike | None = None,
    limits: MotionLimits | None = None,
) -> ScaledTrajectory:
    """Uniform time scaling: the least duration with which a motion keeps limits.

    Also called dynamic time scaling. Torques are checked at samples of the profile, and between
    those that decide; velocities, accelerations and jerks everywhere.

    Parameters
    ----------
    trajectory : Trajectory
        The profile, n joints; its own duration does not matter.

    References
    ----------
    Book section 4.4.2.3.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> from robotmodels.trajectories import quintic, time_scaled
    >>> arm = load("ur5e")
    >>> move = quintic([0, -1.5, 1, 0, 0, 0], [1, -0.5, 1, 0, 0, 0], duration=1.0)
    >>> scaled = time_scaled(move, arm)
    >>> scaled.duration < 1.0, scaled.windows.shape
    (True, (501, 2))
    """
    check_model(model)
    motion = as_instance(trajectory, Trajectory, "trajectory").motion
    end = trajectory.duration
    if not end > 0.0:
        raise InvalidValueError("trajectory: it has no duration.")
    problem = PathLimits(trajectory.n, model, limits, torque, True, both_ends=True)
    checked_limits(problem.limits, trajectory.n, *motion.extremes(0))
    bound, least = problem.torque, end * trajectory.check(problem.limits).stretch
    if not np.any(motion.extremes(1)):
        raise InvalidValueError("trajectory: it does not move, so it has no least duration.")
    if not (np.isfinite(bound).any() or least > 0.0):
        raise InvalidValueError("limits, torque: all are infinite, so any duration keeps them.")
    fraction = np.linspace(0.0, 1.0, _FINE)
    parts = torque_parts(problem, motion, fraction)
    fraction, (A, B, C) = fraction[::_SHOWN], (part[::_SHOWN] for part in parts)
    windows = windows_of((A, B, C), bound, least)
    # torques and dry friction have to hold the robot at the ends where it rests
    q, v = motion.derivatives(fraction * end, (0, 1))
    rests = [k for k in (0, -1) if not at_rest(v)[k].any()]
    T = np.inf
    if not problem.not_held(q[rests], str, True):
        T = _least_duration(problem, motion, parts, least)
    if np.isinf(T):
        place = "the fraction {:.4g} of the motion"
        why = problem.not_held(q, lambda i: place.format(fraction[i]), False)
        status = ScalingStatus.NOT_HELD_STILL if why else ScalingStatus.NO_WINDOW
        return ScaledTrajectory(None, status, fraction, windows, why)
    result = Trajectory(stretched(motion, T * _MARGIN), trajectory.scalar)
    return ScaledTrajectory(result, ScalingStatus.SCALED, fraction, windows)


def torque_parts(
    problem: PathLimits, motion: Motion, fraction: Array
) -> tuple[Array, Array, Array]:
    """`PathLimits.parts` at fractions (N,) of a motion, each (N, n)."""
    T = motion.duration
    q, v, a = motion.derivatives(fraction * T, (0, 1, 2))
    return problem.parts(q, v * T, a * T * T)


def windows_of(parts: tuple[Array, Array, Array], bound: Array, least: float) -> Array:
    """Window of the shortest durations above a least one. Shapes: parts (..., n) -> (..., 2)."""
    low, high = _forbidden(parts, bound)
    with np.errstate(divide="ignore"):
        z = np.full((*low.shape[:-1], 1), 1.0 / np.float64(least))
    while True:  # from the quickest down over the intervals that are forbidden
        inside = (low < z) & ((z < high) | (high == np.inf))
        if not inside.any():
            break
        z = np.minimum(z, np.where(inside, low, np.inf).min(axis=-1, keepdims=True))
    slow = np.where((high < z) & (low < high), high, 0.0).max(axis=-1, initial=0.0)
    with np.errstate(divide="ignore"):
        window = np.stack((1.0 / z[..., 0], 1.0 / slow), axis=-1)
    return np.where(z > 0.0, window, np.inf)


def _forbidden(parts: tuple[Array, Array, Array], bound: Array) -> tuple[Array, Array]:
    """Open intervals (..., 4 n) of ``z = 1 / T`` in which a limit is exceeded; some are empty.

    Of ``A z^2 + B z + c > 0`` with ``c = +-C - bound``: outside of the roots, or between them.
    """
    A, B, C = (np.concatenate((x, 0.0 - x), axis=-1) + 0.0 for x in parts)  # no -0.0
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        c = C - np.concatenate((bound, bound))
        square = np.where(np.isfinite(c), B * B - 4.0 * A * c, 0.0)
        far = -0.5 * (B + np.copysign(np.sqrt(np.maximum(square, 0.0)), B))
        roots = np.sort(np.stack((far / A, c / far)), axis=0)
    convex, never = A >= 0.0, (square <= 0.0) & (c <= 0.0)
    first, last = (np.where(square > 0.0, root, np.inf) for root in roots)
    low = np.stack((np.where(convex, 0.0, first), np.where(convex, last, np.inf)), axis=-1)
    high = np.stack((np.where(convex, first, last), np.full(c.shape, np.inf)), axis=-1)
    low[never], high[never] = np.inf, 0.0
    low = np.maximum(low, 0.0)
    shape = (*c.shape[:-1], -1)
    return low.reshape(shape), high.reshape(shape)


def _least_duration(
    problem: PathLimits, motion: Motion, parts: tuple[Array, Array, Array], least: float
) -> float:
    """Least duration that keeps the limits at all samples, and between those that decide."""
    fraction, every, bound = np.linspace(0.0, 1.0, _FINE), [parts], problem.torque
    latest = windows_of(parts, bound, least)[:, 0]
    for k in np.argsort(-latest, kind="stable")[:_WORST]:
        low, high = fraction[max(k - 1, 0)], fraction[min(k + 1, _FINE - 1)]
        for _ in range(_ROUNDS):
            fine = np.linspace(low, high, _ZOOM)
            every.append(torque_parts(problem, motion, fine))
            i = int(windows_of(every[-1], bound, least)[:, 0].argmax())
            low, high = fine[max(i - 1, 0)], fine[min(i + 1, _ZOOM - 1)]
    A, B, C = (np.concatenate(rows).reshape(-1) for rows in zip(*every, strict=True))
    # all samples at once, as limits of one joint each
    least = max(least, float(latest[np.isfinite(latest)].max(initial=0.0)))
    return float(windows_of((A, B, C), np.resize(bound, A.size), least)[0])


def stretched(motion: Motion, duration: float) -> Motion:
    """The same profile in another duration."""
    factor = duration / motion.duration
    if isinstance(motion, PiecewisePolynomial):
        lengths = motion.lengths * factor
        return PiecewisePolynomial(motion.breaks * factor, motion.coefficients, lengths)
    if isinstance(motion, TimedMotion):
        return TimedMotion(motion.path, stretched(motion.law, duration))  # type: ignore[arg-type]
    law = PiecewisePolynomial([[0.0, duration]], [[[0.0], [motion.duration]]])  # type: ignore[arg-type]
    return TimedMotion(motion, law)
