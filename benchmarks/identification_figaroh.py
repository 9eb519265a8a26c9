"""FIGAROH identifying a robot from given signals, for `bench_identification.py`.

    PYTHON_WITH_FIGAROH benchmarks/identification_figaroh.py JOB.npz URDF ROUNDS

Needs FIGAROH and nothing of this project. Prints one JSON object. FIGAROH's own functions do it
as its examples do: regressor of all samples, columns without effect left out, double QR with the
torques, which is ordinary least squares. Its weighted least squares needs a square matrix of all
equations and is not asked for.
"""

import json
import sys
import time
import warnings
from pathlib import Path
from types import SimpleNamespace

import numpy as np

warnings.simplefilter("ignore")
try:
    import pinocchio as pin
    from figaroh.tools import qrdecomposition, regressor
except ImportError as error:
    print(json.dumps({"skipped": f"FIGAROH is not installed ({error})"}))
    sys.exit(0)


def highest_memory():
    """Highest resident memory of this process so far, MB."""
    status = Path("/proc/self/status").read_text()
    line = next(line for line in status.splitlines() if line.startswith("VmHWM"))
    return int(line.split()[1]) / 1024.0


def identify(robot, q, v, a, tau):
    """Rank and root mean square of the residuals of all equations."""
    n = robot.model.nv
    config = regressor.RegressorConfig(
        has_friction=True, has_actuator_inertia=True, has_joint_offset=True
    )
    builder = regressor.RegressorBuilder(robot, config)
    W = builder.build_basic_regressor(q, v, a, {"act_idxv": list(range(n))})
    names = {f"parameter {k}": 0.0 for k in range(W.shape[1])}
    empty, kept = regressor.get_index_eliminate(W, names)
    W = regressor.build_regressor_reduced(W, empty)
    y = tau.T.ravel()
    base, _, _, found = qrdecomposition.QRDecomposer().double_decomposition(y, W, kept)
    return len(found), float(np.sqrt(np.mean((y - base @ found) ** 2)))


def main():
    """Do it as often as asked."""
    with np.load(sys.argv[1]) as job:
        arrays = [job[name] for name in ("q", "v", "a", "tau")]
    model = pin.buildModelFromXML(Path(sys.argv[2]).read_text(encoding="utf-8"))
    robot = SimpleNamespace(model=model, data=model.createData())
    identify(robot, *(x[:500] for x in arrays))
    before = highest_memory()
    spent = []
    for _ in range(int(sys.argv[3])):
        clock, processor = time.perf_counter(), time.process_time()
        rank, rmse = identify(robot, *arrays)
        spent.append((time.process_time() - processor, time.perf_counter() - clock))
    processor, clock = np.median(spent, axis=0).tolist()
    print(json.dumps({
        "processor": processor, "clock": clock, "rank": rank, "rmse": rmse,
        "memory": highest_memory(), "before": before,
    }))  # fmt: skip


if __name__ == "__main__":
    main()
