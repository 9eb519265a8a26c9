"""Speed of the direct models beside raw Pinocchio and the Robotics Toolbox, in one run.

    python benchmarks/bench_models.py [--out benchmarks/results]

Contestants of a row take turns, round after round, so that a drifting machine is fair to all of
them; the figures are medians in microseconds a sample. The Robotics Toolbox is optional
(`pip install roboticstoolbox-python`); without it its entries are left out and that is said.
"""

from __future__ import annotations

import argparse
import json
import platform
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numpy as np
import pinocchio as pin

import robotmodels as rm

ROUNDS = 15
BATCH = 100_000
FEW = 2_000


@dataclass(frozen=True)
class Contestant:
    """One way to do the work of a row."""

    name: str
    run: Callable[[], object]
    samples: int


@dataclass(frozen=True)
class Row:
    """A line of the table: medians in microseconds a sample, and the goal."""

    work: str
    microseconds: dict[str, float]
    ours: str
    goal: str
    met: bool


def measure(contestants: list[Contestant]) -> dict[str, float]:
    """Median time of each contestant, taking turns."""
    times: dict[str, list[float]] = {c.name: [] for c in contestants}
    for c in contestants:
        c.run()  # compile, page in
    for _ in range(ROUNDS):
        for c in contestants:
            start = time.perf_counter()
            c.run()
            times[c.name].append((time.perf_counter() - start) / c.samples * 1e6)
    return {name: float(np.median(values)) for name, values in times.items()}


def rows() -> list[Row]:
    """Measure everything on the Puma 560, which both toolboxes have with inertia."""
    model = rm.load("puma560")
    rng = np.random.default_rng(0)
    q, v, a = rng.uniform(-2.0, 2.0, (3, BATCH, model.n))
    pm, data = model.pin_model, model.pin_model.createData()
    tip = pm.getFrameId("tool", pin.FrameType.BODY)
    toolbox = _toolbox()
    few = slice(FEW)

    def loop(call: Callable[..., object], *arrays: np.ndarray) -> Callable[[], None]:
        def run() -> None:
            for row in zip(*arrays, strict=True):
                call(*row)

        return run

    def pin_pose(x: np.ndarray) -> np.ndarray:
        pin.forwardKinematics(pm, data, x)
        return pin.updateFramePlacement(pm, data, tip).homogeneous

    def pin_jacobian(x: np.ndarray) -> np.ndarray:
        return pin.computeFrameJacobian(pm, data, x, tip, pin.LOCAL_WORLD_ALIGNED)

    result = []
    contestants = [
        Contestant("robotmodels", lambda: rm.dgm(model, q), BATCH),
        Contestant("Pinocchio, Python loop", loop(pin_pose, q[few]), FEW),
    ]
    if toolbox:
        ets = toolbox.ets()
        contestants += [
            Contestant("RTB ets.eval", lambda: ets.eval(q), BATCH),
            Contestant("RTB fkine", loop(toolbox.fkine, q[few]), FEW),
        ]
    us = measure(contestants)
    result.append(_row("pose of the tool, 1e5 configurations", us, "<= 0.3 us", 0.3))

    contestants = [
        Contestant("robotmodels", lambda: rm.jacobian(model, q), BATCH),
        Contestant("Pinocchio, Python loop", loop(pin_jacobian, q[few]), FEW),
    ]
    if toolbox:
        contestants += [
            Contestant("RTB ets.jacob0", loop(ets.jacob0, q[few]), FEW),
            Contestant("RTB jacob0", loop(toolbox.jacob0, q[few]), FEW),
        ]
    us = measure(contestants)
    result.append(_row("Jacobian, 1e5 configurations", us, "<= 0.5 us", 0.5))

    contestants = [
        Contestant("robotmodels", loop(lambda x: rm.dgm(model, x), q[few]), FEW),
        Contestant("Pinocchio", loop(pin_pose, q[few]), FEW),
    ]
    if toolbox:
        contestants.append(Contestant("RTB fkine", loop(toolbox.fkine, q[few]), FEW))
    us = measure(contestants)
    result.append(_row("single dgm call with its checks", us, "<= 8 us", 8.0))

    rigid = model.with_drive(None)
    for name, robot in (("rigid", rigid), ("with drives", model)):
        contestants = [
            Contestant("robotmodels", loop(lambda *x, m=robot: rm.idm(m, *x),
                                           q[few], v[few], a[few]), FEW),
            Contestant("Pinocchio", loop(lambda *x: pin.rnea(pm, data, *x),
                                         q[few], v[few], a[few]), FEW),
        ]  # fmt: skip
        if toolbox:
            contestants.append(
                Contestant("RTB rne", loop(toolbox.rne, q[few], v[few], a[few]), FEW)
            )
        us = measure(contestants)
        result.append(_row(f"single idm call with its checks, {name}", us, "<= 8 us", 8.0))

    pool = pin.ModelPool(pm, 1)
    Q, V, A = (np.asfortranarray(x.T) for x in (q, v, a))
    contestants = [
        Contestant("robotmodels", lambda: rm.idm(rigid, q, v, a), BATCH),
        Contestant("Pinocchio rneaInParallel(1)",
                   lambda: pin.rneaInParallel(1, pool, Q, V, A), BATCH),
    ]  # fmt: skip
    if toolbox:
        contestants.append(Contestant("RTB rne", lambda: toolbox.rne(q, v, a), BATCH))
    us = measure(contestants)
    limit = 1.3 * us["Pinocchio rneaInParallel(1)"]
    result.append(_row("inverse dynamics, 1e5 samples", us, "<= 1.3 x rneaInParallel", limit))

    def streamed() -> None:
        for _ in rm.torque_regressor_chunks(model, q, v, a, drive=False):
            pass

    contestants = [
        Contestant("robotmodels", streamed, BATCH),
        Contestant("Pinocchio, Python loop",
                   loop(lambda *x: pin.computeJointTorqueRegressor(pm, data, *x),
                        q[few], v[few], a[few]), FEW),
    ]  # fmt: skip
    us = measure(contestants)
    result.append(_row("torque regressor 6 x 60, 1e5 samples, streamed", us, "<= 1.2 us", 1.2))
    return result


