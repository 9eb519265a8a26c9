"""Speed of the closed-form inverse models beside their peers, in one run.

    python -m benchmarks.bench_igm [--out benchmarks/results] [--rounds 15] [--slow]

Contestants of a row take turns, round after round, so that a drifting machine is fair to all of
them; the figures are medians of the processor's time in microseconds a pose. Every peer is told
the same arm (those with arms of their own solve poses of these) and has to give back random
postures before it enters. Peers that are not installed are named and left out (`pip install eaik
ssik ik-geo ur-analytic-ik roboticstoolbox-python`). `--slow` adds ssik's preparation of a general
arm of one's own, which takes minutes.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import robotmodels as rm
from benchmarks import igm_arms, igm_peers
from benchmarks.igm_peers import Peer, peers_of
from benchmarks.kept import RESULTS, keep
from benchmarks.machine import head, machine
from benchmarks.measure import Contestant, in_turns, loop
from robotmodels.igm.known import known_arm

Array = NDArray[np.float64]

FEW, BATCH = 200, 100_000
THOUSAND = 1000
STRUCTURED = ("puma560", "rx90", "irb6640", "kr6_r900", "ur5", "ur5e")
OURS = "robotmodels"
KERNEL = "robotmodels, kernel"


@dataclass(frozen=True)
class Row:
    """A line of the table: medians in microseconds a pose, and the goals that were set."""

    work: str
    microseconds: dict[str, float]
    goal: str
    met: bool | None


def medians(contestants: list[Contestant], rounds: int) -> dict[str, float]:
    """Median of the processor's time of each contestant, microseconds."""
    found = in_turns(contestants, rounds)
    return {name: 1e6 * timing.processor.median for name, timing in found.items()}


def row(work: str, us: dict[str, float], goals: dict[str, float]) -> Row:
    """A line with its goals, each for one contestant."""
    print(f"{work}: " + "; ".join(f"{name} {value:.2f}" for name, value in us.items()), flush=True)
    text = ", ".join(
        f"<= {goal:g} us" + (" in the kernel" if name == KERNEL else "")
        for name, goal in goals.items()
    )
    met = all(us[name] <= goal for name, goal in goals.items()) if goals else None
    return Row(work, us, text, met)


def reachable(model: rm.RobotModel, count: int, seed: int = 0) -> Array:
    """Poses of random postures over whole turns."""
    rng = np.random.default_rng(seed)
    low, high = -np.pi * np.ones(model.n), np.pi * np.ones(model.n)
    slides = model.table.sigma[model.table.joint_rows] == 1
    low[slides], high[slides] = -0.5, 0.5
    return rm.dgm(model, rng.uniform(low, high, (count, model.n)))


def single_peer(peer: Peer, n: int) -> Contestant:
    """A peer on poses of its own direct model."""
    q = np.random.default_rng(0).uniform(-np.pi, np.pi, (FEW, n))
    return Contestant(peer.name, loop(peer.solve, np.array([peer.direct(x) for x in q])), FEW)


# --- what stands beneath rm.igm -------------------------------------------------------------------


def kernel(model: rm.RobotModel, T: Array) -> Callable[[], object] | None:
    """The compiled plan on the poses of one call: checked, ordered and labelled postures.

    None for arms that Paul's method does not serve.
    """
    arm = known_arm(model)
    if arm.kernel is None:
        return None
    N, S, n = len(T), arm.most, model.n
    poses, references = np.ascontiguousarray(T), np.zeros((N, n))
    q, residual = np.empty((N, S, n)), np.empty((N, S))
    marks = np.empty((N, 2 + 2 * S), np.int64)
    return lambda: arm.kernel(
        arm.instructions, arm.numbers, poses, references, 0, q, residual, marks
    )


# --- rows ----------------------------------------------------------------------------------------


