"""Performance analysis: sections, aspects, paths, indices, cuspidality, polytopes."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np

import robotmodels as rm
from benchmarks.measure import Contestant
from benchmarks.works import OURS, Settings, Work, at_most, module, same
from robotmodels import performance as pf
from robotmodels.trajectories import cartesian_trajectory

Q = np.array([0.3, -1.0, 1.2, 0.4, 0.8, 0.2])


def orthogonal() -> rm.RobotModel:
    """The arm of three joints with d2 = 1, d3 = 2, d4 = 1.5, r2 = 1."""
    table = rm.DHTable(
        antecedent=[0, 1, 2], sigma=[0, 0, 0], alpha=[0, -np.pi / 2, np.pi / 2], d=[0, 1, 2],
        theta=[0, 0, 0], r=[0, 1, 0],
    )  # fmt: skip
    return rm.RobotModel.from_table(table, tool=rm.se3.translation(1.5, 0, 0))


def maps(settings: Settings) -> Iterator[Work]:
    """Long calls, each once a round."""
    arm, puma, ur5e = orthogonal(), rm.load("puma560"), rm.load("ur5e")
    count = settings.number(10**6, 10**5)
    many = np.random.default_rng(0).uniform(-3, 3, (count, 6))
    line = cartesian_trajectory(rm.dgm(puma, Q), rm.dgm(puma, Q + 0.2), 1000)
    rows: dict[str, tuple[Callable[[], object], float | None]] = {
        "section of 500 x 500 cells, 3 joints": (lambda: pf.workspace(arm, resolution=500), 1.0),
        f"isotropy of {count} configurations": (lambda: pf.isotropy_index(puma, many), 2.0),
        "aspects of six joints": (lambda: pf.aspects(ur5e, limits=False), 5.0),
        "path of 1000 poses, 8 postures": (lambda: pf.feasible_path(puma, line, False), 0.2),
        "cuspidality, 3 joints": (lambda: pf.cuspidality(arm), None),
        "cuspidality, CRX-10iA": (lambda: pf.cuspidality(rm.load("crx10ia"), poses=40), None),
    }
    for title, (run, goal) in rows.items():
        goals = [] if goal is None else [at_most(goal, "s")]
        yield Work(title, "s", [Contestant(OURS, run, rounds=5)], goals)


def polytopes(settings: Settings) -> Iterator[Work]:
    """Velocity and force polytopes of the position."""
    arm = rm.load("ur5e")
    J, v, tau = rm.jacobian(arm, Q)[:3], arm.table.velocity, arm.table.effort
    directions = np.random.default_rng(0).normal(size=(100, 3))
    peer = module("pycapacity")
    for kind in ("velocity", "force"):
        ways = [Contestant(OURS, lambda k=kind: pf.polytope(arm, Q, k, "position"))]
        if peer is not None:
            from pycapacity import robot

            call, most = getattr(robot, f"{kind}_polytope"), v if kind == "velocity" else tau
            run = lambda f=call, x=most: f(J, -x, x)  # noqa: E731
            theirs = (directions @ np.asarray(run().vertices)).max(axis=1)
            ours = (directions @ pf.polytope(arm, Q, kind, "position").vertices.T).max(axis=1)
            said = same(f"{kind} polytope", ours, theirs, 1e-6)
            ways.append(Contestant("pycapacity", run, said=said))
        yield Work(f"{kind} polytope", "ms", ways)


WORKS = {"maps": maps, "polytopes": polytopes}
