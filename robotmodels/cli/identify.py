"""``robotmodels identify``: dynamic parameters of a robot from logs of positions and torques."""

from __future__ import annotations

import argparse
import json
import re
import sys
import warnings
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .._arrays import Array
from ..errors import InvalidValueError, RobotModelsError, ShapeError, UrdfWarning
from ..model import RobotModel
from .columns import column, columns
from .numbers import numbers
from .source import add_source, robot_of

if TYPE_CHECKING:
    from ..identification import (
        ConsistentFit,
        Controller,
        IdentificationResult,
        Log,
        Synchronisation,
    )
    from ..inertia import InertialParameters

METHODS = (
    "ols", "wls", "irls", "robust", "tls", "ridge", "iv", "didim", "cloe", "sequential",
    "recursive",
)  # fmt: skip
FORMS = ("torque", "filtered", "power", "energy")
_KINDS = ("Ia", "Fv", "Fc", "offset")
_MOST = 64
_OPTIONS = {
    "angles": "--angles", "lengths": "--lengths", "times": "--times", "time": "--time",
    "dt": "--dt", "positions": "--positions", "torques": "--torques",
    "torques_from": "--torques-from", "velocities": "--velocities",
    "accelerations": "--accelerations", "position_references": "--references",
    "signs": "--signs", "gears": "--gears", "drive_gains": "--drive-gains",
    "offsets": "--offsets", "delimiter": "--delimiter", "cutoff": "--cutoff",
    "decimation": "--decimation", "dead_band": "--dead-band", "edges": "--edges",
    "strength": "--strength", "loss": "--loss", "noise": "--noise", "forgetting": "--forgetting",
    "prior": "--prior",
}  # fmt: skip
"""Arguments of the package in messages, and the options that set them."""
_WHOLE = (
    ("transmission=model.transmission", "--motor-side"),
    ("checked=False", "--no-check"),
    ("time=False", "--time none"),
    ("transmission=", "--motor-side"),
    ("times='ms', 'us' or 'ns'", "--times ms, us or ns"),
    ("velocities=False", "--velocities none"),
    ("accelerations=False", "--accelerations none"),
    (" of read_log", ""),
)
_ARGUMENT = re.compile(r"(?<![\w-])([a-z_]+)=(?:\[\.\.\.\]|'([^']*)'|([0-9]+(?:\.[0-9]+)?))?")
_EXAMPLES = """\
examples:
  robotmodels identify --robot tx40 --log positions.csv --torques-from currents.csv --dt 2e-4 \\
      --motor-side --test-share 0.3 --out report/
  robotmodels identify --robot ur10e.urdf --log run1.csv run2.csv --test run3.csv --angles deg \\
      --positions actual_q_0 actual_q_1 actual_q_2 actual_q_3 actual_q_4 actual_q_5 \\
      --torques "current_*" --drive-gains 13.3 13.3 9.4 9.4 9.4 9.4 --method irls --out report/
  robotmodels identify --robot arm.urdf --log run.npz --cutoff 40 --decimation 20 --json

Into the folder of --out go report.txt, report.html (text and figures, one offline file),
result.json (parameters, covariance, every option, hashes of the data) and identified.urdf (a robot
of real bodies and drives). Without --out the report is printed.

exit status: 0 identified, 1 the method has not converged, 2 an argument or the log is wrong"""


