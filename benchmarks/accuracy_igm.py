"""Completeness and accuracy of the inverse geometric models, beside EAIK where it serves the arm.

    python -m benchmarks.accuracy_igm [--poses 100000] [--only ARM ...] [--out benchmarks/results]

For each arm, the poses of random postures, 3 of 100 of them singular or nearly so (wrist aligned,
elbow stretched or folded, shoulder on the axis, all combinations; exactly, or 1e-12 ... 1e-3 rad
beside it), are given to `rm.igm` with the posture they were made of as reference. What it returns
is judged by the direct model alone. See the notes that are printed below the table.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import robotmodels as rm
from benchmarks import igm_arms
from benchmarks.igm_checks import (
    CLOSE,
    branch_given_back,
    difference,
    gaps,
    given_back,
    newton_search,
    residual,
)
from benchmarks.igm_postures import Kind, sample, sigma_of
from benchmarks.machine import head, machine
from benchmarks.peers.igm import eaik
from benchmarks.works import OURS, RESULTS, Row, keep, table

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

ARMS = ("rx90", "puma560", "irb6640", "kr6_r900", "stanford_arm", "ur5", "ur5e", "crx10ia", "xarm6")
SINGULAR = 0.03
SEARCHED, STARTS = 200, 250  # poses given to the independent search, and its starts for each
WITH_LIMITS = 2000  # poses solved within the limits
CHUNK = 10_000
GOAL = 1e-12
FAR_FROM_FOLDS = 1e-4  # smallest singular value of the Jacobian of every posture returned


def postures_of(name: str, count: int) -> tuple[rm.RobotModel, Array, Array, Flags]:
    """The arm, its postures, what is singular in each, which are so to rounding."""
    model, rng = rm.load(name), np.random.default_rng(0)
    found = sample(model, name in ("crx10ia", "xarm6"), count, SINGULAR, rng)
    order = rng.permutation(count)
    return model, found.q[order], found.kind[order], found.exact[order]


def ours(name: str, count: int) -> Row:
    """`rm.igm` on one arm of the catalogue."""
    model, q, kind, exact = postures_of(name, count)
    # kernels of singular poses are compiled when the first one comes, which is not to be timed
    found = rm.igm(model, rm.dgm(model, q[kind > 0][:50]))
    counts: Counter[str] = Counter()
    kinds: Counter[str] = Counter()
    worst, seconds = 0.0, 0.0
    for start in range(0, count, CHUNK):
        part = slice(start, start + CHUNK)
        T, singular = rm.dgm(model, q[part]), kind[part] > 0
        began = time.process_time()
        found = rm.igm(model, T, q_ref=q[part])
        seconds += time.process_time() - began
        there = given_back(model, T, q[part], found.q, found.valid)
        itself = gaps(model, found.q, found.valid, q[part]).min(axis=1, initial=np.inf) < 1e-4
        i, s = np.nonzero(found.valid)
        error = np.zeros(found.valid.shape)
        error[i, s] = residual(model, T[i], found.q[i, s])
        worst = max(worst, float(error.max(initial=0.0)))
        kinds.update(tuple(Kind)[k].value for k in kind[part][~there])
        for word, flags in {
            "lost": ~there & ~singular,
            "lost_singular": ~there & singular,
            "not_at_reference": there & exact[part] & ~itself,
            "above_goal": error.max(axis=1, initial=0.0) > GOAL,
            "nan": (np.isnan(found.q).any(axis=2) & found.valid).any(axis=1),
            "odd": odd(model, found.q, found.valid, found.double),
        }.items():
            counts[word] += int(flags.sum())
    rng = np.random.default_rng(1)
    unknown, checked = beside_search(model, q[kind == 0][:SEARCHED], rng)
    outside, wrong_order = within_limits(model, rng)
    words = ("lost", "lost_singular", "not_at_reference", "above_goal", "nan", "odd")
    return {
        "arm": name, "solver": OURS, "method": found.method, "poses": count,
        "singular": int((kind > 0).sum()), **{word: counts[word] for word in words},
        "residual": worst, "unknown": unknown, "checked_by_search": checked, "limits": outside,
        "order": wrong_order, "microseconds": seconds / count * 1e6, "lost_by_kind": dict(kinds),
    }  # fmt: skip


def odd(model: rm.RobotModel, q: Array, valid: Flags, double: Flags | None = None) -> Flags:
    """Poses with an odd number of postures, none of them near a fold."""
    total = valid.sum(axis=1) + (0 if double is None else (double & valid).sum(axis=1))
    poses = np.flatnonzero(total % 2 == 1)
    far = np.zeros(len(valid), np.bool_)
    for i in poses:
        J = rm.jacobian(model, q[i][valid[i]])
        far[i] = np.linalg.svd(J, compute_uv=False)[:, -1].min() > FAR_FROM_FOLDS
    return far


def beside_search(model: rm.RobotModel, q: Array, rng: np.random.Generator) -> tuple[int, int]:
    """Postures that Newton's method finds from many starts and `rm.igm` does not, of how many."""
    T = rm.dgm(model, q)
    found = rm.igm(model, T)
    search = newton_search(model, T, STARTS, rng).postures
    unknown = total = 0
    for i, rows in enumerate(search):
        total += len(rows)
        if len(rows):
            every = np.repeat(found.q[i][None], len(rows), axis=0)
            there = np.repeat(found.valid[i][None], len(rows), axis=0)
            pose = np.repeat(T[i][None], len(rows), axis=0)
            away = ~given_back(model, pose, rows, every, there)
            unknown += int(away.sum())
    return unknown, total


