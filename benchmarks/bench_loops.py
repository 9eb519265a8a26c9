"""Speed of robots with loops beside Pinocchio called from Python, in one run.

    python -m benchmarks.bench_loops [--out benchmarks/results] [--rounds 15]

Contestants of a row take turns. Pinocchio's direct model runs bare: with one point for a planar
pin, as ours has it, with two points on its axis, and with twenty proximal iterations. Its closing
is the Newton iteration that users write.
toolbox-parallel-robots needs Pinocchio's CasADi bindings, which the wheel does not have.
"""

from __future__ import annotations

import argparse
import importlib.util
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

import robotmodels as rm
from benchmarks.kept import RESULTS, keep
from benchmarks.machine import head, machine
from benchmarks.measure import Contestant, in_turns
from robotmodels import loops
from robotmodels.loops.dynamics import Engine, engine_of

Array = NDArray[np.float64]
OURS, POSTURES, CALLS, FEW = "robotmodels", 10_000, 500, 100
PEER = "toolbox_parallel_robots"


@dataclass
class Row:
    """A line of the table: medians in microseconds, and the goal that was set."""

    work: str
    microseconds: dict[str, float]
    goal: str


def measure(work: str, contestants: list[Contestant], rounds: int, goal: str = "") -> Row:
    """Time the contestants of a row, taking turns."""
    found = {name: t.processor.times(1e6) for name, t in in_turns(contestants, rounds).items()}
    median = {name: spread.median for name, spread in found.items()}
    print(f"{work}: " + "; ".join(f"{name} {value:.2f} us" for name, value in median.items()))
    return Row(work, median, goal)


def planar(rows: list[dict], frames: tuple[int, int], actuated: list[int]) -> loops.LoopedRobot:
    """A planar robot of bars with unit masses."""
    table = rm.DHTable.from_rows(rows)
    bars = rm.InertialParameters.from_com(
        np.ones(table.f), np.full((table.f, 3), 0.1), [0.1 * np.eye(3)] * table.f
    )
    tree = rm.RobotModel.from_table(table, bars, gravity=(0.0, -9.81, 0.0))
    return loops.LoopedRobot(tree, [loops.Closure("pin", frames)], actuated)


def robots() -> dict[str, tuple[loops.LoopedRobot, Array]]:
    """Robots and closed postures."""
    first = [{"sigma": 0}, {"antecedent": 0, "sigma": 0, "d": 1.0}]
    four = planar(
        [*first, {"antecedent": 1, "sigma": 0, "d": 0.3},
         {"antecedent": 3, "sigma": 2, "d": 0.9}, {"antecedent": 2, "sigma": 2, "d": 0.7}],
        (4, 5), [0],
    )  # fmt: skip
    bars = [{"antecedent": k, "sigma": 0, "d": 0.6} for k in (1, 2)]
    ends = [{"antecedent": k, "sigma": 2, "d": 0.8} for k in (3, 4)]
    five = planar([*first, *bars, *ends], (5, 6), [0, 1])
    return {
        "four-bar": (four, loops.close(four, [0.7], [1.2, -0.5]).q),
        "five-bar": (five, loops.close(five, [2.0, 1.0], [-1.0, 1.0]).q),
    }


def by_hand(engine: Engine) -> tuple[pin.StdVec_RigidConstraintModel, ...]:
    """A pin as users write it: two points on its axis; and its data."""
    models, datas = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
    for z in (0.0, 1.0):
        first, at = engine.models[0], pin.SE3(np.eye(3), np.array([0.0, 0.0, z]))
        models.append(
            pin.RigidConstraintModel(
                pin.ContactType.CONTACT_3D, engine.model,
                first.joint1_id, first.joint1_placement * at,
                first.joint2_id, first.joint2_placement * at, pin.LOCAL,
            )
        )  # fmt: skip
    for model in models:
        datas.append(model.createData())
    return models, datas


