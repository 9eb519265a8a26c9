"""Evaluated and planned motions; time-optimal motion along a path; planned motions."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from typing import Any

import numpy as np

import robotmodels as rm
from benchmarks.measure import Contestant
from benchmarks.works import OURS, Goal, Settings, Work, at_most, module, same
from robotmodels import trajectories as tr

MOTIONS, SAMPLES = 100, 10_000
LIMITS = tr.MotionLimits(1.0, 2.0, 10.0)


def motions(settings: Settings) -> Iterator[Work]:
    """Six joints at 10 000 times, and jerk-limited plans of seven joints that move."""
    rng = np.random.default_rng(1)
    q0, q1 = rng.uniform(-1.5, 1.5, (2, 6))
    laws = {
        "quintic": tr.quintic(q0, q1, limits=LIMITS),
        "jerk-limited": tr.jerk_limited(q0, q1, limits=LIMITS),
        "cubic spline of 20 points": tr.cubic_spline(
            rng.uniform(-1.5, 1.5, (20, 6)), limits=LIMITS.without_jerk()
        ),
    }
    toolbox, ruckig = module("roboticstoolbox-python"), module("ruckig")
    for name, motion in laws.items():
        t = np.linspace(0.0, motion.duration, SAMPLES)
        ways = [Contestant(OURS, lambda m=motion, x=t: m.at(x))]
        if name == "quintic" and toolbox is not None:
            said = same("jtraj", motion.q(t), toolbox.jtraj(q0, q1, t).q, 1e-9)
            ways.append(Contestant("RTB jtraj", lambda x=t: toolbox.jtraj(q0, q1, x), said=said))
        title = f"{name}, six joints at {SAMPLES} times"
        yield Work(title, "us", ways, [at_most(2000.0, "us")])
    q0, q1 = rng.uniform(-1.5, 1.5, (2, MOTIONS, 7))
    v0 = rng.uniform(-0.3, 0.3, (MOTIONS, 7))

    def plan(i: int) -> tr.Trajectory:
        together = tr.Synchronisation.SAME_TIME
        return tr.jerk_limited(q0[i], q1[i], limits=LIMITS, v0=v0[i], synchronisation=together)

    ways = [Contestant(OURS, lambda: [plan(i) for i in range(MOTIONS)], MOTIONS)]
    if ruckig is not None:
        bare = by_ruckig(ruckig, q0[0], q1[0], v0[0])
        t = np.linspace(0.0, min(bare.duration, plan(0).duration), 50)
        said = same("ruckig", plan(0).q(t), [bare.at_time(x)[0] for x in t.tolist()], 1e-8)
        rows = [(q0[i], q1[i], v0[i]) for i in range(MOTIONS)]
        run = [lambda: [by_ruckig(ruckig, *row) for row in rows]]
        ways.append(Contestant("ruckig, bare", run[0], MOTIONS, said))
    yield Work("jerk-limited motion of 7 joints, one plan", "us", ways)


def by_ruckig(ruckig: Any, q0: np.ndarray, q1: np.ndarray, v0: np.ndarray) -> Any:
    """The peer's own plan, as its documentation writes it."""
    n = len(q0)
    given = ruckig.InputParameter(n)
    given.current_position, given.target_position = q0, q1
    given.current_velocity, given.target_velocity = v0, np.zeros(n)
    given.current_acceleration, given.target_acceleration = np.zeros(n), np.zeros(n)
    given.max_velocity, given.max_acceleration = np.full(n, 1.0), np.full(n, 2.0)
    given.max_jerk = np.full(n, 10.0)
    found = ruckig.Trajectory(n)
    ruckig.Ruckig(n).calculate(given, found)
    return found


def planar() -> rm.RobotModel:
    """A vertical arm of two links."""
    inertia = rm.InertialParameters.from_com(
        [5.0, 3.0], [[0.5, 0, 0]] * 2, [np.diag([0, 0, 0.42]), np.diag([0, 0, 0.25])]
    )
    return rm.load("planar_2r").with_inertia(inertia).with_gravity((0, -9.81, 0))


def by_toppra(model: rm.RobotModel, points: np.ndarray, torque: np.ndarray, N: int) -> float:
    """The duration by toppra with its quickest solver; it calls our inverse dynamic model."""
    import toppra
    from toppra import algorithm, constraint

    logging.getLogger("toppra").setLevel(logging.CRITICAL)
    path = toppra.SplineInterpolator(np.arange(float(len(points))), points)
    rows = constraint.JointTorqueConstraint(
        lambda q, v, a: rm.idm(model, q, v, a), np.stack((-torque, torque), axis=1),
        np.zeros(model.n),
    )  # fmt: skip
    grid = np.linspace(0.0, path.duration, N + 1)
    solver = algorithm.TOPPRA([rows], path, gridpoints=grid, solver_wrapper="seidel")
    return float(solver.compute_trajectory(0.0, 0.0).duration)


def time_optimal(settings: Settings) -> Iterator[Work]:
    """One path under limits of torque, timed by both on the same grid."""
    rng, ur5e = np.random.default_rng(0), rm.load("ur5e")
    cases = (
        ("a vertical 2R", planar(), np.array([120.0, 40.0]), 60, 500.0),
        ("ur5e", ur5e, ur5e.table.effort, 200, 10_000.0),
    )
    for name, model, torque, N, goal in cases:
        points = 0.7 * rng.uniform(-1.0, 1.0, (5, model.n)) + np.resize([0.5, -1.0], model.n)
        path = tr.cubic_spline(points, np.arange(5.0), ends="not_a_knot")

        def ours(p: Any = path, m: Any = model, u: Any = torque, k: int = N) -> tr.TimedPath:
            return tr.time_optimal(p, None, m, u, points=k)

        ways = [Contestant(OURS, ours, said=lambda timed: f"{timed.duration:.6g} s")]
        if module("toppra") is not None:
            theirs = (model, points, torque, N)
            said = same("toppra's duration", [ours().duration], [by_toppra(*theirs)], 1e-3)
            ways.append(Contestant("toppra", lambda x=theirs: by_toppra(*x), said=said))
        yield Work(f"time-optimal path, {name}, {N} intervals", "us", ways, [at_most(goal, "us")])


def planned(settings: Settings) -> Iterator[Work]:
    """A free motion of a 2R planned in seconds, beside the straight path."""
    ends, torque, limits = ([0.0, 0.0], [1.0, 0.5]), [120.0, 40.0], tr.MotionLimits()
    straight = tr.time_optimal(tr.linear(*ends, duration=1.0), limits, planar(), torque).duration
    seconds = 2.0 if settings.quick else 10.0

    def run() -> tr.Plan:
        return tr.kinodynamic(planar(), *ends, limits, torque, rng=0, seconds=seconds)

    ways = [Contestant(OURS, run, said=lambda plan: f"{plan.duration / straight:.3f}", rounds=1)]
    goal = Goal("shorter than the straight path", lambda t: float(t[0].note) < 1.0)
    yield Work(f"planned motion of a 2R, {seconds:g} s allowed", "s", ways, [goal])


WORKS = {"motions": motions, "time_optimal": time_optimal, "planned": planned}
