"""Print the lines and files of every package of robotmodels, of the tests and of the benchmarks.

    python .ci/lines.py [--check]

Whole Python files are counted as they stand. ``--check`` ends with 1 where a package or folder is
more than 15 % above its budget and above the lines that `ACCEPTED` states for it.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
BUDGETS = {
    "igm": 9000, "kinematics": 5300, "symbolic": 2700, "identification": 6800,
    "calibration": 5900, "estimation": 1800, "logs": 1500, "minimal_parameters": 2100,
    "regressors": 1200, "dynamics, friction, drive, inertia, simulation": 3000, "viz": 4200,
    "cli": 2100, "trajectories": 4000, "kernels": 3100, "performance": 2000, "loops": 800,
    "parallel": 2000, "control": 1500, "visual_servoing": 1400, "flexible": 1500, "export": 1000,
}  # fmt: skip
"""Lines of a package, or of several together; the rest shares `REST`."""
REST = 6500
FOLDERS = {"robotmodels": 71000, "tests": 32000, "benchmarks": 2500}
ACCEPTED = {
    "igm": 11000, "identification": 8170, "calibration": 7910, "logs": 2010,
    "minimal_parameters": 2770, "viz": 5490, "trajectories": 5650, "performance": 3700,
    "loops": 1680, "parallel": 2990, "control": 1860, "visual_servoing": 2300, "flexible": 3090,
    "export": 1600, "all other packages": 7490, "robotmodels": 89520, "benchmarks": 3280,
}  # fmt: skip
"""What is above its budget, and the lines it may have: these numbers only shrink."""


def lines(path: Path) -> tuple[int, int]:
    """Lines and Python files of a file or folder."""
    found = [path] if path.is_file() else sorted(path.rglob("*.py"))
    return sum(len(p.read_text(encoding="utf-8").splitlines()) for p in found), len(found)


def total(counts: list[tuple[int, int]]) -> tuple[int, int]:
    """Sums of lines and files."""
    return sum(count for count, _ in counts), sum(files for _, files in counts)


def main() -> None:
    """Print the table, or check it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="end with 1 above the budgets")
    check = parser.parse_args().check
    package = ROOT / "robotmodels"
    rooms = {p.stem: lines(p) for p in sorted(package.iterdir()) if p.suffix == ".py" or p.is_dir()}
    rooms = {name: count for name, count in rooms.items() if count[0]}
    rows, named, wrong = [], set(), []
    for group, budget in BUDGETS.items():
        names = [name for name in group.split(", ") if name in rooms]
        named |= set(names)
        rows.append((group, *total([rooms[name] for name in names]), budget))
    rest = [rooms[name] for name in rooms if name not in named]
    rows.append(("all other packages", *total(rest), REST))
    rows += [(name, *lines(ROOT / name), budget) for name, budget in FOLDERS.items()]
    for name, count, files, budget in rows:
        print(f"{name:<50}{count:>8}{files:>6} files, budget {budget}")
        if count > max(round(1.15 * budget), ACCEPTED.get(name, 0)):
            wrong.append(f"{name}: {count} lines, budget {budget}")
    if check and wrong:
        sys.exit("\n".join(wrong))


if __name__ == "__main__":
    main()
