"""Postures of a pose: closed forms, general arms, numbers."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

import robotmodels as rm
from benchmarks import igm_arms, igm_peers
from benchmarks.bench_igm import kernel, reachable
from benchmarks.bench_igm_numeric import Contestant as Numeric
from benchmarks.bench_igm_numeric import contestants as numeric_field
from benchmarks.bench_igm_numeric import met
from benchmarks.igm_peers import Peer, peers_of
from benchmarks.measure import Timing, loop
from benchmarks.side_by_side.agreement import same_postures, same_robot
from benchmarks.side_by_side.works import (
    BATCH,
    ONE,
    Entry,
    Goal,
    Settings,
    Tool,
    Work,
    at_most,
    named,
)

STRUCTURED = {"puma560": "spherical wrist, Puma 560", "ur5e": "UR5e"}
FEW, THOUSAND = 200, 1000
KERNEL = "kernel"
TOOLS = {
    "EAIK": (Tool.EAIK, ""),
    "ik-geo": (Tool.IK_GEO, ""),
    "ssik, own robot": (Tool.SSIK, "a robot of one's own"),
    "ssik, prebuilt": (Tool.SSIK, "prebuilt"),
    "RTB ikine_a, 1 posture": (Tool.RTB, "ikine_a, one posture"),
}
"""Who a peer is, and its way; the others are no columns of the table."""
PARTIAL = ("ikine_a, one posture", "ik_LM, default tol")
"""One posture of eight; a tolerance that lets nearly every answer be wrong."""
WAYS = {
    "robotmodels, batch": (Tool.OURS, BATCH, ""),
    "robotmodels, one by one": (Tool.OURS, ONE, ""),
    "Pinocchio CLIK, Python loop": (Tool.PINOCCHIO, ONE, "CLIK"),
    "RTB ik_LM, tol=1e-06": (Tool.RTB, ONE, "ik_LM, default tol"),
    "RTB ik_LM, tol=5e-13": (Tool.RTB, ONE, "ik_LM, tol=5e-13"),
}


def postures(_: Settings) -> Iterator[Work]:
    """One pose, through the door and in the kernel."""
    for name, title in STRUCTURED.items():
        model = rm.load(name)
        yield _one_pose(model, title, [p for p in peers_of(model, name) if p.name in TOOLS])


def postures_batch(settings: Settings) -> Iterator[Work]:
    """Many poses in a call."""
    for name, title in STRUCTURED.items():
        model = rm.load(name)
        peers = [p for p in peers_of(model, name) if p.name in TOOLS]
        yield _batch(model, title, peers, settings.number(100_000, 10_000))


def _alone(peer: Peer, model: rm.RobotModel) -> Entry:
    tool, how = TOOLS[peer.name]
    whole = how not in PARTIAL
    if same_robot(model, peer):
        poses = reachable(model, FEW)
        found = [peer.solve(T) for T in poses]
        note = same_postures(peer.name, model, poses, peer, found, whole)
    else:
        q = np.random.default_rng(0).uniform(-np.pi, np.pi, (FEW, model.n))
        poses = np.array([peer.direct(x) for x in q])
        count = sum(len(peer.postures(peer.solve(T))) for T in poses)
        note = f"{count} postures of {FEW} poses of the robot it ships, which is not ours"
    return Entry(
        tool, how, loop(peer.solve, poses), FEW, lambda _: note, whole=whole, mode=ONE
    )  # fmt: skip


def _one_pose(model: rm.RobotModel, title: str, peers: list[Peer]) -> Work:
    T = reachable(model, THOUSAND)
    compiled = kernel(model, T)
    assert compiled is not None
    entries = [
        Entry(Tool.OURS, "", loop(lambda x: rm.igm(model, x), T[:FEW]), FEW, mode=ONE),
        Entry(Tool.OURS, "", compiled, THOUSAND, mode=KERNEL),
        *(_alone(peer, model) for peer in peers),
    ]
    goals = [at_most(12.0, "us", ONE), at_most(3.0, "us", KERNEL, said="in the kernel")]
    return Work("postures", f"all 8 postures of one pose, {title}", "us", entries, goals)


def _batch(model: rm.RobotModel, title: str, peers: list[Peer], count: int) -> Work:
    T = reachable(model, count)
    entries = [Entry(Tool.OURS, "", lambda: rm.igm(model, T), count)]
    for p in peers:
        if p.batch is not None:
            solve = p.batch
            note = same_postures(p.name, model, T[:FEW], p, solve(T[:FEW]))
            tool, how = TOOLS[p.name]
            entries.append(
                Entry(tool, how, lambda f=solve: f(T), count, lambda _, told=note: told)
            )  # fmt: skip
    title = f"all 8 postures, batch of {count} poses, {title}"
    return Work("postures_batch", title, "us", entries, [at_most(2.5, "us")])


def general_6r(settings: Settings) -> Iterator[Work]:
    """Arms without a closed form, and a new one."""
    count = settings.number(THOUSAND, FEW)
    how = f"{count} poses"
    arms = {"crx10ia": rm.load("crx10ia"), "a random arm": igm_arms.random_arm(0)}
    for name, model in arms.items():
        T = reachable(model, count)
        entries = [
            Entry(Tool.OURS, how, lambda m=model, x=T: rm.igm(m, x), count, mode=BATCH),
            Entry(Tool.OURS, "", loop(lambda x, m=model: rm.igm(m, x), T[:20]), 20, mode=ONE),
        ]
        entries += [_alone(p, model) for p in peers_of(model, name) if p.name in TOOLS]
        goals = [at_most(450.0, "us", BATCH, how, "in batch")]
        title = f"general 6R, up to 16 postures, {name}"
        yield Work("general_6r", title, "us", entries, goals)
    fresh = (igm_arms.random_arm(seed) for seed in range(1000, 2000))

    def new_robot() -> None:
        model = next(fresh)
        rm.igm(model, igm_peers.model_pose(model))

    entries = [Entry(Tool.OURS, "", new_robot)]
    if igm_peers.module("ssik") is not None and settings.slow:
        entries.append(Entry(Tool.SSIK, "a robot of one's own", _prepared_by_ssik, rounds=1))
    title = "general 6R, a new robot: preparation and first pose"
    yield Work("general_6r", title, "s", entries, [at_most(2.0, "s")])


def _prepared_by_ssik() -> None:
    model = igm_arms.random_arm(999)
    arm = igm_peers.ssik_arm(model)
    arm.prepare()
    arm.solve(igm_peers.model_pose(model), **igm_peers.SSIK)


def numeric(settings: Settings) -> Iterator[Work]:
    """One solution by iteration."""
    field = numeric_field("puma560", False, settings.number(2000, 200))

    def entry(c: Numeric) -> Entry:
        def said(answer: tuple[np.ndarray, np.ndarray]) -> str:
            q, claims = answer
            true = met(c, q)
            reached, false = (claims & true).mean(), (claims & ~true).mean()
            return f"{reached:.2%} reached, {false:.2%} claimed and not met"

        tool, mode, how = WAYS[c.name]
        whole = how not in PARTIAL
        return Entry(tool, how, c.run, len(c.poses), said, whole=whole, mode=mode)

    def sound(timings: dict[str, Timing]) -> bool:
        reached, false = timings[named(Tool.OURS, BATCH)].note.replace("%", "").split(",")
        return float(reached.split()[0]) >= 99.5 and float(false.split()[0]) == 0.0

    goals = [
        at_most(120.0, "us", BATCH, said="in batch"),
        Goal(">= 99.5 % reached, no false success", sound),
    ]
    title = "numeric inverse, one solution to 1e-6 m and rad, Puma 560"
    yield Work("numeric", title, "us", [entry(c) for c in field], goals)


WORKS = {
    "postures": postures,
    "postures_batch": postures_batch,
    "general_6r": general_6r,
    "numeric": numeric,
}