def add_command(commands: Any) -> None:
    """Add the command to the parser.

    Parameters
    ----------
    commands : argparse subparsers
        Where to add it.

    Examples
    --------
    >>> add_command(argparse.ArgumentParser().add_subparsers())
    """
    parser = commands.add_parser(
        "identify",
        help="dynamic parameters of a robot from logs of its motion",
        description="Dynamic identification: base parameters, frictions and rotor inertias from "
        "positions and torques,\nwith their deviations, and the errors on motion kept aside.",
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_source(parser, option=True)
    _add_files(parser.add_argument_group("the logs"))
    _add_test(parser.add_argument_group("motion that is kept aside, one of"))
    _add_fit(parser.add_argument_group("the fit"))
    parser.add_argument("--out", type=Path, metavar="FOLDER", help="where the files go")
    parser.add_argument("--json", action="store_true", help="print the result as JSON")
    parser.set_defaults(run=run)


def _add_files(files: Any) -> None:
    files.add_argument("--log", required=True, nargs="+", metavar="FILE",
                       help="CSV, NPZ, Parquet or MAT files, each a recording")  # fmt: skip
    files.add_argument("--torques-from", nargs="+", metavar="FILE",
                       help="files that have the torques, one for each log")  # fmt: skip
    for option, what in (
        ("--positions", "columns of the positions: names, numbers from 0, or a pattern"),
        ("--torques", "columns of the torques or currents"),
        ("--velocities", "columns of velocities, where they are measured, or none"),
        ("--accelerations", "columns of accelerations, where they are measured, or none"),
        ("--references", "columns of the positions that the controller was to follow, or none"),
    ):
        files.add_argument(option, nargs="+", metavar="COLUMN", help=what)
    files.add_argument("--time", metavar="COLUMN", help='column of times, or "none"')
    files.add_argument("--times", choices=("s", "ms", "us", "ns"), help="its unit")
    files.add_argument("--dt", type=float, metavar="SECONDS",
                       help="sampling period, needed without times")  # fmt: skip
    files.add_argument("--angles", choices=("rad", "deg"), default="rad",
                       help="unit of the positions (default: %(default)s)")  # fmt: skip
    files.add_argument("--lengths", choices=("m", "mm"), default="m",
                       help="of prismatic joints (default: %(default)s)")  # fmt: skip
    files.add_argument("--gears", metavar="NUMBERS",
                       help="the files have motor angles and torques: turns of the motor for one "
                       "of the joint")  # fmt: skip
    files.add_argument("--motor-side", action="store_true",
                       help="the same, by the robot's own transmission")  # fmt: skip
    files.add_argument("--drive-gains", metavar="NUMBERS",
                       help="the torque columns are currents: N m for one unit")  # fmt: skip
    files.add_argument("--signs", metavar="NUMBERS", help="1 or -1 for each joint")
    files.add_argument("--offsets", metavar="NUMBERS",
                       help="added to the positions, rad or m")  # fmt: skip
    files.add_argument("--delimiter", help="between cells; default found")
    files.add_argument("--rows", nargs=2, type=int, metavar=("FROM", "TO"),
                       help="rows that are fitted; default all")  # fmt: skip
    files.add_argument("--delay", metavar="SECONDS",
                       help="by which the torques lag behind the positions, or auto to estimate "
                       "it")  # fmt: skip


def _add_test(test: Any) -> None:
    test.add_argument("--test", nargs="+", metavar="FILE", help="files that only test")
    test.add_argument("--test-torques-from", nargs="+", metavar="FILE",
                      help="files that have their torques")  # fmt: skip
    test.add_argument("--test-rows", nargs=2, type=int, metavar=("FROM", "TO"),
                      help="rows of the logs that only test")  # fmt: skip
    test.add_argument("--test-share", type=float, metavar="SHARE",
                      help="share at the end of the logs that only tests")  # fmt: skip


def _add_fit(fitted: Any) -> None:
    fitted.add_argument("--method", choices=METHODS, default="wls",
                        help="how the equations are solved (default: %(default)s)")  # fmt: skip
    fitted.add_argument("--form", choices=FORMS, default="torque",
                        help="what the equations balance (default: %(default)s)")  # fmt: skip
    fitted.add_argument("--drive", nargs="*", choices=_KINDS, default=list(_KINDS), metavar="KIND",
                        help="drive parameters that are identified (default: Ia Fv Fc "
                        "offset)")  # fmt: skip
    fitted.add_argument("--cutoff", type=float, metavar="HZ",
                        help="-3 dB of the positions' low-pass; default by the log")  # fmt: skip
    fitted.add_argument("--decimation", type=int, metavar="N",
                        help="samples for an equation; default by the log, 1: all")  # fmt: skip
    fitted.add_argument("--dead-band", metavar="NUMBERS",
                        help="velocities (rad/s, m/s) below which a joint's equations are left "
                        "out")  # fmt: skip
    fitted.add_argument("--edges", type=float, metavar="SECONDS",
                        help="cut at both ends of each recording")  # fmt: skip
    fitted.add_argument("--no-check", action="store_true",
                        help="do not look for wrong units, signs and order first")  # fmt: skip
    fitted.add_argument("--consistent", action="store_true",
                        help="tell what real bodies and drives cost (as --out does)")  # fmt: skip
    fitted.add_argument("--prior", metavar="ROBOT",
                        help="what decides what the torques do not: a robot, or the mass in "
                        "kg of one of uniform bodies; default its own inertia")  # fmt: skip
    fitted.add_argument("--essential", nargs="?", const="30", metavar="RATIO",
                        help="leave out parameters that are not seen: until no relative deviation "
                        "is more than RATIO (30) times the least; or f_test, aic")  # fmt: skip
    fitted.add_argument("--loss", choices=("huber", "cauchy", "tukey"),
                        help="of --method robust (default: huber)")  # fmt: skip
    fitted.add_argument("--strength", type=float,
                        help="of --method ridge, toward the robot's own parameters; default by "
                        "cross-validation")  # fmt: skip
    fitted.add_argument("--noise", type=float,
                        help="of --method tls: noise of the columns, relative (default: "
                        "0.001)")  # fmt: skip
    fitted.add_argument("--forgetting", type=float,
                        help="of --method recursive: weight of an instant relative to the "
                        "next")  # fmt: skip
    fitted.add_argument("--kp", metavar="NUMBERS",
                        help="of methods iv, didim, cloe: the controller's gains of position, "
                        "N m/rad or N/m; with --kd. Default a tuned controller")  # fmt: skip
    fitted.add_argument("--kd", metavar="NUMBERS", help="its gains of velocity")
    fitted.add_argument("--workers", type=int, default=1, metavar="N",
                        help="processes (default: %(default)s), with the same result")  # fmt: skip


def run(arguments: argparse.Namespace) -> int:
    """Read, fit, and print or write.

    Parameters
    ----------
    arguments : Namespace
        Parsed arguments.

    Returns
    -------
    int
        0 if the method has converged, else 1.

    Raises
    ------
    RobotModelsError
        A robot, files or options that make no sense.

    Examples
    --------
    >>> parser = argparse.ArgumentParser()
    >>> add_command(parser.add_subparsers())
    >>> parser.parse_args(["identify", "--robot", "tx40", "--log", "a.csv"]).method
    'wls'
    """
    try:
        return _run(arguments)
    except (InvalidValueError, ShapeError) as error:
        words = _as_options(str(error))
        if words == str(error):
            raise
        raise type(error)(words) from error


def _run(arguments: argparse.Namespace) -> int:
    from ..identification import EstimateStatus, fit

    model = robot_of(arguments)
    log, test = logs(arguments, model)
    kinds = tuple(dict.fromkeys(arguments.drive))
    prior = _prior(arguments, model)
    with _workers(arguments.workers) as executor:
        result = fit(
            model, log, arguments.method, form=arguments.form, drive=kinds or False,
            cutoff=arguments.cutoff, decimation=arguments.decimation,
            dead_band=_joint_numbers(arguments.dead_band, model, "--dead-band"),
            edges=arguments.edges, essential=_essential(arguments.essential),
            loss=arguments.loss, strength=arguments.strength, noise=arguments.noise,
            forgetting=arguments.forgetting, controller=_controller(arguments, model),
            prior=model if arguments.method == "ridge" else None, test=test,
            checked=not arguments.no_check, executor=executor,
            progress=_progress if sys.stderr.isatty() else None,
        )  # fmt: skip
    robot = None
    if arguments.consistent or arguments.out is not None:
        robot = _real(result, prior, asked=arguments.consistent)
    if arguments.out is not None:
        write(result, arguments.out, test, robot, quiet=arguments.json)
    if arguments.json:
        from ..identification.reporting.write import result_data

        print(json.dumps(result_data(result, robot), indent=2, ensure_ascii=False))
    elif arguments.out is None:
        from ..identification.reporting.text import report_text

        print(report_text(result, robot), end="")
    return 0 if result.estimate.status is EstimateStatus.SOLVED else 1


def logs(arguments: argparse.Namespace, model: RobotModel) -> tuple[Log, Log | None]:
    """The log that is fitted and the one that is kept aside.

    Parameters
    ----------
    arguments : Namespace
        Parsed arguments.
    model : RobotModel
        The robot.

    Returns
    -------
    log : Log
        For the fit.
    test : Log or None
        Kept aside.

    Raises
    ------
    RobotModelsError
        As `read_log`; several ways to keep motion aside.
    """
    from ..identification.preparation.synchronisation import synchronisation
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
            delay = _estimated_delay(synchronisation(whole, model))
        else:
            delay = float(numbers(arguments.delay, 1, "--delay")[0])
        whole = with_delay(whole, delay)
        other = None if other is None else with_delay(other, delay)
    first, last = (0, len(whole))
    if arguments.rows is not None:
        first, last = _range(arguments.rows, len(whole), "--rows")
    if arguments.test_rows is not None:
        if arguments.rows is None:
            raise InvalidValueError("--test-rows: say with --rows which rows are fitted.")
        start, stop = _range(arguments.test_rows, len(whole), "--test-rows")
        if max(first, start) < min(last, stop):
            raise InvalidValueError(
                f"--test-rows: rows {start} to {stop} are not kept aside where {first} to {last} "
                "are fitted; give rows that do not overlap."
            )
        other = whole.rows(start, stop)
    elif (share := arguments.test_share) is not None:
        if not 0.0 < share < 1.0:
            raise InvalidValueError(f"--test-share: expected a part of 1, got {share:g}.")
        middle = first + round((1.0 - share) * (last - first))
        other = whole.rows(middle, last)
        last = middle
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


def _estimated_delay(found: Synchronisation) -> float:
    """The delay, where there is one that means something."""
    from ..identification import SynchronisationStatus

    if found.status is SynchronisationStatus.AT_THE_END:
        raise InvalidValueError(
            f"--delay auto: the torques fit best at an end of the delays that were tried "
            f"({1e3 * found.delays[0]:.0f} to {1e3 * found.delays[-1]:.0f} ms); see whether "
            "positions and torques are of the same motion, and give the delay in seconds."
        )
    if not found.status.is_success:
        raise InvalidValueError(
            f"--delay auto: {found.status.sentence} Give the delay in seconds, or leave it out."
        )
    return float(found.delay)


def _as_options(message: str) -> str:
    """A message of the package in the words of the command line."""
    for words, option in _WHOLE:
        message = message.replace(words, option)

    def option_of(match: re.Match[str]) -> str:
        name, word, number = match.groups()
        if name not in _OPTIONS:
            return match.group()
        value = word or number
        return _OPTIONS[name] if not value else f"{_OPTIONS[name]} {value}"

    return _ARGUMENT.sub(option_of, message)


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
    return read_log(
        files, torques_from=torques, positions=_columns(arguments.positions),
        torques=_columns(arguments.torques), velocities=_or_none(arguments.velocities),
        accelerations=_or_none(arguments.accelerations),
        position_references=_or_none(arguments.references), time=time, dt=arguments.dt,
        times=arguments.times, angles=arguments.angles, lengths=arguments.lengths,
        signs=_joint_numbers(arguments.signs, model, "--signs"),
        gears=_joint_numbers(arguments.gears, model, "--gears"),
        transmission=model.transmission if arguments.motor_side else None,
        drive_gains=_joint_numbers(arguments.drive_gains, model, "--drive-gains"),
        offsets=_joint_numbers(arguments.offsets, model, "--offsets"), model=model,
        delimiter=arguments.delimiter,
    )  # fmt: skip


def write(
    result: IdentificationResult,
    folder: Path,
    test: Log | None = None,
    robot: ConsistentFit | None = None,
    quiet: bool = False,
) -> None:
    """Write the files of a report into a folder and say which.

    Parameters
    ----------
    result : IdentificationResult
        Of the fit.
    folder : Path
        Made if it is not there.
    test : Log, optional
        Kept aside, for the figures.
    robot : ConsistentFit, optional
        What the URDF is made of; none without it.
    quiet : bool
        Whether nothing is printed but warnings.

    Raises
    ------
    RobotModelsError, OSError
        A file that cannot be made.
    """
    from ..identification.reporting.text import report_text
    from ..identification.reporting.write import write_result
    from ..viz import identification_html

    folder.mkdir(parents=True, exist_ok=True)
    report = report_text(result, robot)
    (folder / "report.txt").write_text(report, encoding="utf-8")
    write_result(result, folder / "result.json", robot)
    written = ["report.txt", "report.html", "result.json"]
    if robot is not None:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", UrdfWarning)
            write_result(result, folder / "identified.urdf", robot)
        for warning in caught:
            print(f"robotmodels: identified.urdf: {warning.message}", file=sys.stderr)
        written.append("identified.urdf")
    identification_html(result, folder / "report.html", test, robot)
    if not quiet:
        print(report.split("\n\nData\n", 1)[0].rstrip())
        for name in written:
            print(f"wrote {folder / name}")


def _real(
    result: IdentificationResult, prior: InertialParameters | None, asked: bool
) -> ConsistentFit | None:
    """The robot of real bodies; where it was not asked for, what is missing for it is only said."""
    from ..identification.consistency.identified_robot import consistent_robot, prior_bodies
    from ..identification.consistency.result import ConsistentStatus

    try:
        if prior is None:
            prior, sentences = prior_bodies(result.model)
            for sentence in sentences:
                print(f"robotmodels: {sentence}", file=sys.stderr)
        found = consistent_robot(result, prior)
    except RobotModelsError as error:
        if asked:
            raise
        print(f"robotmodels: no identified.urdf: {error}", file=sys.stderr)
        return None
    if found.status is ConsistentStatus.FAILED:
        if asked:
            raise InvalidValueError(f"--consistent: {found.status.sentence}")
        print(f"robotmodels: no identified.urdf: {found.status.sentence}", file=sys.stderr)
        return None
    return found


def _prior(arguments: argparse.Namespace, model: RobotModel) -> InertialParameters | None:
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


def _essential(text: str | None) -> bool | float | str:
    if text is None:
        return False
    try:
        return float(text)
    except ValueError:
        return text


def _controller(arguments: argparse.Namespace, model: RobotModel) -> Controller | None:
    if arguments.kp is None and arguments.kd is None:
        return None
    if arguments.kp is None or arguments.kd is None:
        raise InvalidValueError("--kp, --kd: a controller has both gains; give the other as well.")
    from ..identification import Controller

    kp, kd = (_joint_numbers(getattr(arguments, name), model, f"--{name}") for name in ("kp", "kd"))
    return Controller(kp, kd)  # type: ignore[arg-type]  # both were given


def _workers(count: int) -> Any:
    """An executor, or None for this process."""
    if not 1 <= count <= _MOST:
        raise InvalidValueError(f"--workers: expected 1 to {_MOST}, got {count}.")
    executor: Executor | None = None if count == 1 else ProcessPoolExecutor(count)
    return nullcontext(None) if executor is None else executor


def _joint_numbers(text: str | None, model: RobotModel, option: str) -> Array | float | None:
    if text is None:
        return None
    values = numbers(text, (1, model.n) if model.n > 1 else 1, option)
    return float(values[0]) if len(values) == 1 else values


def _columns(words: list[str] | None) -> list[int | str] | int | str | None:
    found = columns(words)
    # one word may be a pattern, or the name of a matrix
    return found[0] if found is not None and len(found) == 1 else found


def _or_none(words: list[str] | None) -> Any:
    return False if words == ["none"] else _columns(words)


def _progress(fraction: float) -> None:
    end = "\n" if fraction >= 1.0 else ""
    print(f"\rreducing the log: {100.0 * fraction:3.0f} %", end=end, file=sys.stderr, flush=True)
