"""``robotmodels identify``: dynamic parameters of a robot from logs of positions and torques."""

from __future__ import annotations

import argparse
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import InvalidValueError, RobotModelsError
from ..model import RobotModel
from .arguments import column, columns, given, joint_numbers, numbers, robot_of
from .output import Report, check_output, progress, with_extra
from .terminal import ExitStatus, say

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from ..identification import IdentificationResult, Log
    from ..identification.methods.base import Method
    from ..inertia import InertialParameters
    from ..minimal_parameters import StandardParameters


EXAMPLES = """\
examples:
  robotmodels identify --robot planar_2r --log positions.csv --torques-from torques.csv \\
      --dt 0.005 --angles deg --test-share 0.25 --prior 5 --out report/
  robotmodels identify --robot arm.urdf --log run1.csv run2.csv --test run3.csv --dt 0.005 \\
      --positions "actual_q_*" --torques "current_*" --drive-gains 13.3 9.4 \\
      --method robust:loss=tukey
  robotmodels identify --robot arm.urdf --log run.npz --cutoff 20 --decimation 10 --json

Into the folder of --out go report.txt, report.html (text and figures, one offline file),
result.json (what --json prints: parameters, covariance, all options, hashes of the data) and
identified.urdf (a physically consistent robot). Without --out the report is printed."""
DESCRIPTION = """\
Dynamic identification: base parameters, frictions and rotor inertias from positions and torques,
with their standard errors, and the errors on held-out motion."""
USAGE = "robotmodels identify --robot ROBOT --log FILE [FILE ...] [options]"
OPTIONS = """\
@robot_option
the logs:
--log FILE [required +] CSV, NPZ, Parquet or MAT files, each a recording
--torques-from FILE [+] files with the torques, one for each log
--positions COLUMN [+] columns of the positions: names, numbers from 0, or a pattern
--torques COLUMN [+] columns of the torques or currents
--velocities COLUMN [+] columns of velocities, where they are measured, or none
--accelerations COLUMN [+] columns of accelerations, where they are measured, or none
--references COLUMN [+] columns of the reference positions of the controller, or none
--time COLUMN [] column of times, or "none"
--times [s|ms|us|ns] its unit
--dt SECONDS [float] sampling period, needed without times
@units
--gears NUMBERS [] the files have motor angles and torques: turns of the motor for one of the joint
--motor-side [flag] the same, by the robot's own transmission
--drive-gains NUMBERS [] the torque columns are currents: N m for one unit
--signs NUMBERS [] 1 or -1 for each joint
--offsets NUMBERS [] added to the positions, rad or m
@delimiter
--rows FROM TO [2 int] rows that are fitted; default all
--delay SECONDS [] delay of the torques behind the positions, or auto to estimate it
held-out motion, one of:
--test FILE [+] files of the held-out log
--test-torques-from FILE [+] files with their torques
--test-rows FROM TO [2 int] held-out rows of the logs
--test-share SHARE [float] held-out share at the end of the logs
the fit:
--method METHOD[:OPTION=VALUE,...] [=wls] method with its options: ols, wls, irls, robust, tls,
    ridge, iv, didim, cloe, sequential, recursive, such as robust:loss=tukey, ridge:strength=10,
    recursive:forgetting=0.99 or wls:essential=30
--form [torque|filtered|power|energy =torque] balanced quantity
--drive KIND [* Ia|Fv|Fc|offset =Ia Fv Fc offset] drive parameters that are identified (default: Ia
    Fv Fc offset)
--cutoff HZ [float] -3 dB of the positions' low-pass; default: chosen for prediction, see the notes
--decimation N [int] samples for an equation, 1: all; default: chosen for prediction, see the notes
--dead-band NUMBERS [] velocities (rad/s, m/s) below which a joint's equations are left out
--edges SECONDS [float] cut at both ends of each recording
--no-check [flag] skip the checks of units, signs and order, and the removal of outliers and frozen
    samples
--consistent [flag] find a physically consistent robot too (as --out does)
--prior ROBOT [] prior inertia: of a robot, or of uniform bodies of this mass in kg; default the
    robot's own
--kp NUMBERS [] of methods iv, didim, cloe: the controller's gains of position, N m/rad or N/m; with
    --kd. Default a tuned controller
--kd NUMBERS [] its gains of velocity
--workers N [int =1] processes (default: %(default)s), with the same result
@output"""
NOT_REACHED = "the method has not converged, or predicts poorly"


