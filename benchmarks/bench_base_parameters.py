"""Base parameters, regressors and inverse dynamics beside Pinocchio and FIGAROH, in one run.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.bench_base_parameters [--rounds 5] [--out ...]

Contestants of a row take turns, round after round; figures are medians of the processor's time,
with the median of the time on the clock beside it. Base parameters: links, rotor inertia and
friction without offsets, of robots told to all through Pinocchio's model of ours. The reference
is the number of singular values of Pinocchio's regressor, columns scaled to length 1, with its
gap. Memory: growth of the highest resident memory over that before the call, in a process of its
own, the motion not counted (of Linux alone, elsewhere left out and that is said).
FIGAROH is optional (`pip install figaroh`); without it its entries are left out and that is said.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
import warnings
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

import robotmodels as rm
from benchmarks.kept import RESULTS, keep
from benchmarks.machine import head, machine
from benchmarks.measure import Contestant, in_turns, loop
from robotmodels import regressors
from robotmodels.dynamics import idm_from_base

ROBOTS = ("erd:ur10", "rx90", "puma560", "iiwa14")
BATCH = 100_000
FEW = 2_000
SAMPLES = 10_000
LONG = (100_000, 1_000_000)
ROOT = Path(__file__).parents[1]
Motion = tuple[np.ndarray, np.ndarray, np.ndarray]


@dataclass(frozen=True)
class Row:
    """One contestant at one work: medians of processor and clock, ratio to the first of them."""

    work: str
    name: str
    processor: float | None
    clock: float | None
    unit: str
    ratio: float | None
    note: str
    goal: str = ""
    met: bool | None = None


def measured(
    work: str, field: list[Contestant], rounds: int, unit: str, goals: dict[str, tuple[str, float]]
) -> list[Row]:
    """Times of contestants taking turns; `goals` has the text and the limit by name."""
    found = in_turns(field, rounds)
    factor = {"ms": 1e3, "us": 1e6}[unit]
    notes = {name: timing.note for name, timing in found.items()}
    median = {
        name: (t.processor.median * factor, t.clock.median * factor) for name, t in found.items()
    }
    first = median[field[0].name][0]
    rows = []
    for c in field:
        processor, clock = median[c.name]
        goal, limit = goals.get(c.name, ("", np.inf))
        if goal.startswith("x "):
            limit *= median[goal[2:]][0]
            goal = f"<= {goals[c.name][1]:g} x {goal[2:]}"
        met = processor <= limit if goal else None
        rows.append(
            Row(work, c.name, processor, clock, unit, processor / first, notes[c.name], goal, met)
        )
    return rows


def motion_of(n: int, count: int) -> Motion:
    """Random motion, filled in place so that nothing else is ever held."""
    rng = np.random.default_rng(0)
    arrays = np.empty((count, n)), np.empty((count, n)), np.empty((count, n))
    for x in arrays:
        rng.random(out=x)
        x -= 0.5
        x *= 6.0
    return arrays


def figaroh_present() -> bool:
    """Whether FIGAROH can be imported."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            import figaroh.tools.regressor  # noqa: F401
    except ImportError:
        return False
    return True


def figaroh_of(model: rm.RobotModel) -> Any:
    """FIGAROH told the same robot."""
    from benchmarks.figaroh_base import Figaroh

    drive = model.drive if model.drive is not None else rm.DriveParameters.zeros(model.n)
    return Figaroh(model.pin_model, drive.Ia, drive.Fv, drive.Fc)


def rank_of(base: rm.BaseParameters) -> int:
    """Base parameters without the offsets."""
    return sum(not name.startswith("offset") for name in base.names)


def said_of(base: rm.BaseParameters, motion: Motion) -> str:
    """Rank, gap, and how well the base parameters give the torques of all."""
    model = base.model
    few: Motion = (motion[0][:1000], motion[1][:1000], motion[2][:1000])
    tau = rm.torque_regressor(model, *few) @ rm.parameter_vector(model)
    own = base.reduce(rm.torque_regressor(model, *few, drive=base.drive)) @ base.values(model)
    error = np.abs(own - tau).max() / np.abs(tau).max()
    gap = "" if base.gap is None else f", gap {base.gap[0]:.2f} / {base.gap[1]:.0e}"
    return f"rank {rank_of(base)}{gap}, torques kept to {error:.0e}"


