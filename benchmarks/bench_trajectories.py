"""Speed of the trajectories beside their peers, in one run.

    python -m benchmarks.bench_trajectories [--out benchmarks/results] [--rounds 25]

Contestants of a row take turns, round after round, so that a drifting machine is fair to all of
them; the figures are medians in microseconds a call, with the best round beside ours. Peers that
are not installed are named and left out (`pip install roboticstoolbox-python ruckig`). What a peer
gives is compared with ours before it enters, wherever the two mean the same motion.
"""

from __future__ import annotations

import argparse
import importlib
import warnings
from dataclasses import asdict, dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

import robotmodels as rm
from benchmarks.kept import RESULTS, keep
from benchmarks.machine import head, machine
from benchmarks.measure import Contestant, in_turns
from robotmodels import trajectories as tr

Array = NDArray[np.float64]

SAMPLES, POSES, MOTIONS = 10_000, 1000, 1000
OURS = "robotmodels"
PEERS = {"roboticstoolbox-python": "roboticstoolbox", "ruckig": "ruckig"}
EVALUATED_MS, JOINTS_MS = 2.0, 10.0


@dataclass(frozen=True)
class Row:
    """A line of the table: medians and best rounds in microseconds, and the goal that was set."""

    work: str
    microseconds: dict[str, float]
    best: dict[str, float]
    goal: str
    met: bool | None


