"""``robotmodels demo``: two arms with every direct model and every posture; a real log."""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from .._arrays import Array
from ..dynamics import ddm, gravity_torque, idm
from ..igm import igm
from ..kinematics import dgm, dkm, jacobian
from ..minimal_parameters import base_parameters
from ..model import RobotModel, write_urdf
from ..robots import load
from .igm import as_json, as_text
from .info import narrow, pose_text
from .output import check_output, progress

if TYPE_CHECKING:
    from ..datasets import Tx40Log
    from ..identification import IdentificationResult

EXAMPLES = """\
examples:
  robotmodels demo
  robotmodels demo --real --out tx40/
  robotmodels demo --chapter 3"""
_INVERSE_BATCH = 10_000
# stated configurations, away from singular positions
_RX90_POSTURE = np.array([0.3, 1.0, -1.8, 0.4, 0.8, -0.2])
_UR5_POSTURE = np.array([0.3, -0.9, 1.2, 0.4, 0.8, -0.2])
_PUBLISHED_RMSE = (6.40, 8.21, 4.13, 1.72, 2.65, 1.72)
"""N m: errors of the best published fit for each joint of the TX40, on the held-out rows."""


DESCRIPTION = """\
Take the Staubli RX-90 from its table to URDF and Pinocchio, and the UR5 from its URDF to its table;
print every direct model of both and every posture that reaches a pose, and draw them. With --real,
identify a Staubli TX40 from its log instead; with --chapter, run an example of another chapter of
the book."""
OPTIONS = """\
--real [flag] identify the dynamic parameters of a real TX40 from the log that is shipped, beside
    published values
--chapter N [int 1|2|3|4|5|6|7] chapter 1 (this demonstration) to 7 of the book
--out FOLDER [path =robotmodels-demo] where the files go
@quiet"""


def run(arguments: argparse.Namespace) -> None:
    """Run the demonstration."""
    started = time.perf_counter()
    check_output(arguments)
    folder: Path = arguments.out
    folder.mkdir(parents=True, exist_ok=True)
    if arguments.real:
        _say("Staubli TX40: from a log of its motion to a robot that predicts its torques")
        _identify_tx40(folder, arguments)
    elif arguments.chapter not in (None, 1):
        from .demo_chapters import CHAPTERS, show_chapter

        _say(f"Chapter {arguments.chapter}: {CHAPTERS[arguments.chapter][0]}")
        show_chapter(arguments.chapter, folder)
    else:
        _show_arms(folder)
    print(f"\nDone in {time.perf_counter() - started:.1f} s.")


def _show_arms(folder: Path) -> None:
    """Every model of the RX-90 and the UR5."""
    _say("Staubli RX-90: from Table 1.1 of the book (Dombre and Khalil) to URDF to Pinocchio")
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
    print("robotmodels demo --real identifies a real TX40 from nine seconds of its motion.")


def _show_base(model: RobotModel) -> None:
    # links and rotors, as in the book's table; friction is each joint's own
    rules = base_parameters(model, drive=("Ia",))
    numbers = base_parameters(model, "numeric", drive=("Ia",))
    print(narrow(rules.text))
    same = "the same parameters" if rules.names == numbers.names else "other parameters"
    print(f"By the columns of the regressor: {same}.")


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


def _show_inverse(model: RobotModel, q: Array, folder: Path) -> None:
    from ..viz import show

    T = dgm(model, q)
    found = igm(model, T)
    print(as_text(as_json(model, T, found, degrees=True)))
    path = folder / f"{model.name}-postures.html"
    words = [f"{k + 1}: {branch}" for k, branch in enumerate(found.branch)]
    show(model, found.q, columns=4, frames=True, legend=words).save(path)
    print(f"Offline scene of the {found.count} postures: {path.resolve()}")
    Q = np.random.default_rng(2).uniform(-np.pi, np.pi, (_INVERSE_BATCH, model.n))
    T = dgm(model, Q)
    found = igm(model, T)
    off = np.abs(np.angle(np.exp(1j * (found.nearest(Q) - Q)))).max()
    print(f"{_INVERSE_BATCH} random poses: {found.valid.sum()} postures, largest residual "
          f"{np.nanmax(found.residual):.1e};\n  the joint variables that made each pose are among "
          f"its postures to {off:.1e} rad")  # fmt: skip


