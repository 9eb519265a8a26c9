"""Time-optimal motion along a given path under limits of velocity, acceleration and torque."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, as_count, as_number
from .._outcomes import Outcome
from ..errors import InvalidValueError
from ..friction import Friction
from ..model import RobotModel
from .limits import MotionLimits, checked_limits
from .motions import Motion, PiecewisePolynomial, TimedMotion
from .path_limits import Passes, PathLimits, Rows, path_of, toward_ends
from .pose_trajectory import PoseTrajectory
from .rate_limits import rate_limited
from .trajectory import TimingResult, Trajectory

_BETWEEN = 1.02  # largest share of a torque between points that is not reported
_INSIDE = np.array([0.01, 0.15, 0.3, 0.5, 0.7, 0.85, 0.99])  # of the time of an interval
_PLACES = np.linspace(0.1, 0.9, 9)  # in an interval: where velocities are looked at
_BESIDE = np.array([-0.02, -0.001, 0.001, 0.02])
_HELD = 5e-4  # of a torque: greatest excess between points with limits at both ends
_FASTER = 2e-5  # of a squared rate: greatest excess of velocities between points
_ROUNDS = 12
_ROUNDING = 1e-7  # of the duration, divided by the number of intervals: least gap


class TimingStatus(Outcome):
    """Outcome of `time_optimal`; fits int8."""

    OPTIMAL = 0, "The motion is the quickest along the path."
    NOT_HELD_STILL = 1, "Gravity exceeds the torques."
    NOT_CONTROLLABLE = 2, "No motion follows the path to its end within the limits."
    PATH_NOT_SMOOTH = 3, "The path has a kink, where every motion has to stop."


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class TimedPath(TimingResult):
    """The quickest motion along a path, and the active limits.

    Parameters
    ----------
    trajectory, status : Trajectory or None, TimingStatus
        The motion, whose parameter has a constant acceleration in each interval; outcome.
    parameter, rate : ndarray, shape (N,)
        Path parameter s on the grid, and its rate, per s: the path's own, or its length in joint
        space where its own timing rests or jumps, or comes from functions.
    maximum_rate : ndarray, shape (N,)
        Largest rate that the limits allow at each point alone: the maximum velocity curve.
    active : ndarray of str, shape (N,)
        The limit that binds from each point on, such as ``"torque of joint 2"``; ``"rate"`` where
        a limit of jerk or of the rate of a torque does; empty at changes between limits.
    grid_gap : float
        Relative difference from the duration on half as many intervals, an estimate of the error.
    explanation : str
        Details of the status; where torques exceed their limits between the points of the grid.
    """

    trajectory: Trajectory | None
    status: TimingStatus
    parameter: Array
    rate: Array
    maximum_rate: Array
    active: NDArray[np.str_]
    grid_gap: float = np.inf
    explanation: str = field(default="")


def time_optimal(
    path: Trajectory | PoseTrajectory,
    limits: MotionLimits | None,
    model: RobotModel | None = None,
    torque: ArrayLike | None = None,
    torque_rate: ArrayLike | None = None,
    friction: bool | Friction = True,
    points: int = 200,
    start_rate: float = 0.0,
    end_rate: float = 0.0,
    *,
    both_ends: bool = False,
) -> TimedPath:
    """Time-optimal path parametrisation: the quickest motion along a path.

    Also called TOPP, TOPP-RA: reachability analysis of a path whose own timing is dropped.
    Accelerations are limited at both ends of every interval of a grid, torques at its start
    (collocation); `TimedPath.reason` lists where torques between the points exceed their limits by
    more than 2 %. With ``both_ends`` they are limited at both ends and, by narrower limits where
    needed, between them to 1.001, but for moments where dry friction changes its sign. Velocities
    are limited at nine places between the points too, on smooth paths to some parts in ten
    thousand; accelerations may exceed their limits there by some parts in a thousand. Where a path
    turns sharply within one interval both may exceed them by far: take more points.

    Parameters
    ----------
    path : Trajectory or PoseTrajectory
        n joints, continuous in direction, or poses (which need ``model``, see `joint_path`).
    limits : MotionLimits
        Of velocity, acceleration and position; a limit of jerk is treated as ``torque_rate``.
    torque_rate : array_like, shape () or (n,), optional
        Greatest rates of the torques, N m/s or N/s, without jumps of dry friction. The motion is
        then a local optimum that keeps them within 1 %.
    friction : bool or Friction
        Whether Fv and Fc of the drives count; or a friction model that acts besides them.
    points : int
        Number of intervals of the grid.
    start_rate, end_rate : float
        Rate of the path's own parameter at the ends, not negative.

    References
    ----------
    Book sections 4.4.1.1 and 4.5.1.2. H. Pham and Q.-C. Pham, A new approach to time-optimal
    path parameterization based on reachability analysis, IEEE T-RO 34, 2018.

    Examples
    --------
    >>> from robotmodels.trajectories import MotionLimits, linear, time_optimal
    >>> line = linear([0.0, 0.0], [1.0, 0.5], duration=1.0)
    >>> timed = time_optimal(line, MotionLimits(velocity=1.0, acceleration=2.0))
    >>> round(timed.duration, 6), str(timed.active[100])  # D / v + v / a
    (1.5, 'velocity of joint 1')
    """
    points = as_count(points, "points", 2)
    first, last = (
        as_number(r, k, least=0.0, below=1e150)
        for r, k in ((start_rate, "start_rate"), (end_rate, "end_rate"))
    )
    motion, scalar = path_of(path, model, points)
    n = path.n if isinstance(path, Trajectory) else (0 if model is None else model.n)
    problem = PathLimits(n, model, limits, torque, friction, both_ends, torque_rate)
    if both_ends and not problem.loaded.size:
        raise InvalidValueError("both_ends: there are no limits of torque; give torque=.")
    if isinstance(motion, str):
        return _without(TimingStatus.PATH_NOT_SMOOTH, motion)
    own, rated = motion is getattr(path, "motion", None), bool(np.isfinite(problem.rates).any())
    s = np.linspace(0.0, 1.0, points + 1) if own and not rated else toward_ends(points)
    s = motion.duration * s
    q, rate, bend = motion.derivatives(s, (0, 1, 2))
    checked_limits(problem.limits, n, q)
    ends = (first, last)
    if isinstance(path, Trajectory) and not own:  # rates of the length
        (speed,) = path.motion.derivatives(np.array([0.0, path.duration]), (1,))
        ends = (first * float(np.linalg.norm(speed[0])), last * float(np.linalg.norm(speed[1])))
    rests = [k for k, r in ((0, first), (points, last)) if r == 0.0]
    found = problem.not_held(q[rests], lambda i: f"s = {s[rests[i]]:.6g}", True)
    if found:
        return _without(TimingStatus.NOT_HELD_STILL, found)
    rows = problem.rows(q, rate, bend)
    passes = problem.passes(s, q, rate, bend, ends, rows)
    if passes.failed >= 0 or np.isinf(passes.duration):
        found = problem.not_held(q, lambda i: f"s = {s[i]:.6g}", False)
        if found:
            return _without(TimingStatus.NOT_HELD_STILL, found)
        return _without(TimingStatus.NOT_CONTROLLABLE, _where(passes, s, ends))
    half = np.append(np.arange(0, points, 2), points)
    coarse = Rows(*(part[half] for part in rows[:4]), still=rows.still)
    gap = problem.passes(s[half], q[half], rate[half], bend[half], ends, coarse).duration
    gap = abs(gap - passes.duration) / passes.duration + _ROUNDING / points
    x = passes.found[:, 0]
    places = s[:-1, None] + np.diff(s)[:, None] * _PLACES
    top = problem.top(motion.derivatives(places.reshape(-1), (1,))[0]).reshape(places.shape)
    for _ in range(_ROUNDS):
        # where velocities inside an interval exceed their limits, those at its ends are lower
        over = ((x[:-1, None] + np.diff(x)[:, None] * _PLACES) / top).max(axis=1)
        if not over.max() > 1.0 + _FASTER:
            break
        for part, y in ((rows.top[:-1], x[:-1]), (rows.top[1:], x[1:])):
            np.minimum(part, y / np.maximum(over, 1.0), out=part, where=y > 0.0)
        then = problem.passes(s, q, rate, bend, ends, rows)
        if then.failed >= 0 or np.isinf(then.duration):
            break
        passes, x = then, then.found[:, 0]
    if not x.max() < 1e200:
        raise InvalidValueError(
            f"limits: nothing limits the motion at s = {s[x.argmax()]:.6g}, so the time would be "
            "zero there; give limits of velocity and acceleration of every joint, or of torque."
        )
    law, slowed = law_of(s, x), np.zeros(x.shape, np.bool_)
    if rated:
        slower = rate_limited(problem, s, q, rate, rows, x)
        if slower is None:
            return _without(
                TimingStatus.NOT_CONTROLLABLE,
                "No motion was found that keeps the limits of jerk or of the rates of torques.",
            )
        slowed = slower[0] < x * (1.0 - 1e-3)
        x, law = slower
    use = _uses(problem, motion, law, both_ends)
    tight = np.zeros((2, points, problem.scale.size))
    for _ in range(_ROUNDS if both_ends and not rated else 0):
        over = np.stack((-1.0 - use.min(axis=1), use.max(axis=1) - 1.0))
        if not over.max(initial=0.0) > _HELD:
            break
        # where torques inside an interval exceed their limits, those at its ends are narrower
        tight[..., problem.acceleration.size :] += 1.1 * np.maximum(over[..., problem.loaded], 0.0)
        then = problem.passes(s, q, rate, bend, ends, rows, tight=tight)
        if then.failed >= 0 or np.isinf(then.duration):
            break
        passes, x = then, then.found[:, 0]
        law = law_of(s, x)
        use = _uses(problem, motion, law, both_ends)
    code = passes.found[:, 5].astype(int)
    velocity = code == problem.scale.size
    if velocity.any():
        with np.errstate(divide="ignore"):
            spare = np.where(rate > 0.0, problem.limits.velocity, -problem.limits.velocity_lower)
            code[velocity] += (spare / np.abs(rate)).argmin(axis=1)[velocity]
    active = np.where(slowed, "rate", problem.names[code])
    speed, most = (np.sqrt(np.maximum(y, 0.0)) for y in (x, passes.found[:, 4]))
    trajectory, why = Trajectory(TimedMotion(motion, law), scalar), _beyond(use, s, both_ends)
    return TimedPath(trajectory, TimingStatus.OPTIMAL, s, speed, most, active, gap, why)


def _uses(problem: PathLimits, motion: Motion, law: PiecewisePolynomial, both_ends: bool) -> Array:
    """Torques (N, P, n) at places inside the intervals, over their limits."""
    N = law.lengths.size
    if not problem.loaded.size:
        return np.zeros((N, 1, problem.n))
    timed, places = TimedMotion(motion, law), np.tile(_INSIDE[:: 1 if both_ends else 2], (N, 1))
    if problem.drives is not None or problem.friction:  # beside turning points, where it jumps
        (v,) = timed.derivatives(law.breaks[0], (1,))
        turns = v[1:] * v[:-1] < 0.0
        at = np.where(turns, v[:-1] / np.where(turns, v[:-1] - v[1:], 1.0), 0.0).max(axis=1)
        places = np.hstack((places, np.clip(at[:, None] + _BESIDE, 0.0, 1.0 - 1e-9)))
    times = (law.breaks[0, :-1, None] + law.lengths[0][:, None] * places).reshape(-1)
    tau = problem.torques(*timed.derivatives(times, (0, 1, 2)))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.nan_to_num(tau / problem.torque, nan=0.0).reshape(N, -1, problem.n)


def _beyond(use: Array, s: Array, both_ends: bool) -> str:
    """Sentence on torques that exceed their limits inside of intervals; empty if none do."""
    size = np.abs(use).max(axis=1, initial=0.0)
    if not size.max(initial=0.0) > _BETWEEN:
        return ""
    i, j = np.unravel_index(int(size.argmax()), size.shape)
    return (
        f"The motion is the quickest on this grid, but between its points the torque of joint "
        f"{j + 1} reaches {size[i, j]:.3g} times its limit at s = {s[i]:.6g} to {s[i + 1]:.6g}. "
        f"Take more points{'' if both_ends else ', or both_ends=True'}."
    )


def law_of(s: Array, x: Array) -> PiecewisePolynomial:
    """Path parameter over time whose squared rates x are linear between points s (N + 1,)."""
    rate = np.sqrt(np.maximum(x, 0.0))
    step = np.diff(s)
    h = 2.0 * step / (rate[1:] + rate[:-1])
    c = np.stack((s[:-1], rate[:-1] * h, 0.5 * (rate[1:] - rate[:-1]) * h), axis=-1)
    times = np.concatenate(((0.0,), np.cumsum(h)))
    return PiecewisePolynomial(times[None], c[..., None], h[None])


def _without(status: TimingStatus, why: str) -> TimedPath:
    none = np.empty(0)
    return TimedPath(None, status, none, none, none, np.empty(0, str), np.inf, why)


def _where(passes: Passes, s: Array, ends: tuple[float, float]) -> str:
    """Sentence on the reason why the end is not reached."""
    i, rate = passes.failed, passes.found[:, 0]
    if i < 0:
        i = int(((rate[1:] <= 0.0) & (rate[:-1] <= 0.0)).argmax())
        return f"The limits let the motion stop at s = {s[i]:.6g}, with no way on."
    if i == len(s) - 1:
        low, high = 0.0, float(np.sqrt(passes.rows.top[-1]))
    else:
        low, high = np.sqrt(np.maximum(passes.found[i, 2:4], 0.0))
    name, given = ("end_rate", ends[1]) if i else ("start_rate", ends[0])
    if i in (0, len(s) - 1) and low <= high:
        return f"{name} {given:.6g} at s = {s[i]:.6g}: the limits allow {low:.6g} to {high:.6g}."
    return f"No rate at s = {s[i]:.6g} lets the rest of the path be followed within the limits."
