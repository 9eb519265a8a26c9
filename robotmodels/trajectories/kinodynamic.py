"""Kinodynamic planning: the best motion between configurations or poses under limits of torque."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, fields
from enum import Enum
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .. import se3
from .._arrays import Array, Value, as_exact, as_number, read_only
from .._choices import chosen
from .._outcomes import Outcome
from ..dynamics import idm
from ..errors import InvalidValueError
from ..geometry import REVOLUTE
from ..igm import igm
from ..kinematics.singular.task import generator_of, whole_number
from ..model import RobotModel, check_model
from ..obstacles import clearance as clearance_of
from ..obstacles.clearance import checked_obstacles
from ..obstacles.shapes import Obstacle
from .candidates import Candidates, Cost, Evaluated, knots_of, spread
from .checks import checked_limits
from .descent import descended
from .limits import MotionLimits
from .path_limits import SLOWEST, PathLimits
from .random_profiles import half_width
from .time_optimal import law_of, time_optimal
from .time_scaling import stretched, time_scaled
from .motions import TimedMotion
from .trajectory import Trajectory

_RATE = 500  # evaluations for each second
_RESTARTS = 3
_LEVELS = (9, 19)  # nodes of the profiles that are improved locally, of every restart
_FINEST = 29  # of the best one
_STEPS = 40
_CHECKED = 10_001
_HOT, _COLD = 0.1, 1e-3  # temperatures, of the cost of the start
_NARROW = 0.1  # of the first steps: the last ones


class Timing(Enum):
    """How a candidate of the planner is timed; the value says how.

    Examples
    --------
    >>> Timing.PROFILE.value
    'its own profile over time, evenly stretched to the least duration'
    """

    OPTIMAL = "the quickest motion along its path"
    PROFILE = "its own profile over time, evenly stretched to the least duration"


class PlanMethod(Enum):
    """How the planner searches; the value says how.

    Examples
    --------
    >>> PlanMethod.DESCENT.value
    'local improvement of the straight path and of random ones'
    """

    ANNEAL = "simulated annealing of the nodes, then local improvement"
    DESCENT = "local improvement of the straight path and of random ones"


class PlanStatus(Outcome):
    """Outcome of `kinodynamic`; fits int8."""

    FOUND = 0, "A motion was found that keeps all limits; a better one may exist."
    NONE_FOUND = 1, "No motion was found that keeps all limits; one may exist."
    ENDS_NOT_HELD = 2, "The torques do not hold the robot at an end."
    ENDS_IN_COLLISION = 3, "The robot is nearer to an obstacle than allowed at an end."


@dataclass(frozen=True, slots=True, eq=False)
class Pose(Value):
    """An end or a via point of a plan given as a pose: the planner chooses the posture.

    Parameters
    ----------
    T : array_like, shape (4, 4)
        World pose of the tool, m.

    Raises
    ------
    ShapeError, NotARotationError
        An array that is no pose.

    Examples
    --------
    >>> Pose(np.eye(4)).T.shape
    (4, 4)
    """

    T: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "T", read_only(as_exact(se3.as_pose(self.T, "T"), (4, 4), "T")))


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Plan(Value):
    """The best motion that the planner found.

    Parameters
    ----------
    trajectory : Trajectory or None
        The motion; None without one.
    status : PlanStatus
        Outcome.
    cost : float
        Its cost, see `Cost`; infinite without one.
    history : ndarray, shape (N, 3)
        Number of the evaluation, cost of the candidate (with a penalty for limits of position and
        clearance that it does not keep; infinite without a timing), least cost so far.
    torque_use : ndarray, shape (n,)
        Greatest torque of each joint over its limit; 0 where it has none.
    restarts : ndarray, shape (R,)
        Least cost of each restart of the search: their spread shows how local it is.
    via_times : ndarray, shape (k,)
        Times at which the via points are met, s.
    explanation : str
        Details of the status.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> from robotmodels.trajectories import MotionLimits, kinodynamic
    >>> plan = kinodynamic(load("ur5e"), np.zeros(6), np.full(6, 0.2), MotionLimits(),
    ...                    torque=[1, 1, 1, 1, 1, 1])
    >>> plan.status.name, plan.trajectory
    ('ENDS_NOT_HELD', None)
    """

    trajectory: Trajectory | None
    status: PlanStatus
    cost: float
    history: Array
    torque_use: Array
    restarts: Array
    via_times: Array
    explanation: str = ""

    def __post_init__(self) -> None:
        for field in fields(self):
            if isinstance(value := getattr(self, field.name), np.ndarray):
                object.__setattr__(self, field.name, read_only(value))

    @property
    def duration(self) -> float:
        """Seconds; NaN without a motion."""
        return np.nan if self.trajectory is None else self.trajectory.duration

    @property
    def evaluations(self) -> int:
        """Number of candidates that were timed."""
        return len(self.history)

    @property
    def spread(self) -> float:
        """Relative difference between the worst and the best restart."""
        return float(np.ptp(self.restarts) / self.restarts.min()) if self.restarts.size else np.nan

    def reason(self) -> str:
        """The status as a sentence, with the end and the joint."""
        return self.explanation or self.status.sentence

    def __repr__(self) -> str:
        lines = [f"<Plan: {self.status.name}, {self.duration:.6g} s, cost {self.cost:.6g}"]
        if self.trajectory is None:
            lines.append(self.reason())
        else:
            use = ", ".join(f"{x:.0%}" for x in self.torque_use)
            lines.append(f"greatest torques {use} of their limits")
        spread = f", spread {self.spread:.2%}" if self.restarts.size else ""
        lines.append(f"{self.evaluations} evaluations, {self.restarts.size} restarts{spread}>")
        return "\n  ".join(lines)


def kinodynamic(
    model: RobotModel,
    q0: ArrayLike | Pose,
    q1: ArrayLike | Pose,
    limits: MotionLimits | None,
    torque: ArrayLike | None = None,
    via: Sequence[ArrayLike | Pose] = (),
    obstacles: Iterable[Obstacle] | Obstacle = (),
    clearance: float = 0.0,
    cost: Cost = Cost(),
    nodes: int = 4,
    method: PlanMethod | str = PlanMethod.ANNEAL,
    timing: Timing | str = Timing.OPTIMAL,
    rng: np.random.Generator | int | None = None,
    seconds: float = 10.0,
    progress: bool | Callable[[int, float], Any] = False,
) -> Plan:
    """Kinodynamic planning: the best motion from rest to rest without a given path.

    Also called optimal motion planning, minimum-time trajectory optimisation. Paths are splines
    through free nodes; simulated annealing varies the nodes, with the exact timing of every path
    (`time_optimal`), from several restarts. The best path of each is then refined to more nodes
    and improved by sequential linear programming. The motion is checked at 10 000 times.

    The search is local in the end: `Plan.restarts` shows its spread.

    Parameters
    ----------
    model : RobotModel
        The robot, n joints, with its drives.
    q0, q1 : array_like, shape (n,), or Pose
        The ends, rad or m. Of a pose the planner chooses the posture.
    limits : MotionLimits
        Of velocity, acceleration and position.
    torque : array_like, shape () or (n,), optional
        Greatest torques of both signs, N m or N; default those of the model's table.
    via : sequence of array_like, shape (n,), or Pose
        Configurations on the way, in this order.
    obstacles : Sphere, Box, Plane, Capsule, or iterable of these
        Bodies that the links avoid, see `robotmodels.obstacles`.
    clearance : float
        Least distance from them, m.
    cost : Cost
        Weights of the duration and of the squared torques.
    nodes : int
        Free configurations of a path in the search.
    method : PlanMethod or str
        ``"anneal"`` or ``"descent"``.
    timing : Timing or str
        ``"optimal"`` times every path exactly; ``"profile"`` takes the nodes as a profile over
        time and stretches it, with the windows of `time_scaled`.
    rng : Generator or int, optional
        Random numbers, or their seed; by default a fixed one.
    seconds : float
        Greatest duration of the search, by the clock. It makes up to 500 evaluations for each second
        and ends early; only if the clock ends it, results with one seed may differ.
    progress : bool or callable
        Called with the number of evaluations and the least cost; True prints both.

    Returns
    -------
    Plan
        The motion, or why there is none.

    Raises
    ------
    ShapeError, InvalidValueError
        Vectors of the wrong length, ends outside of the limits of position, ends or via points
        that coincide, NaN, limits that are all infinite.

    References
    ----------
    Seed book sections 4.4.1 to 4.4.3 and the appendix of chapter 4.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> from robotmodels.trajectories import MotionLimits, kinodynamic
    >>> plan = kinodynamic(load("ur5e"), [0, -1.5, 1, 0, 0, 0], [1, -1, 0.5, 0, 0, 0],
    ...                    MotionLimits(acceleration=50.0), seconds=0.5)
    >>> plan.status.name, bool(plan.torque_use.max() <= 1.001)
    ('FOUND', True)
    """
    check_model(model)
    timing, method = chosen(Timing, timing, "timing"), chosen(PlanMethod, method, "method")
    if not isinstance(cost, Cost):
        raise InvalidValueError(f"cost: expected a Cost, got {type(cost).__name__}.")
    wanted = as_number(clearance, "clearance", least=0.0)
    count, bodies = whole_number(nodes, "nodes", 0), checked_obstacles(obstacles)
    problem = PathLimits(model.n, model, limits, torque, True, both_ends=True)
    search = _Search(as_number(seconds, "seconds", above=0.0), progress)
    given = [q0, *_listed(via), q1]
    postures = [_postures(model, each, k, given, problem) for k, each in enumerate(given)]
    missing = [k for k, each in enumerate(postures) if not len(each)]
    if missing:
        name = _name(missing[0], len(given))
        why = f"No posture reaches the pose {name} within the limits of position."
        return search.without(PlanStatus.NONE_FOUND, why)
    for status, test in (
        (PlanStatus.ENDS_NOT_HELD, _held), (PlanStatus.ENDS_IN_COLLISION, _clear),
    ):  # fmt: skip
        for k in range(len(given)):
            if 0 < k < len(given) - 1 and test is _held:
                continue
            good, why = test(problem, postures[k], bodies, wanted, _name(k, len(given)))
            postures[k] = postures[k][good]
            if not good.any():
                end = k in (0, len(given) - 1)
                return search.without(status if end else PlanStatus.NONE_FOUND, why)
    generator = generator_of(rng)
    optimal = timing is Timing.OPTIMAL
    tasks = []
    for choice in product(*postures):
        stations = np.array(choice)
        at = knots_of(stations, count)
        task = Candidates(problem, stations, at, bodies, wanted, cost, optimal)
        tasks.append((task.evaluated(task.straight()).penalized, len(tasks), task))
    tasks = [task for _, _, task in sorted(tasks)[:_RESTARTS]]
    results = []
    for r in range(_RESTARTS):
        found = _restart(search, tasks[r % len(tasks)], method, generator, r)
        results.append(found)
    return _best(search, results, model, limits, wanted)


class _Search:
    """Counts evaluations, keeps their costs and ends the search."""

    __slots__ = ("allowed", "best", "deadline", "history", "report")

    def __init__(self, seconds: float, progress: bool | Callable[[int, float], Any]) -> None:
        self.deadline = time.monotonic() + seconds
        self.allowed = int(_RATE * seconds) + 1
        self.best = np.inf
        self.history: list[tuple[int, float, float]] = []
        self.report = progress if callable(progress) else (_printed if progress else None)

    def evaluated(self, task: Candidates, free: Array) -> Evaluated | None:
        """What became of a candidate; None when the search is over."""
        if time.monotonic() > self.deadline:
            return None
        found = task.evaluated(free)
        self.best = min(self.best, found.penalized)
        self.history.append((len(self.history) + 1, found.penalized, self.best))
        if self.report is not None and len(self.history) % 50 == 0:
            self.report(len(self.history), self.best)
        return found

    def without(self, status: PlanStatus, why: str) -> Plan:
        """A plan without a motion."""
        none = np.empty(0)
        return Plan(None, status, np.inf, self.rows, none, none, none, why)

    @property
    def rows(self) -> Array:
        """History (N, 3)."""
        return np.array(self.history).reshape(-1, 3)


def _printed(evaluations: int, cost: float) -> None:
    print(f"{evaluations} evaluations, least cost {cost:.6g}")


def _listed(via: Any) -> list[Any]:
    """Via points one by one."""
    if isinstance(via, Pose):
        raise InvalidValueError("via: expected a sequence of configurations or poses, got a Pose.")
    points = list(via)
    if points and np.ndim(points[0]) == 0 and not isinstance(points[0], Pose):
        raise InvalidValueError("via: expected a sequence of configurations, got one; write [q].")
    return points


def _name(k: int, stations: int) -> str:
    return "q0" if k == 0 else "q1" if k == stations - 1 else f"via[{k - 1}]"


def _postures(
    model: RobotModel, given: Any, k: int, every: list[Any], problem: PathLimits
) -> Array:  # fmt: skip
    """Configurations (m, n) of an end or via point, within the limits of position."""
    limits, name = problem.limits, _name(k, len(every))
    if not isinstance(given, Pose):
        q = as_exact(given, (model.n,), name)
        checked_limits(limits, model.n, q[None])
        before = every[k - 1] if k else None
        if before is not None and not isinstance(before, Pose) and np.array_equal(before, q):
            raise InvalidValueError(
                f"{name}: it is the same as {_name(k - 1, len(every))}; leave one of them out."
            )
        return q[None]
    near = next((np.asarray(q, float) for q in every if not isinstance(q, Pose)), None)
    found = igm(model, given.T, near)
    q = found.q[found.valid]
    turn = 2.0 * np.pi * (model.table.sigma[model.table.joint_rows] == REVOLUTE)
    reference = np.clip(np.zeros(model.n) if near is None else near, limits.lower, limits.upper)
    q = q - turn * np.round((q - reference) / np.where(turn > 0.0, turn, 1.0))
    for side in (1.0, -1.0):  # a whole turn back inside
        out = (q > limits.upper) if side > 0.0 else (q < limits.lower)
        q = q - side * turn * out
    return q[((q >= limits.lower) & (q <= limits.upper)).all(axis=1)]


def _held(
    problem: PathLimits, q: Array, bodies: tuple[Obstacle, ...], wanted: float, name: str
) -> tuple[Array, str]:
    """Which configurations (m, n) the torques hold, and a sentence about the first."""
    rest = np.zeros(q.shape)
    load = np.abs(problem.rows(q, rest, rest).held)
    stuck = np.abs(problem.drag(q, np.full(q.shape, SLOWEST)))
    margin = problem.torque * (1.0 + 1e-9) + stuck - load
    j = int(margin[0].argmin())
    return (margin >= 0.0).all(axis=1), (
        f"The torques do not hold the robot at {name}: joint {j + 1} needs {load[0, j]:.6g} and "
        f"has {problem.torque[j]:.6g}, a margin of {margin[0, j]:.4g} (N m or N)."
    )


def _clear(
    problem: PathLimits, q: Array, bodies: tuple[Obstacle, ...], wanted: float, name: str
) -> tuple[Array, str]:
    """Which configurations (m, n) keep the clearance, and a sentence about the first."""
    if not bodies or problem.model is None:
        return np.ones(len(q), np.bool_), ""
    distance = clearance_of(problem.model, q, bodies)
    return distance >= wanted, (
        f"The clearance at {name} is {distance[0]:.4g} m, less than the {wanted:.4g} m asked for."
    )


def _annealed(
    search: _Search, task: Candidates, rng: np.random.Generator, evaluations: int
) -> tuple[Array, Evaluated]:
    """Simulated annealing from the straight path, with steps that shrink with the temperature."""
    free = best = task.straight()
    now = least = task.evaluated(free)
    width = half_width(task.stations.min(axis=0), task.stations.max(axis=0))
    scale = now.penalized if np.isfinite(now.penalized) else 1.0
    for k in range(evaluations):
        cold = k / max(evaluations - 1, 1)
        size = width * _NARROW**cold
        wave = int(rng.geometric(0.5)) if len(free) > 1 else 1
        bump = np.sin(wave * np.pi * task.knots[task.free]) / wave**2
        step = bump[:, None] * rng.normal(0.0, 1.0, free.shape[1])
        trial = free + size * step
        then = search.evaluated(task, trial)
        if then is None:
            break
        worse = then.penalized - now.penalized if np.isfinite(then.penalized) else np.inf
        temperature = scale * _HOT * (_COLD / _HOT) ** cold
        if not np.isfinite(now.penalized) or worse < temperature * rng.exponential():
            free, now = trial, then
        if now.penalized < least.penalized:
            best, least = free, now
            scale = least.penalized
    return best, least


def _restart(
    search: _Search, task: Candidates, method: PlanMethod, rng: np.random.Generator, r: int
) -> tuple[Evaluated, Candidates, Array, Trajectory | None]:
    """One search: cost, profile and its nodes, and the path with the timing that it came from."""
    free = task.straight()
    if method is PlanMethod.ANNEAL:
        free, now = _annealed(search, task, rng, search.allowed // (_RESTARTS + 1))
    else:
        if r:
            width = half_width(task.stations.min(axis=0), task.stations.max(axis=0))
            free = free + width * rng.uniform(-1.0, 1.0, free.shape)
        now = task.evaluated(free)
    if not task.optimal:
        free, now = descended(task, free, 2 * _STEPS, search.evaluated)
        return now, task, free, None
    path, timed, at = _timed(task, free)
    if timed is None:
        return now, task, free, path
    profile, fine, done = timed, task, now
    for nodes in _LEVELS:
        fine = task.finer(spread(at, nodes))
        free = profile.q(fine.knots[fine.free] * profile.duration)
        free, done = descended(fine, free, _STEPS, search.evaluated)
        profile = fine.path(free)
    return done, fine, free, path


def _timed(task: Candidates, free: Array) -> tuple[Trajectory, Trajectory | None, Array]:
    """A path, its quickest motion, and the fractions of time of its stations."""
    path = task.path(free)
    passes = task.limits.passes(task.grid, *task.sampled(free))
    if not np.isfinite(passes.duration):
        return path, None, np.empty(0)
    law = law_of(task.grid, passes.found[:, 0])
    at = np.interp(task.knots[task.fixed], task.grid, law.breaks[0]) / passes.duration
    return path, Trajectory(TimedMotion(path.motion, law)), at


def _best(
    search: _Search, results: list[Any], model: RobotModel, limits: MotionLimits | None,
    wanted: float,
) -> Plan:  # fmt: skip
    """The plan from the results of the restarts, the best of them refined once more."""
    results = sorted(results, key=lambda found: found[0].penalized)
    restarts = np.array([found[0].penalized for found in results])
    for k, (done, task, free, path) in enumerate(results):
        options = []
        if np.isfinite(done.cost) and not task.optimal:
            if path is not None and k == 0:
                fine = task.finer(spread(task.knots[task.fixed], _FINEST))
                start = task.path(free).q(fine.knots[fine.free])
                finer, then = descended(fine, start, _STEPS, search.evaluated)
                if then.penalized < done.penalized:
                    done, task, free = then, fine, finer
            options = _finished(search, task, free, model, limits, path is not None)
        elif path is not None:
            options = [_retimed(task, path, model, limits)]
        options = [o for o in options if o is not None and _short(task, o, wanted) <= 1e-9]
        if options:
            costs = [_cost_of(task, model, option) for option in options]
            i = int(np.argmin([c for c, _ in costs]))
            times = _times_at(options[i], task.stations[1:-1])
            return Plan(
                options[i], PlanStatus.FOUND, costs[i][0], search.rows, costs[i][1], restarts, times
            )
    return search.without(PlanStatus.NONE_FOUND, "")


def _finished(
    search: _Search, task: Candidates, free: Array, model: RobotModel,
    limits: MotionLimits | None, retimed: bool,
) -> list[Trajectory | None]:  # fmt: skip
    """Motions of a profile: stretched to the least duration, and timed anew along its path."""
    for _ in range(4):
        path = task.path(free)
        scaled = time_scaled(path, model, task.limits.torque, limits).trajectory
        if scaled is None:
            break
        short = _short(task, scaled, task.clearance)
        if short <= 0.0:
            break
        task.margin += 1.5 * short + 1e-6
        free, _ = descended(task, free, 8, search.evaluated)
    if scaled is not None and task.cost.torque:
        slow = task.evaluated(free).duration
        if slow > scaled.duration:
            scaled = Trajectory(stretched(scaled.motion, slow))
    return [scaled, _retimed(task, path, model, limits) if retimed else None]


def _retimed(
    task: Candidates, path: Trajectory, model: RobotModel, limits: MotionLimits | None
) -> Trajectory | None:  # fmt: skip
    """The quickest motion along a path that keeps the limits between the points of its grid too."""
    given = task.limits.limits
    share = 1.0
    for _ in range(4):
        tight = MotionLimits(
            given.velocity * share, given.acceleration * share,
            velocity_lower=given.velocity_lower * share,
            acceleration_lower=given.acceleration_lower * share,
        )  # fmt: skip
        motion = time_optimal(
            path, tight, model, task.limits.torque * share, points=400, both_ends=True
        ).trajectory
        if motion is None:
            return None
        over = _use(task, model, motion)[1]
        if over <= 1.0 + 1e-6:
            return motion
        share /= over
    return None


def _use(task: Candidates, model: RobotModel, motion: Trajectory) -> tuple[Array, float]:
    """Greatest torques over their limits (n,), and the greatest ratio to any limit."""
    seen = motion.at(np.linspace(0.0, motion.duration, _CHECKED))
    bound, limits = task.limits.torque, task.limits.limits
    with np.errstate(divide="ignore", invalid="ignore"):
        torque = np.abs(idm(model, seen.q, seen.v, seen.a)).max(axis=0)
        use = np.where(torque > 0.0, torque / bound, 0.0)
        rates = [
            np.where(side * x > 0.0, x / most, 0.0).max()
            for x, upper, lower in (
                (seen.v, limits.velocity, limits.velocity_lower),
                (seen.a, limits.acceleration, limits.acceleration_lower),
            )
            for side, most in ((1.0, upper), (-1.0, lower))
        ]
    return use, float(max(use.max(), *rates))


def _cost_of(task: Candidates, model: RobotModel, motion: Trajectory) -> tuple[float, Array]:
    """Cost of a motion and the greatest torques over their limits (n,)."""
    use, _ = _use(task, model, motion)
    cost = task.cost.time * motion.duration
    if task.cost.torque:
        seen = motion.at(np.linspace(0.0, motion.duration, _CHECKED))
        ratio = idm(model, seen.q, seen.v, seen.a) / task.limits.torque
        cost += task.cost.torque * float((ratio**2).sum(axis=1).mean()) * motion.duration
    return cost, use


def _short(task: Candidates, motion: Trajectory, wanted: float) -> float:
    """How far a motion is outside of the limits of position or the clearance, at many times."""
    margin, task.margin = task.margin, 0.0
    found = task.violation(motion.q(np.linspace(0.0, motion.duration, _CHECKED)))
    task.margin = margin
    return found


def _times_at(motion: Trajectory, stations: Array) -> Array:
    """Times (k,) at which configurations (k, n) are met, in this order."""
    times, low = [], 0.0
    for q in stations:
        a, b = low, motion.duration
        for _ in range(12):
            t = np.linspace(a, b, 401)
            k = int(np.linalg.norm(motion.q(t) - q, axis=1).argmin())
            a, b = t[max(k - 1, 0)], t[min(k + 1, 400)]
        times.append(t[k])
        low = t[k]
    return np.array(times)