def within_limits(model: rm.RobotModel, rng: np.random.Generator) -> tuple[int, int]:
    """Poses whose rows within the limits are not what they should be; rows out of order."""
    low = np.where(np.isfinite(model.lower), model.lower, -np.pi)
    high = np.where(np.isfinite(model.upper), model.upper, np.pi)
    q = rng.uniform(low, high, (WITH_LIMITS, model.n))
    T = rm.dgm(model, q)
    every = rm.igm(model, T, q_ref=q)
    found = rm.igm(model, T, q_ref=q, limits=True)
    rows = np.where(found.valid[..., None], found.q, 0.5 * (low + high))
    bad = ((rows < model.lower) | (rows > model.upper)).any(axis=(1, 2))
    # the posture itself, not a whole turn away from it
    bad |= ~(np.abs(np.nan_to_num(found.q, nan=np.inf) - q[:, None]).max(axis=2) < CLOSE).any(
        axis=1
    )
    # every posture that a whole turn brings within the limits, and no other
    turning = np.flatnonzero(sigma_of(model) == 0)
    shifted = every.q.copy()
    for k in turning:
        up = np.ceil((model.lower[k] - every.q[..., k] - 1e-12) / (2 * np.pi))
        shifted[..., k] += 2 * np.pi * np.where(np.isfinite(up), up, 0.0)
    inside = every.valid & ((shifted >= model.lower) & (shifted <= model.upper)).all(axis=2)
    bad |= inside.sum(axis=1) != found.count
    wrong = np.zeros(len(q), np.bool_)
    for result in (every, found):
        way = result.q - q[:, None]
        if result is every:
            way = difference(model, result.q, np.broadcast_to(q[:, None], result.q.shape))
        distance = np.where(result.valid, np.linalg.norm(way, axis=2), np.inf)
        wrong |= (distance[:, 1:] < distance[:, :-1] - 1e-9).any(axis=1)
    return int(bad.sum()), int(wrong.sum())


# --- EAIK ----------------------------------------------------------------------------------------


def theirs(name: str, count: int) -> Row | None:
    """EAIK on the same poses, None where it does not serve the arm or is not installed."""
    model, q, kind, _ = postures_of(name, count)
    peers = list(eaik(model))
    if not peers or peers[0].batch is None:
        return None
    counts: Counter[str] = Counter()
    kinds: Counter[str] = Counter()
    worst, seconds = 0.0, 0.0
    for start in range(0, count, CHUNK):
        part = slice(start, start + CHUNK)
        T, singular = rm.dgm(model, q[part]), kind[part] > 0
        began = time.process_time()
        answers = peers[0].batch(T)
        seconds += time.process_time() - began
        rows, valid, claimed = packed(answers, model.n)
        i, s = np.nonzero(valid)
        error = np.full(valid.shape, np.inf)
        error[i, s] = residual(model, T[i], rows[i, s])
        # whatever meets the pose counts, also what it calls least squares
        met = error < CLOSE
        there = branch_given_back(model, T, q[part], rows, met)
        counts["lost"] += int((~there & ~singular).sum())
        counts["lost_singular"] += int((~there & singular).sum())
        kinds.update(tuple(Kind)[k].value for k in kind[part][~there])
        promised = np.where(claimed, error, 0.0)
        worst = max(worst, float(promised.max(initial=0.0)))
        counts["above_goal"] += int((promised > GOAL).any(axis=1).sum())
        counts["odd"] += int(odd(model, rows, met).sum())
    words = ("lost", "lost_singular", "above_goal", "odd")
    return {
        "arm": name, "solver": "EAIK", "poses": count, "singular": int((kind > 0).sum()),
        **{word: counts[word] for word in words}, "residual": worst,
        "microseconds": seconds / count * 1e6, "lost_by_kind": dict(kinds),
    }  # fmt: skip


