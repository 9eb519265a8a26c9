"""Speed of the performance analysis beside its peers, in one run.

    python -m benchmarks.bench_performance [--rounds 5]

Polytopes beside pycapacity (`pip install pycapacity`); a peer that is not installed is named and
left out. Its vertices are compared with ours before it enters.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable

import numpy as np

import robotmodels as rm
from benchmarks.measure import Contestant, in_turns
from robotmodels import performance as pf
from robotmodels.se3 import translation

OURS = "robotmodels"


def orthogonal() -> rm.RobotModel:
    """The arm of three joints with d2 = 1, d3 = 2, d4 = 1.5, r2 = 1."""
    table = rm.DHTable(
        antecedent=[0, 1, 2], sigma=[0, 0, 0], alpha=[0, -np.pi / 2, np.pi / 2], d=[0, 1, 2],
        theta=[0, 0, 0], r=[0, 1, 0],
    )  # fmt: skip
    return rm.RobotModel.from_table(table, tool=translation(1.5, 0, 0))


def polytopes(arm: rm.RobotModel, q: np.ndarray) -> dict[str, list[Contestant]]:
    """Velocity and force polytopes of the position, ours and those of pycapacity."""
    J = rm.jacobian(arm, q)[:3]
    v, tau = arm.table.velocity, arm.table.effort
    rows: dict[str, list[Contestant]] = {}
    for kind in ("velocity", "force"):
        rows[kind] = [Contestant(OURS, lambda k=kind: pf.polytope(arm, q, k, "position"), 1)]
    try:
        from pycapacity import robot as peer
    except ImportError:
        print("pycapacity is not installed")
        return rows
    calls: dict[str, Callable[[], object]] = {
        "velocity": lambda: peer.velocity_polytope(J, -v, v),
        "force": lambda: peer.force_polytope(J, -tau, tau),
    }
    directions = np.random.default_rng(0).normal(size=(100, 3))
    for kind, call in calls.items():
        theirs = (directions @ np.asarray(call().vertices)).max(axis=1)  # type: ignore[attr-defined]
        ours = (directions @ pf.polytope(arm, q, kind, "position").vertices.T).max(axis=1)
        if np.abs(ours / theirs - 1.0).max() > 1e-6:
            raise SystemExit(f"{kind} polytope: the two differ.")
        rows[kind].append(Contestant("pycapacity", call, 1))
    return rows


def works() -> dict[str, tuple[list[Contestant], float | None]]:
    """Contestants of each row, and the goal in seconds."""
    arm, puma, ur5e = orthogonal(), rm.load("puma560"), rm.load("ur5e")
    q = np.array([0.3, -1.0, 1.2, 0.4, 0.8, 0.2])
    million = np.random.default_rng(0).uniform(-3, 3, (10**6, 6))
    ends = rm.dgm(puma, q), rm.dgm(puma, q + 0.2)
    from robotmodels.trajectories import cartesian_trajectory

    line = cartesian_trajectory(*ends, 1000)
    rows = {
        "section of 500 x 500 cells, 3 joints":
            (lambda: pf.workspace(arm, resolution=500), 1.0),
        "isotropy of 1e6 configurations": (lambda: pf.isotropy_index(puma, million), 2.0),
        "aspects of six joints": (lambda: pf.aspects(ur5e, limits=False), 5.0),
        "path of 1000 poses, 8 postures": (lambda: pf.feasible_path(puma, line, False), 0.2),
        "cuspidality, 3 joints": (lambda: pf.cuspidality(arm), None),
        "cuspidality, CRX-10iA": (lambda: pf.cuspidality(rm.load("crx10ia"), poses=40), None),
    }  # fmt: skip
    found: dict[str, tuple[list[Contestant], float | None]] = {
        work: ([Contestant(OURS, run)], goal) for work, (run, goal) in rows.items()
    }
    for kind, contestants in polytopes(ur5e, q).items():
        found[f"{kind} polytope"] = (contestants, None)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=5)
    rounds = parser.parse_args().rounds
    print("| work | ms | best | peer ms | ratio | goal |\n|---|---|---|---|---|---|")
    for work, (contestants, goal) in works().items():
        times = {name: t.processor.times(1e3) for name, t in in_turns(contestants, rounds).items()}
        ours = times.pop(OURS)
        peer = next(iter(times.values()), None)
        other = "" if peer is None else f"{peer.median:.2f}"
        ratio = "" if peer is None else f"{peer.median / ours.median:.1f}"
        wanted = (
            ""
            if goal is None
            else f"{1e3 * goal:g} {'met' if ours.least <= 1e3 * goal else 'missed'}"
        )
        print(f"| {work} | {ours.median:.2f} | {ours.least:.2f} | {other} | {ratio} | {wanted} |")


if __name__ == "__main__":
    main()
