"""Visual servoing beside the Machine Vision Toolbox and OpenCV, in one run.

    python -m benchmarks.bench_visual_servoing [--out benchmarks/results] [--rounds 15]

Contestants of a row take turns; figures are medians of the processor's time in microseconds a
call. Peers that are not installed are named and left out
(`pip install machinevision-toolbox-python opencv-python-headless`); what a peer gives is compared
with ours before it enters.
"""

from __future__ import annotations

import argparse
import importlib
import warnings
from dataclasses import asdict, dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from benchmarks.kept import RESULTS, keep
from benchmarks.machine import head, machine
from benchmarks.measure import Contestant, in_turns
from robotmodels import visual_servoing as vs
from robotmodels.se3 import rotation, translation

OURS = "robotmodels"
PEERS = {
    "machinevision-toolbox-python": "machinevisiontoolbox",
    "opencv-python-headless": "cv2",
}
CORNERS = np.array([[-0.1, -0.1, 0], [0.1, -0.1, 0], [0.1, 0.1, 0], [-0.1, 0.1, 0]])
GOAL = translation(0, 0, 0.5)
START = translation(0.1, -0.05, 0.9) @ rotation("x", 0.4) @ rotation("z", 0.3)
STEPS, TRIPLES, VELOCITY = 50, 1000, 60.0


@dataclass(frozen=True)
class Row:
    """A line of the table: medians in microseconds, and whether the goal is met."""

    work: str
    microseconds: dict[str, float]
    goal: str
    met: bool | None