def packed(answers: list, n: int) -> tuple[Array, Flags, Flags]:
    """EAIK's answers as arrays: postures (N, S, n), which there are, which it claims exact."""
    most = max(len(a.Q) for a in answers)
    q = np.full((len(answers), most, n), np.nan)
    there, claimed = np.zeros((2, len(answers), most), np.bool_)
    for i, a in enumerate(answers):
        k = len(a.Q)
        if k:
            q[i, :k], there[i, :k] = a.Q, np.isfinite(a.Q).all(axis=1)
            claimed[i, :k] = ~np.asarray(a.is_LS, np.bool_)
    return q, there, claimed & there


def printed_postures() -> tuple[int, float]:
    """How many of the 16 printed postures of Manocha and Canny come, and how far off [deg]."""
    model = igm_arms.manocha_canny()
    found = rm.igm(model, igm_arms.manocha_canny_pose(model))
    printed = np.deg2rad(igm_arms.MANOCHA_CANNY_POSTURES)
    gap = np.abs(difference(model, found.q[found.valid][:, None], printed[None])).max(axis=2)
    near = gap.argmin(axis=1)
    return len(set(near[gap.min(axis=1) < np.deg2rad(0.05)])), float(
        np.rad2deg(gap.min(axis=1).max())
    )


NOTES = """
- lost: postures that made a pose of which no row is within 1e-6 of them in every joint, and none
  is joined to them by a path on which the pose is kept to 1e-12 (the pose does not tell those
  apart). For EAIK, which takes no reference, also members of the same infinite family count.
- off q_ref: poses singular to rounding where the posture that made it, given as `q_ref`, is not
  itself among the rows, only another member of its family.
- residual: the largest one of any row returned [m or rad]; above: poses with a row above 1e-12.
  For EAIK, of the rows that it does not call least squares.
- odd: poses with an odd number of postures though none is near a fold.
- unknown: postures that damped Newton steps from {starts} random starts find for {searched} regular
  poses and the model does not, of how many they find.
- limits: of {limited} poses, those where the rows within the limits are not those postures that
  whole turns bring there, or the posture that made it is not among them; order: those whose rows
  are not ordered by their distance to `q_ref`.
"""


COLUMNS = (
    "arm", "solver", "poses", "singular", "lost", "lost_singular", "not_at_reference", "residual",
    "above_goal", "nan", "odd", "unknown", "checked_by_search", "limits", "order", "microseconds",
)  # fmt: skip


def report(rows: list[Row], printed: tuple[int, float], about: dict[str, str]) -> str:
    """The results as Markdown."""
    lines = head("Inverse geometric models: completeness and accuracy", about)
    shown = {"residual": "{:.1e}", "microseconds": "{:.1f}"}
    lines += table(
        [word.replace("_", " ") for word in COLUMNS],
        [[shown.get(w, "{}").format(r[w]) if w in r else "" for w in COLUMNS] for r in rows],
    )
    lines.append(NOTES.format(starts=STARTS, searched=SEARCHED, limited=WITH_LIMITS).rstrip())
    for r in rows:
        if r["lost_by_kind"]:
            kinds = ", ".join(f"{kind} {number}" for kind, number in r["lost_by_kind"].items())
            lines.append(f"- lost, {r['arm']}, {r['solver']}, by what is singular: {kinds}")
    lines.append(
        f"- Manocha and Canny's arm: {printed[0]} of the 16 printed postures, the farthest "
        f"{printed[1]:.3f} deg from the print (two decimals)."
    )
    return "\n".join(lines) + "\n"


def main() -> None:
    """Count, print and keep the results."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=RESULTS)
    parser.add_argument("--poses", type=int, default=100_000)
    parser.add_argument("--only", nargs="*", default=ARMS, help="arms of the catalogue")
    given = parser.parse_args()
    rows = []
    for name in given.only:
        for row in (ours(name, given.poses), theirs(name, given.poses)):
            if row is not None:
                rows.append(row)
                print({word: row[word] for word in COLUMNS if word in row}, flush=True)
    about, printed = machine(["eaik"]), printed_postures()
    text = report(rows, printed, about)
    print(text)
    kept = {"machine": about, "rows": rows, "printed_postures": printed}
    keep(given.out, "accuracy_igm", text, kept)


if __name__ == "__main__":
    main()
