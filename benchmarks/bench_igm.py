"""Inverse geometric models: closed forms, general arms, arm angles, calibrated arms, iteration."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

import robotmodels as rm
from benchmarks.igm_checks import residual
from benchmarks.measure import Contestant, loop
from benchmarks.peers.igm import CLOSE, NOT_EVERY_POSTURE, Peer, peers_of
from benchmarks.works import OURS, DisagreementError, Goal, Settings, Work, at_most, module

FEW, THOUSAND = 200, 1000
STRUCTURED = ("puma560", "ur5e")
TOLERANCE = 1e-6  # of the iteration, m and rad


def from_classical(rows: list[tuple[float, float, float]]) -> rm.RobotModel:
    """An arm of turning joints from classical ``(a, d, alpha)``, metres and radians."""
    table, tool = rm.DHTable.from_standard(
        [{"theta": 0.0, "d": d, "a": a, "alpha": alpha} for a, d, alpha in rows]
    )
    return rm.RobotModel.from_table(table, tool=tool)


def random_arm(seed: int) -> rm.RobotModel:
    """Six turning joints with nothing special about them."""
    rng = np.random.default_rng(seed)
    a, d = rng.uniform(-0.5, 0.5, (2, 6))
    alpha = rng.uniform(-np.pi, np.pi, 6)
    return from_classical(list(zip(a.tolist(), d.tolist(), alpha.tolist(), strict=True)))


def calibrated(
    model: rm.RobotModel, metres: float, radians: float, rng: np.random.Generator
) -> rm.RobotModel:
    """The arm as calibration finds it: every parameter a little off."""
    table = model.table
    f = len(table.sigma)

    def off(size: float) -> np.ndarray:
        return rng.uniform(-size, size, f)

    return model.with_table(
        replace(
            table, alpha=table.alpha + off(radians), theta=table.theta + off(radians),
            beta=table.beta + off(radians), d=table.d + off(metres), r=table.r + off(metres),
        )
    )  # fmt: skip


def reachable(model: rm.RobotModel, count: int, seed: int = 0) -> np.ndarray:
    """Poses of random postures over whole turns."""
    rng = np.random.default_rng(seed)
    return rm.dgm(model, rng.uniform(-np.pi, np.pi, (count, model.n)))


def agreement(model: rm.RobotModel, T: np.ndarray, peer: Peer, found: Any) -> str:
    """A note on a peer's postures; `DisagreementError` if one of ours or of theirs is missing."""
    own = rm.igm(model, T)
    lost = new = beside = total = 0
    for k, answer in enumerate(found):
        ours, theirs = own.q[k][own.valid[k]], peer.postures(answer)
        reach = np.array([np.abs(peer.direct(q) - T[k]).max() <= CLOSE for q in theirs], bool)
        beside += int((~reach).sum())
        theirs = theirs[reach]
        total += len(theirs)
        turn = (ours[:, None] - theirs[None] + np.pi) % (2.0 * np.pi) - np.pi
        away = np.abs(turn).max(axis=2)
        if peer.name not in NOT_EVERY_POSTURE:
            lost += int((away.min(axis=1, initial=np.inf) > CLOSE).sum())
        new += int((away.min(axis=0, initial=np.inf) > CLOSE).sum())
    if lost or new or not total:
        raise DisagreementError(
            f"{peer.name} on {len(T)} poses: {total} postures, {lost} of ours are not among them, "
            f"{new} are not among ours."
        )
    note = f"{total} postures of {len(T)} poses, as ours"
    return note + (f", and {beside} that miss the pose" if beside else "")


def alone(model: rm.RobotModel, peer: Peer) -> Contestant:
    """A peer on poses one by one: ours, or those of the robot that it ships."""
    q = np.random.default_rng(5).uniform(-np.pi, np.pi, (FEW, model.n))
    poses = np.array([peer.direct(x) for x in q])
    whole = peer.name not in NOT_EVERY_POSTURE
    if np.abs(poses - rm.dgm(model, q)).max() < 1e-10:
        note = agreement(model, poses, peer, [peer.solve(T) for T in poses])
    else:
        note = "of the robot that it ships, which is not ours"
    return Contestant(peer.name, loop(peer.solve, poses), FEW, lambda _: note, whole=whole)


