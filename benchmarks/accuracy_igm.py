"""Completeness and accuracy of the inverse geometric models.

    python -m benchmarks.accuracy_igm [--poses 100000] [--only ARM ...] [--out benchmarks/results]

For each arm, the poses of random postures, 3 of 100 of them singular or nearly so (wrist aligned,
elbow stretched or folded, shoulder on the axis, all combinations; exactly, or 1e-12 ... 1e-3 rad
beside it), are given to `rm.igm` with the posture they were made of as reference. What it returns
is judged by the direct model alone. See the notes that are printed below the table; postures of
other programs are compared by ``python -m benchmarks --only igm``.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import robotmodels as rm
from benchmarks.igm_checks import CLOSE, given_back, newton_search, residual
from benchmarks.igm_postures import Kind, sample
from benchmarks.machine import head, machine
from benchmarks.works import OURS, RESULTS, Row, keep, table

Array = NDArray[np.float64]

ARMS = ("rx90", "puma560", "irb6640", "kr6_r900", "stanford_arm", "ur5", "ur5e", "crx10ia", "xarm6")
SINGULAR = 0.03
SEARCHED, STARTS = 200, 250  # poses given to the independent search, and its starts for each
CHUNK = 10_000
GOAL = 1e-12


def judged(name: str, count: int) -> Row:
    """How many of the postures that made the poses are given back, and how exact they are."""
    model, rng = rm.load(name), np.random.default_rng(0)
    made = sample(model, name in ("crx10ia", "xarm6"), count, SINGULAR, rng)
    order = rng.permutation(count)
    q, kind = made.q[order], made.kind[order]
    first = q[kind > 0][:50]  # kernels of singular poses are compiled before the time is taken
    rm.igm(model, rm.dgm(model, first), q_ref=first)
    counts, kinds = Counter[str](), Counter[str]()
    worst = seconds = 0.0
    for start in range(0, count, CHUNK):
        part = slice(start, start + CHUNK)
        T, singular = rm.dgm(model, q[part]), kind[part] > 0
        began = time.process_time()
        found = rm.igm(model, T, q_ref=q[part])
        seconds += time.process_time() - began
        i, s = np.nonzero(found.valid)
        error = np.full(found.valid.shape, np.inf)
        error[i, s] = residual(model, T[i], found.q[i, s])
        back = given_back(model, T, q[part], found.q, error < CLOSE)
        promised = np.where(found.valid, error, 0.0).max(axis=1, initial=0.0)
        worst = max(worst, float(promised.max(initial=0.0)))
        kinds.update(tuple(Kind)[k].value for k in kind[part][~back])
        counts["lost"] += int((~back & ~singular).sum())
        counts["lost_singular"] += int((~back & singular).sum())
        counts["above_goal"] += int((promised > GOAL).sum())
    row = {"arm": name, "solver": OURS, "poses": count, "singular": int((kind > 0).sum())}
    row |= {word: counts[word] for word in ("lost", "lost_singular", "above_goal")}
    row |= {"residual": worst, "microseconds": seconds / count * 1e6, "lost_by_kind": dict(kinds)}
    unknown, checked = beside_search(model, q[kind == 0][:SEARCHED])
    return row | {"unknown": unknown, "checked_by_search": checked}


def beside_search(model: rm.RobotModel, q: Array) -> tuple[int, int]:
    """Postures that Newton's method finds from many starts and `rm.igm` does not, of how many."""
    T = rm.dgm(model, q)
    found = rm.igm(model, T)
    search = newton_search(model, T, STARTS, np.random.default_rng(1))
    pose = np.repeat(np.arange(len(T)), [len(rows) for rows in search])
    rows = np.concatenate(search)
    there = given_back(model, T[pose], rows, found.q[pose], found.valid[pose])
    return int((~there).sum()), len(rows)


NOTES = """
- lost: postures that made a pose of which no row is within 1e-6 of them in every joint, and none
  is joined to them by a path on which the pose is kept to 1e-12 (the pose does not tell those
  apart).
- residual: the largest one of any row returned [m or rad]; above: poses with a row above 1e-12.
- unknown: postures that damped Newton steps from {starts} random starts find for {searched} regular
  poses and the model does not, of how many they find.
"""
COLUMNS = (
    "arm", "poses", "singular", "lost", "lost_singular", "residual", "above_goal",
    "unknown", "checked_by_search", "microseconds",
)  # fmt: skip


def report(rows: list[Row], about: dict[str, str]) -> str:
    """The results as Markdown."""
    lines = head("Inverse geometric models: completeness and accuracy", about)
    shown = {"residual": "{:.1e}", "microseconds": "{:.1f}"}
    lines += table(
        [word.replace("_", " ") for word in COLUMNS],
        [[shown.get(w, "{}").format(r[w]) for w in COLUMNS] for r in rows],
    )
    lines.append(NOTES.format(starts=STARTS, searched=SEARCHED).rstrip())
    for r in (r for r in rows if r["lost_by_kind"]):
        kinds = ", ".join(f"{kind} {number}" for kind, number in r["lost_by_kind"].items())
        lines.append(f"- lost, {r['arm']}, by what is singular: {kinds}")
    return "\n".join(lines) + "\n"


def main() -> None:
    """Count, print and keep the results."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=RESULTS)
    parser.add_argument("--poses", type=int, default=100_000)
    parser.add_argument("--only", nargs="*", default=ARMS, help="arms of the catalogue")
    given = parser.parse_args()
    rows: list[Row] = []
    for name in given.only:
        rows.append(judged(name, given.poses))
        print({word: rows[-1][word] for word in COLUMNS}, flush=True)
    about = machine()
    text = report(rows, about)
    print(text)
    keep(given.out, "accuracy_igm", text, {"machine": about, "rows": rows})


if __name__ == "__main__":
    main()
