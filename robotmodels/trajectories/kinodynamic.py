"""Kinodynamic planning: the best motion between configurations or poses under limits of torque.

References
----------
Book sections 4.4.1 to 4.4.3 and the appendix of chapter 4.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .. import se3
from .._arrays import Array, Value, as_count, as_exact, as_number, read_only
from .._arrays.tasks import Progress
from .._choices import as_instance, chosen
from .._outcomes import Outcome
from ..errors import InvalidValueError
from ..geometry import REVOLUTE
from ..igm import igm
from ..kinematics.singular.task import generator_of
from ..model import RobotModel, check_model
from ..obstacles import clearance as clearance_of
from ..obstacles.clearance import checked_obstacles
from ..obstacles.shapes import Obstacle
from .candidates import Candidates, Cost, shares, spread
from .limits import MotionLimits, checked_limits
from .path_limits import PathLimits
from .plan_search import RESTARTS, PlanMethod, Search, best_motion, restart
from .trajectory import TimingResult, Trajectory

_NO_TIME = 1e-50  # s: shorter motions are not limited by anything
_QUICKEST = Cost()


class Timing(Enum):
    """Timing of a candidate of the planner; the value describes it."""

    OPTIMAL = "the quickest motion along its path"
    PROFILE = "its own profile over time, evenly stretched to the least duration"


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
    """

    T: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "T", read_only(as_exact(se3.as_pose(self.T, "T"), (4, 4), "T")))


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Plan(TimingResult):
    """The best motion that the planner found.

    Parameters
    ----------
    trajectory, status, explanation : Trajectory or None, PlanStatus, str
        The motion; outcome and its details.
    cost : float
        Its cost, see `Cost`; infinite without one.
    history : ndarray, shape (N, 3)
        Number of the evaluation, cost of the candidate with penalties, least cost so far.
    torque_use : ndarray, shape (n,)
        Largest torque of each joint over its limit; 0 where it has none.
    restarts, via_times : ndarray, shape (R,) and (k,)
        Least cost of each restart of the search; times at which the via points are met, s.
    """

    trajectory: Trajectory | None
    status: PlanStatus
    cost: float
    history: Array
    torque_use: Array
    restarts: Array
    via_times: Array
    explanation: str = ""

    @property
    def evaluations(self) -> int:
        """Number of candidates that were timed."""
        return len(self.history)

    @property
    def spread(self) -> float:
        """Relative difference between the worst and the best restart."""
        if not np.isfinite(self.restarts).all() or not self.restarts.size:
            return np.inf
        return float(np.ptp(self.restarts) / self.restarts.min())


