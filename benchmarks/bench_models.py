"""Poses, Jacobians, dynamics, regressors, velocities of a Puma 560: one by one and in batch."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

import robotmodels as rm
from benchmarks.measure import Contestant, loop
from benchmarks.works import OURS, Settings, Work, at_most, module, no_longer, same

FEW = 2_000
PINOCCHIO_ORDER = [9, 6, 7, 8, 0, 1, 3, 2, 4, 5]
"""Where m mx my mz xx xy yy xz yz zz stand among our XX XY XZ YY YZ ZZ MX MY MZ M."""
RAW = "Pinocchio"
Motion = tuple[np.ndarray, np.ndarray, np.ndarray]


@dataclass(frozen=True, slots=True)
class Puma:
    """The robot in every tool's words, and random motion."""

    model: rm.RobotModel
    motion: Motion
    few: Motion
    pose: Callable[[np.ndarray], np.ndarray]
    jacobian: Callable[[np.ndarray], np.ndarray]
    toolbox: Any


def puma(settings: Settings) -> Puma:
    """The Puma 560, which all have with inertia."""
    model = rm.load("puma560")
    rng = np.random.default_rng(0)
    q, v, a = rng.uniform(-2.0, 2.0, (3, settings.number(100_000, 20_000), model.n))
    pm, data = model.pin_model, model.pin_model.createData()
    tip = pm.getFrameId("tool", pin.FrameType.BODY)

    def pose(x: np.ndarray) -> np.ndarray:
        pin.forwardKinematics(pm, data, x)
        return pin.updateFramePlacement(pm, data, tip).homogeneous

    def jacobian(x: np.ndarray) -> np.ndarray:
        return pin.computeFrameJacobian(pm, data, x, tip, pin.LOCAL_WORLD_ALIGNED)

    toolbox = None
    if module("roboticstoolbox-python") is not None:
        from roboticstoolbox import models

        toolbox = models.DH.Puma560()
    return Puma(model, (q, v, a), (q[:FEW], v[:FEW], a[:FEW]), pose, jacobian, toolbox)


def toolbox_arm(model: rm.RobotModel) -> Any:
    """The Robotics Toolbox with our table and parameters: its own Puma has others."""
    import roboticstoolbox

    table, inertia, drive = model.table, model.inertia, model.drive
    links = []
    for j in range(model.n):
        mass = inertia.mass[j]
        c = inertia.first_moments[j] / mass if mass else np.zeros(3)
        about_c = inertia.tensors[j] - mass * (c @ c * np.eye(3) - np.outer(c, c))
        more: dict[str, Any] = {}
        if drive is not None:  # its dry friction has a value for each direction, with the offset
            dry = [drive.Fc[j] + drive.offset[j], -drive.Fc[j] + drive.offset[j]]
            more = {"Jm": drive.Ia[j], "B": drive.Fv[j], "Tc": dry, "G": 1.0}
        links.append(
            roboticstoolbox.RevoluteMDH(
                d=table.r[j], a=table.d[j], alpha=table.alpha[j], offset=table.theta[j],
                m=mass, r=c, I=about_c, **more,
            )
        )  # fmt: skip
    return roboticstoolbox.DHRobot(links, name=model.name, gravity=model.gravity)


def pose(settings: Settings) -> Iterator[Work]:
    """Pose of the tool."""
    p = puma(settings)
    (q, *_), (few, *_) = p.motion, p.few
    T = rm.dgm(p.model, few)
    batch = [Contestant(OURS, lambda: rm.dgm(p.model, q), len(q))]
    one = [
        Contestant(OURS, loop(lambda x: rm.dgm(p.model, x), few), FEW),
        Contestant(RAW, loop(p.pose, few), FEW, same("pose", T, [p.pose(x) for x in few])),
    ]
    if p.toolbox is not None:
        ets, fkine = p.toolbox.ets(), p.toolbox.fkine
        said = same("RTB's poses", T, ets.eval(few))
        batch.append(Contestant("RTB ets.eval", lambda: ets.eval(q), len(q), said))
        one.append(Contestant("RTB fkine", loop(fkine, few), FEW, said))
    yield Work(f"pose of the tool, batch of {len(q)}", "us", batch, [at_most(0.3, "us")])
    yield Work("pose of the tool, one call with its checks", "us", one, [at_most(8.0, "us")])


def jacobian(settings: Settings) -> Iterator[Work]:
    """Jacobian of the tool."""
    p = puma(settings)
    (q, *_), (few, *_) = p.motion, p.few
    J = rm.jacobian(p.model, few)
    batch = [Contestant(OURS, lambda: rm.jacobian(p.model, q), len(q))]
    said = same("Jacobian", J, [p.jacobian(x) for x in few])
    one = [
        Contestant(OURS, loop(lambda x: rm.jacobian(p.model, x), few), FEW),
        Contestant(RAW, loop(p.jacobian, few), FEW, said),
    ]
    if p.toolbox is not None:
        for name, way in {"ets.jacob0": p.toolbox.ets().jacob0, "jacob0": p.toolbox.jacob0}.items():
            said = same("RTB's Jacobian", J, [way(x) for x in few])
            one.append(Contestant(f"RTB {name}", loop(way, few), FEW, said))
    yield Work(f"Jacobian, batch of {len(q)}", "us", batch, [at_most(0.5, "us")])
    yield Work("Jacobian, one call", "us", one)


