"""The tables of `docs/benchmarks.md` and of the README, made from `benchmarks/results`.

    python benchmarks/readme_tables.py [--check] [--root FOLDER]

Puts them between the lines ``<!-- tables from benchmarks/results: begin -->`` and
``<!-- tables from benchmarks/results: end -->``; ``--check`` changes nothing and ends with 1 where
a page is not what the results give. Needs the standard library alone.
"""

from __future__ import annotations

import argparse
import json
import sys
from math import degrees
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.rounded import figure, told_goals, told_ratios, way_of

BEGIN = "<!-- tables from benchmarks/results: begin -->"
END = "<!-- tables from benchmarks/results: end -->"
RESULTS = Path(__file__).parent / "results"
OURS, RAW = "robotmodels", "Pinocchio"
PACKAGES = {
    "pin": "pin", "roboticstoolbox-python": "RTB", "figaroh": "FIGAROH", "eaik": "EAIK",
    "ssik": "ssik", "ik-geo": "ik-geo", "pybotics": "pybotics", "ruckig": "ruckig",
}  # fmt: skip
Row = dict[str, Any]
SHORT = {
    "inverse dynamics, 100000 samples": "inverse dynamics, per sample of 100 000",
    "all 8 postures, batch of 100000 poses, UR5e": "all 8 solutions of a pose, UR5e, batch",
    "torque regressor 6 x 60, 100000 samples": "torque regressor, per sample of 100 000",
    "base parameters, 6R with friction and rotors": "base parameters of a 6R from 100 000 samples",
    "UR10 full calibration, 100 poses": "calibration of a UR10, 100 poses",
}
"""The rows of the README: the work in the results, and its words there."""


def tables(results: Path = RESULTS) -> str:
    """Everything that stands between the two lines."""
    peers = json.loads((results / "peers.json").read_text(encoding="utf-8"))
    if any("goals" not in r for r in peers["rows"]):
        raise ValueError("peers.json is of an older form: python -m benchmarks writes it anew.")
    parts = [speed(peers), accuracy(results)]
    return "\n\n".join("\n".join(part) for part in parts if part)


def speed(peers: dict[str, Any]) -> list[str]:
    """A line for each work."""
    facts = peers["machine"]
    told = [f"{PACKAGES[k]} {v}" for k, v in facts.items() if k in PACKAGES and v[0].isdigit()]
    lines = [
        f"Medians of the processor's time, {facts['cpu']}, one thread, Python {facts['python']}, "
        f"{', '.join(told)}; load {facts['load']}{a_warning(facts)}; run: {facts['run']}. "
        "Others / ours, above 1 where ours is faster: like with like, the fastest of those who do "
        "the whole work in one mode (in brackets) to ours in that mode; no figure where nobody "
        "else has a mode of ours. Goal: what was asked of ours, of a machine at rest. Spreads, "
        "and what was found: `benchmarks/results/peers.md`; to measure it again: "
        f"`python -m benchmarks`.{left_out(peers)}",
        "",
        "| work | robotmodels | Pinocchio, raw calls from Python | peers | others / ours | goal |",
        "|---|---|---|---|---|---|",
    ]
    for r in peers["rows"]:
        entries = r["entries"]
        unit = r["unit"]
        ours = "; ".join(told_time(e, unit) for e in entries if e["tool"] == OURS)
        raw = "; ".join(told_time(e, unit) for e in entries if e["tool"] == RAW)
        others = [e for e in entries if e["tool"] not in (OURS, RAW)]
        by_tool = [f"{e['tool']} {told_time(e, unit)}" for e in others]
        ratio = told_ratios(r, "{ratio} ({mode})")
        cells = [r["work"], ours, raw, "; ".join(by_tool), ratio, told_goals(r)]
        lines.append(f"| {' | '.join(cells)} |")
    return lines