def reference_rank(model: rm.RobotModel) -> str:
    """Singular values of Pinocchio's regressor, with columns of rotors and friction."""
    pm, data, n = model.pin_model, model.pin_model.createData(), model.n
    stack = []
    for q, v, a in zip(*motion_of(n, 500), strict=True):
        links = pin.computeJointTorqueRegressor(pm, data, q, v, a)
        stack.append(np.hstack((links, np.diag(a), np.diag(v), np.diag(np.sign(v)))))
    W = np.vstack(stack)
    length = np.linalg.norm(W, axis=0)
    seen = length > 1e-10 * length.max()
    s = np.linalg.svd(W[:, seen] / length[seen], compute_uv=False)
    rank = int((s > 1e-9 * s[0]).sum())
    least = s[rank] if rank < len(s) else 0.0
    return f"rank {rank}, singular values {s[rank - 1]:.0e} / {least:.0e}"


def base_parameter_rows(peer: bool, rounds: int) -> list[Row]:
    """Base parameters of four robots."""
    rows = []
    for name in ROBOTS:
        model = rm.load(name)
        motion = motion_of(model.n, SAMPLES)

        def said(base: rm.BaseParameters, motion: Motion = motion) -> str:
            return said_of(base, motion)

        field = [
            Contestant("robotmodels, symbolic", lambda m=model: rm.base_parameters(m), said=said),
            Contestant(
                "robotmodels, numeric", lambda m=model: rm.base_parameters(m, "numeric"), said=said
            ),
            Contestant(
                "robotmodels, numeric, 1e4 samples",
                lambda m=model, x=motion: rm.base_parameters(m, "numeric", motion=x), said=said,
            ),
        ]  # fmt: skip
        if peer:
            figaroh = figaroh_of(model)
            field.append(
                Contestant(
                    "FIGAROH, 1e4 samples", lambda f=figaroh, x=motion: f.base(x), said=figaroh.said
                )
            )
        goal = {c.name: ("<= 100 ms", 100.0) for c in field[:2]}
        rows += measured(name, field, rounds, "ms", goal)
        rows.append(
            Row(name, "reference: singular values", None, None, "ms", None, reference_rank(model))
        )
    return rows


def through(chunks: Iterable[object]) -> None:
    """Go through the pieces of a stream."""
    for _ in chunks:
        pass


def regressor_rows(peer: bool, rounds: int) -> list[Row]:
    """Regressors of the UR10, 1e5 samples, and fewer in loops."""
    model = rm.load("erd:ur10")
    motion = motion_of(model.n, BATCH)
    q, v, _ = motion
    few: Motion = (motion[0][:FEW], motion[1][:FEW], motion[2][:FEW])
    pm, data = model.pin_model, model.pin_model.createData()
    base = rm.base_parameters(model, drive=True)
    links = rm.base_parameters(model, drive=False)
    goal = {"robotmodels": ("<= 1.2 us", 1.2)}

    def pin_torque(*x: np.ndarray) -> object:
        return pin.computeJointTorqueRegressor(pm, data, *x)

    def pin_energy(q: np.ndarray, v: np.ndarray) -> object:
        kinetic = pin.computeKineticEnergyRegressor(pm, data, q, v)
        return kinetic + pin.computePotentialEnergyRegressor(pm, data, q)

    def torques(**choice: Any) -> Callable[[], None]:
        return lambda: through(rm.torque_regressor_chunks(model, *motion, **choice))

    plain = Contestant("Pinocchio, Python loop", loop(pin_torque, *few), FEW)
    field = [Contestant("robotmodels", torques(drive=False), BATCH), plain]
    if peer:
        figaroh = figaroh_of(model)
        field.append(Contestant("FIGAROH", lambda: figaroh.stack(few, drive=False), FEW))
    rows = measured("torque, 6 x 60", field, rounds, "us", goal)
    name = f"torque, base parameters alone, 6 x {len(links)}"
    field = [Contestant("robotmodels", torques(drive=False, columns=links), BATCH)]
    rows += measured(name, field, rounds, "us", goal)
    field = [Contestant("robotmodels", torques(), BATCH)]
    if peer:
        field.append(
            Contestant("FIGAROH, without offsets, 6 x 78", lambda: figaroh.stack(few), FEW)
        )
    rows += measured("torque with drives, 6 x 84", field, rounds, "us", {})
    name = f"torque with drives, base parameters alone, 6 x {len(base)}"
    rows += measured(
        name, [Contestant("robotmodels", torques(columns=base), BATCH)], rounds, "us", {}
    )
    streams = {
        "power, 84": lambda: regressors.chunked(
            regressors.power_regressor, model, *motion, size=1024
        ),
        "momentum, 6 x 84, and its rate": lambda: regressors.chunked(
            regressors.momentum_regressor, model, q, v, size=128
        ),
    }
    for work, stream in streams.items():
        field = [Contestant("robotmodels", lambda s=stream: through(s()), BATCH)]
        rows += measured(work, field, rounds, "us", {})
    energy = [
        Contestant(
            "robotmodels",
            lambda: through(
                regressors.chunked(rm.energy_regressor, model, q, v, size=1024, drive=False)
            ),
            BATCH,
        ),
        Contestant(
            "Pinocchio, kinetic and potential, Python loop", loop(pin_energy, *few[:2]), FEW
        ),
    ]
    return rows + measured("energy, 60", energy, rounds, "us", {})


