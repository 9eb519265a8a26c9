"""Jerk-limited motion of seven axes between states that move: ruckig, bare and wrapped."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from benchmarks.side_by_side.works import BATCH, ONE, Entry, Goal, Settings, Tool, Work, module
from robotmodels import trajectories as tr

MOTIONS, MANY = 100, 1000
LIMITS = 1.0, 2.0, 10.0
CLOSE = 1e-8


def jerk_limited(settings: Settings) -> Iterator[Work]:
    """One row: planned, not evaluated, per motion."""
    rng = np.random.default_rng(2)
    batch = settings.number(MANY, MOTIONS)
    q0, q1 = rng.uniform(-1.5, 1.5, (2, batch, 7))
    v0 = rng.uniform(-0.3, 0.3, (batch, 7))
    limits = tr.MotionLimits(*(np.full(7, x) for x in LIMITS))
    same = tr.Synchronisation.SAME_TIME

    def plan(*states: np.ndarray) -> tr.Trajectory:
        return tr.jerk_limited(*states[:2], limits=limits, v0=states[2], synchronisation=same)

    def each() -> None:
        for i in range(MOTIONS):
            plan(q0[i], q1[i], v0[i])

    entries = [
        Entry(Tool.OURS, "checked, a motion to evaluate", each, MOTIONS, mode=ONE),
        Entry(Tool.OURS, f"{batch} motions", lambda: plan(q0, q1, v0), batch, mode=BATCH),
    ]
    ruckig = module(Tool.RUCKIG)
    goals = []
    if ruckig is not None:
        off = max(_difference(ruckig, plan, (q0[i], q1[i], v0[i])) for i in range(20))

        def bare() -> None:
            for i in range(MOTIONS):
                by_ruckig(ruckig, q0[i], q1[i], v0[i])

        note = f"differs from ours by {off:.0e} rad"
        entries.append(Entry(Tool.RUCKIG, "bare", bare, MOTIONS, lambda _: note, mode=ONE))
        goals = [Goal("ruckig itself, wrapped", lambda _: off <= CLOSE)]
    yield Work("jerk_limited", "jerk-limited motion of 7 axes, a plan", "us", entries, goals)


def by_ruckig(ruckig: Any, q0: np.ndarray, q1: np.ndarray, v0: np.ndarray) -> Any:
    """The peer's own plan, as its documentation writes it."""
    n = len(q0)
    given = ruckig.InputParameter(n)
    given.current_position, given.target_position = q0, q1
    given.current_velocity, given.target_velocity = v0, np.zeros(n)
    given.current_acceleration, given.target_acceleration = np.zeros(n), np.zeros(n)
    given.max_velocity, given.max_acceleration = np.full(n, LIMITS[0]), np.full(n, LIMITS[1])
    given.max_jerk = np.full(n, LIMITS[2])
    found = ruckig.Trajectory(n)
    ruckig.Ruckig(n).calculate(given, found)
    return found


def _difference(ruckig: Any, plan: Any, states: tuple[np.ndarray, ...]) -> float:
    """Largest difference of positions, over the motion."""
    ours, theirs = plan(*states), by_ruckig(ruckig, *states)
    times = np.linspace(0.0, min(ours.duration, theirs.duration), 50)
    return float(np.abs(ours.q(times) - [theirs.at_time(t)[0] for t in times.tolist()]).max())


WORKS = {"jerk_limited": jerk_limited}