def _row(work: str, us: dict[str, float], goal: str, limit: float) -> Row:
    return Row(work, us, "robotmodels", goal, us["robotmodels"] <= limit)


def _toolbox():
    try:
        from roboticstoolbox import models
    except ImportError:
        print("The Robotics Toolbox is not installed: its entries are left out.")
        return None
    return models.DH.Puma560()


def machine() -> dict[str, str]:
    """What the figures were measured on, and with which versions."""
    packages = ("pin", "numpy", "numba", "roboticstoolbox-python")
    found = {"robotmodels": rm.__version__}
    for package in packages:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "not installed"
    cpu = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        names = [line for line in info.read_text().splitlines() if line.startswith("model name")]
        cpu = names[0].partition(":")[2].strip() if names else cpu
    return {"cpu": cpu, "system": platform.system(), "python": platform.python_version(), **found}


def report(table: list[Row], about: dict[str, str]) -> str:
    """The results as Markdown, with ratios to ours."""
    lines = ["# Direct models: measured side by side", ""]
    lines += [f"- {key}: {value}" for key, value in about.items()]
    lines += [
        "",
        f"Medians of {ROUNDS} rounds in us a sample, one thread; in brackets the ratio to ours.",
        "",
        "| work | ours | others | goal | met |",
        "|---|---|---|---|---|",
    ]
    for row in table:
        ours = row.microseconds[row.ours]
        others = "; ".join(
            f"{name} {value:.2f} ({value / ours:.1f}x)"
            for name, value in row.microseconds.items()
            if name != row.ours
        )
        met = "yes" if row.met else "no"
        lines.append(f"| {row.work} | {ours:.2f} | {others} | {row.goal} | {met} |")
    return "\n".join(lines) + "\n"


def main() -> None:
    """Measure, print and keep the results."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "results")
    arguments = parser.parse_args()
    about, table = machine(), rows()
    text = report(table, about)
    print(text)
    arguments.out.mkdir(parents=True, exist_ok=True)
    (arguments.out / "models.md").write_text(text, encoding="utf-8")
    kept = {"machine": about, "rows": [asdict(row) for row in table]}
    (arguments.out / "models.json").write_text(json.dumps(kept, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
