"""One robot through the whole book: from its URDF to C code that runs its identified model.

    python notebooks/one_robot.py [--small] [--out FOLDER]

A simulated UR5e differs from its data sheet in lengths, angles, masses and friction. It is
calibrated by touching four sockets and identified from a log; its workspace is computed; it moves
along a line as fast as its torques allow, controlled, and its model is exported. ``--small`` takes
fewer touches and a shorter log, for tests. Notebook 15 has the same steps with pictures.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import robotmodels as rm
from robotmodels import calibration, control, export, identification, performance
from robotmodels import trajectories as tr

Array = NDArray[np.float64]
KINDS = ("Ia", "Fv", "Fc")
TORQUE = np.array([120.0, 120.0, 120.0, 22.0, 22.0, 22.0])  # N m, four fifths of the data sheet's
MOTION = tr.MotionLimits(velocity=[3.1] * 6, acceleration=[40.0] * 6)


def true_robot(nominal: rm.RobotModel, rng: np.random.Generator) -> rm.RobotModel:
    """The robot as it is: errors of 0.4 mm and 0.8 mrad, masses off by up to 10 %, friction."""
    parameters = calibration.candidate_parameters(nominal)
    sizes = np.array([0.4e-3 if unit == "m" else 0.8e-3 for unit in parameters.units])
    errors = sizes * rng.normal(size=len(sizes))
    masses = nominal.inertia.values * rng.uniform(0.9, 1.1, (nominal.f, 1))
    drive = rm.DriveParameters(
        Ia=[1.2, 1.2, 0.8, 0.2, 0.2, 0.2],
        Fv=[9.0, 9.0, 7.0, 2.0, 2.0, 2.0],
        Fc=[7.0, 8.0, 6.0, 2.0, 2.0, 2.0],
    )
    geometry = calibration.calibrated_model(parameters, errors).model
    return geometry.with_inertia(rm.InertialParameters(masses)).with_drive(drive)


def touches(
    real: rm.RobotModel, count: int, rng: np.random.Generator
) -> list[calibration.Measurement]:
    """Joint readings with the ball in four sockets, whose distances a gauge plate gives."""
    sockets = np.array([[0.35, 0.3, 0.1], [0.55, -0.1, 0.1], [-0.4, 0.35, 0.1], [0.3, -0.4, 0.35]])
    place = np.arange(count) % len(sockets)
    angles = rng.uniform([np.pi - 0.6, -0.6, -np.pi], [np.pi + 0.6, 0.6, np.pi], (count, 3))
    T = [rm.se3.from_rpy(rpy, sockets[k]) for rpy, k in zip(angles, place, strict=True)]
    q = rm.igm(real, T).q[:, 0]
    there = np.isfinite(q).all(axis=1)
    read = q[there] + 2e-5 * rng.normal(size=(there.sum(), 6))
    lengths = np.linalg.norm(sockets[1:] - sockets[0], axis=1)
    return [
        calibration.PointContact(read, place[there], name="socket"),
        *(
            calibration.KnownDistance("socket:0", f"socket:{k}", float(length))
            for k, length in enumerate(lengths, start=1)
        ),
    ]


def identified(
    arm: rm.RobotModel, real: rm.RobotModel, seconds: float, rng: np.random.Generator
) -> rm.RobotModel:
    """The arm with the inertial parameters, rotors and friction that a log of its motion gives."""
    limits = tr.MotionLimits(
        velocity=[2.0] * 6, acceleration=[8.0] * 6, lower=[-2.5] * 6, upper=[2.5] * 6
    )
    exciting = identification.exciting_trajectory(
        arm, drive=KINDS, limits=limits, duration=seconds, starts=1, baseline=10, iterations=5,
        rng=rng,
    )  # fmt: skip
    q, v, a = exciting.trajectory.motion.derivatives(np.arange(0.0, seconds, 2e-3), (0, 1, 2))
    noise = rng.normal(size=(2, *q.shape))
    log = identification.Log(2e-3, q + 5e-5 * noise[0], rm.idm(real, q, v, a) + 0.2 * noise[1])
    result = identification.fit(arm, log, drive=KINDS)
    print(result)
    return identification.consistent_robot(result).of(arm)


def tool_errors(
    real: rm.RobotModel, model: rm.RobotModel, motion: tr.Trajectory, rng: np.random.Generator
) -> tuple[float, float, control.ControlledMotion]:
    """Largest errors of the torques, N m, and of the tool on its way, mm; the controlled motion."""
    q, v, a = (size * rng.uniform(-1.0, 1.0, (200, 6)) for size in (2.5, 2.0, 8.0))
    torque = np.abs(rm.idm(model, q, v, a) - rm.idm(real, q, v, a)).max()
    law = control.ComputedTorque(motion, omega=20.0, model=model)
    run = control.run(real, law, motion.q(0.0), t=motion.duration, period=1e-3)
    wanted = rm.dgm(real, np.array([motion.q(time) for time in run.t]))
    tool = np.linalg.norm((rm.dgm(real, run.q) - wanted)[:, :3, 3], axis=1).max()
    return float(torque), 1e3 * float(tool), run


def main(small: bool = False, out: Path | None = None) -> dict[str, float]:
    """Do all steps; returns the figures that are printed at the end."""
    rng = np.random.default_rng(15)
    folder = out or Path()
    rm.write_urdf(rm.load("ur5e"), folder / "ur5e.urdf")
    nominal = rm.load(folder / "ur5e.urdf").with_tool(rm.se3.translation(0.03, 0.0, 0.15))
    real = true_robot(nominal, rng)

    fitted = calibration.fit(nominal, touches(real, 40 if small else 120, rng))
    print(fitted)
    known = identified(fitted.model, real, 5.0 if small else 20.0, rng)

    print(performance.workspace(known, resolution=12 if small else 40))
    print(performance.aspects(nominal, limits=False))
    start = rm.dgm(known, [0.2, -1.2, 1.6, -0.6, 1.2, 0.3])
    end = rm.se3.translation(-0.15, 0.35, -0.1) @ start
    line = tr.cartesian_trajectory(start, end, 60)
    follow = performance.feasible_path(known, line)
    print(follow)
    joints = tr.joint_path(known, line, q_start=follow.q[0])
    path = tr.cubic_spline(joints.q, np.linspace(0.0, 1.0, len(line)))
    timed = tr.time_optimal(path, MOTION, model=known, torque=TORQUE)
    print(timed)

    figures = {}
    for name, model in {"data sheet": nominal, "calibrated and identified": known}.items():
        torque, tool, run = tool_errors(real, model, timed.trajectory, rng)
        figures |= {f"torque, {name}": torque, f"tool, {name}": tool}
        print(f"{name}: torques off by up to {torque:.2f} N m, the tool by up to {tool:.2f} mm")
        print(run)
    program = export.program(known, "idm", drive=KINDS)
    export.write(program, folder / "ur5e_idm.c")
    q, v, a = rng.uniform(-2.0, 2.0, (3, 6))
    figures["C program"] = float(np.abs(program(q, v, a) - rm.idm(known, q, v, a)).max())
    print(f"ur5e_idm.c: {program.count.multiplications} multiplications")
    return figures


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--small", action="store_true", help="fewer touches, a shorter log")
    parser.add_argument("--out", type=Path, help="folder for the URDF and the C file")
    given = parser.parse_args()
    main(given.small, given.out)
