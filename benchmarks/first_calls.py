"""What the first call of each room costs where nothing has been compiled yet.

    python -m benchmarks.first_calls [--out FILE]

Each call runs in a process of its own with an empty cache. Its processor time is divided by that
of one fixed small compilation in the same process, the unit of these figures (0.4 s on the
reference machine), so that they do not depend on the speed or the load of the machine.
"""

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

UNIT = """
import sys, time
import numba, numpy as np
sys.path.insert(0, ".")
@numba.njit
def small(a, b):
    total = 0.0
    for i in range(a.shape[0]):
        for j in range(b.shape[1]):
            for k in range(a.shape[1]):
                total += a[i, k] * b[k, j]
    return total
start = time.process_time()
small(np.eye(3), np.eye(3))
unit = time.process_time() - start
import robotmodels as rm
{prepare}
start = time.process_time()
{call}
print((time.process_time() - start) / unit)
"""
RX90 = 'm = rm.load("rx90"); q = 0.1 * np.arange(1.0, 7.0); T = rm.dgm(m, q)'
ARM = 'm = rm.load("planar_2r"); m = m.with_inertia(rm.uniform_bodies(m, 4.0)); q = np.ones(2)'
HEXAPOD = (
    "from robotmodels import parallel; h = parallel.gough_symmetric(1.0); "
    "T = h.pose([0.1, 0, 1, 0.1, 0.2, 0]); q = parallel.igm(h, T).q[0]"
)
LINKS = (
    "from robotmodels import flexible as f; m = rm.load('planar_2r'); "
    "l = f.beam(0.5, EI=(np.inf, 1.0), density=0.2, hub=0.1); a = f.FlexibleRobot(m, {1: l, 2: l})"
)
CALLS = {
    "igm, RX-90": (RX90, "rm.igm(m, T)"),
    "igm, TRR arm of the exercise with a mask": (
        'm = rm.load("lab_trr"); T = rm.dgm(m, [-0.3, 0.5, 0.4])', 'rm.igm(m, T, mask="position")',
    ),
    "igm_numeric": (RX90, "rm.igm_numeric(m, T, q0=q + 0.05, rng=0)"),
    "ikm": (RX90, "rm.ikm(m, q, np.ones(6))"),
    "idm": (RX90, "rm.idm(m.with_inertia(rm.uniform_bodies(m, 4.0)), q, q, q)"),
    "base_parameters": (ARM, "rm.base_parameters(m)"),
    "calibration.fit": (
        RX90 + "; from robotmodels import calibration as c; "
        "q = np.random.default_rng(0).uniform(-1, 1, (40, 6)); p = rm.dgm(m, q)",
        "c.fit(m, c.Pose(q, p), folds=0, held_out=0.0)",
    ),
    "identification.fit": (
        ARM + "; from robotmodels import identification as i; t = 0.005 * np.arange(800)[:, None]; "
        "w = np.array([2.0, 3.0]); log = i.Log(0.005, np.sin(w * t), np.cos(w * t))",
        "i.fit(m, log, checked=False)",
    ),
    "trajectories.time_optimal": (
        ARM, "rm.trajectories.time_optimal(rm.trajectories.quintic(q, -q, duration=1.0), "
        "rm.trajectories.MotionLimits(velocity=1.0, acceleration=2.0))",
    ),
    "trajectories.kinodynamic": (
        ARM, "rm.trajectories.kinodynamic(m, q, -q, rm.trajectories.MotionLimits(velocity=1.0, "
        "acceleration=2.0), torque=[200.0, 100.0], rng=0, seconds=2)",
    ),
    "performance.workspace": (ARM, "rm.performance.workspace(m, limits=False)"),
    "performance.cuspidality": (
        "t = rm.DHTable(antecedent=[0, 1, 2], sigma=[0, 0, 0], alpha=[0, -np.pi / 2, np.pi / 2], "
        "d=[0, 1, 2], theta=[0, 0, 0], r=[0, 1, 0]); "
        "m = rm.RobotModel.from_table(t, tool=rm.se3.translation(1.5, 0, 0))",
        "rm.performance.cuspidality(m)",
    ),
    "parallel.dgm": (HEXAPOD, "parallel.dgm(h, q)"),
    "parallel.assembly_modes": (HEXAPOD, "parallel.assembly_modes(h, q)"),
    "loops.close": (
        "sys.path.insert(0, 'tests'); from looped_robots import four_bar; "
        "b = four_bar(np.random.default_rng(0))", "rm.loops.close(b, [0.6])",
    ),
    "control.run": (
        ARM, "rm.control.run(m, rm.control.ComputedTorque(q, omega=8.0, model=m), 0.9 * q, t=0.1)",
    ),
    "visual_servoing.servo": (
        "from robotmodels import visual_servoing as vs; g = rm.se3.translation(0, 0, 0.5)",
        "vs.servo(vs.task_3d(g), rm.se3.translation(0.1, 0, 0.9), duration=1.0)",
    ),
    "flexible.ddm": (LINKS, "f.ddm(a, [0, 0], None, [0, 0], None, [0, 0])"),
    "flexible.simulate": (LINKS, "f.simulate(a, [0.1, 0.2], t=0.1)"),
    "export.program": (RX90, 'rm.export.program(m, "igm")'),
}  # fmt: skip


def units(prepare: str, call: str) -> float:
    """Processor time of a first call in units of one small compilation."""
    with tempfile.TemporaryDirectory() as cache:
        done = subprocess.run(
            [sys.executable, "-c", UNIT.format(prepare=prepare, call=call)],
            env=os.environ | {"NUMBA_CACHE_DIR": cache, "OPENBLAS_NUM_THREADS": "1"},
            capture_output=True, text=True,
        )  # fmt: skip
    if done.returncode:
        sys.exit(done.stderr)
    return float(done.stdout)


def main() -> None:
    """Measure, print, and keep the table."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.first_calls", description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )  # fmt: skip
    parser.add_argument("--out", type=Path, help="Markdown file to write")
    out = parser.parse_args().out
    lines = ["| first call | units of a small compilation |", "|---|---|"]
    for name, code in CALLS.items():
        lines.append(f"| {name} | {units(*code):.1f} |")
        print(lines[-1], flush=True)
    if out:
        title = "Processor time of first calls, nothing compiled before:\n\n"
        out.write_text(title + "\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
