"""Speed of the models of parallel robots beside plain NumPy, in one run.

    python -m benchmarks.bench_parallel [--out benchmarks/results] [--rounds 15]

Contestants of a row take turns, round after round, so that a drifting machine is fair to all of
them; the figures are medians in microseconds for each pose, with the best round beside ours. No
package on the index lists all assembly modes of a hexapod; the elimination of E. Martyushev (fkSGP,
Python code) states 8.4 ms with errors up to 1.3e-7. What a peer gives is compared with ours.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from benchmarks.kept import RESULTS, keep
from benchmarks.machine import head, machine
from benchmarks.measure import Contestant, in_turns
from robotmodels import parallel as pr

Array = NDArray[np.float64]
OURS, NUMPY, EIGENVALUES = "robotmodels", "Newton in NumPy", "sextic by numpy.roots"
ROWS = 2000


@dataclass(frozen=True)
class Row:
    """A line of the table: microseconds for each pose, and the goal that was set."""

    work: str
    microseconds: dict[str, float]
    best: dict[str, float]
    goal: float
    met: bool


def measure(work: str, field: list[Contestant], rounds: int, goal: float) -> Row:
    """Time the contestants of a row."""
    found = {name: t.processor.times(1e6) for name, t in in_turns(field, rounds).items()}
    median = {name: spread.median for name, spread in found.items()}
    print(f"{work}: " + "; ".join(f"{name} {value:.1f}" for name, value in median.items()))
    best = {name: spread.least for name, spread in found.items()}
    return Row(work, median, best, goal, median[OURS] <= goal)


def newton_in_numpy(robot: pr.ParallelRobot, q: Array, T: Array) -> Array:
    """One pose as textbooks do it: the direct model by Newton's method."""
    R, p = T[:3, :3].copy(), T[:3, 3].copy()
    for _ in range(20):
        arm = robot.platform @ R.T
        d = p + arm - robot.base
        size = np.linalg.norm(d, axis=1)
        u = d / size[:, None]
        step = np.linalg.solve(np.c_[u, np.cross(arm, u)], q - size)
        p, R = p + step[:3], Rotation.from_rotvec(step[3:]).as_matrix() @ R
        if np.abs(step).max() < 1e-9:
            break
    out = np.eye(4)
    out[:3, :3], out[:3, 3] = R, p
    return out


def rows(rounds: int) -> list[Row]:
    """All rows of the table."""
    rng, table = np.random.default_rng(0), []
    robot = pr.gough(*rng.normal(size=(2, 6, 3)))
    hexapod = pr.gough_symmetric(1.0)
    T = hexapod.pose(hexapod.coordinates(hexapod.home) + 0.2 * rng.uniform(-1, 1, (ROWS, 6)))
    q = pr.igm(hexapod, T).q[:, 0]
    many = pr.igm(robot, robot.pose(rng.uniform(-1, 1, (20, 6)))).q[:, 0]

    def add(work: str, goal: float, count: int, run: Callable[[], Any], *others: Any) -> None:
        peers = [Contestant(name, call, n, rounds=3) for name, call, n in others]
        table.append(measure(work, [Contestant(OURS, run, count), *peers], rounds, goal))

    add("all modes of a 6-6, alone", 25e3, 1, lambda: pr.assembly_modes(robot, many[0]))
    add("all modes of a 6-6, batch", 25e3, 20, lambda: pr.assembly_modes(robot, many))
    for kind in ("SSM", "TSSM", "MSSM"):
        special = pr.gough_symmetric(1.0, kind=kind)
        lengths = pr.igm(special, T[0]).q[0]
        add(f"all modes, {kind}", 25e3, 1, lambda r=special, x=lengths: pr.assembly_modes(r, x))
    planar = pr.planar_3rpr(*rng.normal(size=(2, 3, 2)))
    places = pr.igm(planar, planar.pose(rng.normal(size=(ROWS, 3)))).q[:, 0]
    polynomial = np.r_[1.0, rng.normal(size=6)]
    bare = (EIGENVALUES, lambda: [np.roots(polynomial) for _ in range(100)], 100)
    add("all modes of a 3-RPR, batch", 50.0, ROWS, lambda: pr.assembly_modes(planar, places), bare)
    first = newton_in_numpy(hexapod, q[0], hexapod.home)
    if np.abs(first - T[0]).max() > 1e-9:
        raise SystemExit("The two direct models differ.")
    slow = (NUMPY, lambda: [newton_in_numpy(hexapod, x, hexapod.home) for x in q[:50]], 50)
    add("iterative direct model, batch", 15.0, ROWS, lambda: pr.dgm(hexapod, q), slow)
    add("inverse Jacobian, batch", 5.0, ROWS, lambda: pr.inverse_jacobian(hexapod, T))
    return table


def report(table: list[Row], about: dict[str, Any], rounds: int) -> str:
    """The table as Markdown."""
    lines = [
        *head("Parallel robots", about),
        f"Medians of {rounds} rounds, microseconds of processor time for each pose.",
        "",
        "| work | ours | our best | others | goal | met |",
        "|---|---|---|---|---|---|",
    ]
    for r in table:
        others = "; ".join(f"{k} {v:.1f}" for k, v in r.microseconds.items() if k != OURS)
        cells = (r.work, f"{r.microseconds[OURS]:.1f}", f"{r.best[OURS]:.1f}", others)
        lines.append(f"| {' | '.join(cells)} | <= {r.goal:g} | {'yes' if r.met else 'no'} |")
    return "\n".join(lines) + "\n"


def main() -> None:
    """Measure, print and keep the results."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=RESULTS)
    parser.add_argument("--rounds", type=int, default=15)
    arguments = parser.parse_args()
    about = machine({})
    table = rows(arguments.rounds)
    text = report(table, about, arguments.rounds)
    print(text)
    keep(arguments.out, "parallel", text, {"machine": about, "rows": [asdict(r) for r in table]})


if __name__ == "__main__":
    main()
