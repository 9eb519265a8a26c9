"""Poses, Jacobians, single calls, inverse dynamics, regressors: on the Puma 560, with inertia."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

import robotmodels as rm
from benchmarks.foreign import kept_beside
from benchmarks.measure import loop
from benchmarks.side_by_side.agreement import same
from benchmarks.side_by_side.works import (
    BATCH,
    ONE,
    Entry,
    Goal,
    Settings,
    Tool,
    Work,
    at_most,
    module,
    named,
)

FEW = 2_000
PINOCCHIO_ORDER = [9, 6, 7, 8, 0, 1, 3, 2, 4, 5]
"""Where m mx my mz xx xy yy xz yz zz stand among our XX XY XZ YY YZ ZZ MX MY MZ M."""
STREAMED, STACKED = "streamed", f"a matrix of {FEW} samples"
IN_PARALLEL = "rneaInParallel, 1 thread"
Motion = tuple[np.ndarray, np.ndarray, np.ndarray]


@dataclass(frozen=True, slots=True)
class Puma:
    """The robot in every tool's words, and random motion."""

    model: rm.RobotModel
    motion: Motion
    pose: Callable[[np.ndarray], np.ndarray]
    jacobian: Callable[[np.ndarray], np.ndarray]
    rnea: Callable[..., np.ndarray]
    with_drive: Callable[..., np.ndarray]
    toolbox: Any

    @property
    def few(self) -> Motion:
        """The first samples, for what goes one by one."""
        q, v, a = self.motion
        return q[:FEW], v[:FEW], a[:FEW]


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

    def rnea(*x: np.ndarray) -> np.ndarray:
        return pin.rnea(pm, data, *x)

    drive = model.drive
    geared = pm.copy()
    geared.armature = np.array(drive.Ia)
    scratch = geared.createData()

    def with_drive(*x: np.ndarray) -> np.ndarray:
        torque = pin.rnea(geared, scratch, *x)
        return torque + drive.Fv * x[1] + drive.Fc * np.sign(x[1]) + drive.offset

    toolbox = None
    if module(Tool.RTB) is not None:
        from roboticstoolbox import models

        toolbox = models.DH.Puma560()
    return Puma(model, (q, v, a), pose, jacobian, rnea, with_drive, toolbox)


def toolbox_arm(model: rm.RobotModel) -> Any:
    """The Robotics Toolbox told our table and parameters: its own Puma has others."""
    import roboticstoolbox

    table, inertia, drive = model.table, model.inertia, model.drive
    links = []
    for j in range(model.n):
        mass = inertia.mass[j]
        c = inertia.first_moments[j] / mass if mass else np.zeros(3)
        about_c = inertia.tensors[j] - mass * (c @ c * np.eye(3) - np.outer(c, c))
        more: dict[str, Any] = {}
        if drive is not None:
            # its dry friction has a value for each sense of motion, which holds the offset too
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
    """Pose of the tool, in batch."""
    p = puma(settings)
    q, few = p.motion[0], p.few[0]
    entries = [
        Entry(Tool.OURS, "", lambda: rm.dgm(p.model, q), len(q), mode=BATCH),
        Entry(Tool.OURS, "", loop(lambda x: rm.dgm(p.model, x), few), FEW, mode=ONE),
        Entry(Tool.PINOCCHIO, "", loop(p.pose, few), FEW, _poses(p, p.pose), mode=ONE),
    ]
    if p.toolbox is not None:
        ets = p.toolbox.ets()
        in_batch = same("RTB's poses", rm.dgm(p.model, few), ets.eval(few))
        alone = _poses(p, lambda x: p.toolbox.fkine(x).A)
        entries += [
            Entry(Tool.RTB, "ets.eval", lambda: ets.eval(q), len(q), in_batch, mode=BATCH),
            Entry(Tool.RTB, "fkine", loop(p.toolbox.fkine, few), FEW, alone, mode=ONE),
        ]
    goal = [at_most(0.3, "us", BATCH)]
    yield Work("pose", f"pose of the tool, {len(q)} configurations", "us", entries, goal)


def _poses(p: Puma, theirs: Callable[[np.ndarray], np.ndarray]) -> Callable[[Any], str]:
    few = p.few[0]
    return same("pose", rm.dgm(p.model, few), [theirs(x) for x in few])


def jacobian(settings: Settings) -> Iterator[Work]:
    """Jacobian of the tool, in batch."""
    p = puma(settings)
    q, few = p.motion[0], p.few[0]

    def checked(theirs: Callable[[np.ndarray], np.ndarray]) -> Callable[[Any], str]:
        return same("Jacobian", rm.jacobian(p.model, few), [theirs(x) for x in few])

    entries = [
        Entry(Tool.OURS, "", lambda: rm.jacobian(p.model, q), len(q), mode=BATCH),
        Entry(Tool.OURS, "", loop(lambda x: rm.jacobian(p.model, x), few), FEW, mode=ONE),
        Entry(Tool.PINOCCHIO, "", loop(p.jacobian, few), FEW, checked(p.jacobian), mode=ONE),
    ]
    if p.toolbox is not None:
        ways = {"ets.jacob0": p.toolbox.ets().jacob0, "jacob0": p.toolbox.jacob0}
        entries += [
            Entry(Tool.RTB, how, loop(way, few), FEW, checked(way), mode=ONE)
            for how, way in ways.items()
        ]
    goal = [at_most(0.5, "us", BATCH)]
    yield Work("jacobian", f"Jacobian, {len(q)} configurations", "us", entries, goal)


