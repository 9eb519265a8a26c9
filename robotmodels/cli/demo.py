"""``robotmodels demo``: two arms with every direct model and every posture; a real log."""

from __future__ import annotations

import argparse
import sys
import textwrap
import time
from functools import partial
from pathlib import Path

import numpy as np

from .._arrays import Array
from ..dynamics import ddm, gravity_torque, idm
from ..geometry import link_transforms
from ..igm import igm
from ..kinematics import dgm, dkm, jacobian
from ..minimal_parameters import base_parameters
from ..model import RobotModel, write_urdf
from ..robots import load
from .igm import as_text
from .info import pose_text
from .output import check_output, progress

EXAMPLES = """\
examples:
  robotmodels demo
  robotmodels demo --real --out tx40/
  robotmodels demo --chapter 3"""
_TERMINAL = 80  # columns
_SAMPLES = 1000
_BATCH = 100_000
_INVERSE_BATCH = 10_000
# stated configurations, away from singular positions
_RX90_POSTURE = np.array([0.3, 1.0, -1.8, 0.4, 0.8, -0.2])
_UR5_POSTURE = np.array([0.3, -0.9, 1.2, 0.4, 0.8, -0.2])


DESCRIPTION = """\
Take the Staubli RX-90 from its table to URDF and Pinocchio, and the UR5 from its URDF to its table;
print every direct model of both and every posture that reaches a pose, and draw them. With --real,
identify a Staubli TX40 from its log instead; with --chapter, run an example of another chapter of
the book."""
OPTIONS = """\
--real [flag] identify the dynamic parameters of a real TX40 from the log that is shipped, beside
    published values
--chapter N [int 1|2|3|4|5|6|7] chapter 1 (this demonstration) to 7 of the book
--out FOLDER [path =robotmodels-demo] where the files go (default: %(default)s)
@quiet"""


def run(arguments: argparse.Namespace) -> None:
    """Run the demonstration."""
    started = time.perf_counter()
    check_output(arguments)
    folder: Path = arguments.out
    folder.mkdir(parents=True, exist_ok=True)
    if arguments.real:
        from .demo_identification import identify_tx40

        _say("Staubli TX40: from a log of its motion to a robot that predicts its torques")
        identify_tx40(folder, partial(progress, arguments))
        print(f"\nDone in {time.perf_counter() - started:.1f} s.")
        return
    if arguments.chapter not in (None, 1):
        from .demo_chapters import CHAPTERS, show_chapter

        _say(f"Chapter {arguments.chapter}: {CHAPTERS[arguments.chapter][0]}")
        show_chapter(arguments.chapter, folder)
        print(f"\nDone in {time.perf_counter() - started:.1f} s.")
        return
    _say("Staubli RX-90: from the table of the seed book (Table 1.1) to URDF to Pinocchio")
    rx90 = load("rx90")
    _show_models(rx90, _RX90_POSTURE, folder)
    _say("Base inertial parameters of the RX-90: the fewest that give its torques")
    _show_base(rx90)
    _say("UR5: from the URDF of example-robot-data to its table")
    ur5 = load("erd:ur5")
    _show_models(ur5, _UR5_POSTURE, folder)
    _say("Inverse geometric model: every posture of both arms that reaches the pose of q")
    # the postures of the RX-90 differ by turns of links about their own length, so that they
    # would hide one another if they stood in one place
    _show_inverse(rx90, _RX90_POSTURE, folder)
    _show_inverse(ur5, _UR5_POSTURE, folder)
    _say("Drawing both arms with meshcat")
    from ..viz import show

    scene = folder / "arms.html"
    beside = np.eye(4)
    beside[1, 3] = 1.0
    show([rx90, ur5.with_base(beside @ ur5.base)], [_RX90_POSTURE, _UR5_POSTURE]).save(scene)
    print(f"Offline scene of both arms: {scene.resolve()} (open it in a browser)")
    print(f"\nDone in {time.perf_counter() - started:.1f} s.")
    print("robotmodels demo --real identifies a real TX40 from nine seconds of its motion.")


def table_poses(model: RobotModel, q: Array) -> Array:
    """Tool poses by the plain product of the table's factors, without Pinocchio or kernels.

    Shapes: q (N, n) -> (N, 4, 4).
    """
    T = np.broadcast_to(model.base, (q.shape[0], 4, 4))
    factors = link_transforms(model.table, q)
    for j in model.table.path(model.tip):
        T = T @ factors[:, j - 1]
    return T @ model.tool


def _show_base(model: RobotModel) -> None:
    # links and rotors, as in the book's table; friction is each joint's own
    rules = base_parameters(model, drive=("Ia",))
    numbers = base_parameters(model, "numeric", drive=("Ia",))
    print(_narrow(rules.text))
    kept, dependent = numbers.gap or (0.0, 0.0)
    same = "the same parameters" if rules.names == numbers.names else "other parameters"
    print(
        f"By the columns of the regressor: {same};\n  of kept columns at least {kept:.2f} is their "
        f"own, of the others at most {dependent:.0e}."
    )


