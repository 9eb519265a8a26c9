"""Search of the kinodynamic planner: annealing, local improvement, and the check of the motion.

References
----------
Book section 4.4.1 and the appendix of chapter 4.
"""

from __future__ import annotations

import time
from dataclasses import replace
from enum import Enum
from typing import NamedTuple

import numpy as np

from .._arrays import Array
from .._arrays.tasks import Progress, Workers
from .candidates import Candidates, Evaluated
from .descent import descended
from .limits import MotionLimits, ranges_of
from .motions import TimedMotion
from .path_limits import at_rest
from .time_optimal import law_of, time_optimal
from .time_scaling import stretched, time_scaled
from .trajectory import Samples, Trajectory

RATE = 500  # evaluations for each second
RESTARTS = 3
_LEVELS = (9, 19, 29)  # nodes of the profiles that are improved; the last only of the best one
_MOST = 120  # variables of a linear program
_STEPS = 40
_CHECKED = 10_001
_MET = 5e-10  # rad or m: how near a via point is passed
_HOT, _COLD = 0.1, 1e-3  # temperatures, of the cost of the start
_NARROW = 0.1  # of the first steps: the last ones


class PlanMethod(Enum):
    """Method of the search; the value describes it."""

    ANNEAL = "simulated annealing of the nodes, then local improvement"
    DESCENT = "local improvement of the straight path and of random ones"


class Restart(NamedTuple):
    """Outcome of one restart: a profile, and the path that it came from if that was timed."""

    found: Evaluated
    task: Candidates
    free: Array
    path: Trajectory | None


class Search:
    """Counts evaluations, keeps their costs and ends the search."""

    def __init__(self, seconds: float, progress: Progress) -> None:
        self.start, self.seconds, self.best = time.monotonic(), seconds, np.inf
        self.share(1.0)
        self.allowed = int(RATE * seconds) + 1
        self.history: list[tuple[int, float, float]] = []
        self.work = Workers(progress=progress)

    def share(self, part: float) -> None:
        """Let the search go on until a part of its time is over."""
        self.deadline = self.start + part * self.seconds

    def evaluated(self, task: Candidates, free: Array) -> Evaluated | None:
        """Timing of a candidate; None when the search is over."""
        if time.monotonic() > self.deadline:
            return None
        found = task.evaluated(free)
        self.best = min(self.best, found.penalized)
        self.history.append((len(self.history) + 1, found.penalized, self.best))
        if len(self.history) % 50 == 0:
            self.work.done(min(len(self.history) / self.allowed, 1.0))
        return found


def _annealed(
    search: Search, task: Candidates, rng: np.random.Generator, evaluations: int
) -> tuple[Array, Evaluated]:
    """Simulated annealing from the straight path, with steps that shrink with the temperature."""
    free = best = task.straight
    now = least = task.evaluated(free)
    scale = now.penalized if np.isfinite(now.penalized) else 1.0
    for k in range(evaluations):
        cold = k / max(evaluations - 1, 1)
        wave = int(rng.geometric(0.5)) if len(free) > 1 else 1
        bump = np.sin(wave * np.pi * task.knots[task.free]) / wave**2
        step = bump[:, None] * rng.normal(0.0, 1.0, free.shape[1])
        trial = free + task.width * _NARROW**cold * step
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


