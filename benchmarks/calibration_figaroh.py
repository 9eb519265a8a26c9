"""FIGAROH calibrating a UR10 as its own example does, for `bench_calibration.py`.

    PYTHON_WITH_FIGAROH benchmarks/calibration_figaroh.py JOB.json

Needs FIGAROH and nothing of this project. Prints one JSON object a line: for each task of the job
its times, or its errors on rows that were kept aside. FIGAROH's own classes do all but the
splitting; the cost is that of its example: logarithms of pose errors, positions with weight 1 and
angles with 0.5.
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
from pathlib import Path
from types import SimpleNamespace

os.environ.setdefault("MPLBACKEND", "Agg")
import numpy as np

try:
    import pinocchio as pin
    from figaroh.calibration.base_calibration import BaseCalibration
    from figaroh.calibration.calibration_tools import calc_updated_fkm
except ImportError as error:
    print(json.dumps({"skipped": f"FIGAROH is not installed ({error})"}))
    sys.exit(0)
logging.disable(logging.CRITICAL)
JOINTS = [
    "shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint", "wrist_2_joint",
    "wrist_3_joint",
]  # fmt: skip
HEADER = ["x1", "y1", "z1", "phix1", "phiy1", "phiz1", *JOINTS]


class Calibration(BaseCalibration):
    """With the cost of FIGAROH's published example."""

    def cost_function(self, var):
        seen = calc_updated_fkm(self.model, self.data, var, self.q_measured, self.calib_config)
        return self.apply_measurement_weighting(
            self._compute_logmap_residuals(self.PEE_measured, seen),
            pos_weight=1.0,
            orient_weight=0.5,
        )


def settings(csv, count, level, method):
    """Its configuration file (JSON is YAML)."""
    return json.dumps({
        "robot": {
            "name": "ur10", "type": "manipulator",
            "properties": {"joints": {"active_joints": JOINTS}},
        },
        "tasks": {"calibration": {
            "enabled": True, "type": "kinematic_calibration",
            "parameters": {
                "calibration_level": level, "include_non_geometric": False,
                "outlier_threshold": 0.02, "estimation": {"method": method},
            },
            "kinematics": {"base_frame": "universe", "tool_frame": "wrist_3_link"},
            "measurements": {
                "markers": [
                    {"name": "m", "ref_joint": "wrist_3_joint", "measurable_dof": [True] * 6}
                ],
                "poses": {"base_pose": [0.0] * 6, "tool_pose": [0.0] * 6},
            },
            "data": {"source_file": csv, "number_of_samples": count},
        }},
    })  # fmt: skip


def fit(robot, rows, level, method, folder):
    """Calibrate, and how long it took on the processor and on the clock."""
    csv, config = str(Path(folder) / "rows.csv"), str(Path(folder) / "config.yaml")
    np.savetxt(csv, rows, delimiter=",", header=",".join(HEADER), comments="", fmt="%.17g")
    Path(config).write_text(settings(csv, len(rows), level, method), encoding="utf-8")
    with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
        warnings.simplefilter("ignore")
        clock, processor = time.perf_counter(), time.process_time()
        found = Calibration(robot, config, [])
        found.calib_config.update(known_baseframe=False, known_tipframe=False)
        found.initialize()
        found.solve()
        spent = time.process_time() - processor, time.perf_counter() - clock
    return found, spent


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


def main():
    """Do the tasks of a job."""
    job = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    model = pin.buildModelFromXML(job["urdf"])
    robot = SimpleNamespace(model=model, data=model.createData(), q0=pin.neutral(model))
    with tempfile.TemporaryDirectory() as folder:
        for task in job["tasks"]:
            rows = np.array(task["rows"])
            level, method = task["level"], task["method"]
            said = {"name": task["name"]}
            if "parts" not in task:
                runs = [fit(robot, rows, level, method, folder) for _ in range(task["repeats"])]
                said["processor"], said["clock"] = np.median([s for _, s in runs], axis=0).tolist()
                e = errors(runs[-1][0], rows)
                said["parameters"] = [len(runs[-1][0].calib_config["param_name"])]
            else:
                e, said["parameters"] = np.zeros((len(rows), 2)), []
                for part in task["parts"]:
                    kept = np.setdiff1d(np.arange(len(rows)), part)
                    found, _ = fit(robot, rows[kept], level, method, folder)
                    e[part] = errors(found, rows[part])
                    said["parameters"].append(len(found.calib_config["param_name"]))
            said["position"], said["angle"] = np.sqrt(np.mean(e**2, axis=0)).tolist()
            print(json.dumps(said), flush=True)


if __name__ == "__main__":
    main()
