"""Exciting trajectories: condition numbers, times, and the random motions that they are beside.

    OPENBLAS_NUM_THREADS=1 python -m benchmarks.bench_excitation [--starts 8] [--random 100]
        [--robots rx90 tx40 ...] [--out benchmarks/results]

One call of `exciting_trajectory` for each line, with its defaults but for what the line names:
10 s, five harmonics or ten points, limits of the robot's table. Times are of the processor for the
whole call (compiled kernels are on disk), with the clock's beside it. "Random" are motions that
keep the same limits, each joint as far as its own limits let it.
"""

from __future__ import annotations

import argparse
import os
import time
from pathlib import Path
from typing import Any

import numpy as np

import robotmodels as rm
from benchmarks.kept import RESULTS, keep
from benchmarks.machine import head, machine
from robotmodels.identification.excitation import exciting_trajectory

GOAL = 100.0  # unscaled condition number of a 6R arm, within GOAL_TIME
GOAL_TIME = 60.0
COLUMNS = ("Ia", "Fv", "Fc")
CASES: tuple[tuple[str, str, dict[str, Any]], ...] = (
    ("rx90", "", {"drive": COLUMNS}),
    ("rx90", "offsets too", {"drive": True}),
    ("rx90", "links alone", {"drive": False}),
    ("rx90", "spline", {"drive": COLUMNS, "kind": "spline"}),
    ("rx90", "log det", {"drive": COLUMNS, "criterion": "log_det"}),
    ("ur10e", "", {"drive": COLUMNS}),
    ("ur10e", "offsets too", {"drive": True}),
    ("tx40", "", {"drive": COLUMNS}),
    ("tx40", "offsets too", {"drive": True}),
    ("panda", "", {"drive": COLUMNS}),
    ("iiwa14", "", {"drive": COLUMNS}),
)


def measured(name: str, what: str, options: dict[str, Any], starts: int, drawn: int) -> dict:
    """One line of the table."""
    model = rm.load(name)
    load = os.getloadavg()[0]
    clock, cpu = time.perf_counter(), time.process_time()
    found = exciting_trajectory(model, starts=starts, baseline=drawn, rng=0, **options)
    cpu, clock = time.process_time() - cpu, time.perf_counter() - clock
    random = found.baseline_conditions
    return {
        "robot": name,
        "case": what,
        "columns": len(found.base),
        "condition": found.condition,
        "scaled": found.scaled_condition,
        "log_det": found.log_det,
        "starts": [start.after.condition for start in found.starts],
        "random_median": float(np.median(random)) if random.size else None,
        "random_best": float(random[0]) if random.size else None,
        "random_best_log_det": max((one.log_det for one in found.baseline), default=None),
        "random": int(random.size),
        "cpu": cpu,
        "clock": clock,
        "load": load,
        "kept": found.limits.kept,
        "status": found.status.name,
    }


def report(rows: list[dict], facts: dict[str, str]) -> str:
    """The table in Markdown."""
    lines = [
        *head("Exciting trajectories: measured", facts),
        f"Goal for a 6R arm: condition number of the base regressor, not scaled, below {GOAL:g} in "
        f"at most {GOAL_TIME:g} s of the processor, starts included; the clock is that of a "
        "machine with the load that is said. Columns in SI units, rows of all joints alike, 500 "
        "samples in a period.",
        "",
        "| robot | case | columns | condition | with scaled columns | log det | every start | "
        "random: median | best | motions | cpu, s | clock, s | load | limits kept | goal met |",
        "|" + "---|" * 15,
    ]
    for row in rows:
        starts = f"{min(row['starts']):.1f} to {max(row['starts']):.1f}"
        met = row["condition"] < GOAL and row["cpu"] <= GOAL_TIME
        chance = [
            "" if row[key] is None else f"{row[key]:.1f}"
            for key in ("random_median", "random_best")
        ]
        lines.append(
            f"| {row['robot']} | {row['case']} | {row['columns']} | {row['condition']:.1f} | "
            f"{row['scaled']:.2f} | {row['log_det']:.1f} | {starts} | {chance[0]} | {chance[1]} | "
            f"{row['random']} | {row['cpu']:.1f} | {row['clock']:.1f} | {row['load']:.1f} | "
            f"{'yes' if row['kept'] else 'no'} | {'yes' if met else 'no'} |"
        )
    best = [row for row in rows if row["case"] == "log det"]
    for row in best:
        lines += ["", f"The line \"log det\" is not made for the condition number: its log det is "
                      f"{row['log_det']:.1f}, that of the best random motion "
                      f"{row['random_best_log_det']:.1f}."]  # fmt: skip
    return "\n".join(lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--starts", type=int, default=8)
    parser.add_argument("--random", type=int, default=100)
    parser.add_argument("--robots", nargs="+")
    parser.add_argument("--out", type=Path, default=RESULTS)
    arguments = parser.parse_args()
    facts = machine() | {
        "starts": str(arguments.starts), "random motions": str(arguments.random),
    }  # fmt: skip
    # loads the kernels from disk
    exciting_trajectory(rm.load("planar_2r"), starts=1, baseline=1, iterations=2, rng=0)
    rows = []
    for name, what, options in CASES:
        if arguments.robots and name not in arguments.robots:
            continue
        rows.append(measured(name, what, options, arguments.starts, arguments.random))
        print({k: v for k, v in rows[-1].items() if k != "starts"}, flush=True)
        kept = {"machine": facts, "rows": rows}
        keep(arguments.out, "excitation", report(rows, facts), kept)


if __name__ == "__main__":
    main()