def _row(values: Array) -> str:
    return "  ".join(f"{v + 0.0:9.4f}" for v in np.asarray(values).round(9))


def _say(text: str) -> None:
    print(f"\n{'=' * 88}\n{text}\n{'=' * 88}", flush=True)


def _identify_tx40(folder: Path, arguments: argparse.Namespace) -> None:
    """Identify the Staubli TX40 from its log (book sections 1.6.2 and 1.6.5)."""
    from ..datasets import load_tx40
    from ..identification import check_log, fit, synchronisation
    from ..identification.checks import check_joints
    from ..identification.report import report_sections
    from .identify import real_bodies, report

    data = load_tx40()
    model, log = data.model, data.log
    print(log)
    print(narrow(f"{data.source}; {data.licence}"))
    print("Checking it (compiles the first time on this machine only) ...", flush=True)
    started = time.perf_counter()
    findings = (*check_log(log, model), *check_joints(log, model))
    print(narrow("\n".join(map(str, findings)) or "The checks of the log found nothing."))
    print(narrow(str(synchronisation(log, model))))
    with progress(arguments, "the whole log") as bar:
        whole = fit(model, log, progress=bar)
    print(f"  identified after {time.perf_counter() - started:.1f} s\n")
    print(comparison(data, whole))
    first = log.rows(data.training.start, data.training.stop)
    last = log.rows(data.held_out.start, data.held_out.stop)
    with progress(arguments, "without the rows that test") as bar:
        trained = fit(model, first, test=last, progress=bar)
    print(f"\nFitted on samples {data.training.start} to {data.training.stop}; torques of samples "
          f"{data.held_out.start}\nto {data.held_out.stop} as predicted, root mean square error in "
          "N m, unfiltered:")  # fmt: skip
    ours = trained.validation.held_out.rmse  # type: ignore[union-attr]
    for word, row in (("here", ours), ("published, best", _PUBLISHED_RMSE)):
        print(f"  {word:16s}" + "".join(f"{error:8.2f}" for error in row))
    print(f"\n{report_sections(trained)[0].text()}\n")
    robot = real_bodies(trained, None, requested=False)
    write = report(trained, last, robot).write
    for name in write(folder) if write is not None else ():
        print(f"wrote {folder.resolve() / name}")


def comparison(data: Tx40Log, result: IdentificationResult) -> str:
    """Identified and published values side by side, and how many agree."""
    from ..identification.report_tables import weak_parameters

    both = [one for one in data.published if one.name in result.names]
    weak = weak_parameters(result.estimate)
    lines = ["Weighted least squares, SI units, with standard errors: here they hold for",
             "residuals that are correlated in time, the published ones for white residuals.",
             f"{'':10s}{'here':>10s}{'':10s}{'published':>12s}"]  # fmt: skip
    for one in both:
        if one.name not in weak:
            x, s = result.value(one.name), result.standard_error(one.name)
            lines.append(f"  {one.name:8s}{x:10.4f} +-{s:7.4f}{one.wls:12.4f} "
                         f"+-{one.wls_deviation:7.4f}")  # fmt: skip
    unlisted = sum(one.name in weak for one in both)
    lines.append(f"  and {unlisted} whose relative standard error is above 30 %.")
    off: Array = np.array([abs(result.value(one.name) - one.wls) for one in both])
    for word, errors in (
        ("of our standard errors", [result.standard_error(one.name) for one in both]),
        ("published ones", [one.wls_deviation for one in both]),
    ):
        count = np.sum(off <= 2.0 * np.array(errors))
        lines.append(f"{count} of {len(both)} are within two {word}.")
    return "\n".join(lines)