def short(results: Path = RESULTS) -> str:
    """The five rows of the README."""
    peers = json.loads((results / "peers.json").read_text(encoding="utf-8"))
    rows = {r["work"]: r for r in peers["rows"]}
    lines = ["| task | robotmodels | fastest other program | times faster |", "|---|---|---|---|"]
    for work, words in SHORT.items():
        r = rows[work]
        mode = max(r["ratios"], key=r["ratios"].__getitem__)
        same = [e for e in r["entries"] if e["mode"] == mode and e["whole"]]
        ours = min((e for e in same if e["tool"] == OURS), key=lambda e: e["median"])
        other = min((e for e in same if e["tool"] != OURS), key=lambda e: e["median"])
        lines.append(
            f"| {words} | {figure(ours['median'])} {r['unit']} | "
            f"{other['tool']} {figure(other['median'])} {r['unit']} | {figure(r['ratios'][mode])} |"
        )
    poses, singular, arms, lost = missed(results)
    lines.append(
        f"\nInverse model, {poses} poses of {arms} arms, {singular} of them singular or nearly so: "
        f"{lost[0]} configurations missed at regular poses, {lost[1]} at singular ones."
    )
    return "\n".join(lines)


def missed(results: Path) -> tuple[int, int, int, tuple[int, int]]:
    """Poses, singular ones of them, arms, configurations missed at regular and singular poses."""
    rows = json.loads((results / "accuracy_igm.json").read_text(encoding="utf-8"))["rows"]
    ours = [r for r in rows if r["solver"] == OURS]
    words = "poses", "singular", "lost", "lost_singular"
    poses, singular, lost, at_singular = (sum(r[k] for r in ours) for k in words)
    return poses, singular, len(ours), (lost, at_singular)


def left_out(peers: dict[str, Any]) -> str:
    """What was not measured."""
    return f" Left out: {'; '.join(peers['absent'])}." if peers["absent"] else ""


def a_warning(facts: dict[str, str]) -> str:
    """What is said of figures of a busy machine."""
    return f", **{facts['warning']}**" if "warning" in facts else ""


def accuracy(results: Path) -> list[str]:
    """What is found, beside those who find it too."""
    igm = json.loads((results / "accuracy_igm.json").read_text(encoding="utf-8"))["rows"]
    camera = json.loads((results / "calibration.json").read_text(encoding="utf-8"))["camera"]
    lines = ["| accuracy | robotmodels | peers |", "|---|---|---|"]
    poses, singular, arms, lost = missed(results)
    title = (
        f"configurations missed, of {poses} poses of {arms} arms, {singular} of them singular or "
        "nearly so"
    )
    theirs = []
    for solver in dict.fromkeys(r["solver"] for r in igm if r["solver"] != OURS):
        own = [r for r in igm if r["solver"] == solver]
        count, left = (sum(r[k] for r in own) for k in ("poses", "lost"))
        theirs.append(f"{solver} {left} of {count} ({len(own)} arms)")
    ours = f"{lost[0]} at regular poses, {lost[1]} at singular ones"
    lines.append(f"| {title} | {ours} | {'; '.join(theirs)} |")
    best = {}
    for r in camera:
        tool = r["name"].partition(":")[0]
        best[tool] = min(best.get(tool, (float("inf"), 0.0)), tuple(r["leave one out"]))
    told = {k: f"{1e3 * p:.2f} mm, {degrees(a):.2f} deg" for k, (p, a) in best.items()}
    others = "; ".join(f"{k} {v}" for k, v in told.items() if k != OURS)
    title = "UR10 and camera, 23 real poses, each left out in turn, the best way of each tool: rms"
    lines.append(f"| {title} | {told[OURS]} | {others} |")
    return lines


def told_time(entry: Row, unit: str) -> str:
    """A median with its unit, its mode and way."""
    way = way_of(entry)
    return f"{figure(entry['median'])} {unit}" + (f" ({way})" if way else "")


def replaced(page: str, new: str) -> str:
    """The page with the tables between its two lines."""
    before, begin, rest = page.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"The page lacks the lines {BEGIN!r} and {END!r}, in this order.")
    return f"{before}{BEGIN}\n{new}\n{END}{after}"


def main() -> None:
    """Replace, or check."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true", help="change nothing")
    parser.add_argument("--root", type=Path, default=RESULTS.parents[1])
    given = parser.parse_args()
    for path, made in (
        (given.root / "README.md", short),
        (given.root / "docs/benchmarks.md", tables),
    ):
        old = path.read_text(encoding="utf-8")
        new = replaced(old, made())
        if given.check and new != old:
            sys.exit(
                f"{path.name} is not what the results give: benchmarks/readme_tables.py does it."
            )
        if new != old:
            path.write_text(new, encoding="utf-8")


if __name__ == "__main__":
    main()
