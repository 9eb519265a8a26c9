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
from .choices import controller, essential, prior, workers
from .logs import logs
from .options import add_options
from .report import real_bodies, report

_EXAMPLES = """\
examples:
  robotmodels identify --robot planar_2r --log positions.csv --torques-from torques.csv \\
      --dt 0.005 --angles deg --test-share 0.25 --prior 5 --out report/
  robotmodels identify --robot arm.urdf --log run1.csv run2.csv --test run3.csv --dt 0.005 \\
      --positions "actual_q_*" --torques "current_*" --drive-gains 13.3 9.4 --method irls
  robotmodels identify --robot arm.urdf --log run.npz --cutoff 20 --decimation 10 --json

Into the folder of --out go report.txt, report.html (text and figures, one offline file),
result.json (what --json prints: parameters, covariance, every option, hashes of the data) and
identified.urdf (a robot of real bodies and drives). Without --out the report is printed."""


def add_command(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "identify",
        usage="robotmodels identify --robot ROBOT --log FILE [FILE ...] [options]",
        description="Dynamic identification: base parameters, frictions and rotor inertias from "
        "positions and torques, with their deviations, and the errors on motion kept aside.",
        epilog=ending(_EXAMPLES, "the method has not converged"),
    )
    add_source(parser, option=True)
    add_options(parser)
    add_output(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Run the command: read, fit, and print or write."""
    from ...identification import EstimateStatus, fit

    check_output(arguments)
    model = robot_of(arguments)
    log, test = logs(arguments, model)
    kinds = tuple(dict.fromkeys(arguments.drive))
    bodies = prior(arguments, model)
    with workers(arguments.workers) as executor, progress(arguments, "reducing the log") as bar:
        result = fit(
            model, log, arguments.method, form=arguments.form, drive=kinds or False,
            cutoff=arguments.cutoff, decimation=arguments.decimation,
            dead_band=joint_numbers(arguments.dead_band, model.n, "--dead-band"),
            edges=arguments.edges, essential=essential(arguments.essential),
            loss=arguments.loss, strength=arguments.strength, noise=arguments.noise,
            forgetting=arguments.forgetting, controller=controller(arguments, model),
            prior=model if arguments.method == "ridge" else None, test=test,
            checked=not arguments.no_check, executor=executor,
            progress=bar and bar.fraction,
        )  # fmt: skip
    if result.estimate.status is EstimateStatus.UNSTABLE:
        say(result.report().rstrip())
        return ExitStatus.NOT_REACHED
    robot = None
    if arguments.consistent or arguments.out is not None:
        robot = real_bodies(result, bodies, asked=arguments.consistent)
    hand_over(report(result, test, robot), arguments)
    solved = result.estimate.status is EstimateStatus.SOLVED
    return ExitStatus.DONE if solved else ExitStatus.NOT_REACHED
