"""Control laws, and 1 s of computed torque at 1 kHz on a UR5."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

import robotmodels as rm
from benchmarks.measure import Contestant
from benchmarks.works import OURS, Settings, Work, at_most, module
from robotmodels import control
from robotmodels.trajectories import quintic

CALLS = 1000
Q = np.array([0.3, -1.0, 1.2, 0.4, 0.8, 0.2])


def laws(arm: rm.RobotModel) -> dict[str, Any]:
    """The laws of the chapter for one arm."""
    T, push = rm.dgm(arm, Q + 0.1), [0, 0, 10.0, 0, 0, 0]
    goal = quintic(Q, Q + 0.3, duration=1.0)
    task = control.ComputedTorque(T, model=arm, space="task")
    return {
        "computed torque": control.ComputedTorque(goal, model=arm),
        "computed torque, task space": task,
        "PID": control.DecentralizedPID(Q, 1.0, 1.0, 1.0),
        "PD with gravity": control.PDGravity(Q, 10.0, 1.0, model=arm),
        "passivity": control.Passivity(goal, 10.0, 1.0, model=arm),
        "sliding mode": control.SlidingMode(goal, 10.0, 1.0, 0.1, model=arm),
        "adaptive": control.AdaptiveSlotineLi(goal, 1.0, 1.0, 1.0, model=arm, drive=False),
        "impedance": control.Impedance(T, 1.0, 10.0, 100.0, model=arm),
        "decoupling in contact": control.ConstrainedDecoupling(np.eye(4), T, push, arm),
        "hybrid": control.ParallelHybrid([0, 0, 1, 0, 0, 0], np.eye(4), T, push, arm),
        "external force loop": control.ExternalForceLoop(task, 1e4, 5.0, force=push),
    }


def commands(settings: Settings) -> Iterator[Work]:
    """One command of each law."""
    arm, v = rm.load("erd:ur5"), np.full(6, 0.1)
    wrench = np.array([0.0, 0.0, 5.0, 0.0, 0.0, 0.0])
    for name, law in laws(arm).items():

        def run(law: Any = law, x: Any = law.state0) -> None:
            for _ in range(CALLS):
                law.command(0.1, Q, v, x, wrench)

        ways = [Contestant(OURS, run, CALLS)]
        yield Work(f"one command of a 6R, {name}", "us", ways, [at_most(30.0, "us")])


def second(settings: Settings) -> Iterator[Work]:
    """The same law, period and plant in every library that is there."""
    arm = rm.load("erd:ur5")
    goal = quintic(Q, Q + 0.3, duration=1.0)
    law = control.ComputedTorque(goal, model=arm)
    ways = [Contestant(OURS, lambda: control.run(arm, law, Q, t=1.0, period=1e-3), rounds=3)]
    mujoco: Any = module("mujoco")
    if mujoco is not None:
        model = mujoco.MjModel.from_xml_string(rm.to_urdf(arm))
        model.opt.timestep = 1e-3

        def by_mujoco() -> None:
            data, M = mujoco.MjData(model), np.zeros((model.nv, model.nv))
            data.qpos[:] = Q
            for k in range(1000):
                t = 1e-3 * k
                mujoco.mj_forward(model, data)
                mujoco.mj_fullM(model, M, data.qM)
                e, de = goal.q(t) - data.qpos, goal.v(t) - data.qvel
                data.qfrc_applied[:] = M @ (goal.a(t) + 20.0 * de + 100.0 * e) + data.qfrc_bias
                mujoco.mj_step(model, data)

        ways.append(Contestant("MuJoCo", by_mujoco, rounds=3))
    yield Work("1 s of computed torque at 1 kHz, UR5", "s", ways, [at_most(1.0, "s")])


WORKS = {"commands": commands, "second": second}
