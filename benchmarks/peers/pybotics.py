"""pybotics in an interpreter of its own: ``["calibrate", COUNT]`` on as many positions.

Needs pybotics and nothing of this project: see `process.py`. It fits the table of its own UR10; its
residual is one number a pose, the distance between measured and predicted position, and its
derivatives are SciPy's differences: less work than a calibration on poses.
"""

import json
import sys
import time

import numpy as np

try:
    from importlib.metadata import version

    from pybotics.optimization import OptimizationHandler, optimize_accuracy
    from pybotics.predefined_models import ur10
    from pybotics.robot import Robot
    from scipy.optimize import least_squares

    READY = {"ready": version("pybotics")}
except ImportError as error:
    READY = {"skipped": f"pybotics is not installed ({error})"}


def calibrate(count):
    """Fit positions with noise of 0.1 mm."""
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
    spent = {"processor": time.process_time() - processor, "clock": time.perf_counter() - clock}
    error = float(np.sqrt(np.mean(found.fun**2)))
    return {**spent, "note": f"{len(start)} parameters, no angles, {error:.3f} mm"}


def main():
    """Answer until the input ends."""
    print(json.dumps(READY), flush=True)
    if "ready" in READY:
        for line in sys.stdin:
            print(json.dumps(calibrate(int(json.loads(line)[1]))), flush=True)


if __name__ == "__main__":
    main()
