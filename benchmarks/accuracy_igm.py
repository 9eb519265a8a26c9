"""Completeness and accuracy of the inverse geometric models, beside EAIK where it serves the arm.

    python -m benchmarks.accuracy_igm [--poses 100000] [--arms 1000] [--out benchmarks/results]

For each arm, the poses of random postures, 3 of 100 of them singular or nearly so (wrist aligned,
elbow stretched or folded, shoulder on the axis, all combinations; exactly, or 1e-12 ... 1e-3 rad
beside it), are given to `rm.igm` with the posture they were made of as reference. What it returns
is judged by the direct model alone. See the notes that are printed below the table.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, replace
from multiprocessing import get_context
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
from benchmarks.igm_peers import PACKAGES, eaik
from benchmarks.igm_postures import Kind, sample, sigma_of, uniform
from benchmarks.machine import machine
from robotmodels.igm.elimination import elimination_solutions, prepare_elimination
from robotmodels.igm.loop import joint_chain

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

ARMS = ("rx90", "puma560", "irb6640", "kr6_r900", "stanford_arm", "ur5", "ur5e", "crx10ia", "xarm6")
SINGULAR = 0.03
SEARCHED, STARTS = 200, 250  # poses given to the independent search, and its starts for each
WITH_LIMITS = 2000  # poses asked for within the limits
CHUNK = 10_000
GOAL = 1e-12
KEPT = 20  # postures that went wrong are kept up to this many of a sort
FAR_FROM_FOLDS = 1e-4  # smallest singular value of the Jacobian of every posture returned


@dataclass(frozen=True)
class Row:
    """What was counted for one solver on one arm."""

    arm: str
    solver: str
    method: str
    poses: int
    singular: int
    lost: int
    lost_singular: int
    not_at_reference: int
    searched_for: int
    residual: float
    above_goal: int
    nan: int
    odd: int
    unknown: int
    checked_by_search: int
    limits: int
    order: int
    microseconds: float
    lost_by_kind: dict[str, int]
    examples: dict[str, list[list[float]]]


class Bar:
    """How far a long run has come, on stderr."""

    def __init__(self, title: str, total: int) -> None:
        self.title, self.total, self.done, self.start = title, total, 0, time.monotonic()

    def step(self, count: int = 1) -> None:
        self.done += count
        part = self.done / self.total
        line = f"{self.title:<28} [{'#' * round(30 * part):<30}] {part:4.0%}"
        end = "\n" if self.done >= self.total else ""
        seconds = time.monotonic() - self.start
        print(f"\r{line} {seconds:5.0f} s", end=end, file=sys.stderr, flush=True)


# --- our own -------------------------------------------------------------------------------------


def ours(name: str, count: int) -> Row:
    """`rm.igm` on one arm of the catalogue."""
    model = rm.load(name)
    rng = np.random.default_rng(0)
    postures = sample(model, name in ("crx10ia", "xarm6"), count, SINGULAR, rng)
    order = rng.permutation(count)
    q, kind, exact = postures.q[order], postures.kind[order], postures.exact[order]
    # kernels of singular poses are compiled when the first one comes, which is not to be timed
    found = rm.igm(model, rm.dgm(model, q[kind > 0][:50]))
    counts: Counter[str] = Counter()
    kinds: Counter[str] = Counter()
    examples: dict[str, list[list[float]]] = {}
    worst, seconds = 0.0, 0.0
    bar = Bar(f"{name}, robotmodels", count)

    def note(what: str, flags: Flags, rows: Array) -> None:
        counts[what] += int(flags.sum())
        kept = examples.setdefault(what, [])
        kept += rows[flags][: KEPT - len(kept)].tolist()

    for start in range(0, count, CHUNK):
        part = slice(start, start + CHUNK)
        T = rm.dgm(model, q[part])
        began = time.perf_counter()
        found = rm.igm(model, T, q_ref=q[part])
        seconds += time.perf_counter() - began
        there = given_back(model, T, q[part], found.q, found.valid)
        singular = kind[part] > 0
        note("lost", ~there & ~singular, q[part])
        note("lost_singular", ~there & singular, q[part])
        kinds.update(tuple(Kind)[k].value for k in kind[part][~there])
        itself = gaps(model, found.q, found.valid, q[part]).min(axis=1, initial=np.inf) < 1e-4
        note("not_at_reference", there & exact[part] & ~itself, q[part])
        note("searched_for", came_from_search(found), q[part])
        i, s = np.nonzero(found.valid)
        error = np.full(found.valid.shape, 0.0)
        error[i, s] = residual(model, T[i], found.q[i, s])
        worst = max(worst, float(error.max(initial=0.0)))
        note("above_goal", error.max(axis=1, initial=0.0) > GOAL, q[part])
        note("nan", np.sum(np.isnan(found.q).any(axis=2) & found.valid, axis=1) > 0, q[part])
        note("odd", odd(model, found.q, found.valid, found.double), q[part])
        bar.step(len(T))
    regular = q[kind == 0]
    unknown, checked = beside_search(model, regular[:SEARCHED], rng, note)
    outside, wrong_order = within_limits(model, rng, note)
    return Row(
        arm=name, solver="robotmodels", method=found.method, poses=count,
        singular=int((kind > 0).sum()), lost=counts["lost"], lost_singular=counts["lost_singular"],
        not_at_reference=counts["not_at_reference"], searched_for=counts["searched_for"],
        residual=worst, above_goal=counts["above_goal"], nan=counts["nan"], odd=counts["odd"],
        unknown=unknown, checked_by_search=checked, limits=outside, order=wrong_order,
        microseconds=seconds / count * 1e6, lost_by_kind=dict(kinds),
        examples={what: rows for what, rows in examples.items() if rows},
    )  # fmt: skip


def came_from_search(found: rm.IGMSolutions) -> Flags:
    """Poses whose posture is the numeric search's, because the family had none."""
    if found.closest is None:
        return np.zeros(found.status.shape, np.bool_)
    return np.isfinite(found.closest).all(axis=-1) & (found.count > 0)


