"""pybotics fitting the table of its own UR10 to simulated positions, for `bench_calibration.py`.

    PYTHON_WITH_PYBOTICS benchmarks/calibration_pybotics.py COUNT [COUNT ...]

Needs pybotics and nothing of this project. Its residual is one number a pose, the distance between
measured and predicted position; its derivatives are SciPy's differences. So it has 24 parameters
of the table and 3 of the tool, of lower rank, and no orientation: less work than a calibration on
poses. Prints one JSON object a line.
"""

import json
import sys
import time

import numpy as np

try:
    from pybotics.optimization import OptimizationHandler, optimize_accuracy
    from pybotics.predefined_models import ur10
    from pybotics.robot import Robot
    from scipy.optimize import least_squares
except ImportError as error:
    print(json.dumps({"skipped": f"pybotics is not installed ({error})"}))
    sys.exit(0)


def fit(count):
    """Fit as many positions as asked, with noise of 0.1 mm."""
    rng = np.random.default_rng(1)
    nominal, real = Robot.from_parameters(ur10()), Robot.from_parameters(ur10())
    scale = np.tile([2e-3, 1.0, 2e-3, 1.0], 6)  # alpha, a, theta, d of a row, rad and mm
    real.kinematic_chain.vector = real.kinematic_chain.vector + scale * rng.normal(size=24)
    real.tool.position = np.array([50.0, -30.0, 120.0])
    nominal.tool.position = np.array([49.0, -29.0, 121.0])
    q = rng.uniform(-2.5, 2.5, (count, 6))
    p = np.array([real.fk(x)[:3, 3] for x in q]) + 0.1 * rng.normal(size=(count, 3))
    handler = OptimizationHandler(
        nominal, kinematic_chain_mask=[True] * 24, tool_mask=[True] * 3 + [False] * 3,
        world_mask=False,
    )  # fmt: skip
    start = handler.generate_optimization_vector()
    clock, processor = time.perf_counter(), time.process_time()
    found = least_squares(optimize_accuracy, start, args=(handler, q, p))
    spent = time.process_time() - processor, time.perf_counter() - clock
    length = np.maximum(np.linalg.norm(found.jac, axis=0), 1e-300)
    return {
        "name": f"{count}", "processor": spent[0], "clock": spent[1],
        "parameters": [len(start)],
        "rank": int(np.linalg.matrix_rank(found.jac / length, 1e-6)),
        "position": 1e-3 * float(np.sqrt(np.mean(found.fun**2))),
    }  # fmt: skip


def main():
    """Fit every number of positions that was asked for."""
    for count in sys.argv[1:]:
        print(json.dumps(fit(int(count))), flush=True)


if __name__ == "__main__":
    main()