def single(settings: Settings) -> Iterator[Work]:
    """One call with all its checks."""
    p = puma(settings)
    few = p.few
    entries = [
        Entry(Tool.OURS, "", loop(lambda x: rm.dgm(p.model, x), few[0]), FEW),
        Entry(Tool.PINOCCHIO, "no checks", loop(p.pose, few[0]), FEW, _poses(p, p.pose)),
    ]
    if p.toolbox is not None:
        said = _poses(p, lambda x: p.toolbox.fkine(x).A)
        entries.append(Entry(Tool.RTB, "fkine", loop(p.toolbox.fkine, few[0]), FEW, said))
    yield Work("single", "one dgm call with its checks", "us", entries, [at_most(8.0, "us")])
    ways = {"no checks": p.rnea, "no checks, friction by NumPy": p.with_drive}
    robots = {"rigid": p.model.with_drive(None), "rotors and friction": p.model}
    for (title, robot), (how, rnea) in zip(robots.items(), ways.items(), strict=True):

        def checked(theirs: Callable[..., Any], m: rm.RobotModel = robot) -> Callable[[Any], str]:
            torques = [theirs(*x) for x in zip(*few, strict=True)]
            return same("inverse dynamics", rm.idm(m, *few), torques)

        entries = [
            Entry(Tool.OURS, "", loop(lambda *x, m=robot: rm.idm(m, *x), *few), FEW),
            Entry(Tool.PINOCCHIO, how, loop(rnea, *few), FEW, checked(rnea)),
        ]
        if p.toolbox is not None:
            own = toolbox_arm(robot)
            entries.append(Entry(Tool.RTB, "rne", loop(own.rne, *few), FEW, checked(own.rne)))
        title = f"one idm call with its checks, {title}"
        yield Work("single", title, "us", entries, [at_most(8.0, "us")])


def inverse_dynamics(settings: Settings) -> Iterator[Work]:
    """Inverse dynamics of links, in batch."""
    p = puma(settings)
    model, motion = p.model.with_drive(None), p.motion
    count = len(motion[0])
    pool = pin.ModelPool(model.pin_model, 1)
    columns = [np.asfortranarray(x.T) for x in motion]
    torques = rm.idm(model, *motion)

    def parallel() -> np.ndarray:
        return pin.rneaInParallel(1, pool, *columns)

    said = same("rneaInParallel", torques, parallel().T)
    entries = [
        Entry(Tool.OURS, "", lambda: rm.idm(model, *motion), count),
        Entry(Tool.PINOCCHIO, IN_PARALLEL, parallel, count, said),
    ]
    if p.toolbox is not None:
        own = toolbox_arm(model)
        said = same("RTB's rne", torques, own.rne(*motion))
        entries.append(Entry(Tool.RTB, "rne", lambda: own.rne(*motion), count, said))
    ours, theirs = named(Tool.OURS), named(Tool.PINOCCHIO, how=IN_PARALLEL)
    goal = Goal(
        "<= 1.3 x rneaInParallel",
        lambda t: t[ours].processor.median <= 1.3 * t[theirs].processor.median,
    )
    yield Work("inverse_dynamics", f"inverse dynamics, {count} samples", "us", entries, [goal])


def regressor(settings: Settings) -> Iterator[Work]:
    """Torque regressor of links, streamed in pieces that stay in the cache."""
    p = puma(settings)
    model, motion, few = p.model, p.motion, p.few
    count = len(motion[0])
    pm, data = model.pin_model, model.pin_model.createData()

    def streamed() -> None:
        for _ in rm.torque_regressor_chunks(model, *motion, drive=False):
            pass

    def stacked() -> np.ndarray:
        return rm.torque_regressor(model, *few, drive=False)

    def alone(*x: np.ndarray) -> np.ndarray:
        return rm.torque_regressor(model, *x, drive=False)

    def one(*x: np.ndarray) -> np.ndarray:
        return pin.computeJointTorqueRegressor(pm, data, *x)

    # theirs has the parameters of a link in another order
    W = stacked().reshape(FEW, model.n, model.n, 10)
    W = W[..., PINOCCHIO_ORDER].reshape(FEW, model.n, -1)
    said = same("regressor", W, [one(*x) for x in zip(*few, strict=True)])
    entries = [
        Entry(Tool.OURS, "", streamed, count, mode=STREAMED),
        Entry(Tool.OURS, "", stacked, FEW, mode=STACKED),
        Entry(Tool.OURS, "", loop(alone, *few), FEW, mode=ONE),
        Entry(Tool.PINOCCHIO, "", loop(one, *few), FEW, said, mode=ONE),
    ]
    if settings.figaroh is not None:
        drive = rm.DriveParameters.zeros(model.n)
        job = settings.figaroh.job(
            urdf=rm.to_urdf(model.with_drive(None)), Ia=drive.Ia, Fv=drive.Fv, Fc=drive.Fc,
            q=few[0], v=few[1], a=few[2],
        )  # fmt: skip
        settings.figaroh.task("keep_regressor", job)()
        # all samples of a joint after those of the joint before
        kept = np.load(kept_beside(job)).reshape(model.n, FEW, -1).swapaxes(0, 1)
        note = same("FIGAROH's regressor", W, kept)(None)
        run = settings.figaroh.task("regressor", job, note)
        entries.append(Entry(Tool.FIGAROH, "", run, FEW, mode=STACKED))
    title = f"torque regressor 6 x 60, {count} samples"
    yield Work("regressor", title, "us", entries, [at_most(1.2, "us", STREAMED)])


WORKS = {
    "pose": pose,
    "jacobian": jacobian,
    "single": single,
    "inverse_dynamics": inverse_dynamics,
    "regressor": regressor,
}
