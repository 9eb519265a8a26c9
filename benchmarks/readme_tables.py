"""The tables of `docs/benchmarks.md` and of the README, made from `benchmarks/results`.

    python benchmarks/readme_tables.py [--check] [--root FOLDER]

Puts them between the lines ``<!-- tables from benchmarks/results: begin -->`` and
``<!-- tables from benchmarks/results: end -->``; ``--check`` changes nothing and ends with 1 where
a page is not what the results give.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from benchmarks.works import OURS, RESULTS, Row, figure, main_table

BEGIN = "<!-- tables from benchmarks/results: begin -->"
END = "<!-- tables from benchmarks/results: end -->"
SHORT = {
    "inverse dynamics, batch of 100000": "inverse dynamics, per sample of 100 000",
    "all postures, batch of 100000 poses, ur5e": "all 8 solutions of a pose, UR5e, batch",
    "torque regressor, a matrix of 2000 samples": "torque regressor, per sample",
    "base parameters of a UR10, from 100000 samples":
        "base parameters of a 6R from 100 000 samples",
    "UR10 full calibration, 100 poses": "calibration of a UR10, 100 poses",
}  # fmt: skip
"""The rows of the README: the work in the results, and its words there."""


def read(results: Path, name: str) -> dict:
    """What is kept of a run."""
    return json.loads((results / f"{name}.json").read_text(encoding="utf-8"))


def tables(results: Path = RESULTS) -> str:
    """The table of the page: machine, works, accuracy."""
    peers = read(results, "peers")
    facts = peers["machine"]
    versions = ", ".join(f"{k} {v}" for k, v in facts.items() if v[:1].isdigit() and k != "load")
    warning = f", **{facts['warning']}**" if "warning" in facts else ""
    left = f" Left out: {'; '.join(peers['absent'])}." if peers["absent"] else ""
    lines = [
        f"Medians of the processor's time, {facts['cpu']}, one thread, {versions}; load "
        f"{facts['load']}{warning}; run: {facts['run']}. Ratio: the fastest of the others that do "
        "the whole work to ours, above 1 where ours is faster; in brackets who does a part. "
        "Spreads: `benchmarks/results/peers.md`; to measure it again: `python -m benchmarks`."
        f"{left}",
        "",
        *main_table(peers["rows"]),
        "",
        missed(results),
        "",
        (results / "first_calls.md").read_text(encoding="utf-8").rstrip(),
    ]
    return "\n".join(lines)


def short(results: Path = RESULTS) -> str:
    """The rows of the README."""
    rows: dict[str, Row] = {r["work"]: r for r in read(results, "peers")["rows"]}
    lines = ["| task | robotmodels | fastest other program | times faster |", "|---|---|---|---|"]
    for work, words in SHORT.items():
        ours, *others = rows[work]["ways"]
        other = min((w for w in others if w["whole"]), key=lambda w: w["median"])
        unit = rows[work]["unit"]
        lines.append(
            f"| {words} | {figure(ours['median'])} {unit} | {other['name'].split()[0].rstrip(',')} "
            f"{figure(other['median'])} {unit} | {figure(rows[work]['ratio'])} |"
        )
    return "\n".join([*lines, "", missed(results)])


def missed(results: Path) -> str:
    """How many configurations the inverse model missed."""
    ours = [r for r in read(results, "accuracy_igm")["rows"] if r["solver"] == OURS]
    words = "poses", "singular", "lost", "lost_singular"
    poses, singular, lost, at_singular = (sum(r[k] for r in ours) for k in words)
    return (
        f"Inverse model, {poses} poses of {len(ours)} arms, {singular} of them singular or nearly "
        f"so: {lost} configurations missed at regular poses, {at_singular} at singular ones."
    )


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
    for name, made in (("README.md", short), ("docs/benchmarks.md", tables)):
        path = given.root / name
        old = path.read_text(encoding="utf-8")
        new = replaced(old, made())
        if given.check and new != old:
            sys.exit(f"{name} is not what the results give: benchmarks/readme_tables.py does it.")
        if new != old:
            path.write_text(new, encoding="utf-8")


if __name__ == "__main__":
    main()
