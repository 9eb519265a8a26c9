"""``robotmodels identify``: dynamic parameters of a robot from logs of positions and torques."""

from __future__ import annotations

import argparse
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import InvalidValueError, RobotModelsError
from ..model import RobotModel
from .arguments import add_source, joint_numbers, robot_of
from .identify_options import add_options, logs
from .output import Report, add_output, check_output, hand_over, progress, with_extra
from .terminal import ExitStatus, ending, say

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from ..identification import IdentificationResult, Log
    from ..identification.methods.base import Method
    from ..inertia import InertialParameters
    from ..minimal_parameters import StandardParameters


_EXAMPLES = """\
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


def add_command(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "identify",
        usage="robotmodels identify --robot ROBOT --log FILE [FILE ...] [options]",
        description="Dynamic identification: base parameters, frictions and rotor inertias from "
        "positions and torques, with their standard errors, and the errors on held-out motion.",
        epilog=ending(_EXAMPLES, "the method has not converged, or predicts poorly"),
    )
    add_source(parser, option=True)
    add_options(parser)
    add_output(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Run the command: read, fit, and print or write."""
    from ..estimation.estimate import EstimateStatus
    from ..identification import fit
    from ..identification import report as text_of

    check_output(arguments)
    model = robot_of(arguments)
    log, test = logs(arguments, model)
    drive = tuple(dict.fromkeys(arguments.drive)) or False
    bodies = prior(arguments, model)
    choices = {name: getattr(arguments, name) for name in ("cutoff", "decimation", "edges")}
    choices["dead_band"] = joint_numbers(arguments.dead_band, model.n, "--dead-band")
    with workers(arguments.workers) as executor, progress(arguments, "reducing the log") as bar:
        result = fit(
            model,
            log,
            method_of_options(arguments, model),
            drive=drive,
            form=arguments.form,
            processing=choices,
            test=test,
            checked=not arguments.no_check,
            executor=executor,
            progress=bar and bar.fraction,
        )
    if result.status is EstimateStatus.UNSTABLE:
        say(text_of(result).rstrip())
        return ExitStatus.NOT_REACHED
    robot = None
    if arguments.consistent or arguments.out is not None:
        robot = real_bodies(result, bodies, asked=arguments.consistent)
    hand_over(report(result, test, robot), arguments)
    solved = result.status is EstimateStatus.SOLVED
    return ExitStatus.DONE if solved else ExitStatus.NOT_REACHED


_MOST = 64


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
    if not 1 <= count <= _MOST:
        raise InvalidValueError(f"--workers: expected 1 to {_MOST}, got {count}.")
    if count == 1:
        return nullcontext()
    from concurrent.futures import ProcessPoolExecutor

    return ProcessPoolExecutor(count)


def report(
    result: IdentificationResult, test: Log | None, robot: StandardParameters | None
) -> Report:
    """An identification in every form."""
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
    return Report(text.rstrip(), head.rstrip(), lambda: result_data(result, robot), write)


def real_bodies(
    result: IdentificationResult, prior: InertialParameters | None, asked: bool
) -> StandardParameters | None:
    """Physically consistent robot; unless requested, a failure is only reported."""
    from ..identification.consistent import consistent_robot, prior_bodies

    try:
        if prior is None:
            prior, sentences = prior_bodies(result.model)
            for sentence in sentences:
                say(sentence)
        robot = consistent_robot(result, prior)
    except RobotModelsError as error:
        if asked:
            raise
        say(f"no identified.urdf: {error}")
        return None
    if not robot.is_usable:
        if asked:
            raise InvalidValueError(f"--consistent: {robot.reason()}")
        say(f"no identified.urdf: {robot.reason()}")
        return None
    return robot
