"""Identifiable geometric parameters of robots under each kind of measurement, as tables.

    python -m benchmarks.accuracy_calibration [--out benchmarks/results]

For each robot, a row for each parameter and a column for each kind. Structural: random
configurations within the joint ranges, contacts at configurations that satisfy them exactly. The
last rows count, and compare the count with the rank that singular values give for other random
configurations.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

import robotmodels as rm
from robotmodels.calibration.identifiable import (
    IdentifiableParameters,
    Reason,
    identifiable_parameters,
)
from robotmodels.calibration.measurements.kinds import Kind, drawn_groups
from robotmodels.calibration.selection import group_rows

ROBOTS = {
    "puma560": "d3", "stanford_arm": "r2", "rx90": "d3", "ur10e": "d3", "panda": "r3",
}  # fmt: skip
"""Robots, and the parameter whose length is known for contacts."""
TARGET = rm.se3.translation(0.1, 0.05, 0.15)
"""Of what is measured, in the tool's frame: at the wrist centre positions would say nothing of the
wrist."""
KINDS = tuple(Kind)
CONTACTS = (Kind.ORIENTATION, Kind.FRAME_CONTACT, Kind.POINT_CONTACT, Kind.PLANE_CONTACT)
MARKS = {
    None: "●", Reason.REGROUPED: "r", Reason.NO_EFFECT: "0", Reason.GAUGE: "g", Reason.KNOWN: "k",
}  # fmt: skip
LEGEND = """\
● estimated; r regrouped: acts like a combination of others; 0 not identifiable: it does not change
what is measured; g gauge: the place of the robot is not seen; k known: gives the scale where no
length is measured. The target is 0.1, 0.05, 0.15 m beside the tool's frame. Contacts have several
points, poses or planes, all unknown, each met in several postures on the nominal robot."""


def rank_elsewhere(found: IdentifiableParameters, kind: Kind, seed: int) -> tuple[int, float]:
    """Rank of other random configurations by singular values, and the gap that it rests on."""
    p, rng = found.candidates, np.random.default_rng(seed)
    fixed = {*found.of_reason(Reason.KNOWN), *found.of_reason(Reason.GAUGE)}
    p = p.without(fixed) if fixed else p
    m = kind.postures
    drawn = drawn_groups(p, kind, 60 if m > 1 else 150, m, rng, limits=False)
    full = np.bincount(drawn.label)[drawn.label] == m
    q = drawn.q[full].reshape(-1, m, drawn.q.shape[1])
    W = group_rows(p, kind, q)
    W = W.reshape(-1, W.shape[-1])
    length = np.linalg.norm(W, axis=0)
    seen = length > 1e-9 * length.max()
    s = np.linalg.svd(W[:, seen] / length[seen], compute_uv=False)
    s = np.append(s, 0.0) / s[0]
    rank = int((s > 1e-8).sum())
    return rank, float(s[rank] / s[rank - 1])


def table(name: str) -> tuple[list[str], bool]:
    """Lines of the table of one robot, and whether all counts agree with the ranks."""
    robot = rm.load(name)
    robot = robot.with_tool(robot.tool @ TARGET)
    known, columns, ranks = ROBOTS[name], {}, {}
    for kind in KINDS:
        lengths = [known] if kind in CONTACTS else []
        found = identifiable_parameters(robot, kind, known_lengths=lengths)
        columns[kind] = found
        ranks[kind] = rank_elsewhere(found, kind, 7)
    names = [kind.name.lower().replace("_", " ") for kind in columns]
    lines = [f"## {name}", "", "| parameter | nominal | " + " | ".join(names) + " |",
             "|---|---:|" + ":-:|" * len(names)]  # fmt: skip
    candidates = next(iter(columns.values())).candidates
    for parameter, nominal in zip(candidates.names, candidates.nominal, strict=True):
        marks = [MARKS[found.reasons.get(parameter)] for found in columns.values()]
        lines.append(f"| {parameter} | {nominal:.4g} | " + " | ".join(marks) + " |")
    agree = all(columns[k].count == ranks[k][0] for k in columns)
    lines += [
        "| **estimated** | | " + " | ".join(str(f.count) for f in columns.values()) + " |",
        "| rank by singular values | | " + " | ".join(str(r) for r, _ in ranks.values()) + " |",
        "| gap of singular values | | " + " | ".join(f"{g:.0e}" for _, g in ranks.values()) + " |",
        "| condition | | " + " | ".join(f"{f.condition:.3g}" for f in columns.values()) + " |",
        "",
    ]  # fmt: skip
    R = int((robot.table.sigma == 0).sum())
    P = int((robot.table.sigma == 1).sum())
    lines += [f"Full pose by 4 R + 2 P + 6: {4 * R + 2 * P + 6}.", ""]
    return lines, agree


def main() -> None:
    """Print the tables and write them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "results")
    out = parser.parse_args().out
    lines, right = ["# Identifiable geometric parameters", "", LEGEND, ""], True
    for name in ROBOTS:
        part, agree = table(name)
        right &= agree
        lines += part
    lines.append(
        "All counts equal the rank by singular values at other configurations."
        if right
        else "SOME COUNTS DIFFER from the rank by singular values."
    )
    text = "\n".join(lines) + "\n"
    print(text)
    (out / "accuracy_calibration.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