def odd(model: rm.RobotModel, q: Array, valid: Flags, double: Flags | None = None) -> Flags:
    """Poses with an odd number of postures, none of them near a fold."""
    total = valid.sum(axis=1) + (0 if double is None else (double & valid).sum(axis=1))
    poses = np.flatnonzero(total % 2 == 1)
    far = np.zeros(len(valid), np.bool_)
    for i in poses:
        J = rm.jacobian(model, q[i][valid[i]])
        far[i] = np.linalg.svd(J, compute_uv=False)[:, -1].min() > FAR_FROM_FOLDS
    return far


def beside_search(
    model: rm.RobotModel, q: Array, rng: np.random.Generator, note
) -> tuple[int, int]:
    """Postures that Newton's method finds from many starts and `rm.igm` does not, of how many."""
    T = rm.dgm(model, q)
    found = rm.igm(model, T)
    search = newton_search(model, T, STARTS, rng).postures
    missed = np.zeros(len(q), np.bool_)
    unknown = total = 0
    for i, rows in enumerate(search):
        total += len(rows)
        if len(rows):
            every = np.repeat(found.q[i][None], len(rows), axis=0)
            there = np.repeat(found.valid[i][None], len(rows), axis=0)
            pose = np.repeat(T[i][None], len(rows), axis=0)
            away = ~given_back(model, pose, rows, every, there)
            unknown += int(away.sum())
            missed[i] = away.any()
    note("unknown", missed, q)
    return unknown, total


def within_limits(model: rm.RobotModel, rng: np.random.Generator, note) -> tuple[int, int]:
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
    note("limits", bad, q)
    wrong = np.zeros(len(q), np.bool_)
    for result in (every, found):
        way = result.q - q[:, None]
        if result is every:
            way = difference(model, result.q, np.broadcast_to(q[:, None], result.q.shape))
        distance = np.where(result.valid, np.linalg.norm(way, axis=2), np.inf)
        wrong |= (distance[:, 1:] < distance[:, :-1] - 1e-9).any(axis=1)
    note("order", wrong, q)
    return int(bad.sum()), int(wrong.sum())


# --- EAIK ----------------------------------------------------------------------------------------


