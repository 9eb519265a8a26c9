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


def peers(arm: rm.RobotModel) -> dict[str, Callable[[], Any] | None]:
    """The run in other libraries, which answers the last positions; None where one is missing."""
    return {
        name: make(arm) if importlib.util.find_spec(module) else None
        for name, module, make in (
            ("MuJoCo", "mujoco", mujoco_run),
            ("Drake", "pydrake", drake_run),
        )
    }


def mujoco_run(arm: rm.RobotModel) -> Callable[[], Any]:
    """MuJoCo: the law through its mass matrix and bias, its step as the plant."""
    import mujoco  # pyright: ignore[reportMissingImports]

    model, goal = mujoco.MjModel.from_xml_string(rm.to_urdf(arm)), quintic(Q, Q + 0.3, duration=1.0)
    model.opt.timestep = 1e-3

    def run() -> Any:
        data, M = mujoco.MjData(model), np.zeros((model.nv, model.nv))
        data.qpos[:] = Q
        for k in range(1000):
            q, v, a = (x[0] for x in goal.motion.derivatives(np.array([1e-3 * k]), (0, 1, 2)))
            mujoco.mj_forward(model, data)
            mujoco.mj_fullM(model, data, M)
            a = a + 20.0 * (v - data.qvel) + 100.0 * (q - data.qpos)
            data.qfrc_applied[:] = M @ a + data.qfrc_bias
            mujoco.mj_step(model, data)
        return data.qpos.copy()

    return run


def drake_run(arm: rm.RobotModel) -> Callable[[], Any]:
    """Drake: its InverseDynamicsController and a discrete MultibodyPlant, all compiled."""
    from pydrake import all as drake  # pyright: ignore[reportMissingImports]

    def added(builder: Any) -> Any:
        plant = drake.MultibodyPlant(1e-3)
        drake.Parser(plant).AddModelsFromString(rm.to_urdf(arm), "urdf")
        for index in plant.GetJointIndices():
            if (joint := plant.get_joint(index)).num_velocities():
                plant.AddJointActuator(joint.name(), joint)
        plant.Finalize()
        return plant if builder is None else builder.AddSystem(plant)

    times, goal = np.linspace(0.0, 1.0, 201), quintic(Q, Q + 0.3, duration=1.0)
    path = drake.PiecewisePolynomial.CubicHermite(times, goal.q(times).T, goal.v(times).T)
    builder = drake.DiagramBuilder()
    plant, believed = added(builder), added(None)
    law = builder.AddSystem(
        drake.InverseDynamicsController(believed, [100.0] * 6, [0.0] * 6, [20.0] * 6, True)
    )
    state = builder.AddSystem(drake.TrajectorySource(path, 1))
    second = builder.AddSystem(drake.TrajectorySource(path.MakeDerivative(2)))
    builder.Connect(plant.get_state_output_port(), law.get_input_port_estimated_state())
    builder.Connect(state.get_output_port(), law.get_input_port_desired_state())
    builder.Connect(second.get_output_port(), law.get_input_port_desired_acceleration())
    force = plant.get_applied_generalized_force_input_port()
    builder.Connect(law.get_output_port_generalized_force(), force)
    diagram = builder.Build()

    def run() -> Any:
        simulator = drake.Simulator(diagram)
        context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
        plant.SetPositions(context, Q)
        simulator.AdvanceTo(1.0)
        return plant.GetPositions(context)

    return run


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
    runs = {"robotmodels": lambda: control.run(arm, law, Q, t=1.0, period=1e-3).q[-1]}
    print("1 s of computed torque at 1 kHz on a UR5, seconds of processor time, error at the end")
    for name, run in (runs | peers(arm)).items():
        if run is None:
            print(f"  {name:12} not installed")
        else:
            error = np.abs(run() - Q - 0.3).max()
            print(f"  {name:12} {seconds(run, 1, RUNS):.3f}   {error:.1e}")


if __name__ == "__main__":
    main()
