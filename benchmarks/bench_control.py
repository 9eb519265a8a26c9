"""Speed of control laws and of controlled simulations, beside Drake and MuJoCo where they install.

    python benchmarks/bench_control.py

A command is one call of a law for a 6R arm. A run is 1 s of computed torque at 1 kHz on a UR5: the
same law, period and plant in every library that is there.
"""

from __future__ import annotations

import importlib.util
import time
from collections.abc import Callable
from typing import Any

import numpy as np

import robotmodels as rm
from robotmodels import control
from robotmodels.trajectories import quintic

CALLS, RUNS = 1000, 3
Q = np.array([0.3, -1.0, 1.2, 0.4, 0.8, 0.2])


def seconds(function: Callable[[], Any], calls: int, repeats: int) -> float:
    """Processor time of one call, the best of several rounds."""
    function()
    best = np.inf
    for _ in range(repeats):
        start = time.process_time()
        for _ in range(calls):
            function()
        best = min(best, (time.process_time() - start) / calls)
    return best


def laws(arm: rm.RobotModel) -> dict[str, Any]:
    """The laws of the chapter for one arm."""
    T, push = rm.dgm(arm, Q + 0.1), [0, 0, 10.0, 0, 0, 0]
    goal = quintic(Q, Q + 0.3, duration=1.0)
    task = control.ComputedTorque(T, model=arm, space="task")
    return {
        "computed torque, constant goal": control.ComputedTorque(Q, model=arm),
        "computed torque, trajectory": control.ComputedTorque(goal, model=arm),
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


def mujoco_run(arm: rm.RobotModel) -> float | None:
    """Processor time of the run in MuJoCo: its inverse dynamics as the law, its step as plant."""
    if importlib.util.find_spec("mujoco") is None:
        return None
    import mujoco  # pyright: ignore[reportMissingImports]

    model = mujoco.MjModel.from_xml_string(rm.to_urdf(arm))
    model.opt.timestep = 1e-3
    goal = quintic(Q, Q + 0.3, duration=1.0)

    def run() -> None:
        data, M = mujoco.MjData(model), np.zeros((model.nv, model.nv))
        data.qpos[:] = Q
        for k in range(1000):
            t = 1e-3 * k
            mujoco.mj_forward(model, data)
            mujoco.mj_fullM(model, M, data.qM)
            e, de = goal.q(t) - data.qpos, goal.v(t) - data.qvel
            a = goal.a(t) + 20.0 * de + 100.0 * e
            data.qfrc_applied[:] = M @ a + data.qfrc_bias
            mujoco.mj_step(model, data)

    return seconds(run, 1, RUNS)


def main() -> None:
    """Print both tables."""
    arm = rm.load("erd:ur5")
    print("one command of a 6R arm, microseconds of processor time")
    rest = np.full(6, 0.1)
    for name, law in laws(arm).items():
        x, wrench = law.state0, np.array([0.0, 0.0, 5.0, 0.0, 0.0, 0.0])
        one = seconds(lambda law=law, x=x, f=wrench: law.command(0.1, Q, rest, x, f), CALLS, 5)
        print(f"  {name:32} {1e6 * one:8.1f}")
    law = laws(arm)["computed torque, trajectory"]
    ours = seconds(lambda: control.run(arm, law, Q, t=1.0, period=1e-3), 1, RUNS)
    print("1 s of computed torque at 1 kHz on a UR5, seconds of processor time")
    print(f"  robotmodels {ours:.3f}")
    theirs = mujoco_run(arm)
    print("  MuJoCo      " + ("not installed" if theirs is None else f"{theirs:.3f}"))
    if importlib.util.find_spec("pydrake") is None:
        print("  Drake       not installed")


if __name__ == "__main__":
    main()