def _narrow(text: str) -> str:
    """A printed table whose long lines are wrapped anew for a narrow terminal."""
    lines: list[str] = []
    for line in text.splitlines():
        # a list that goes on: no formula begins so far to the right without its equals sign
        goes_on = line.startswith(" " * 8) and not line.lstrip().startswith("=")
        if goes_on and lines:
            lines[-1] += " " + line.strip()
        else:
            lines.append(line)
    return "\n".join(
        textwrap.fill(line, _TERMINAL, subsequent_indent=" " * 4, break_on_hyphens=False)
        for line in lines
    )


def _show_models(model: RobotModel, q: Array, folder: Path) -> None:
    print(model)
    path = folder / f"{model.name}.urdf"
    write_urdf(model, path)
    print(f"URDF: {path.resolve()}")
    for note in model.notes:
        print(f"Note: {note}")
    v, a = np.full(model.n, 0.5), np.full(model.n, 1.0)
    print(f"\nAt q (rad)     {_row(q)}\n   v (rad/s)   {_row(v)}\n   a (rad/s^2) {_row(a)}")
    print(f"pose of the tool (m):\n{pose_text(dgm(model, q))}")
    print("Jacobian (rows v, w; world axes):")
    print("\n".join("  " + _row(row) for row in jacobian(model, q)))
    print(f"velocity of the tool (m/s, rad/s): {_row(dkm(model, q, v))}")
    print(f"gravity torque (N m):              {_row(gravity_torque(model, q))}")
    tau = idm(model, q, v, a)
    print(f"inverse dynamics, torque (N m):    {_row(tau)}")
    back = ddm(model, q, v, tau)
    print(f"direct dynamics of it (rad/s^2):   {_row(back)}")
    Q = np.random.default_rng(0).uniform(-np.pi, np.pi, (_SAMPLES, model.n))
    pinocchio = np.array([dgm(model, row) for row in Q])
    difference = np.abs(pinocchio - table_poses(model, Q)).max()
    print(f"\nLargest difference between Pinocchio and the plain product of the table's factors\n"
          f"  over {_SAMPLES} random configurations: {difference:.1e}")  # fmt: skip
    if "robotmodels.kernels.poses" not in sys.modules:
        print("Compiling the batch kernel (the first time on this machine only) ...", flush=True)
        started = time.perf_counter()
        dgm(model, Q)
        print(f"  ready after {time.perf_counter() - started:.1f} s")
    Q = np.random.default_rng(1).uniform(-np.pi, np.pi, (_BATCH, model.n))
    times = []
    for _ in range(5):
        started = time.perf_counter()
        dgm(model, Q)
        times.append(time.perf_counter() - started)
    print(f"Poses in batch: {np.median(times) / _BATCH * 1e6:.2f} us each ({_BATCH} poses, median "
          "of 5 runs)")  # fmt: skip


def _show_inverse(model: RobotModel, q: Array, folder: Path) -> None:
    from ..viz import show

    T = dgm(model, q)
    print("Preparing (compiles the first time on this machine only) ...", flush=True)
    started = time.perf_counter()
    found = igm(model, T)
    print(f"  ready after {time.perf_counter() - started:.1f} s")
    print(as_text(model, T, found, "world", degrees=True))
    path = folder / f"{model.name}-postures.html"
    words = [f"{k + 1}: {branch}" for k, branch in enumerate(found.branch)]
    show(model, found.q, columns=4, frames=True, legend=words).save(path)
    print(f"Offline scene of the {found.count} postures: {path.resolve()}")
    Q = np.random.default_rng(2).uniform(-np.pi, np.pi, (_INVERSE_BATCH, model.n))
    T = dgm(model, Q)
    times = []
    for _ in range(3):
        started = time.perf_counter()
        found = igm(model, T)
        times.append(time.perf_counter() - started)
    off = np.abs(np.angle(np.exp(1j * (found.nearest(Q) - Q)))).max()
    print(f"{_INVERSE_BATCH} random poses: {found.valid.sum()} postures, "
          f"{np.median(times) / _INVERSE_BATCH * 1e6:.1f} us a pose (median of 3 runs),\n  largest "
          f"residual {np.nanmax(found.residual):.1e}; the joint variables that made each pose are\n"
          f"  among its postures to {off:.1e} rad")  # fmt: skip


def _row(values: Array) -> str:
    return "  ".join(f"{v + 0.0:9.4f}" for v in np.asarray(values).round(9))


def _say(text: str) -> None:
    print(f"\n{'=' * 88}\n{text}\n{'=' * 88}", flush=True)
