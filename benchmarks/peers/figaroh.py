"""FIGAROH in an interpreter of its own, a task at a time: see `process.py`.

Needs FIGAROH and nothing of this project. Tasks, each with the file of its arrays:

- ``["regressor", JOB]``: links alone, all samples
- ``["base", JOB]``: base parameters with rotors and friction
- ``["identify", JOB]``: ordinary least squares of given signals, as its examples do it
- ``["calibrate", JOB]``: geometric calibration on poses
- ``["calibrate_without_each", JOB]``: the same, each pose left out in turn
"""

import contextlib
import io
import json
import logging
import os
import sys
import tempfile
import time
import warnings
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np

os.environ.setdefault("MPLBACKEND", "Agg")
warnings.simplefilter("ignore")
logging.disable(logging.CRITICAL)
try:
    from importlib.metadata import version

    import pinocchio as pin
    from figaroh.calibration.base_calibration import BaseCalibration
    from figaroh.calibration.calibration_tools import calc_updated_fkm
    from figaroh.identification import parameter
    from figaroh.tools import qrdecomposition, regressor

    READY = {"ready": version("figaroh")}
except ImportError as error:
    READY = {"skipped": f"FIGAROH is not installed ({error})"}
    BaseCalibration = object

JOINTS = [
    "shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint", "wrist_2_joint",
    "wrist_3_joint",
]  # fmt: skip
HEADER = ["x1", "y1", "z1", "phix1", "phiy1", "phiz1", *JOINTS]


@cache
def content(path):
    """Arrays and texts of a job."""
    with np.load(path) as job:
        return {name: job[name] for name in job.files}


@cache
def robot_of(path):
    """The robot of a job."""
    model = pin.buildModelFromXML(str(content(path)["urdf"]))
    return SimpleNamespace(model=model, data=model.createData(), q0=pin.neutral(model))


def motion(path):
    """Positions, velocities, accelerations."""
    return [content(path)[name] for name in ("q", "v", "a")]


def stack(path, drive=True, offset=False):
    """The regressor of all samples."""
    config = regressor.RegressorConfig(
        has_friction=drive, has_actuator_inertia=drive, has_joint_offset=offset
    )
    robot = pin.RobotWrapper(robot_of(path).model)
    builder = regressor.RegressorBuilder(robot, config)
    return builder.build_basic_regressor(*motion(path), settings_of(path))


def settings_of(path):
    """Rotors and friction of a job, in its words."""
    job = content(path)
    drives = {key: job[name].tolist() for key, name in (("fv", "Fv"), ("fs", "Fc"), ("Ia", "Ia"))}
    return {
        "has_friction": True, "has_actuator_inertia": True, "has_joint_offset": False,
        "act_idxv": list(range(robot_of(path).model.nv)), **drives,
    }  # fmt: skip


def regress(path):
    """The regressor of the links."""
    return timed(lambda: stack(path, drive=False), lambda _: "")


def base(path):
    """Base parameters: columns without effect left out, double QR."""

    def run():
        values = parameter.get_standard_parameters(robot_of(path).model)
        values |= parameter.add_standard_additional_parameters(
            robot_of(path).model, settings_of(path)
        )
        W = stack(path)
        empty, names = regressor.get_index_eliminate(W, values)
        W = regressor.build_regressor_reduced(W, empty)
        found = qrdecomposition.QRDecomposer()
        found.double_decomposition(np.zeros(len(W)), W, names, values)
        return len(found.base_indices)

    return timed(run, lambda rank: f"rank {rank}")


def identify(path):
    """Rank and root mean square of the residuals of all equations."""

    def run():
        W = stack(path, offset=True)
        names = {f"parameter {k}": 0.0 for k in range(W.shape[1])}
        empty, kept = regressor.get_index_eliminate(W, names)
        W = regressor.build_regressor_reduced(W, empty)
        y = content(path)["tau"].T.ravel()
        base, _, _, found = qrdecomposition.QRDecomposer().double_decomposition(y, W, kept)
        return len(found), float(np.sqrt(np.mean((y - base @ found) ** 2)))

    return timed(run, lambda found: f"rank {found[0]}, RMSE {found[1]:.3f} N m")


