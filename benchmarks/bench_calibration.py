"""Full calibration of a UR10 on simulated poses, and real poses of a camera, each left out once."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

import robotmodels as rm
from benchmarks.measure import Contestant
from benchmarks.works import OURS, Settings, Work, at_most
from robotmodels.calibration import CalibrationResult, ParameterPrior, Pose, fit
from robotmodels.calibration.robot import calibrated_pose
from robotmodels.datasets import ur10_camera

GOALS = {30: 0.03, 100: 0.06, 500: 0.25}
NOISE = 1e-4  # m and rad
CAMERA_PRIOR = ParameterPrior(length=1e-4, angle=3e-3)


def rolled(T: np.ndarray) -> list[float]:
    """Position, roll, pitch and yaw, as FIGAROH reads them."""
    return [*T[:3, 3].tolist(), *rm.se3.to_rpy(T[:3, :3])]


def rows_of(q: np.ndarray, T: np.ndarray) -> np.ndarray:
    """Poses and readings in FIGAROH's columns."""
    return np.array([rolled(x) + y.tolist() for x, y in zip(T, q, strict=True)])


def simulated(count: int) -> tuple[rm.RobotModel, np.ndarray, np.ndarray]:
    """Nominal UR10, readings and noisy poses of one that is off in every placement."""
    rng = np.random.default_rng(1)
    model = ur10_camera().model
    n = model.n
    at = np.concatenate([[model.base], rm.link_transforms(model.table, np.zeros(n))])
    at[1], at[0] = at[0] @ at[1], np.eye(4)

    def off(length: float, angle: float) -> np.ndarray:
        return rm.se3.from_rpy(angle * rng.normal(size=3), length * rng.normal(size=3))

    links = [at[j] @ off(1e-3, 2e-3) for j in range(1, n + 1)]
    base = off(0.05, 0.05)
    tool = model.tool @ rm.se3.from_rpy([0.2, -0.1, 0.3], [0.05, -0.03, 0.12])
    q = rng.uniform(-2.5, 2.5, (count, n))
    poses = []
    for row in q:
        T = base
        for link, angle in zip(links, row, strict=True):
            T = T @ link @ rm.se3.rotation("z", angle)
        poses.append(T @ tool @ off(NOISE, NOISE))
    return model, q, np.array(poses)


def calibration(settings: Settings) -> Iterator[Work]:
    """Three sizes; of a short run the smallest."""
    urdf = ur10_camera().urdf
    for count, goal in GOALS.items():
        if settings.quick and count > 30:
            return
        model, q, T = simulated(count)

        def ours(m: rm.RobotModel = model, x: Any = q, y: Any = T) -> CalibrationResult:
            return fit(m, Pose(x, y), folds=0, held_out=0)

        def said(found: CalibrationResult) -> str:
            error = 1e3 * found.validation.in_sample.rms["m"]
            return f"{len(found.names)} parameters, {error:.3f} mm"

        ways = [Contestant(OURS, ours, said=said)]
        rounds = 1 if count > 100 else 3
        if settings.figaroh is not None:
            job = settings.figaroh.job(urdf=urdf, rows=rows_of(q, T))
            ways.append(
                Contestant("FIGAROH", settings.figaroh.task("calibrate", job), rounds=rounds)
            )
        if settings.pybotics is not None:
            task = settings.pybotics.task("calibrate", f"{count}")
            ways.append(Contestant("pybotics, distances of positions", task, rounds=rounds))
        title = f"UR10 full calibration, {count} poses"
        yield Work(title, "s", ways, [at_most(goal, "s")])


def camera(settings: Settings) -> Iterator[Work]:
    """23 real poses of a camera: errors where each pose is left out in turn."""
    data = ur10_camera()
    q, T = data.measured
    kept = [np.delete(np.arange(len(q)), k) for k in range(len(q))]

    def ours() -> str:
        P = []
        for k, rows in enumerate(kept):
            found = fit(data.model, Pose(q[rows], T[rows]), prior=CAMERA_PRIOR, folds=0, held_out=0)
            P.append(calibrated_pose(found.robot, q[k : k + 1])[0])
        return errors(np.array(P), T)

    ways = [Contestant(OURS, ours, len(q), said=str, rounds=1)]
    if settings.figaroh is not None:
        job = settings.figaroh.job(urdf=data.urdf, rows=rows_of(q, T))
        task = settings.figaroh.task("calibrate_without_each", job)
        ways.append(Contestant("FIGAROH", task, len(q), rounds=1))
    yield Work("UR10 and camera, 23 real poses, each left out in turn", "s", ways)


def errors(P: np.ndarray, T: np.ndarray) -> str:
    """Root mean squares of position and angle."""
    turn = np.trace(P[:, :3, :3].swapaxes(1, 2) @ T[:, :3, :3], axis1=1, axis2=2)
    angle = np.degrees(np.arccos(np.clip((turn - 1.0) / 2.0, -1.0, 1.0)))
    away = 1e3 * np.linalg.norm(P[:, :3, 3] - T[:, :3, 3], axis=1)
    return f"rms {np.sqrt(np.mean(away**2)):.2f} mm, {np.sqrt(np.mean(angle**2)):.2f} deg"


WORKS = {"calibration": calibration, "camera": camera}
