"""FIGAROH at work in an interpreter of its own, a task at a time: see `foreign.py`.

Needs FIGAROH and nothing of this project. Tasks, each with the file of its arrays:

- ``["regressor", JOB, NOTE]``: links alone, all samples; the note comes back with the time
- ``["keep_regressor", JOB]``: the same once, kept in ``JOB.answer.npy``
- ``["base", JOB]``: base parameters with rotors and friction
- ``["identify", JOB]``: least squares of given signals
- ``["calibrate", JOB]``: geometric calibration on poses
"""

import json
import sys
import tempfile
import time
import warnings
from functools import cache
from types import SimpleNamespace

import numpy as np

warnings.simplefilter("ignore")
try:
    from importlib.metadata import version

    import pinocchio as pin
    from calibration_figaroh import errors, fit
    from figaroh_base import Figaroh
    from identification_figaroh import highest_memory, identify

    READY = {"ready": version("figaroh")}
except ImportError as error:
    READY = {"skipped": f"FIGAROH is not installed ({error})"}


@cache
def content(path):
    """Arrays and texts of a job."""
    with np.load(path) as job:
        return {name: job[name] for name in job.files}


@cache
def model_of(path):
    """The robot of a job."""
    return pin.buildModelFromXML(str(content(path)["urdf"]))


@cache
def figaroh_of(path):
    """FIGAROH told the robot of a job."""
    job = content(path)
    return Figaroh(model_of(path), job["Ia"], job["Fv"], job["Fc"])


def motion(path):
    """Positions, velocities, accelerations."""
    return [content(path)[name] for name in ("q", "v", "a")]


def regress(path, note=""):
    """The regressor of the links."""
    figaroh, samples = figaroh_of(path), motion(path)
    return timed(lambda: figaroh.stack(samples, drive=False), lambda _: note)


def keep_regressor(path):
    """The same, for others to look at."""
    W = figaroh_of(path).stack(motion(path), drive=False)
    np.save(f"{path}.answer.npy", W)
    return told(0.0, 0.0, "")


def base(path):
    """Base parameters."""
    figaroh, samples = figaroh_of(path), motion(path)
    return timed(lambda: figaroh.base(samples), figaroh.said)


def least_squares(path):
    """From signals to parameters."""
    model = model_of(path)
    robot = SimpleNamespace(model=model, data=model.createData())
    arrays = (*motion(path), content(path)["tau"])
    before = highest_memory()

    def note(found):
        grown = highest_memory() - before
        return f"rank {found[0]}, RMSE {found[1]:.3f} N m, {grown:.0f} MB more memory"

    return timed(lambda: identify(robot, *arrays), note)


def calibrate(path):
    """Geometric parameters from poses."""
    model, rows = model_of(path), content(path)["rows"]
    robot = SimpleNamespace(model=model, data=model.createData(), q0=pin.neutral(model))
    with tempfile.TemporaryDirectory() as folder:
        found, spent = fit(robot, rows, "full_params", "structural", folder)
    position = 1e3 * np.sqrt(np.mean(errors(found, rows)[:, 0] ** 2))
    kept = len(found.calib_config["param_name"])
    return told(*spent, f"{kept} parameters, {position:.3f} mm")


def timed(work, note):
    """Do it, and say how long it took."""
    clock, processor = time.perf_counter(), time.process_time()
    answer = work()
    spent = time.process_time() - processor, time.perf_counter() - clock
    return told(*spent, note(answer))


def told(processor, clock, note):
    """The answer to a task."""
    return {"processor": processor, "clock": clock, "note": note}


TASKS = {
    "regressor": regress, "keep_regressor": keep_regressor, "base": base,
    "identify": least_squares, "calibrate": calibrate,
}  # fmt: skip


def main():
    """Answer until there is nothing more to do."""
    print(json.dumps(READY), flush=True)
    if "ready" not in READY:
        return
    for line in sys.stdin:
        name, *words = json.loads(line)
        print(json.dumps(TASKS[name](*words)), flush=True)


if __name__ == "__main__":
    main()
