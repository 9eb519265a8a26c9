"""Recursions of flexible robots beside a dense direct model, and simulated seconds."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

import robotmodels as rm
from benchmarks.measure import Contestant
from benchmarks.works import OURS, Settings, Work, at_most, same
from robotmodels import flexible
from robotmodels.flexible.models import generalized_forces


def chain(n: int) -> flexible.FlexibleRobot:
    """N equal links with two modes each."""
    model = rm.RobotModel.from_table(
        rm.DHTable(antecedent=range(n), sigma=[0] * n, alpha=[0.3] * n, d=[0.4] * n)
    )
    link = flexible.beam(0.4, EI=(np.inf, 100.0), density=1.0, modes=2)
    return flexible.FlexibleRobot(model, dict.fromkeys(range(1, n + 1), link))


def direct(settings: Settings) -> Iterator[Work]:
    """The direct model of chains, alone and in a batch, and by a mass matrix and a system."""
    for n in (3, 6, 12, 30):
        arm, rng = chain(n), np.random.default_rng(n)
        q, v, tau = rng.normal(size=(3, n))
        e, ev = 0.01 * rng.normal(size=(2, arm.m))

        def dense(arm=arm, x=(q, e, v, ev), tau=tau) -> np.ndarray:
            rows = [part[None] for part in x]
            rest = np.hstack(generalized_forces(arm, *rows, 0.0 * rows[0], 0.0 * rows[1]))[0]
            return np.linalg.solve(
                flexible.mass_matrix(arm, *x[:2]), np.append(tau, np.zeros(arm.m)) - rest
            )

        found = np.concatenate(flexible.ddm(arm, q, e, v, ev, tau))
        ways = [
            Contestant(OURS, lambda r=arm, x=(q, e, v, ev, tau): flexible.ddm(r, *x)),
            Contestant(
                "mass matrix and linear system", dense, said=same("ddm", found, dense(), 1e-8)
            ),
        ]
        goals = [at_most(60.0, "us")] if n == 6 else []
        yield Work(f"direct model, {n} links with two modes", "us", ways, goals)
        many = [np.tile(x, (100, 1)) for x in (q, e, v, ev, tau)]
        batch = [Contestant(OURS, lambda r=arm, x=many: flexible.ddm(r, *x), 100)]
        yield Work(f"direct model, {n} links with two modes, batch", "us", batch)


def second(settings: Settings) -> Iterator[Work]:
    """A simulated second of two links that fall."""
    model = rm.RobotModel.from_table(
        rm.DHTable(antecedent=[0, 1], sigma=[0, 0], d=[0, 0.5]), gravity=(0, -9.81, 0)
    )
    link = flexible.beam(0.5, EI=(np.inf, 10.0), density=0.2, hub=0.1, tip=0.1)
    arm = flexible.FlexibleRobot(model, {1: link, 2: link})
    for rtol in (1e-6, 1e-9):
        run = lambda r=rtol: flexible.simulate(arm, [0.0, 0.0], t=1.0, rtol=r)  # noqa: E731
        ways = [Contestant(OURS, run, rounds=3)]
        yield Work(f"a simulated second of two links, tolerance {rtol:g}", "s", ways)


WORKS = {"chains": direct, "falling": second}