def module(package: str) -> ModuleType | None:
    """A peer's module, None where it is not installed."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return importlib.import_module(PEERS[package])
    except ImportError:
        return None


def measure(
    work: str, contestants: list[Contestant], rounds: int, goal: float | None = None
) -> Row:
    """Time the contestants of a row, taking turns; the goal is ours, in microseconds."""
    found = {name: t.processor.times(1e6) for name, t in in_turns(contestants, rounds).items()}
    median = {name: spread.median for name, spread in found.items()}
    best = {name: spread.least for name, spread in found.items()}
    print(f"{work}: " + "; ".join(f"{name} {value:.1f}" for name, value in median.items()))
    met = None if goal is None else median[OURS] <= goal
    return Row(work, median, best, "" if goal is None else f"<= {goal:g} us", met)


def agrees(ours: Any, theirs: Any, tolerance: float, what: str) -> None:
    """Stop where a peer does not give the same motion."""
    off = float(np.abs(np.asarray(ours) - np.asarray(theirs)).max())
    if off > tolerance:
        raise SystemExit(f"{what}: the two motions differ by {off:.3g}.")


def ends(count: int = 6, seed: int = 0) -> tuple[Array, Array]:
    """Two random postures."""
    q0, q1 = np.random.default_rng(seed).uniform(-1.5, 1.5, (2, count))
    return q0, q1


# --- rows ----------------------------------------------------------------------------------------


def evaluation_rows(rounds: int) -> list[Row]:
    """Positions, velocities, accelerations and jerks of six joints at 10 000 times."""
    rng, (q0, q1) = np.random.default_rng(1), ends()
    limits = tr.MotionLimits(1.0, 2.0, 10.0)
    jumps, points = limits.without_jerk(), rng.uniform(-1.5, 1.5, (20, 6))
    same = tr.Synchronisation.SAME_TIME
    moving = {"v0": np.full(6, 0.1), "synchronisation": same}
    motions = {
        "quintic": tr.quintic(q0, q1, limits=limits),
        "trapezoid": tr.trapezoidal(q0, q1, limits=jumps),
        "trapezoids of joints that share the time": tr.trapezoidal(
            q0, q1, limits=jumps, synchronisation=same
        ),
        "smoothed trapezoid": tr.smoothed_trapezoidal(q0, q1, limits=limits),
        "jerk limited": tr.jerk_limited(q0, q1, limits=limits),
        "jerk limited, joints in any state": tr.jerk_limited(q0, q1, limits=limits, **moving),
        "cubic spline of 20 points": tr.cubic_spline(points, limits=jumps),
        "lines with blends, 20 points": tr.blended_lines(points, limits=jumps),
        "Fourier series, 5 harmonics": tr.fourier(*rng.normal(size=(2, 5, 6))),
    }
    rows = []
    for name, motion in motions.items():
        t = np.linspace(0.0, motion.duration, SAMPLES)
        contestants = [Contestant(OURS, lambda m=motion, x=t: m.at(x))]
        contestants += peers_of_evaluation(name, motion, q0, q1, t)
        rows.append(measure(f"evaluation, {name}", contestants, rounds, EVALUATED_MS * 1e3))
    return rows


def peers_of_evaluation(
    name: str, motion: tr.Trajectory, q0: Array, q1: Array, t: Array
) -> list[Contestant]:
    """What others do for the same samples, planning included where they cannot part the two."""
    rtb, ruckig = module("roboticstoolbox-python"), module("ruckig")
    if name == "quintic" and rtb is not None:
        agrees(motion.q(t), rtb.jtraj(q0, q1, t).q, 1e-9, "jtraj")
        return [Contestant("RTB jtraj, planned anew, no jerk", lambda: rtb.jtraj(q0, q1, t))]
    if name == "trapezoid" and rtb is not None:
        return [
            Contestant(
                "RTB mtraj(trapezoidal), planned anew, no jerk",
                lambda: rtb.mtraj(rtb.trapezoidal, q0, q1, SAMPLES),
            )
        ]
    if name == "jerk limited, joints in any state" and ruckig is not None:
        found = by_ruckig(ruckig, q0, q1, np.full(6, 0.1))
        times = t.tolist()
        agrees(motion.q(t), [found.at_time(x)[0] for x in times], 1e-8, "ruckig")
        return [
            Contestant(
                "ruckig at_time, Python loop, no jerk",
                lambda: [found.at_time(x) for x in times],
            )
        ]
    return []


def by_ruckig(ruckig: Any, q0: Array, q1: Array, v0: Array) -> Any:
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


def planning_rows(rounds: int) -> list[Row]:
    """Motions planned, not evaluated: per motion of six joints."""
    ruckig = module("ruckig")
    limits = tr.MotionLimits(1.0, 2.0, 10.0)
    rng = np.random.default_rng(2)
    q0, q1 = rng.uniform(-1.5, 1.5, (2, MOTIONS, 6))
    v0 = rng.uniform(-0.3, 0.3, (MOTIONS, 6))
    few, same = 100, tr.Synchronisation.SAME_TIME

    def any_states() -> None:
        for i in range(few):
            tr.jerk_limited(q0[i], q1[i], limits=limits, v0=v0[i], synchronisation=same)

    contestants = [Contestant(OURS, any_states, few)]
    contestants.append(
        Contestant(
            f"{OURS}, one call for {MOTIONS}",
            lambda: tr.jerk_limited(q0, q1, limits=limits, v0=v0, synchronisation=same),
            MOTIONS,
        )
    )
    if ruckig is not None:
        contestants.append(
            Contestant(
                "ruckig, bare",
                lambda: [by_ruckig(ruckig, q0[i], q1[i], v0[i]) for i in range(few)], few,
            )
        )  # fmt: skip
    rows = [measure("plan, jerk limited, joints in any state (ruckig)", contestants, rounds)]

    def rest() -> None:
        for i in range(few):
            tr.jerk_limited(q0[i], q1[i], limits=limits)

    contestants = [
        Contestant(OURS, rest, few),
        Contestant(
            f"{OURS}, one call for {MOTIONS}",
            lambda: tr.jerk_limited(q0, q1, limits=limits), MOTIONS,
        ),
    ]  # fmt: skip
    if ruckig is not None:
        still = np.zeros(6)
        contestants.append(
            Contestant(
                "ruckig, bare, not coordinated",
                lambda: [by_ruckig(ruckig, q0[i], q1[i], still) for i in range(few)], few,
            )
        )  # fmt: skip
    rows.append(measure("plan, jerk limited, coordinated, rest to rest", contestants, rounds))
    contestants = [
        Contestant(
            OURS,
            lambda: [tr.quintic(q0[i], q1[i], limits=limits, v0=v0[i]) for i in range(5)], 5,
        )
    ]  # fmt: skip
    rows.append(
        measure("plan, quintic with end velocities, least duration", contestants, rounds // 3 + 1)
    )
    return rows


def via_rows(rounds: int) -> list[Row]:
    """Twenty points by lines and blends, planned and evaluated every 2 ms."""
    rtb = module("roboticstoolbox-python")
    points = np.random.default_rng(3).uniform(-1.5, 1.5, (20, 6))
    limits = tr.MotionLimits(1.0, 4.0)
    contestants = [
        Contestant(OURS, lambda: tr.blended_lines(points, limits=limits).resample(period=0.002))
    ]
    if rtb is not None:
        contestants.append(
            Contestant(
                "RTB mstraj",
                lambda: rtb.mstraj(points[1:], dt=0.002, tacc=0.25, qdmax=1.0, q0=points[0]),
            )
        )
    return [measure("20 via points, lines with blends, every 2 ms", contestants, rounds)]


def space_rows(rounds: int) -> list[Row]:
    """Straight lines in space, and the way to joints."""
    rtb = module("roboticstoolbox-python")
    rows = []
    arm, q = rm.load("puma560"), np.array([0.1, 0.2, -0.5, 0.4, 0.7, 0.6])
    T0, T1 = rm.dgm(arm, q), rm.dgm(arm, q + 0.3)
    contestants = [Contestant(OURS, lambda: tr.cartesian_trajectory(T0, T1, POSES))]
    if rtb is not None:
        from spatialmath import SE3

        first, last = SE3(T0, check=False), SE3(T1, check=False)
        agrees(
            tr.cartesian_trajectory(T0, T1, POSES)[[0, -1]],
            np.array(rtb.ctraj(first, last, POSES).A)[[0, -1]], 1e-12, "ctraj",
        )  # fmt: skip
        contestants.append(Contestant("RTB ctraj", lambda: rtb.ctraj(first, last, POSES)))
    rows.append(measure(f"ctraj, {POSES} poses", contestants, rounds))
    for name in ("puma560", "rx90", "ur5", "kr6_r900"):
        model = rm.load(name)
        line = tr.straight_line(rm.dgm(model, q), rm.dgm(model, q + 0.3), duration=2.0)
        contestants = [Contestant(OURS, lambda m=model, x=line: tr.joint_path(m, x, q))]
        if rtb is not None and name == "puma560":
            contestants.append(rtb_joints(rtb, q))
        rows.append(
            measure(
                f"straight line of {POSES} poses to joints, {name}", contestants, rounds,
                JOINTS_MS * 1e3,
            )
        )  # fmt: skip
    return rows


def rtb_joints(rtb: Any, q: Array) -> Contestant:
    """RTB on its own Puma: ctraj, and its compiled numeric inverse from the posture before."""
    robot = rtb.models.DH.Puma560()
    ets = robot.ets()
    first, last = robot.fkine(q), robot.fkine(q + 0.3)

    def run() -> Array:
        path, near = np.empty((POSES, 6)), q
        for i, T in enumerate(rtb.ctraj(first, last, POSES).A):
            near = path[i] = ets.ik_LM(T, q0=near)[0]
        return path

    poses = rtb.ctraj(first, last, POSES).A
    found = run()
    agrees([robot.fkine(x).A for x in found[::100]], poses[::100], 1e-3, "ik_LM")
    return Contestant("RTB ctraj and ets.ik_LM, own arm, no velocities, no report", run)


# --- report --------------------------------------------------------------------------------------


def report(rows: list[Row], about: dict[str, str], rounds: int) -> str:
    """The results as Markdown, with ratios to ours."""
    lines = [
        *head("Trajectories: measured side by side", about),
        f"Medians of {rounds} rounds in us a call, one thread, and our best round; in brackets the "
        f"ratio to our median. Evaluation: six joints, {SAMPLES} times, positions, velocities, "
        "accelerations and jerks. To joints: all postures of every pose, the branch followed, "
        "velocities, and the report of singular positions, limits and jumps.",
        "",
        "| work | ours | our best | ours otherwise | others | goal | met |",
        "|---|---|---|---|---|---|---|",
    ]
    for r in rows:
        first = r.microseconds[OURS]
        own = {k.removeprefix(OURS + ", "): v for k, v in r.microseconds.items() if OURS in k}
        otherwise = "; ".join(f"{k} {v:.1f}" for k, v in own.items() if k != OURS)
        others = "; ".join(
            f"{k} {v:.1f} ({v / first:.1f}x)" for k, v in r.microseconds.items() if OURS not in k
        )
        met = "" if r.met is None else ("yes" if r.met else "no")
        cells = (r.work, f"{first:.1f}", f"{r.best[OURS]:.1f}", otherwise, others, r.goal, met)
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def main() -> None:
    """Measure, print and keep the results."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=RESULTS)
    parser.add_argument("--rounds", type=int, default=25)
    arguments = parser.parse_args()
    about = machine(PEERS)
    missing = [package for package in PEERS if module(package) is None]
    if missing:
        print(f"Not installed, so left out: {', '.join(missing)}.")
    rounds = arguments.rounds
    rows = evaluation_rows(rounds) + planning_rows(rounds) + via_rows(rounds) + space_rows(rounds)
    text = report(rows, about, rounds)
    print(text)
    kept = {"machine": about, "rows": [asdict(r) for r in rows]}
    keep(arguments.out, "trajectories", text, kept)


if __name__ == "__main__":
    main()
