"""``robotmodels identify``: dynamic parameters of a robot from logs of positions and torques."""

from __future__ import annotations

import argparse
from typing import Any

from ..exit_status import ExitStatus, ending
from ..numbers import joint_numbers
from ..output import add_output, check_output, hand_over
from ..progress import progress
from ..source import add_source, robot_of
from ..streams import say
from .choices import method_of_options, prior, workers
from .logs import logs
from .options import add_options
from .report import real_bodies, report

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
    from ...estimation.estimate import EstimateStatus
    from ...identification import fit
    from ...identification import report as text_of

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
