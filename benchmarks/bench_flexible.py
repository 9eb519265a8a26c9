"""Recursions of flexible robots, and simulated seconds beside Exudyn."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

import robotmodels as rm
from benchmarks.measure import Contestant
from benchmarks.works import (
    OURS,
    DisagreementError,
    Goal,
    Settings,
    Work,
    at_most,
    module,
)
from robotmodels import flexible


def chain(n: int) -> flexible.FlexibleRobot:
    """N equal links with two modes each."""
    model = rm.RobotModel.from_table(
        rm.DHTable(antecedent=range(n), sigma=[0] * n, alpha=[0.3] * n, d=[0.4] * n)
    )
    link = flexible.beam(0.4, EI=(np.inf, 100.0), density=1.0, modes=2)
    return flexible.FlexibleRobot(model, dict.fromkeys(range(1, n + 1), link))


def direct(settings: Settings) -> Iterator[Work]:
    """The direct model of chains, alone and in a batch."""
    for n in (3, 6, 12, 30):
        arm, rng = chain(n), np.random.default_rng(n)
        q, v, tau = rng.normal(size=(3, n))
        e, ev = 0.01 * rng.normal(size=(2, arm.m))

        ways = [Contestant(OURS, lambda r=arm, x=(q, e, v, ev, tau): flexible.ddm(r, *x))]
        goals = [at_most(60.0, "us")] if n == 6 else []
        yield Work(f"direct model, {n} links with two modes", "us", ways, goals)
        many: Any = [np.tile(x, (100, 1)) for x in (q, e, v, ev, tau)]
        batch = [Contestant(OURS, lambda r=arm, x=many: flexible.ddm(r, *x), 100)]
        yield Work(f"direct model, {n} links with two modes, batch", "us", batch)


def second(settings: Settings) -> Iterator[Work]:
    """A simulated second of two links that fall, no less exact than Exudyn.

    Notes: the error of the tip, of each program beside its finest run.
    """
    model = rm.RobotModel.from_table(
        rm.DHTable(antecedent=[0, 1], sigma=[0, 0], d=[0, 0.5]), gravity=(0, -9.81, 0)
    )
    link = flexible.beam(0.5, EI=(np.inf, 10.0), density=0.2, gyration=0.01)
    arm = flexible.FlexibleRobot(model, {1: link, 2: link})

    def run(rtol: float, control: Any = None) -> np.ndarray:
        found = flexible.simulate(arm, [0.0, 0.0], None, control, rtol=rtol, atol=1e-2 * rtol)
        return flexible.dgm(arm, found.q[-1], found.e[-1])[:3, 3]

    def called(rtol: float) -> np.ndarray:
        return run(rtol, lambda t: np.zeros(2))

    finest = run(1e-11)
    for title, rtol, steps in ("to a micrometre", 1e-3, 8000), ("to a tenth of a mm", 1e-2, 500):

        def said(tip: np.ndarray, of: np.ndarray = finest) -> str:
            return f"off by {np.linalg.norm(tip - of):.1g} m"

        ways = [
            Contestant(OURS, lambda r=rtol: run(r), said=said, rounds=3),
            Contestant(
                "torques by a function", lambda r=rtol: called(r), said=said, rounds=3, whole=False
            ),
        ]
        goals = []
        if module("exudyn") is not None:
            from benchmarks.peers.exudyn_arm import two_links

            theirs = two_links(link_in_points(link, model))
            best = theirs(32000)
            if np.linalg.norm(best - finest) > 2e-3:  # the mass lies in a few places there
                raise DisagreementError("Exudyn: the tip is elsewhere after a second.")
            exudyn = Contestant(
                f"Exudyn, {steps} steps",
                lambda k=steps, f=theirs: f(k),
                said=lambda tip, of=best: said(tip, of),
                rounds=3,
            )
            ways.append(exudyn)
            goals = [
                Goal(
                    "20 times as fast",
                    lambda t: 20 * t[0].processor.median <= t[2].processor.median,
                )
            ]
        yield Work(f"a simulated second of two flexible links, {title}", "s", ways, goals)


def link_in_points(link: flexible.FlexibleLink, model: rm.RobotModel) -> dict[str, np.ndarray]:
    """The link as four rows of points along its length, with its shapes."""
    corners = 0.01 * np.array([[0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])
    x = link.nodes[:, 0]
    shapes = np.repeat(link.shapes[:, None], 4, axis=1)
    slope = np.gradient(link.shapes[:, 1], x, axis=0, edge_order=2)
    shapes[:, :, 0] -= slope[:, None] * corners[None, :, 1, None]
    weights = np.gradient(x) * np.where((x == x[0]) | (x == x[-1]), 0.5, 1.0)
    return {
        "points": (link.nodes[:, None] + corners).reshape(-1, 3), "gravity": model.gravity,
        "masses": np.repeat(0.05 * weights, 4), "shapes": shapes.reshape(-1, 3, link.m),
        "frequencies": link.frequencies,
    }  # fmt: skip


WORKS = {"chains": direct, "falling": second}