def run(arguments: argparse.Namespace) -> Report | ExitStatus:
    """Run the command: read, fit, and print or write."""
    from ..estimation.estimate import EstimateStatus
    from ..identification import fit
    from ..identification import report as text_of

    check_output(arguments)
    model = robot_of(arguments)
    log, test = logs(arguments, model)
    drive = tuple(dict.fromkeys(arguments.drive)) or False
    bodies = prior(arguments, model)
    choices = given(arguments, "cutoff", "decimation", "edges")
    choices["dead_band"] = joint_numbers(arguments.dead_band, model.n, "--dead-band")
    with workers(arguments.workers) as executor, progress(arguments, "reducing the log") as bar:
        method, checked = method_of_options(arguments, model), not arguments.no_check
        more: dict[str, Any] = {"drive": drive, "form": arguments.form, "test": test}
        more |= {"processing": choices, "checked": checked}
        result = fit(model, log, method, executor=executor, progress=bar, **more)
    if result.status is EstimateStatus.UNSTABLE:
        say(text_of(result).rstrip())
        return ExitStatus.NOT_REACHED
    robot = None
    if arguments.consistent or arguments.out is not None:
        robot = real_bodies(result, bodies, requested=arguments.consistent)
    return report(result, test, robot)


def prior(arguments: argparse.Namespace, model: RobotModel) -> InertialParameters | None:
    """Prior inertial parameters of ``--prior``: another robot's, or uniform bodies."""
    if arguments.prior is None:
        return None
    from ..minimal_parameters import uniform_bodies

    try:
        mass = float(arguments.prior)
    except ValueError:
        source = argparse.Namespace(**(vars(arguments) | {"robot": arguments.prior}))
        bodies = robot_of(source).inertia
        if bodies.f != model.f:
            raise InvalidValueError(
                f"--prior: {arguments.prior!r} has {bodies.f} links, the robot {model.f}."
            ) from None
        return bodies
    return uniform_bodies(model, mass)


def method_of_options(arguments: argparse.Namespace, model: RobotModel) -> Method:
    """The method of ``--method``; gains of ``--kp`` and ``--kd`` are for simulating methods."""
    from dataclasses import replace

    import numpy as np

    from ..identification import Controller, Ridge
    from ..identification.method_names import method_of

    method = method_of(arguments.method)
    if isinstance(method, Ridge) and method.prior is None:
        method = replace(method, prior=model)
    gains = [arguments.kp, arguments.kd]
    if gains == [None, None]:
        return method
    if None in gains:
        raise InvalidValueError("--kp, --kd: a controller has both gains; give the other as well.")
    if not hasattr(method, "controller"):
        raise InvalidValueError(
            f"--kp, --kd: the method {method.name!r} does not simulate the robot; they are for iv, "
            "didim and cloe."
        )
    kp, kd = (
        np.broadcast_to(np.asarray(joint_numbers(gain, model.n, "--kp, --kd")), (model.n,))
        for gain in gains
    )
    return replace(method, controller=Controller(kp, kd))


def workers(count: int) -> AbstractContextManager[Executor | None]:
    """Worker processes."""
    from concurrent.futures import ProcessPoolExecutor

    if count < 1:
        raise InvalidValueError(f"--workers: expected 1 or more, got {count}.")
    return nullcontext() if count == 1 else ProcessPoolExecutor(count)


def report(
    result: IdentificationResult, test: Log | None, robot: StandardParameters | None
) -> Report:
    """An identification in every form."""
    from ..estimation.estimate import EstimateStatus
    from ..identification import report as text_of
    from ..identification import write_result
    from ..identification.result_file import result_data

    text = text_of(result, robot)

    def write(folder: Path) -> list[str]:
        from ..viz import identification_html

        names = ["report.txt", "result.json"]
        (folder / "report.txt").write_text(text, encoding="utf-8")
        write_result(result, folder / "result.json", robot)
        if robot is not None:
            write_result(result, folder / "identified.urdf", robot)
            names.append("identified.urdf")
        page = folder / "report.html"
        return names + with_extra(page, lambda: identification_html(result, page, test, robot))

    head = text.split("\n\nData\n", 1)[0]
    is_solved = result.status is EstimateStatus.SOLVED
    return Report(
        text.rstrip(), lambda: result_data(result, robot), is_solved, head.rstrip(), write
    )