def kinodynamic(
    model: RobotModel,
    q0: ArrayLike | Pose,
    q1: ArrayLike | Pose,
    limits: MotionLimits | None,
    torque: ArrayLike | None = None,
    via: Sequence[ArrayLike | Pose] = (),
    obstacles: Iterable[Obstacle] | Obstacle = (),
    clearance: float = 0.0,
    cost: Cost = _QUICKEST,
    nodes: int = 4,
    method: PlanMethod | str = PlanMethod.ANNEAL,
    timing: Timing | str = Timing.OPTIMAL,
    rng: np.random.Generator | int | None = None,
    seconds: float = 10.0,
    progress: Progress = False,
) -> Plan:
    """Kinodynamic planning: the best motion from rest to rest without a given path.

    Also called optimal motion planning, minimum-time trajectory optimisation. Paths are splines
    through free nodes, varied by simulated annealing with the exact timing of every path
    (`time_optimal`), then refined to more nodes and improved by sequential linear programming. The
    search is local: `Plan.restarts` shows its spread. The motion is checked at 10 000 times.

    Parameters
    ----------
    q0, q1, via : array_like, shape (n,), or Pose; via a sequence of these
        The ends, rad or m, and configurations on the way, in this order. Of a pose the planner
        chooses the posture.
    obstacles, clearance : Sphere, Box, Plane, Capsule, or iterable of these, and float
        Bodies that the links avoid, and the least distance from them, m.
    cost : Cost
        Weights of the duration and of the squared torques.
    nodes : int
        Free configurations of a path in the search.
    method, timing : PlanMethod and Timing, or str
        ``"anneal"`` or ``"descent"``; ``"optimal"`` times every path exactly, ``"profile"``
        stretches a profile over time, as `time_scaled`.
    seconds : float
        Longest duration of the search, of up to 500 evaluations for each second; results with one
        seed differ only where the clock ends it.
    progress : bool or callable, optional
        A function is called with the fraction done; True writes it to the log (`logging`).

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
    as_instance(cost, Cost, "cost")
    wanted = as_number(clearance, "clearance", least=0.0)
    count, bodies = as_count(nodes, "nodes", 0), checked_obstacles(obstacles)
    problem = PathLimits(model.n, model, limits, torque, True, both_ends=True)
    seconds = as_number(seconds, "seconds", above=0.0)
    if cost.torque and not problem.loaded.size:
        raise InvalidValueError("cost: a weight of the torques needs limits of torque.")
    given = [q0, *_listed(via), q1]
    names = ["q0", *(f"via[{k}]" for k in range(len(given) - 2)), "q1"]
    postures = [_postures(problem, given, k, names) for k in range(len(given))]
    for name, q in zip(names, postures, strict=True):
        if not len(q):
            why = f"No posture reaches the pose {name} within the limits of position."
            return _without(PlanStatus.NONE_FOUND, why)
    for k, (name, q) in enumerate(zip(names, postures, strict=True)):
        end = name in ("q0", "q1")
        held = [problem.not_held(x[None], lambda _, at=name: at, True) if end else "" for x in q]
        if all(held):
            return _without(PlanStatus.ENDS_NOT_HELD, held[0])
        q = q[[not why for why in held]]
        if bodies:
            distance = np.atleast_1d(clearance_of(model, q, bodies))
            if (distance < wanted).all():
                return _without(
                    PlanStatus.ENDS_IN_COLLISION if end else PlanStatus.NONE_FOUND,
                    f"The clearance at {name} is {distance[0]:.4g} m, less than the {wanted:.4g} m "
                    "requested.",
                )
            q = q[distance >= wanted]
        postures[k] = q
    tasks, optimal = [], timing is Timing.OPTIMAL
    for stations in map(np.array, product(*postures)):
        if not np.any(np.diff(stations, axis=0), axis=1).all():
            continue
        at = spread(shares(stations), count)
        task = Candidates(problem, stations, at, bodies, wanted, cost, optimal)
        straight = task.evaluated(task.straight)
        if straight.duration < _NO_TIME:
            raise InvalidValueError(
                "limits, torque: nothing limits the straight motion, so its time would be zero; "
                "give the robot inertia, or limits of velocity and acceleration of every joint."
            )
        tasks.append((straight.penalized, len(tasks), task))
    if not tasks:
        raise InvalidValueError("q0, q1, via: two that follow each other are the same posture.")
    tasks = [task for _, _, task in sorted(tasks)[:RESTARTS]]
    search, results, generator = Search(seconds, progress), [], generator_of(rng)
    for r in range(RESTARTS):
        search.share((r + 1) / (RESTARTS + 1))
        results.append(restart(search, tasks[r % len(tasks)], method, generator, r))
    search.share(1.0)
    results.sort(key=lambda result: result.found.penalized)
    restarts = np.array([result.found.penalized for result in results])
    best, history = best_motion(search, results, limits), np.reshape(search.history, (-1, 3))
    search.work.done()  # also where the clock ended it
    if best is None:
        return replace(_without(PlanStatus.NONE_FOUND, ""), history=history, restarts=restarts)
    motion, cost_of_best, use, times = best
    return Plan(motion, PlanStatus.FOUND, cost_of_best, history, use, restarts, times)


def _without(status: PlanStatus, why: str) -> Plan:
    """A plan without a motion."""
    none = np.empty(0)
    return Plan(None, status, np.inf, np.empty((0, 3)), none, none, none, why)


def _listed(via: Any) -> list[Any]:
    """Via points one by one."""
    if not np.iterable(via):
        raise InvalidValueError(
            f"via: expected a sequence of configurations or poses, got {type(via).__name__}."
        )
    points = list(via)
    if points and np.ndim(points[0]) == 0 and not isinstance(points[0], Pose):
        raise InvalidValueError("via: expected a sequence of configurations, got one; write [q].")
    return points


def _postures(problem: PathLimits, every: list[Any], k: int, names: list[str]) -> Array:
    """Configurations (m, n) of an end or via point, within the limits of position."""
    model, limits, given = problem.model, problem.limits, every[k]
    assert model is not None
    if not isinstance(given, Pose):
        q = as_exact(given, (model.n,), names[k])
        checked_limits(limits, model.n, q[None])
        if k and not isinstance(every[k - 1], Pose) and np.array_equal(every[k - 1], q):
            raise InvalidValueError(
                f"{names[k]}: it is the same as {names[k - 1]}; leave one of them out."
            )
        return q[None]
    near = next((np.asarray(q, float) for q in every if not isinstance(q, Pose)), None)
    found = igm(model, given.T, near)
    q = found.q[found.valid]
    turn = 2.0 * np.pi * (model.table.sigma[model.table.joint_rows] == REVOLUTE)
    reference = np.clip(np.zeros(model.n) if near is None else near, limits.lower, limits.upper)
    q = q - turn * np.round((q - reference) / np.where(turn > 0.0, turn, 1.0))
    q = q - turn * (q > limits.upper)  # a whole turn back inside
    q = q + turn * (q < limits.lower)
    return q[((q >= limits.lower) & (q <= limits.upper)).all(axis=1)]
