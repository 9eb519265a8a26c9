"""Other programs that solve inverse geometric models: one arm in the terms of each.

`peers_of(model)` gives those that are installed and know the family of the arm. Each has to give
back random postures of its own direct model, or it is left out.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import robotmodels as rm
from benchmarks.works import module
from robotmodels.igm.loop import joint_chain

Array = NDArray[np.float64]

CHECKS = 20
CLOSE = 1e-6  # postures as near as this in every joint are the same [rad]
PREBUILT = {
    "puma560": "puma560",
    "kr6_r900": "kr6_r900",
    "ur5": "ur5",
    "ur5e": "ur5e",
    "crx10ia": "fanuc_crx10ia",
    "xarm6": "xarm6",
    "iiwa14": "iiwa14",
}


@dataclass(frozen=True)
class Peer:
    """One way to solve poses: its own, of its own model of the arm.

    ``solve`` takes a pose and gives what the peer itself gives; ``postures`` turns that into
    ``(S, n)``. ``direct`` is its own direct model, one posture at a time; ``batch`` solves
    ``(N, 4, 4)`` at once where the peer can.
    """

    name: str
    solve: Callable[[Array], Any]
    postures: Callable[[Any], Array]
    direct: Callable[[Array], Array]
    batch: Callable[[Array], list] | None = None


def frames_at_zero(model: rm.RobotModel) -> Array:
    """Frames of the joints and of the tool in the world at q = 0, shape (n + 1, 4, 4)."""
    chain = joint_chain(model)
    T = chain.base @ chain.D[0]
    frames = [T]
    for constant in chain.D[1:]:
        T = T @ constant
        frames.append(T)
    return np.array(frames)


def peers_of(model: rm.RobotModel, name: str = "") -> list[Peer]:
    """Peers that solve this arm; ``name`` is its name in the catalogue, if it is there."""
    found = []
    for make in (eaik, ik_geo, ssik, ssik_prebuilt, toolbox_puma):
        for peer in make(model, name):
            wrong = mistakes(peer, model.n)
            if wrong:
                print(f"  {peer.name} is left out: {wrong} of {CHECKS} postures not given back")
            else:
                found.append(peer)
    return found


def mistakes(peer: Peer, n: int) -> int:
    """How many of some random postures a peer does not give back."""
    q = np.random.default_rng(1).uniform(-np.pi, np.pi, (CHECKS, n))
    if peer.name in NOT_EVERY_POSTURE:
        # judged by whether the pose is reached
        return sum(
            np.abs(np.array([peer.direct(p) for p in peer.postures(peer.solve(T))]) - T).max(
                axis=(1, 2)
            ).min() > CLOSE
            for T in map(peer.direct, q)
        )  # fmt: skip
    lost = 0
    for wanted in q:
        rows = peer.postures(peer.solve(peer.direct(wanted)))
        gap = np.abs((rows - wanted + np.pi) % (2 * np.pi) - np.pi)
        lost += not (gap.max(axis=1, initial=0.0) < CLOSE).any()
    return lost


NOT_EVERY_POSTURE = ("RTB ikine_a, 1 posture",)


def eaik(model: rm.RobotModel, _: str = "") -> Iterator[Peer]:
    """EAIK, told the frames at zero; refuses arms outside its families."""
    if module("eaik") is None or (joint_chain(model).sigma != 0).any():
        return
    from eaik.IK_Homogeneous import HomogeneousRobot

    robot = HomogeneousRobot(frames_at_zero(model))
    if not robot.hasKnownDecomposition():
        return
    yield Peer(
        "EAIK",
        robot.IK,
        lambda found: np.array(found.Q).reshape(-1, model.n),
        robot.fwdKin,
        lambda poses: robot.IK_batched(poses, 1),
    )


def ik_geo(model: rm.RobotModel, _: str = "") -> Iterator[Peer]:
    """IK-Geo in Rust, axes and points; the user has to say the family."""
    peer = module("ik-geo")
    chain = joint_chain(model)
    if peer is None or chain.k != 6 or (chain.sigma != 0).any():
        return
    method = rm.igm(model, rm.dgm(model, np.linspace(0.3, 1.1, model.n))).method
    if "within" in method:
        return  # structured up to calibration errors, of which it knows nothing
    frames = frames_at_zero(model)
    axes, points, end = frames[:6, :3, 2], frames[:, :3, 3].copy(), frames[6, :3, :3]
    # its solvers want the meeting point of axes as the point on each of them
    points[4], points[5] = nearest_points(points[4], axes[4], points[5], axes[5])
    if "Pieper" in method:
        points[3] = points[4]
        parallel = np.linalg.norm(np.cross(axes[1], axes[2])) < 1e-9
        family = "spherical_two_parallel" if parallel else "spherical"
    elif "parallel" in method:
        family = "three_parallel_two_intersecting"
    else:
        return
    offsets = np.vstack([points[:1], np.diff(points, axis=0)])
    robot = getattr(peer.Robot, family)(axes.tolist(), offsets.tolist())

    def solve(T: Array) -> list:
        # it reads the rotation transposed
        return robot.get_ik((end @ T[:3, :3].T).tolist(), T[:3, 3].tolist())

    yield Peer(
        "ik-geo",
        solve,
        lambda found: np.array([q for q, _ in found]).reshape(-1, 6),
        lambda q: rm.dgm(model, q),
    )


def nearest_points(a: Array, u: Array, b: Array, v: Array) -> tuple[Array, Array]:
    """Points of two lines that are nearest to each other."""
    s, t = np.linalg.lstsq(np.array([u, -v]).T, b - a, rcond=None)[0]
    return a + s * u, b + t * v


SSIK = {"respect_limits": False, "enumerate_windings": False}
"""All branches, each once, as the others give them."""


def _rows_of_ssik(n: int) -> Callable[[Any], Array]:
    return lambda found: np.array([s.q for s in found]).reshape(-1, n)


def ssik(model: rm.RobotModel, _: str = "") -> Iterator[Peer]:
    """The arm told to ssik; general arms take it minutes to prepare and are left out."""
    peer = module("ssik")
    chain = joint_chain(model)
    if peer is None or chain.k != 6 or (chain.sigma != 0).any():
        return
    relative = np.array(chain.D)
    relative[0] = chain.base @ relative[0]
    arm = peer.Manipulator.from_transforms(relative)
    if "general" not in arm.solver_name:
        direct = lambda q: rm.dgm(model, q)  # noqa: E731
        yield Peer("ssik, own robot", lambda T: arm.solve(T, **SSIK), _rows_of_ssik(6), direct)


def ssik_prebuilt(model: rm.RobotModel, name: str = "") -> Iterator[Peer]:
    """An arm that ssik ships, with its own numbers and its native code."""
    peer = module("ssik")
    if peer is None or name not in PREBUILT:
        return
    arm = peer.Manipulator.from_prebuilt(PREBUILT[name])
    if arm.dof != 6:
        return
    yield Peer("ssik, prebuilt", lambda T: arm.solve(T, **SSIK), _rows_of_ssik(6), arm.fk)


def toolbox_puma(model: rm.RobotModel, name: str = "") -> Iterator[Peer]:
    """The Robotics Toolbox's closed form of the Puma: one posture a call."""
    if name != "puma560" or module("roboticstoolbox-python") is None:
        return
    from roboticstoolbox import models

    robot = models.DH.Puma560()
    yield Peer(
        NOT_EVERY_POSTURE[0],
        robot.ikine_a,
        lambda found: np.array([found.q]) if found.success else np.empty((0, 6)),
        lambda q: robot.fkine(q).A,
    )