def theirs(name: str, count: int) -> Row | None:
    """EAIK on the same poses, None where it does not serve the arm or is not installed."""
    model = rm.load(name)
    peers = list(eaik(model))
    if not peers or peers[0].batch is None:
        return None
    rng = np.random.default_rng(0)
    postures = sample(model, False, count, SINGULAR, rng)
    order = rng.permutation(count)
    q, kind = postures.q[order], postures.kind[order]
    lost, kinds, seconds, worst, above, oddly = Counter(), Counter(), 0.0, 0.0, 0, 0
    bar = Bar(f"{name}, EAIK", count)
    for start in range(0, count, CHUNK):
        part = slice(start, start + CHUNK)
        T = rm.dgm(model, q[part])
        began = time.perf_counter()
        answers = peers[0].batch(T)
        seconds += time.perf_counter() - began
        rows, valid, claimed = packed(answers, model.n)
        i, s = np.nonzero(valid)
        error = np.full(valid.shape, np.inf)
        error[i, s] = residual(model, T[i], rows[i, s])
        # whatever meets the pose counts, also what it calls least squares
        met = error < CLOSE
        there = branch_given_back(model, T, q[part], rows, met)
        singular = kind[part] > 0
        lost["lost"] += int((~there & ~singular).sum())
        lost["lost_singular"] += int((~there & singular).sum())
        kinds.update(tuple(Kind)[k].value for k in kind[part][~there])
        promised = np.where(claimed, error, 0.0)
        worst = max(worst, float(promised.max(initial=0.0)))
        above += int((promised > GOAL).any(axis=1).sum())
        oddly += int(odd(model, rows, met).sum())
        bar.step(len(T))
    return Row(
        arm=name, solver="EAIK", method="", poses=count, singular=int((kind > 0).sum()),
        lost=lost["lost"], lost_singular=lost["lost_singular"], not_at_reference=0,
        searched_for=0, residual=worst, above_goal=above, nan=0, odd=oddly, unknown=0,
        checked_by_search=0, limits=0, order=0, microseconds=seconds / count * 1e6,
        lost_by_kind=dict(kinds), examples={},
    )  # fmt: skip


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


# --- general arms --------------------------------------------------------------------------------


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


@dataclass(frozen=True)
class Union:
    """One pose of each of many random arms: the formulations of the elimination side by side."""

    arms: int
    found: int
    union: int
    generating_lost: int
    odd: int
    unreliable: int
    seeds: list[int]


def random_arms(count: int) -> Union:
    """What the solver finds, and what its formulations find one by one, taken together."""
    totals, seeds = np.zeros(5, np.int64), []
    bar = Bar("random general arms", count)
    # nothing is timed here
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
        for seed, numbers in enumerate(pool.map(random_arm, range(count), chunksize=5)):
            found, union, lost, uneven, _ = numbers
            totals += numbers
            if lost or uneven or union > found:
                seeds.append(seed)
            bar.step()
    a, b, c, d, e = map(int, totals)
    return Union(count, a, b, c, d, e, seeds)


def random_arm(seed: int) -> tuple[int, int, bool, bool, bool]:
    """Postures found, those of all formulations, generating one lost, odd count, unreliable."""
    model = igm_arms.random_arm(seed)
    solver = prepare_elimination(joint_chain(model))
    assert solver is not None
    q0 = uniform(model, 1, np.random.default_rng(seed + 10**6))
    U = rm.dgm(model, q0)
    q, valid, double = elimination_solutions(solver, U)
    every = q[0][valid[0]]
    for form in solver.forms:
        alone, there, _ = elimination_solutions(replace(solver, forms=(form,)), U)
        for row in alone[0][there[0]]:
            if not len(every) or np.abs(difference(model, every, row)).max(axis=1).min() > 1e-5:
                every = np.vstack([every, row])
    lost = not gaps(model, q, valid, q0)[0].min(initial=np.inf) < CLOSE
    uneven = bool(odd(model, q, valid, double)[0])
    return int(valid.sum()), len(every), lost, uneven, not solver.well_conditioned


# --- report --------------------------------------------------------------------------------------