def inverse_dynamics_rows(rounds: int) -> list[Row]:
    """Inverse dynamics of the UR10, 1e5 samples."""
    model = rm.load("erd:ur10").with_drive(None)
    motion = motion_of(model.n, BATCH)
    base = rm.base_parameters(model, drive=False)
    values = base.values(model)
    pool = pin.ModelPool(model.pin_model, 1)
    columns = [np.asfortranarray(x.T) for x in motion]
    field = [
        Contestant("robotmodels", lambda: rm.idm(model, *motion), BATCH),
        Contestant(
            "robotmodels, from base parameters",
            lambda: idm_from_base(model, base, values, *motion), BATCH,
        ),
        Contestant("rneaInParallel(1)", lambda: pin.rneaInParallel(1, pool, *columns), BATCH),
    ]  # fmt: skip
    goal = {"robotmodels": ("x rneaInParallel(1)", 1.3)}
    return measured("inverse dynamics, 1e5 samples", field, rounds, "us", goal)


def standard_rows(rounds: int) -> list[Row]:
    """Back to a robot: from the robot's own base parameters, and from disturbed ones."""
    try:
        import clarabel  # noqa: F401
    except ImportError:
        print("Clarabel is not installed: the way back to a robot is left out.")
        return []
    rows = []
    rng = np.random.default_rng(0)
    for name in ROBOTS:
        model = rm.load(name)
        base = rm.base_parameters(model)
        prior = rm.uniform_bodies(model, float(model.inertia.mass.sum()) or 100.0)
        own = base.values(model)
        disturbed = own * rng.normal(1.0, 0.2, len(own))

        def said(found: rm.StandardParameters, base: rm.BaseParameters = base) -> str:
            off = np.abs(found.deviation).max()
            return f"{found.status.name}, off by {off:.0e}, {len(base)} parameters"

        field = [
            Contestant(
                case, lambda b=base, x=values, p=prior: rm.standard_parameters(b, x, prior=p),
                said=said,
            )
            for case, values in (("its own base parameters", own), ("20 % off", disturbed))
        ]  # fmt: skip
        rows += measured(name, field, rounds, "ms", {})
    return rows


def child(who: str, count: int) -> None:
    """One call in this process: prints its memory, times and answer."""
    model = rm.load("erd:ur10")
    figaroh = figaroh_of(model) if who == "FIGAROH" else None

    def answer(motion: Motion) -> Any:
        if figaroh is not None:
            return figaroh.base(motion)
        return rm.base_parameters(model, "numeric", motion=motion)

    few = motion_of(model.n, 1000)
    clock = time.perf_counter()
    answer(few)  # compiles or loads what is compiled, pages in
    first = time.perf_counter() - clock
    motion = motion_of(model.n, count)
    Path("/proc/self/clear_refs").write_text("5")  # the highest memory starts anew
    before = highest_memory()
    clock, processor = time.perf_counter(), time.process_time()
    found = answer(motion)
    spent = time.process_time() - processor, time.perf_counter() - clock
    grown = highest_memory() - before
    rank = len(found[0].base_indices) if figaroh is not None else rank_of(found)
    told = {"grown": grown, "processor": spent[0], "clock": spent[1], "first": first, "rank": rank}
    print(json.dumps(told))