def module(package: str) -> ModuleType | None:
    """A peer's module, None where it is not installed."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return importlib.import_module(PEERS[package])
    except ImportError:
        return None


def measured(work: str, contestants: list[Contestant], rounds: int, goal: str = "") -> Row:
    """Time the contestants of a row; the goal is a limit in us or a ratio to the first peer."""
    found = {name: t.processor.median * 1e6 for name, t in in_turns(contestants, rounds).items()}
    print(f"{work}: " + "; ".join(f"{name} {value:.1f}" for name, value in found.items()))
    ours, others = found[OURS], [v for name, v in found.items() if not name.startswith(OURS)]
    met = None
    if goal.endswith("us"):
        met = ours <= VELOCITY
    elif goal and others:
        met = ours * 5.0 <= others[0]
    return Row(work, found, goal, met)


def agrees(ours: Any, theirs: Any, tolerance: float, what: str) -> None:
    """Stop where a peer does not give the same."""
    off = float(np.abs(np.asarray(ours) - np.asarray(theirs)).max())
    if off > tolerance:
        raise SystemExit(f"{what}: the two differ by {off:.3g}.")


def law_rows(rounds: int) -> list[Row]:
    """One velocity, and a loop of a sampled law."""
    feature = vs.Points(CORNERS)
    task = vs.Task(feature, GOAL, gain=0.5)
    first = [Contestant(OURS, lambda: [vs.camera_velocity(task, START) for _ in range(100)], 100)]
    loop = [
        Contestant(
            OURS,
            lambda: vs.servo(task, START, noise=1e-300, duration=(STEPS - 1) * 0.1, step=0.1),
            STEPS,
        )
    ]
    peer = module("machinevision-toolbox-python")
    if peer is not None:
        from spatialmath import SE3

        camera = peer.CentralCamera(f=1.0, pp=(0.0, 0.0), rho=1.0)
        goal, p = feature.measure(GOAL).reshape(4, 2).T, feature.measure(START).reshape(4, 2).T
        X = CORNERS @ START[:3, :3].T + START[:3, 3]

        def once() -> Any:
            L = camera.visjac_p(p, X[:, 2])
            return 0.5 * np.linalg.pinv(L) @ (goal - p).T.ravel()

        agrees(vs.camera_velocity(task, START).v, once(), 1e-9, "visjac_p")
        first.append(Contestant("machinevision-toolbox visjac_p and pinv", once))
        seen = SE3(np.linalg.inv(START), check=False)

        def servo() -> Any:
            law = peer.IBVS(
                camera, P=CORNERS.T, pose_0=seen, p_d=goal, lmbda=0.05, eterm=0.0, graphics=False
            )
            law.run(STEPS)
            return law

        agrees(len(servo().history), STEPS, 0, "steps of IBVS")
        loop.append(Contestant("machinevision-toolbox IBVS", servo, STEPS, rounds=3))
    return [
        measured("velocity of the camera, four points", first, rounds, f"<= {VELOCITY:g} us"),
        measured(f"a step of a loop of {STEPS}, four points", loop, rounds, ">= 5x"),
    ]


def pose_rows(rounds: int) -> list[Row]:
    """Three points, planar points, homographies."""
    rng = np.random.default_rng(0)
    P = rng.uniform(-1.0, 1.0, (TRIPLES, 3, 3))
    X = P + np.array((0.0, 0.0, 4.0))
    images = np.ascontiguousarray(X[..., :2] / X[..., 2:])
    square = vs.Points(CORNERS).measure(START).reshape(4, 2)
    target = vs.Points(CORNERS).measure(GOAL).reshape(4, 2)
    three = [Contestant(OURS, lambda: vs.p3p(P, images), TRIPLES)]
    plane = [Contestant(OURS, lambda: vs.pnp(CORNERS, square))]
    matrix = [Contestant(OURS, lambda: vs.homography(target, square))]
    cv2 = module("opencv-python-headless")
    if cv2 is not None:
        K = np.eye(3)
        few = range(100)
        three.append(
            Contestant(
                "OpenCV solveP3P",
                lambda: [cv2.solveP3P(P[i], images[i], K, None, cv2.SOLVEPNP_P3P) for i in few],
                len(few),
            )
        )
        plane.append(
            Contestant(
                "OpenCV solvePnPGeneric IPPE, not refined",
                lambda: cv2.solvePnPGeneric(CORNERS, square, K, None, flags=cv2.SOLVEPNP_IPPE),
            )
        )
        H = cv2.findHomography(target, square)[0]
        agrees(vs.homography(target, square) / vs.homography(target, square)[2, 2], H, 1e-6, "H")
        matrix.append(
            Contestant("OpenCV findHomography", lambda: cv2.findHomography(target, square))
        )
    return [
        measured(f"all poses of three points, {TRIPLES} triples", three, rounds),
        measured("pose of four planar points, both minima", plane, rounds),
        measured("homography of four points", matrix, rounds),
    ]


def main() -> None:
    """Measure, print and keep the results."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=RESULTS)
    parser.add_argument("--rounds", type=int, default=15)
    arguments = parser.parse_args()
    about = machine(PEERS)
    missing = [package for package in PEERS if module(package) is None]
    if missing:
        print(f"Not installed, so left out: {', '.join(missing)}.")
    rows = law_rows(arguments.rounds) + pose_rows(arguments.rounds)
    lines = [
        *head("Visual servoing: measured side by side", about),
        "Medians in us a call, one thread; in brackets the ratio to ours.",
        "",
        "| work | ours | others | goal | met |",
        "|---|---|---|---|---|",
    ]
    for r in rows:
        ours = r.microseconds[OURS]
        others = "; ".join(
            f"{k} {v:.1f} ({v / ours:.1f}x)" for k, v in r.microseconds.items() if k != OURS
        )
        met = "" if r.met is None else ("yes" if r.met else "no")
        lines.append(f"| {r.work} | {ours:.1f} | {others} | {r.goal} | {met} |")
    text = "\n".join(lines) + "\n"
    print(text)
    kept = {"machine": about, "rows": [asdict(r) for r in rows]}
    keep(arguments.out, "visual_servoing", text, kept)


if __name__ == "__main__":
    main()
