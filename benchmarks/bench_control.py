"""Control laws, and 1 s of computed torque at 1 kHz on a UR5."""

from __future__ import annotations

from collections.abc import Callable, Iterator
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
    """The same law, period and plant in every library that is there; notes: final errors."""
    arm = rm.load("erd:ur5")
    law = control.ComputedTorque(quintic(Q, Q + 0.3, duration=1.0), model=arm)

    def ours() -> np.ndarray:
        return control.run(arm, law, Q, t=1.0, period=1e-3).q[-1]

    def said(q: np.ndarray) -> str:
        return f"off the goal by {np.abs(q - Q - 0.3).max():.1g} rad"

    ways = [Contestant(OURS, ours, said=said, rounds=3)]
    for name, package, make in (("MuJoCo", "mujoco", by_mujoco), ("Drake", "drake", by_drake)):
        if module(package) is not None:
            ways.append(Contestant(name, make(arm), said=said, rounds=3))
    yield Work("1 s of computed torque at 1 kHz, UR5", "s", ways, [at_most(1.0, "s")])


def by_mujoco(arm: rm.RobotModel) -> Callable[[], np.ndarray]:
    """MuJoCo: the law through its mass matrix and bias, its step as the plant."""
    import mujoco  # pyright: ignore[reportMissingImports]

    model, goal = mujoco.MjModel.from_xml_string(rm.to_urdf(arm)), quintic(Q, Q + 0.3, duration=1.0)
    model.opt.timestep = 1e-3

    def run() -> np.ndarray:
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


def by_drake(arm: rm.RobotModel) -> Callable[[], np.ndarray]:
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
    rate = builder.AddSystem(drake.TrajectorySource(path.MakeDerivative(2)))
    builder.Connect(plant.get_state_output_port(), law.get_input_port_estimated_state())
    builder.Connect(state.get_output_port(), law.get_input_port_desired_state())
    builder.Connect(rate.get_output_port(), law.get_input_port_desired_acceleration())
    force = plant.get_applied_generalized_force_input_port()
    builder.Connect(law.get_output_port_generalized_force(), force)
    diagram = builder.Build()

    def run() -> np.ndarray:
        simulator = drake.Simulator(diagram)
        context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
        plant.SetPositions(context, Q)
        simulator.AdvanceTo(1.0)
        return plant.GetPositions(context)

    return run


WORKS = {"commands": commands, "second": second}