NOTES = """
- lost: postures that made a pose of which no row is within 1e-6 of them in every joint, and none
  is joined to them by a path on which the pose is kept to 1e-12 (the pose does not tell those
  apart). For EAIK, which takes no reference, also members of the same infinite family count.
- off q_ref: poses singular to rounding where the posture that made it, given as `q_ref`, is not
  itself among the rows, only another member of its family.
- searched: poses whose posture was not found by the family but by the numeric search.
- residual: the largest one of any row returned [m or rad]; above: poses with a row above 1e-12.
  For EAIK, of the rows that it does not call least squares.
- odd: poses with an odd number of postures though none is near a fold.
- unknown: postures that damped Newton steps from {starts} random starts find for {searched} regular
  poses and the model does not, of how many they find.
- limits: of {limited} poses, those where the rows within the limits are not those postures that
  whole turns bring there, or the posture that made it is not among them; order: those whose rows
  are not ordered by their distance to `q_ref`.
"""


def brief(r: Row) -> str:
    """One line while the run goes on."""
    return (
        f"{r.arm}, {r.solver}: lost {r.lost} regular and {r.lost_singular} of {r.singular} "
        f"singular, residual {r.residual:.1e}, odd {r.odd}, {r.microseconds:.1f} us a pose"
    )


def report(rows: list[Row], printed: tuple[int, float], union: Union | None, about: dict) -> str:
    """The results as Markdown."""
    lines = ["# Inverse geometric models: completeness and accuracy", ""]
    lines += [f"- {key}: {value}" for key, value in about.items()]
    lines += [
        "",
        "| arm | solver | poses (singular) | lost | lost, singular | off q_ref | searched "
        "| residual | above | NaN | odd | unknown | limits | order | us |",
        "|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for r in rows:
        own = r.solver == "robotmodels"
        ask = [r.not_at_reference, r.searched_for] if own else ["-", "-"]
        more = (
            [f"{r.unknown} of {r.checked_by_search}", r.limits, r.order] if own else ["-", "-", "-"]
        )
        cells = [
            r.arm, r.solver, f"{r.poses} ({r.singular})", r.lost, r.lost_singular, *ask,
            f"{r.residual:.1e}", r.above_goal, r.nan, r.odd, *more, f"{r.microseconds:.1f}",
        ]  # fmt: skip
        lines.append("| " + " | ".join(map(str, cells)) + " |")
    lines.append(NOTES.format(starts=STARTS, searched=SEARCHED, limited=WITH_LIMITS).rstrip())
    lost = [r for r in rows if r.lost_by_kind]
    if lost:
        lines += ["", "Lost, by what is singular:", ""]
        for r in lost:
            kinds = ", ".join(f"{kind} {number}" for kind, number in r.lost_by_kind.items())
            lines.append(f"- {r.arm}, {r.solver}: {kinds}")
    lines += ["", "## General six-joint arms", ""]
    lines.append(
        f"- Manocha and Canny's arm: {printed[0]} of the 16 printed postures, the farthest "
        f"{printed[1]:.3f} deg from the print (two decimals)."
    )
    if union is not None:
        lines.append(
            f"- {union.arms} random arms, one pose each: {union.found} postures, {union.union} in "
            f"the union of all formulations; {union.generating_lost} postures that made the pose "
            f"lost, {union.odd} odd counts off folds, {union.unreliable} arms that the self-test "
            "calls unreliable."
        )
    return "\n".join(lines) + "\n"


def main() -> None:
    """Count, print and keep the results."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "results")
    parser.add_argument("--poses", type=int, default=100_000)
    parser.add_argument("--arms", type=int, default=1000, help="random general arms")
    parser.add_argument("--only", nargs="*", default=ARMS, help="arms of the catalogue")
    arguments = parser.parse_args()
    rows = []
    for name in arguments.only:
        for row in (ours(name, arguments.poses), theirs(name, arguments.poses)):
            if row is not None:
                rows.append(row)
                print(brief(row), flush=True)
    printed = printed_postures()
    union = random_arms(arguments.arms) if arguments.arms else None
    about = machine(PACKAGES)
    text = report(rows, printed, union, about)
    print(text)
    arguments.out.mkdir(parents=True, exist_ok=True)
    (arguments.out / "accuracy_igm.md").write_text(text, encoding="utf-8")
    kept = {
        "machine": about,
        "rows": [asdict(row) for row in rows],
        "printed_postures": {"found": printed[0], "farthest_degrees": printed[1]},
        "random_arms": None if union is None else asdict(union),
    }
    (arguments.out / "accuracy_igm.json").write_text(
        json.dumps(kept, indent=2) + "\n", encoding="utf-8"
    )


if __name__ == "__main__":
    main()