def inverse_dynamics(settings: Settings) -> Iterator[Work]:
    """Inverse dynamics, with drives one by one, and of links in batch."""
    p = puma(settings)
    drive, rigid = p.model.drive, p.model.with_drive(None)
    geared = p.model.pin_model.copy()
    geared.armature = np.array(drive.Ia)
    plain = (rigid.pin_model, rigid.pin_model.createData())
    scratch = geared.createData()

    def with_drive(*x: np.ndarray) -> np.ndarray:
        torque = pin.rnea(geared, scratch, *x)
        return torque + drive.Fv * x[1] + drive.Fc * np.sign(x[1]) + drive.offset

    robots = {
        "rigid": (rigid, lambda *x: pin.rnea(*plain, *x)),
        "rotors and friction": (p.model, with_drive),
    }
    for title, (robot, rnea) in robots.items():
        tau = rm.idm(robot, *p.few)
        theirs = [rnea(*x) for x in zip(*p.few, strict=True)]
        one = [
            Contestant(OURS, loop(lambda *x, m=robot: rm.idm(m, *x), *p.few), FEW),
            Contestant(RAW, loop(rnea, *p.few), FEW, same("rnea", tau, theirs)),
        ]
        if p.toolbox is not None:
            own = toolbox_arm(robot)
            said = same("RTB's rne", tau, own.rne(*p.few))
            one.append(Contestant("RTB rne", loop(own.rne, *p.few), FEW, said))
        yield Work(f"inverse dynamics, one call, {title}", "us", one, [at_most(8.0, "us")])
    count = len(p.motion[0])
    pool = pin.ModelPool(rigid.pin_model, 1)
    columns = [np.asfortranarray(x.T) for x in p.motion]
    tau = rm.idm(rigid, *p.motion)
    said = same("rneaInParallel", tau, pin.rneaInParallel(1, pool, *columns).T)
    batch = [
        Contestant(OURS, lambda: rm.idm(rigid, *p.motion), count),
        Contestant(
            f"{RAW} rneaInParallel", lambda: pin.rneaInParallel(1, pool, *columns), count, said
        ),
    ]
    if p.toolbox is not None:
        own = toolbox_arm(rigid)
        said = same("RTB's rne", tau, own.rne(*p.motion))
        batch.append(Contestant("RTB rne", lambda: own.rne(*p.motion), count, said))
    goal = no_longer(1.3, "<= 1.3 x rneaInParallel")
    yield Work(f"inverse dynamics, batch of {count}", "us", batch, [goal])


def regressor(settings: Settings) -> Iterator[Work]:
    """Torque regressor of links."""
    p = puma(settings)
    model, few = p.model, p.few
    pm, data = model.pin_model, model.pin_model.createData()

    def streamed() -> None:
        for _ in rm.torque_regressor_chunks(model, *p.motion, drive=False):
            pass

    def stacked() -> np.ndarray:
        return rm.torque_regressor(model, *few, drive=False)

    def one(*x: np.ndarray) -> np.ndarray:
        return pin.computeJointTorqueRegressor(pm, data, *x)

    # the parameters of a link stand in another order there
    W = stacked().reshape(FEW, model.n, model.n, 10)[..., PINOCCHIO_ORDER].reshape(FEW, model.n, -1)
    said = same("regressor", W, [one(*x) for x in zip(*few, strict=True)])
    count = len(p.motion[0])
    work = f"torque regressor 6 x 60, {count} samples in pieces"
    yield Work(work, "us", [Contestant(OURS, streamed, count)], [at_most(1.2, "us")])
    batch = [Contestant(OURS, stacked, FEW)]
    if settings.figaroh is not None:
        job = settings.figaroh.robot_job(model.with_drive(None), q=few[0], v=few[1], a=few[2])
        batch.append(Contestant("FIGAROH", settings.figaroh.task("regressor", job), FEW))
    yield Work(f"torque regressor, a matrix of {FEW} samples", "us", batch)
    alone = loop(lambda *x: rm.torque_regressor(model, *x, drive=False), *few)
    ways = [Contestant(OURS, alone, FEW), Contestant(RAW, loop(one, *few), FEW, said)]
    yield Work("torque regressor, one call", "us", ways)


def inverse_velocities(settings: Settings) -> Iterator[Work]:
    """Joint velocities of random twists, with everything that a result of `rm.ikm` has."""
    p = puma(settings)
    (q, twist, _), model = p.motion, p.model
    twist = twist[:, :6]

    def by_svd() -> np.ndarray:
        U, s, Vt = np.linalg.svd(rm.jacobian(model, q), full_matrices=False)
        return np.einsum("nij,ni->nj", Vt, np.einsum("nij,ni->nj", U, twist) / s)

    ways = [
        Contestant(OURS, lambda: rm.ikm(model, q, twist), len(q)),
        Contestant("NumPy, batched SVD of our Jacobians", by_svd, len(q)),
    ]
    yield Work(f"inverse kinematic model, batch of {len(q)}", "us", ways, [at_most(8.0, "us")])


WORKS = {
    "pose": pose,
    "jacobian": jacobian,
    "inverse_dynamics": inverse_dynamics,
    "regressor": regressor,
    "inverse_velocities": inverse_velocities,
}