def structured_rows(rounds: int) -> list[Row]:
    """All eight postures of arms with a spherical wrist, and of UR arms."""
    rows = []
    for name in STRUCTURED:
        model = rm.load(name)
        T = reachable(model, BATCH)
        few, thousand = T[:FEW], np.ascontiguousarray(T[:THOUSAND])
        peers = peers_of(model, name)
        contestants = [Contestant(OURS, loop(lambda x, m=model: rm.igm(m, x), few), FEW)]
        alone = kernel(model, thousand)
        if alone is not None:
            contestants.append(Contestant(KERNEL, alone, THOUSAND))
        contestants += [single_peer(peer, model.n) for peer in peers]
        us = medians(contestants, rounds)
        goals = {OURS: 12.0} | ({KERNEL: 3.0} if alone is not None else {})
        rows.append(row(f"{name}: all postures, one pose", us, goals))
        for poses in (thousand, T):
            contestants = [Contestant(OURS, lambda m=model, x=poses: rm.igm(m, x), len(poses))]
            contestants += [
                Contestant(f"{p.name}, batch", lambda f=p.batch, x=poses: f(x), len(poses))
                for p in peers
                if p.batch is not None
            ]
            us = medians(contestants, rounds if len(poses) < BATCH else max(rounds // 3, 3))
            rows.append(row(f"{name}: all postures, batch of {len(poses)}", us, {OURS: 2.5}))
    return rows


def general_rows(rounds: int, slow: bool) -> list[Row]:
    """Up to sixteen postures of arms without a closed form."""
    rows = []
    arms = {
        "crx10ia": rm.load("crx10ia"),
        "xarm6": rm.load("xarm6"),
        "Manocha and Canny's arm": igm_arms.manocha_canny(),
        "a random 6R arm": igm_arms.random_arm(0),
    }
    for name, model in arms.items():
        T = reachable(model, THOUSAND)
        contestants = [
            Contestant(f"{OURS}, batch of {THOUSAND}", lambda m=model, x=T: rm.igm(m, x), THOUSAND),
            Contestant(OURS, loop(lambda x, m=model: rm.igm(m, x), T[:FEW]), FEW),
        ]
        contestants += [single_peer(peer, model.n) for peer in peers_of(model, name)]
        us = medians(contestants, max(rounds // 3, 3))
        goals = {f"{OURS}, batch of {THOUSAND}": 450.0}
        rows.append(row(f"{name}: up to 16 postures", us, goals))
    fresh = (igm_arms.random_arm(seed) for seed in range(1000, 2000))

    def new_robot() -> None:
        model = next(fresh)
        rm.igm(model, igm_peers.model_pose(model))

    contestants = [Contestant(OURS, new_robot, 1)]
    if slow and igm_peers.module("ssik") is not None:
        model = igm_arms.random_arm(999)

        def theirs() -> None:
            arm = igm_peers.ssik_arm(model)
            arm.prepare()
            arm.solve(igm_peers.model_pose(model), **igm_peers.SSIK)

        contestants.append(Contestant("ssik, own robot", theirs, 1, rounds=1))
    us = medians(contestants, max(rounds // 3, 3))
    rows.append(row("a new general 6R arm: the first call, preparation included", us, {OURS: 2e6}))
    return rows


def arm_angle_rows(rounds: int) -> list[Row]:
    """S-R-S arms: the eight postures for each arm angle."""
    model = rm.load("iiwa14")
    T = reachable(model, THOUSAND)
    angles = np.linspace(-np.pi, np.pi, 16, endpoint=False)
    contestants = [
        Contestant(
            f"{OURS}, {THOUSAND} poses x 16 angles",
            lambda: rm.igm(model, T, arm_angle=angles), 16 * THOUSAND,
        ),
        Contestant(
            f"{OURS}, one pose x 16 angles",
            loop(lambda x: rm.igm(model, x, arm_angle=angles), T[:FEW]), 16 * FEW,
        ),
        Contestant(
            f"{OURS}, one pose, one angle",
            loop(lambda x: rm.igm(model, x, arm_angle=0.3), T[:FEW]), FEW,
        ),
    ]  # fmt: skip
    peer = igm_peers.module("ssik")
    if peer is not None:
        arm = peer.Manipulator.from_prebuilt("iiwa14")
        poses = T[:FEW]
        found = np.median([len(arm.solve(x, **igm_peers.SSIK)) for x in poses[:20]])
        contestants.append(
            Contestant(
                f"ssik, prebuilt, one pose, {found:.0f} postures",
                loop(lambda x: arm.solve(x, **igm_peers.SSIK), poses),
                FEW * max(round(found / 8), 1),
            )
        )
    us = medians(contestants, rounds)
    goals = {f"{OURS}, {THOUSAND} poses x 16 angles": 5.0}
    return [row("iiwa14: eight postures for one arm angle", us, goals)]


def other_rows(rounds: int) -> list[Row]:
    """Calibrated neighbours of structured arms, and arms of five and three joints."""
    rows = []
    for name in ("puma560", "ur5e"):
        model = igm_arms.calibrated(rm.load(name), 1e-3, 2e-3, np.random.default_rng(0))
        T = reachable(model, THOUSAND)
        contestants = _both(model, T)
        contestants += [single_peer(peer, model.n) for peer in peers_of(model)]
        us = medians(contestants, max(rounds // 3, 3))
        rows.append(row(f"{name}, calibrated (1 mm, 2 mrad off)", us, {}))
    arms = {
        "xarm5": rm.load("xarm5"),
        "the first five joints of the rx90": igm_arms.first_joints(rm.load("rx90"), 5),
        "the first three joints of the puma560": igm_arms.first_joints(rm.load("puma560"), 3),
        "the laboratory's TRR": rm.load("lab_trr"),
    }
    for name, model in arms.items():
        T = reachable(model, THOUSAND)
        contestants = _both(model, T)
        peers = peers_of(model, name)
        contestants += [single_peer(peer, model.n) for peer in peers]
        us = medians(contestants, max(rounds // 3, 3))
        rows.append(row(f"{name}: all postures", us, {}))
    return rows


def _both(model: rm.RobotModel, T: Array) -> list[Contestant]:
    return [
        Contestant(OURS, loop(lambda x: rm.igm(model, x), T[:FEW]), FEW),
        Contestant(f"{OURS}, batch of {len(T)}", lambda: rm.igm(model, T), len(T)),
    ]


# --- report --------------------------------------------------------------------------------------


def report(rows: list[Row], about: dict[str, str], rounds: int) -> str:
    """The results as Markdown, with ratios to ours."""
    lines = [
        *head("Closed-form inverse models: measured side by side", about),
        f"Medians of {rounds} rounds (fewer for the long rows) in us a pose, one thread; in "
        "brackets the ratio to ours, the first of the row. Poses are those of random postures "
        "over whole turns; EAIK's batches are asked of one thread; ssik is asked for every branch "
        "once, without limits; `prebuilt` arms are ssik's own, with its native code. `kernel` is "
        "the compiled plan alone, per pose of a call with 1000, without Python between.",
        "",
        "| work | ours | ours otherwise | others | goal | met |",
        "|---|---|---|---|---|---|",
    ]
    for r in rows:
        names = list(r.microseconds)
        first = r.microseconds[names[0]]
        own = [name for name in names[1:] if name.startswith(OURS)]
        otherwise = "; ".join(f"{_short(name)} {r.microseconds[name]:.2f}" for name in own)
        others = "; ".join(
            f"{name} {r.microseconds[name]:.1f} ({r.microseconds[name] / first:.1f}x)"
            for name in names
            if not name.startswith(OURS)
        )
        met = "" if r.met is None else ("yes" if r.met else "no")
        label = _short(names[0])
        ours = f"{first:.2f}" + ("" if names[0] == OURS else f" ({label})")
        lines.append(f"| {r.work} | {ours} | {otherwise} | {others} | {r.goal} | {met} |")
    return "\n".join(lines) + "\n"


def _short(name: str) -> str:
    return name.removeprefix(OURS).removeprefix(", ") or "one by one"


def main() -> None:
    """Measure, print and keep the results."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=RESULTS)
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument(
        "--slow", action="store_true", help="minutes of ssik for a robot of one's own"
    )
    arguments = parser.parse_args()
    missing = igm_peers.absent()
    if missing:
        print(f"Not installed, so left out: {', '.join(missing)}.")
    about = machine(igm_peers.PACKAGES)
    rows = structured_rows(arguments.rounds)
    rows += general_rows(arguments.rounds, arguments.slow)
    rows += arm_angle_rows(arguments.rounds) + other_rows(arguments.rounds)
    text = report(rows, about, arguments.rounds)
    print(text)
    keep(arguments.out, "igm", text, {"machine": about, "rows": [asdict(r) for r in rows]})


if __name__ == "__main__":
    main()