def restart(
    search: Search, task: Candidates, method: PlanMethod, rng: np.random.Generator, r: int
) -> Restart:
    """One search from the straight path, or from a random one."""
    free = task.straight
    if method is PlanMethod.ANNEAL:
        free, now = _annealed(search, task, rng, search.allowed // (RESTARTS + 1))
    else:
        free = free + task.width * rng.uniform(-1.0, 1.0, free.shape) if r else free
        now = task.evaluated(free)
    if not task.optimal:
        free, now = descended(task, free, 2 * _STEPS, search.evaluated)
        return Restart(now, task, free, None)
    path, passes = task.path(free), task.limits.passes(task.grid, *task.sampled(free))
    if not np.isfinite(passes.duration):
        return Restart(now, task, free, path)
    law = law_of(task.grid, passes.found[:, 0])
    at = np.interp(task.knots[task.fixed], task.grid, law.breaks[0]) / passes.duration
    profile = Trajectory(TimedMotion(path.motion, law))
    for nodes in _levels(task)[:-1]:
        now, task, free = _finer(search, task, profile, at, nodes)
        profile = task.path(free)
    return Restart(now, task, free, path)


def _levels(task: Candidates) -> tuple[int, ...]:
    """Numbers of nodes of the local improvement."""
    return tuple(k for k in _LEVELS if k * task.limits.n <= _MOST or k <= _LEVELS[1])


def _finer(
    search: Search, task: Candidates, profile: Trajectory, at: Array, nodes: int
) -> tuple[Evaluated, Candidates, Array]:
    """A profile with more nodes, improved."""
    fine = task.as_profile(at, nodes)
    free = profile.q(fine.knots[fine.free] * profile.duration)
    free, now = descended(fine, free, _STEPS, search.evaluated)
    return now, fine, free


def best_motion(
    search: Search, results: list[Restart], limits: MotionLimits | None
) -> tuple[Trajectory, float, Array, Array] | None:
    """The best motion of the first restart that keeps all limits, its cost, torques and via times.

    The restarts are in the order of their costs; the first is refined.
    """
    smooth = limits is not None and np.isfinite([limits.jerk, limits.jerk_lower]).any()
    for k, (done, task, free, path) in enumerate(results):
        options: list[Trajectory | None] = []
        if np.isfinite(done.cost) and not task.optimal:
            if path is not None and k == 0:
                at, nodes = task.knots[task.fixed], _levels(task)[-1]
                then, fine, finer = _finer(search, task, task.path(free), at, nodes)
                if then.penalized < done.penalized:
                    task, free = fine, finer
            options = _finished(search, task, free, limits, path is not None and not smooth)
        if path is not None and not smooth:
            options.append(_retimed(task, path))
        kept = []
        for motion in options:
            if motion is None or task.violation(_seen(motion).q) > 1e-9:
                continue
            times, via = _times_at(motion, task.stations[1:-1]), task.stations[1:-1]
            if np.abs(motion.q(times) - via).max(initial=0.0) <= _MET:
                share, weights = _shares(task, motion), task.cost
                cost = weights.time + weights.torque * float((share**2).sum(axis=1).mean())
                kept.append((motion, cost * motion.duration, np.abs(share).max(axis=0), times))
        if kept:
            return min(kept, key=lambda best: best[1])
    return None


def _finished(
    search: Search, task: Candidates, free: Array, limits: MotionLimits | None, retimed: bool
) -> list[Trajectory | None]:
    """Motions of a profile: stretched to the least duration, and timed anew along its path."""
    rates = None if limits is None else replace(limits, lower=-np.inf, upper=np.inf)
    path, model, scaled = task.path(free), task.limits.model, None
    assert model is not None
    for _ in range(4):
        path = task.path(free)
        scaled = time_scaled(path, model, task.limits.torque, rates).trajectory
        short = 0.0 if scaled is None else task.violation(_seen(scaled).q)
        if short <= 0.0:
            break
        task.margin += 1.5 * short + 1e-6
        free, _ = descended(task, free, 8, search.evaluated)
    if scaled is not None and task.cost.torque:
        slow = task.evaluated(free).duration
        if slow > scaled.duration:
            scaled = Trajectory(stretched(scaled.motion, slow))
    return [scaled, _retimed(task, path) if retimed else None]


def _retimed(task: Candidates, path: Trajectory) -> Trajectory | None:
    """The quickest motion along a path that keeps the limits between the points of its grid too."""
    given, share = task.limits.limits.without_jerk(), 1.0
    for _ in range(4):
        v, a = ((share * x, share * y) for _, x, y in ranges_of(given)[1:3])
        tight = MotionLimits(v[1], a[1], velocity_lower=v[0], acceleration_lower=a[0])
        torque = task.limits.torque * share
        timed = time_optimal(path, tight, task.limits.model, torque, points=400, both_ends=True)
        if timed.trajectory is None:
            return None
        over = float(np.abs(_shares(task, timed.trajectory)).max(initial=0.0))
        over = max(over, timed.trajectory.check(given).stretch)
        if over <= 1.0 + 1e-6:
            return timed.trajectory
        share /= over
    return None


def _seen(motion: Trajectory) -> Samples:
    return motion.at(np.linspace(0.0, motion.duration, _CHECKED))


def _shares(task: Candidates, motion: Trajectory) -> Array:
    """Torques over their limits at many times, shape (N, n)."""
    seen = _seen(motion)
    with np.errstate(divide="ignore", invalid="ignore"):
        tau = task.limits.torques(seen.q, at_rest(seen.v), seen.a)
        return np.where(tau != 0.0, tau / task.limits.torque, 0.0)


def _times_at(motion: Trajectory, stations: Array) -> Array:
    """Times (k,) at which configurations (k, n) are met, in this order."""
    times, low = [], 0.0
    for q in stations:
        a, b = low, motion.duration
        for _ in range(12):
            t = np.linspace(a, b, 401)
            k = int(np.linalg.norm(motion.q(t) - q, axis=1).argmin())
            a, low, b = t[max(k - 1, 0)], t[k], t[min(k + 1, 400)]
        times.append(low)
    return np.array(times)