def highest_memory() -> float:
    """Highest resident memory of this process so far, MB. Not `getrusage`: it inherits."""
    status = Path("/proc/self/status").read_text()
    line = next(line for line in status.splitlines() if line.startswith("VmHWM"))
    return int(line.split()[1]) / 1024.0


def memory_rows(peer: bool) -> list[dict[str, Any]]:
    """Highest memory of long logs, each in a process of its own; FIGAROH up to 1e5 samples."""
    if not Path("/proc/self/clear_refs").exists():
        print("The highest memory of a process is not told here: long logs are left out.")
        return []
    asked = [("robotmodels, numeric", count) for count in (SAMPLES, *LONG)]
    if peer:
        asked += [("FIGAROH", count) for count in (SAMPLES, LONG[0])]
    rows = []
    for who, count in asked:
        command = [
            sys.executable,
            "-W",
            "ignore",
            "-m",
            "benchmarks.bench_base_parameters",
            "--child",
            who,
            "--count",
            str(count),
        ]
        out = subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT).stdout
        rows.append({"name": who, "samples": count, **json.loads(out.splitlines()[-1])})
    return rows


def report(
    parts: dict[str, list[Row]], memory: list[dict[str, Any]], about: dict[str, str], rounds: int
) -> str:
    """The results as Markdown."""
    lines = [
        *head("Base parameters and regressors: measured side by side", about),
        f"Medians of {rounds} rounds (FIGAROH too) of the processor's time, and of the clock's; "
        "`x`: ratio to the first line of each work. Goals are of the processor's time.",
        "`rank`: base parameters of links, rotors and friction, without offsets. `gap`: least "
        "that a kept column has beyond those before it / most of one left out, of the longest.",
    ]
    for title, rows in parts.items():
        if not rows:
            continue
        unit = "us a sample" if rows[0].unit == "us" else "ms a call"
        lines += ["", f"## {title}", ""]
        lines += [f"| work | contestant | {unit} | clock | x | answer | goal | met |"]
        lines += ["|---|---|---|---|---|---|---|---|"]
        for row in rows:
            met = {True: "yes", False: "no", None: ""}[row.met]
            figures = (row.processor, row.clock, row.ratio)
            told = " | ".join("" if x is None else f"{x:.2f}" for x in figures)
            lines.append(f"| {row.work} | {row.name} | {told} | {row.note} | {row.goal} | {met} |")
    if not memory:
        return "\n".join(lines) + "\n"
    lines += ["", "## Memory and time of long logs: base parameters of the UR10", ""]
    lines += [
        "One call each, in a process of its own. `first call`: on 1000 samples, on the clock, with "
        "what is compiled read from disk. Goal: memory does not grow with the samples.",
        "",
    ]
    lines += [
        "| contestant | samples | growth of memory, MB | s | clock | us a sample | rank | first "
        "call, s |"
    ]
    lines += ["|---|---|---|---|---|---|---|---|"]
    for row in memory:
        each = row["processor"] / row["samples"] * 1e6
        lines.append(
            f"| {row['name']} | {row['samples']:.0e} | {row['grown']:.1f} | "
            f"{row['processor']:.2f} | {row['clock']:.2f} | {each:.1f} | {row['rank']} | "
            f"{row['first']:.2f} |"
        )
    return "\n".join(lines) + "\n"


def main() -> None:
    """Measure, print and keep the results."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=RESULTS)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--child", help=argparse.SUPPRESS)
    parser.add_argument("--count", type=int, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.child:
        child(arguments.child, arguments.count)
        return
    about, rounds = machine(["clarabel", "figaroh"]), arguments.rounds
    peer = figaroh_present()
    if not peer:
        print("FIGAROH is not installed: its entries are left out.")
    parts = {
        "Base parameters with rotors and friction": base_parameter_rows(peer, rounds),
        "Regressors of the UR10": regressor_rows(peer, 2 * rounds + 1),
        "Inverse dynamics of the UR10": inverse_dynamics_rows(2 * rounds + 1),
        "Back to a robot": standard_rows(rounds),
    }
    memory = memory_rows(peer)
    text = report(parts, memory, about, rounds)
    print(text)
    kept = {
        "machine": about,
        "rounds": rounds,
        "parts": {title: [asdict(row) for row in rows] for title, rows in parts.items()},
        "memory": memory,
    }
    keep(arguments.out, "base_parameters", text, kept)


if __name__ == "__main__":
    main()