def closing_row(robot: loops.LoopedRobot, q: Array, rounds: int) -> Row:
    """Postures of a four-bar at positions of its crank within a radian."""
    angles = q[0] + np.random.default_rng(0).uniform(-1.0, 1.0, (POSTURES, 1))
    engine, passive = engine_of(robot), robot.passive
    model, data, constraints = engine.model, engine.data, engine.models
    order, back = (
        (slice(None), slice(None)) if engine.order is None else (engine.order, engine.back)
    )

    def newton() -> None:
        for angle in angles[:FEW, 0]:
            x = q.copy()
            x[0] = angle
            for _ in range(20):
                pin.computeJointJacobians(model, data, x[order])
                for constraint, found in zip(constraints, engine.datas, strict=True):
                    constraint.calc(model, data, found)
                e = np.concatenate([found.c1Mc2.translation for found in engine.datas])
                if np.abs(e).max() < 1e-12:
                    break
                J = pin.getConstraintsJacobian(model, data, constraints, engine.datas)
                x[passive] -= np.linalg.lstsq(-J[:, back][:, passive], e, rcond=None)[0]

    contestants = [
        Contestant(OURS, lambda: loops.close(robot, angles, q), POSTURES),
        Contestant("Pinocchio, Newton in Python", newton, FEW, rounds=3),
    ]
    return measure("close a four-bar", contestants, rounds, "1e4 postures <= 20 ms: 2 us each")


def direct_row(name: str, robot: loops.LoopedRobot, q: Array, rounds: int) -> Row:
    """The direct model, one sample a call and in a batch."""
    v_a, tau = np.random.default_rng(0).normal(size=(2, len(robot.actuated)))
    v = loops.velocity_map(robot, q) @ v_a
    engine = engine_of(robot)
    full = np.zeros(robot.n)
    full[robot.actuated] = tau
    order = engine.order
    samples = q[order], v[order], full[order]
    finer = pin.ProximalSettings(1e-14, 1e-10, 20)
    points = by_hand(engine)
    data = engine.model.createData()
    pin.initConstraintDynamics(engine.model, data, *points)

    def bare(settings: pin.ProximalSettings, data: pin.Data, closures: tuple) -> None:
        for _ in range(CALLS):
            pin.constraintDynamics(engine.model, data, *samples, *closures, settings)

    contestants = [
        Contestant(OURS, lambda: [loops.ddm(robot, q, v, tau) for _ in range(CALLS)], CALLS),
        Contestant("Pinocchio, one point",
            lambda: bare(engine.settings, engine.data, (engine.models, engine.datas)), CALLS),
        Contestant("Pinocchio, two points", lambda: bare(engine.settings, data, points), CALLS),
        Contestant("Pinocchio, 20 iterations", lambda: bare(finer, data, points), CALLS),
        Contestant(
            f"{OURS}, batch",
            lambda: loops.ddm(robot, np.tile(q, (CALLS, 1)), np.tile(v, (CALLS, 1)), tau), CALLS,
        ),
    ]  # fmt: skip
    return measure(f"direct model, {name}", contestants, rounds, "<= 1.3 of two points")


def main() -> None:
    """Measure, print and keep the results."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=RESULTS)
    parser.add_argument("--rounds", type=int, default=15)
    given = parser.parse_args()
    about = machine(["pin"])
    if importlib.util.find_spec(PEER) is None:
        print(f"left out: {PEER}, which is not installed")
    rows = [closing_row(*robots()["four-bar"], given.rounds)]
    rows += [direct_row(name, *robot, given.rounds) for name, robot in robots().items()]
    text = [*head("Kinematic loops: measured side by side", about), "| us each | goal | medians |"]
    text.append("|---|---|---|")
    for row in rows:
        medians = "; ".join(f"{name} {value:.2f}" for name, value in row.microseconds.items())
        text.append(f"| {row.work} | {row.goal} | {medians} |")
    keep(given.out, "loops", "\n".join(text) + "\n", [asdict(row) for row in rows])


if __name__ == "__main__":
    main()