def postures(settings: Settings) -> Iterator[Work]:
    """All postures of arms with closed forms."""
    for name in STRUCTURED:
        model, count = rm.load(name), settings.number(100_000, 10_000)
        T, peers = reachable(model, count), peers_of(model, name)
        one = [Contestant(OURS, loop(lambda x, m=model: rm.igm(m, x), T[:FEW]), FEW)]
        one += [alone(model, peer) for peer in peers]
        title = f"all postures, one pose, {name}"
        yield Work(title, "us", one, [at_most(12.0, "us")])
        batch = [Contestant(OURS, lambda m=model, x=T: rm.igm(m, x), count)]
        for p in peers:
            if p.batch is not None:
                note = agreement(model, T[:FEW], p, p.batch(T[:FEW]))
                run = p.batch
                batch.append(
                    Contestant(p.name, lambda f=run, x=T: f(x), count, lambda _, n=note: n)
                )
        title = f"all postures, batch of {count} poses, {name}"
        yield Work(title, "us", batch, [at_most(2.5, "us")])


def general(settings: Settings) -> Iterator[Work]:
    """Arms without a closed form, a new one, arm angles, a calibrated arm."""
    count = settings.number(THOUSAND, FEW)
    arms = {
        "crx10ia": rm.load("crx10ia"),
        "a random 6R": random_arm(0),
        "a calibrated Puma": calibrated(rm.load("puma560"), 1e-3, 2e-3, np.random.default_rng(0)),
    }
    for name, model in arms.items():
        T = reachable(model, count)
        batch = [Contestant(OURS, lambda m=model, x=T: rm.igm(m, x), count)]
        yield Work(f"up to 16 postures, batch, {name}", "us", batch, [at_most(450.0, "us")])
        one = [Contestant(OURS, loop(lambda x, m=model: rm.igm(m, x), T[:20]), 20)]
        one += [alone(model, peer) for peer in peers_of(model, name)]
        yield Work(f"up to 16 postures, one pose, {name}", "us", one)
    fresh = (random_arm(seed) for seed in range(1000, 2000))

    def new_robot() -> None:
        model = next(fresh)
        rm.igm(model, rm.dgm(model, np.linspace(0.3, 1.1, model.n)))

    work = "general 6R, a new robot: preparation and first pose"
    yield Work(work, "s", [Contestant(OURS, new_robot)], [at_most(2.0, "s")])
    arm, angles = rm.load("iiwa14"), np.linspace(-np.pi, np.pi, 16, endpoint=False)
    T = reachable(arm, count)
    many = Contestant(OURS, lambda: rm.igm(arm, T, arm_angle=angles), 16 * count)
    work = "iiwa14: eight postures for one arm angle, batch"
    yield Work(work, "us", [many], [at_most(5.0, "us")])


def numeric(settings: Settings) -> Iterator[Work]:
    """One posture by iteration to 1e-6 m and rad, its claims checked by the direct model."""
    model, count = rm.load("puma560"), settings.number(2000, 200)
    rng = np.random.default_rng(0)
    poses = rm.dgm(model, rng.uniform(model.lower, model.upper, (count, model.n)))

    def said(found: rm.IGMSolutions) -> str:
        q, claims = np.asarray(found.closest), found.valid[:, 0]
        met = residual(model, poses, q) <= 1.1 * TOLERANCE
        reached, false = (100.0 * float(x.mean()) for x in (claims & met, claims & ~met))
        return f"{reached:.2f} % reached, {false:.2f} % false"

    ways = [Contestant(OURS, lambda: rm.igm_numeric(model, poses), count, said)]
    if module("roboticstoolbox-python") is not None:
        from roboticstoolbox import models

        ets, q = models.DH.Puma560().ets(), rng.uniform(model.lower, model.upper, (FEW, model.n))
        for tolerance in (1e-6, 5e-13):  # its default, and half the square of ours
            run = loop(lambda T, e=ets, t=tolerance: e.ik_LM(T, tol=t), [ets.eval(x) for x in q])
            whole = tolerance < 1e-6
            ways.append(Contestant(f"RTB ik_LM, tol={tolerance:g}", run, FEW, whole=whole))
    sound = Goal(
        ">= 99.5 % reached, no false claim",
        lambda t: float(t[0].note.split()[0]) >= 99.5 and float(t[0].note.split()[3]) == 0.0,
    )
    goals = [at_most(120.0, "us"), sound]
    yield Work("numeric inverse, one solution, Puma 560, batch", "us", ways, goals)


WORKS = {"postures": postures, "general": general, "numeric": numeric}
