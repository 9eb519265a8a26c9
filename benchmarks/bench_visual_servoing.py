"""Visual servoing beside the Machine Vision Toolbox and OpenCV."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from benchmarks.measure import Contestant
from benchmarks.works import OURS, Settings, Work, at_most, module, no_longer, same
from robotmodels import visual_servoing as vs
from robotmodels.se3 import rotation, translation

CORNERS = np.array([[-0.1, -0.1, 0], [0.1, -0.1, 0], [0.1, 0.1, 0], [-0.1, 0.1, 0]])
GOAL = translation(0, 0, 0.5)
START = translation(0.1, -0.05, 0.9) @ rotation("x", 0.4) @ rotation("z", 0.3)
STEPS, TRIPLES = 50, 1000


def law(settings: Settings) -> Iterator[Work]:
    """One velocity, and a loop of a sampled law."""
    feature = vs.Points(CORNERS)
    task = vs.Task(feature, GOAL, gain=0.5)
    duration = (STEPS - 1) * 0.1
    one = [Contestant(OURS, lambda: [vs.camera_velocity(task, START) for _ in range(100)], 100)]
    many = [
        Contestant(
            OURS, lambda: vs.servo(task, START, noise=1e-300, duration=duration, step=0.1), STEPS
        )
    ]
    goals = []
    peer: Any = module("machinevision-toolbox-python")
    if peer is not None:
        from spatialmath import SE3

        camera = peer.CentralCamera(f=1.0, pp=(0.0, 0.0), rho=1.0)
        goal, p = feature.measure(GOAL).reshape(4, 2).T, feature.measure(START).reshape(4, 2).T
        X = CORNERS @ START[:3, :3].T + START[:3, 3]

        def once() -> Any:
            return 0.5 * np.linalg.pinv(camera.visjac_p(p, X[:, 2])) @ (goal - p).T.ravel()

        said = same("visjac_p", vs.camera_velocity(task, START).v, once(), 1e-9)
        one.append(Contestant("Machine Vision Toolbox, visjac_p and pinv", once, said=said))
        seen = SE3(np.linalg.inv(START), check=False)

        def servo() -> None:
            law = peer.IBVS(
                camera, P=CORNERS.T, pose_0=seen, p_d=goal, lmbda=0.05, eterm=0.0, graphics=False
            )
            law.run(STEPS)

        many.append(Contestant("Machine Vision Toolbox, IBVS", servo, STEPS, rounds=3))
        goals = [no_longer(0.2, "5 times as fast")]
    yield Work("velocity of the camera, four points", "us", one, [at_most(60.0, "us")])
    yield Work(f"a step of a loop of {STEPS}, four points", "us", many, goals)


def poses(settings: Settings) -> Iterator[Work]:
    """Three points, planar points, homographies."""
    P = np.random.default_rng(0).uniform(-1.0, 1.0, (TRIPLES, 3, 3))
    X = P + np.array((0.0, 0.0, 4.0))
    images = np.ascontiguousarray(X[..., :2] / X[..., 2:])
    square = vs.Points(CORNERS).measure(START).reshape(4, 2)
    target = vs.Points(CORNERS).measure(GOAL).reshape(4, 2)
    three = [Contestant(OURS, lambda: vs.p3p(P, images), TRIPLES)]
    plane = [Contestant(OURS, lambda: vs.pnp(CORNERS, square))]
    matrix = [Contestant(OURS, lambda: vs.homography(target, square))]
    cv2: Any = module("opencv-python-headless")
    if cv2 is not None:
        K, few = np.eye(3), range(100)
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
        H = vs.homography(target, square)
        said = same("homography", H / H[2, 2], cv2.findHomography(target, square)[0], 1e-6)
        run = lambda: cv2.findHomography(target, square)  # noqa: E731
        matrix.append(Contestant("OpenCV findHomography", run, said=said))
    yield Work(f"all poses of three points, {TRIPLES} triples", "us", three)
    yield Work("pose of four planar points, both minima", "us", plane)
    yield Work("homography of four points", "us", matrix)


WORKS = {"law": law, "poses": poses}
