"""Speed of the recursions of flexible robots, and of simulated seconds.

    python -m benchmarks.bench_flexible [--out benchmarks/results] [--rounds 15] [--exudyn PYTHON]

Contestants of a row take turns. The direct model of a chain of N links is set beside a dense one:
the mass matrix by columns and a linear system, which costs N^3. A simulated second of two links is
set beside Exudyn's floating frames with the same modes, where an interpreter that has it is named
(its default is generalised-alpha with constant steps): the errors are those of the tip at the end,
against its own finest steps or our finest tolerance.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import time
from pathlib import Path

import numpy as np

import robotmodels as rm
from benchmarks.kept import RESULTS, keep
from benchmarks.machine import head, machine
from benchmarks.measure import Contestant, in_turns
from robotmodels import flexible
from robotmodels.flexible.models import forces

LINKS, GOAL = (3, 6, 12, 30), 60.0  # number of links; us for six
OURS = "robotmodels"


def chain(n: int) -> flexible.FlexibleRobot:
    """N equal links with two modes each."""
    model = rm.RobotModel.from_table(
        rm.DHTable(antecedent=range(n), sigma=[0] * n, alpha=[0.3] * n, d=[0.4] * n)
    )
    link = flexible.beam(0.4, EI=(np.inf, 100.0), density=1.0, modes=2)
    return flexible.FlexibleRobot(model, dict.fromkeys(range(1, n + 1), link))


def direct(n: int) -> list[Contestant]:
    """The direct model of a chain, alone and in a batch, and a dense one."""
    arm, rng = chain(n), np.random.default_rng(n)
    q, v, tau = rng.normal(size=(3, n))
    e, ev = 0.01 * rng.normal(size=(2, arm.m))
    many = [np.tile(x, (100, 1)) for x in (q, e, v, ev, tau)]

    def dense() -> np.ndarray:
        M, x, dx = flexible.mass_matrix(arm, q, e), np.append(q, e)[None], np.append(v, ev)[None]
        rest = forces(arm, x, dx, 0.0 * dx)[0][0]
        return np.linalg.solve(M, np.append(tau, np.zeros(arm.m)) - rest)

    found = np.concatenate(flexible.ddm(arm, q, e, v, ev, tau))
    off = float(np.abs(found - dense()).max() / np.abs(found).max())
    if off > 1e-8:
        raise SystemExit(f"direct model of {n} links: the two differ by {off:.3g}.")
    return [
        Contestant(OURS, lambda: flexible.ddm(arm, q, e, v, ev, tau)),
        Contestant(f"{OURS}, 100 at once", lambda: flexible.ddm(arm, *many), 100),
        Contestant("mass matrix and linear system", dense),
    ]


def second() -> list[Contestant]:
    """A simulated second of two links that fall."""
    model = rm.RobotModel.from_table(
        rm.DHTable(antecedent=[0, 1], sigma=[0, 0], d=[0, 0.5]), gravity=(0, -9.81, 0)
    )
    link = flexible.beam(0.5, EI=(np.inf, 10.0), density=0.2, hub=0.1, tip=0.1)
    arm = flexible.FlexibleRobot(model, {1: link, 2: link})
    return [
        Contestant(
            f"{OURS}, relative tolerance {rtol:g}",
            lambda rtol=rtol: flexible.simulate(arm, [0.0, 0.0], t=1.0, rtol=rtol),
            rounds=3,
        )
        for rtol in (1e-6, 1e-9)
    ]


def exudyn(python: str) -> list[str]:
    """Lines of the table: a second of two links that fall, in Exudyn and here, with errors."""
    link = flexible.beam(0.5, EI=(np.inf, 10.0), density=0.2, gyration=0.01)
    model = rm.RobotModel.from_table(
        rm.DHTable(antecedent=[0, 1], sigma=[0, 0], d=[0, 0.5]), gravity=(0, -9.81, 0)
    )
    arm = flexible.FlexibleRobot(model, {1: link, 2: link})
    x, corners = link.nodes[:, 0], 0.01 * np.array([[0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])
    shapes = np.repeat(link.shapes[:, None], 4, axis=1)
    slope = np.gradient(link.shapes[:, 1], x, axis=0, edge_order=2)
    shapes[:, :, 0] -= slope[:, None] * corners[None, :, 1, None]
    weights = np.gradient(x) * np.where((x == x[0]) | (x == x[-1]), 0.5, 1.0)
    steps = (500, 2000, 8000, 32000)
    given = {
        "points": (link.nodes[:, None] + corners).reshape(-1, 3), "gravity": model.gravity,
        "masses": np.repeat(0.05 * weights, 4), "shapes": shapes.reshape(-1, 3, link.m),
        "frequencies": link.frequencies, "steps": np.array(steps),
    }  # fmt: skip
    text = json.dumps({key: value.tolist() for key, value in given.items()})
    script = str(Path(__file__).with_name("exudyn_arm.py"))
    done = subprocess.run([python, script], input=text, capture_output=True, text=True, check=True)
    rows = np.array(json.loads(done.stdout.splitlines()[-1]))
    off = np.linalg.norm(rows[:, 1:] - rows[-1, 1:], axis=1)
    lines = [
        f"| Exudyn, {n} steps | {1e6 * row[0]:.0f} us, error {e:.1g} m | |"
        for n, row, e in zip(steps[:-1], rows, off, strict=False)
    ]
    tips = []
    for rtol in (1e-11, 1e-4, 1e-6, 1e-9):
        started = time.process_time()
        run = flexible.simulate(arm, [0.0, 0.0], t=1.0, rtol=rtol, atol=1e-2 * rtol)
        spent = time.process_time() - started
        tips.append(flexible.dgm(arm, run.q[-1], run.e[-1])[:3, 3])
        error = np.linalg.norm(tips[-1] - tips[0])
        note = f"{1e6 * spent:.0f} us, error {error:.1g} m"
        lines += [f"| {OURS}, relative tolerance {rtol:g} | {note} | |"] if rtol > 1e-11 else []
    if (apart := np.linalg.norm(tips[0] - rows[-1, 1:])) > 2e-3:  # the mass lies in 41 places there
        raise SystemExit(f"Exudyn: the tip is {apart:.3g} m from ours after a second.")
    return lines


def main() -> None:
    """Measure, print and keep the results."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=RESULTS)
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--exudyn", metavar="PYTHON", help="interpreter that has Exudyn")
    arguments = parser.parse_args()
    about, lines, kept = machine({}), [], {}
    work = {f"direct model, {n} links with two modes": direct(n) for n in LINKS}
    for name, contestants in {**work, "a simulated second, two links": second()}.items():
        found = in_turns(contestants, arguments.rounds)
        times = {who: spent.processor.times(1e6).median for who, spent in found.items()}
        kept[name] = times
        goal = f"<= {GOAL:g} us" if " 6 links" in name else ""
        lines.append(f"| {name} | {'; '.join(f'{w} {t:.1f}' for w, t in times.items())} | {goal} |")
    if arguments.exudyn:
        lines += exudyn(arguments.exudyn)
    else:
        lines.append("| Exudyn: skipped, no interpreter is named by --exudyn | | |")
    slope = np.polyfit(LINKS, [kept[name][f"{OURS}, 100 at once"] for name in work], 1)[0]
    text = "\n".join(
        [
            *head("Flexible robots: measured side by side", about),
            f"Medians in us a call, one thread; {slope:.2f} us for each further link in a batch.",
            "", "| work | us | goal |", "|---|---|---|", *lines,
        ]
    )  # fmt: skip
    print(text)
    keep(arguments.out, "flexible", text + "\n", {"machine": about, "rows": kept})


if __name__ == "__main__":
    main()