class Calibration(BaseCalibration):
    """With the cost of its published example."""

    def cost_function(self, var):
        seen = calc_updated_fkm(self.model, self.data, var, self.q_measured, self.calib_config)
        return self.apply_measurement_weighting(
            self._compute_logmap_residuals(self.PEE_measured, seen),
            pos_weight=1.0,
            orient_weight=0.5,
        )


def configuration(csv, count):
    """Its configuration file (JSON is YAML)."""
    marker = {"name": "m", "ref_joint": "wrist_3_joint", "measurable_dof": [True] * 6}
    task = {
        "enabled": True, "type": "kinematic_calibration",
        "parameters": {
            "calibration_level": "full_params", "include_non_geometric": False,
            "outlier_threshold": 0.02, "estimation": {"method": "structural"},
        },
        "kinematics": {"base_frame": "universe", "tool_frame": "wrist_3_link"},
        "measurements": {
            "markers": [marker], "poses": {"base_pose": [0.0] * 6, "tool_pose": [0.0] * 6},
        },
        "data": {"source_file": csv, "number_of_samples": count},
    }  # fmt: skip
    robot = {"name": "ur10", "type": "manipulator", "properties": {"joints": {
        "active_joints": JOINTS}}}  # fmt: skip
    return json.dumps({"robot": robot, "tasks": {"calibration": task}})


def calibrated(robot, rows):
    """Calibrate on rows of poses and readings."""
    with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(io.StringIO()):
        csv, config = str(Path(folder) / "rows.csv"), str(Path(folder) / "config.yaml")
        np.savetxt(csv, rows, delimiter=",", header=",".join(HEADER), comments="", fmt="%.17g")
        Path(config).write_text(configuration(csv, len(rows)), encoding="utf-8")
        found = Calibration(robot, config, [])
        found.calib_config.update(known_baseframe=False, known_tipframe=False)
        found.initialize()
        found.solve()
    return found


def errors(found, rows):
    """Position (m) and angle (rad) of every row."""
    config = dict(found.calib_config, NbSample=len(rows))
    x = found.LM_result.x
    seen = calc_updated_fkm(found.model, found.data, x, rows[:, 6:], config).reshape(6, -1).T
    out = []
    for m, e in zip(rows[:, :6], seen, strict=True):
        R = pin.rpy.rpyToMatrix(m[3:]).T @ pin.rpy.rpyToMatrix(e[3:])
        out.append((np.linalg.norm(e[:3] - m[:3]), np.linalg.norm(pin.log3(R))))
    return np.array(out)


def rms(off):
    """Root mean squares as a note."""
    position, angle = np.sqrt(np.mean(off**2, axis=0))
    return f"rms {1e3 * position:.2f} mm, {np.degrees(angle):.2f} deg"


def calibrate(path):
    """Geometric parameters from poses."""
    rows = content(path)["rows"]
    run = timed(lambda: calibrated(robot_of(path), rows), lambda found: rms(errors(found, rows)))
    return run


def calibrate_without_each(path):
    """The same without each row in turn, judged by that row."""
    rows = content(path)["rows"]

    def run():
        return np.concatenate([
            errors(calibrated(robot_of(path), np.delete(rows, k, axis=0)), rows[k : k + 1])
            for k in range(len(rows))
        ])  # fmt: skip

    return timed(run, rms)


def timed(work, note):
    """Do it; the answer to a task."""
    clock, processor = time.perf_counter(), time.process_time()
    answer = work()
    spent = {"processor": time.process_time() - processor, "clock": time.perf_counter() - clock}
    return {**spent, "note": note(answer)}


TASKS = {
    "regressor": regress, "base": base, "identify": identify, "calibrate": calibrate,
    "calibrate_without_each": calibrate_without_each,
}  # fmt: skip


def main():
    """Answer until the input ends."""
    print(json.dumps(READY), flush=True)
    if "ready" not in READY:
        return
    for line in sys.stdin:
        name, *words = json.loads(line)
        print(json.dumps(TASKS[name](*words)), flush=True)


if __name__ == "__main__":
    main()