def real_bodies(
    result: IdentificationResult, prior: InertialParameters | None, requested: bool
) -> StandardParameters | None:
    """Physically consistent robot; unless requested, a failure is only reported."""
    from ..identification.result import consistent_robot, prior_bodies

    robot = None
    try:
        if prior is None:
            prior, sentences = prior_bodies(result.model)
            for sentence in sentences:
                say(sentence)
        robot = consistent_robot(result, prior)
        reason = None if robot.is_usable else f"--consistent: {robot.reason()}"
    except RobotModelsError as error:
        reason = str(error)
    if reason is not None and requested:
        raise InvalidValueError(reason)
    if reason is not None:
        say(f"no identified.urdf: {reason}")
    return robot if reason is None else None


def logs(arguments: argparse.Namespace, model: RobotModel) -> tuple[Log, Log | None]:
    """The log to fit and the held-out log."""
    from ..identification.delay import synchronisation
    from ..logs import with_delay

    ways = (arguments.test, arguments.test_rows, arguments.test_share)
    if sum(way is not None for way in ways) > 1:
        raise InvalidValueError("--test, --test-rows and --test-share: give one of them.")
    if arguments.test_torques_from is not None and arguments.test is None:
        raise InvalidValueError("--test-torques-from: it belongs to --test.")
    whole = _read(arguments, model, arguments.log, arguments.torques_from)
    other = None
    if arguments.test is not None:
        other = _read(arguments, model, arguments.test, arguments.test_torques_from)
    if arguments.delay is not None:
        if arguments.delay == "auto":
            found = synchronisation(whole, model)
            if not found.status.is_success:
                raise InvalidValueError(f"--delay auto: {found} Or give it in seconds.")
            delay = float(found.delay)
        else:
            delay = float(numbers(arguments.delay, 1, "--delay")[0])
        whole = with_delay(whole, delay)
        other = None if other is None else with_delay(other, delay)
    first, last = _range(arguments.rows or [0, len(whole)], len(whole), "--rows")
    share = arguments.test_share
    if arguments.test_rows is not None:
        if arguments.rows is None:
            raise InvalidValueError("--test-rows: give the fitted rows by --rows.")
        start, stop = _range(arguments.test_rows, len(whole), "--test-rows")
        if max(first, start) < min(last, stop):
            raise InvalidValueError(
                f"--test-rows: rows {start} to {stop} are not held out where {first} to {last} "
                "are fitted; give rows that do not overlap."
            )
        other = whole.rows(start, stop)
    elif share is not None:
        if not 0.0 < share < 1.0:
            raise InvalidValueError(
                f"--test-share: expected a share between 0 and 1, got {share:g}."
            )
        last, end = first + round((1.0 - share) * (last - first)), last
        other = whole.rows(last, end)
    return whole.rows(first, last), other


def _range(rows: list[int], N: int, option: str) -> tuple[int, int]:
    """First row and the one after the last, from 0."""
    start, stop = (row + N if row < 0 else row for row in rows)
    if not 0 <= start < stop <= N:
        raise InvalidValueError(
            f"{option}: expected a first row and the one after the last within the {N} rows of the "
            f"log, got {rows[0]} {rows[1]}."
        )
    return start, stop


def _read(
    arguments: argparse.Namespace, model: RobotModel, files: list[str], torques: list[str] | None
) -> Log:
    from ..logs import read_log

    time: Any = arguments.time
    if time is not None:
        time = False if time == "none" else column(time)
    if arguments.motor_side and arguments.gears is not None:
        raise InvalidValueError("--motor-side and --gears: give one of them.")
    if arguments.motor_side and model.transmission is None:
        raise InvalidValueError(
            f"--motor-side: {model.name!r} has no transmission; give the ratios by --gears."
        )
    each = {
        name: joint_numbers(getattr(arguments, name), model.n, "--" + name.replace("_", "-"))
        for name in ("signs", "gears", "drive_gains", "offsets")
    }
    measured = {
        name: _or_none(getattr(arguments, name))
        for name in ("velocities", "accelerations", "references")
    }
    measured["position_references"] = measured.pop("references")
    return read_log(
        files, torques_from=torques, positions=_columns(arguments.positions),
        torques=_columns(arguments.torques), time=time, model=model,
        transmission=model.transmission if arguments.motor_side else None, **each, **measured,
        **given(arguments, "dt", "times", "angles", "lengths", "delimiter"),
    )  # fmt: skip


def _columns(words: list[str] | None) -> list[int | str] | int | str | None:
    names = columns(words)
    # one word may be a pattern, or the name of a matrix
    return names[0] if names is not None and len(names) == 1 else names


def _or_none(words: list[str] | None) -> Any:
    return False if words == ["none"] else _columns(words)
