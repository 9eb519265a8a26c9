"""Options and logs of ``robotmodels identify``: reading, delay, fitted and held-out parts."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from ..errors import InvalidValueError
from ..model import RobotModel
from .arguments import add_delimiter, add_units, column, columns, joint_numbers, numbers

if TYPE_CHECKING:
    from ..identification import Log
    from ..identification.delay import Synchronisation


METHODS = (
    "ols", "wls", "irls", "robust", "tls", "ridge", "iv", "didim", "cloe", "sequential",
    "recursive",
)  # fmt: skip
FORMS = ("torque", "filtered", "power", "energy")
_KINDS = ("Ia", "Fv", "Fc", "offset")


def add_options(parser: Any) -> None:
    """Add the options for logs, held-out motion and the fit."""
    _add_files(parser.add_argument_group("the logs"))
    _add_test(parser.add_argument_group("held-out motion, one of"))
    _add_fit(parser.add_argument_group("the fit"))


def _add_files(files: Any) -> None:
    files.add_argument("--log", required=True, nargs="+", metavar="FILE",
                       help="CSV, NPZ, Parquet or MAT files, each a recording")  # fmt: skip
    files.add_argument("--torques-from", nargs="+", metavar="FILE",
                       help="files with the torques, one for each log")  # fmt: skip
    for option, what in (
        ("--positions", "columns of the positions: names, numbers from 0, or a pattern"),
        ("--torques", "columns of the torques or currents"),
        ("--velocities", "columns of velocities, where they are measured, or none"),
        ("--accelerations", "columns of accelerations, where they are measured, or none"),
        ("--references", "columns of the reference positions of the controller, or none"),
    ):
        files.add_argument(option, nargs="+", metavar="COLUMN", help=what)
    files.add_argument("--time", metavar="COLUMN", help='column of times, or "none"')
    files.add_argument("--times", choices=("s", "ms", "us", "ns"), help="its unit")
    files.add_argument("--dt", type=float, metavar="SECONDS",
                       help="sampling period, needed without times")  # fmt: skip
    add_units(files)
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
    add_delimiter(files)
    files.add_argument("--rows", nargs=2, type=int, metavar=("FROM", "TO"),
                       help="rows that are fitted; default all")  # fmt: skip
    files.add_argument("--delay", metavar="SECONDS",
                       help="delay of the torques behind the positions, or auto to estimate "
                       "it")  # fmt: skip


def _add_test(test: Any) -> None:
    test.add_argument("--test", nargs="+", metavar="FILE", help="files of the held-out log")
    test.add_argument("--test-torques-from", nargs="+", metavar="FILE",
                      help="files with their torques")  # fmt: skip
    test.add_argument("--test-rows", nargs=2, type=int, metavar=("FROM", "TO"),
                      help="held-out rows of the logs")  # fmt: skip
    test.add_argument("--test-share", type=float, metavar="SHARE",
                      help="held-out share at the end of the logs")  # fmt: skip


def _add_fit(fitted: Any) -> None:
    fitted.add_argument("--method", default="wls", metavar="METHOD[:OPTION=VALUE,...]",
                        help=f"method with its options: {', '.join(METHODS)}, such as "
                        "robust:loss=tukey, ridge:strength=10, recursive:forgetting=0.99 or "
                        "wls:essential=30 (default: %(default)s)")  # fmt: skip
    fitted.add_argument("--form", choices=FORMS, default="torque",
                        help="balanced quantity (default: %(default)s)")  # fmt: skip
    fitted.add_argument("--drive", nargs="*", choices=_KINDS, default=list(_KINDS), metavar="KIND",
                        help="drive parameters that are identified (default: Ia Fv Fc "
                        "offset)")  # fmt: skip
    fitted.add_argument("--cutoff", type=float, metavar="HZ",
                        help="-3 dB of the positions' low-pass; default: chosen for "
                        "prediction, see the notes")  # fmt: skip
    fitted.add_argument("--decimation", type=int, metavar="N",
                        help="samples for an equation, 1: all; default: chosen for prediction, see "
                        "the notes")  # fmt: skip
    fitted.add_argument("--dead-band", metavar="NUMBERS",
                        help="velocities (rad/s, m/s) below which a joint's equations are left "
                        "out")  # fmt: skip
    fitted.add_argument("--edges", type=float, metavar="SECONDS",
                        help="cut at both ends of each recording")  # fmt: skip
    fitted.add_argument("--no-check", action="store_true",
                        help="skip the checks of units, signs and order, and the removal of "
                        "outliers and frozen samples")  # fmt: skip
    fitted.add_argument("--consistent", action="store_true",
                        help="find a physically consistent robot too (as --out does)")  # fmt: skip
    fitted.add_argument("--prior", metavar="ROBOT",
                        help="prior inertia: of a robot, or of "
                        "uniform bodies of this mass in kg; default the robot's own")  # fmt: skip
    fitted.add_argument("--kp", metavar="NUMBERS",
                        help="of methods iv, didim, cloe: the controller's gains of position, "
                        "N m/rad or N/m; with --kd. Default a tuned controller")  # fmt: skip
    fitted.add_argument("--kd", metavar="NUMBERS", help="its gains of velocity")
    fitted.add_argument("--workers", type=int, default=1, metavar="N",
                        help="processes (default: %(default)s), with the same result")  # fmt: skip


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
            raise InvalidValueError("--test-rows: give the fitted rows by --rows.")
        start, stop = _range(arguments.test_rows, len(whole), "--test-rows")
        if max(first, start) < min(last, stop):
            raise InvalidValueError(
                f"--test-rows: rows {start} to {stop} are not held out where {first} to {last} "
                "are fitted; give rows that do not overlap."
            )
        other = whole.rows(start, stop)
    elif (share := arguments.test_share) is not None:
        if not 0.0 < share < 1.0:
            raise InvalidValueError(
                f"--test-share: expected a share between 0 and 1, got {share:g}."
            )
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


def _estimated_delay(estimate: Synchronisation) -> float:
    """Estimated delay, if it is determined."""
    from ..identification.delay import SynchronisationStatus

    if estimate.status is SynchronisationStatus.AT_THE_END:
        raise InvalidValueError(
            "--delay auto: the torques fit best at an end of the delays tried "
            f"({1e3 * estimate.delays[0]:.0f} to {1e3 * estimate.delays[-1]:.0f} ms); "
            "check whether positions and torques belong to the same motion, and give the delay "
            "in seconds."
        )
    if not estimate.status.is_success:
        raise InvalidValueError(
            f"--delay auto: {estimate.status.sentence} Give the delay in seconds, or leave it out."
        )
    return float(estimate.delay)


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
        signs=joint_numbers(arguments.signs, model.n, "--signs"),
        gears=joint_numbers(arguments.gears, model.n, "--gears"),
        transmission=model.transmission if arguments.motor_side else None,
        drive_gains=joint_numbers(arguments.drive_gains, model.n, "--drive-gains"),
        offsets=joint_numbers(arguments.offsets, model.n, "--offsets"), model=model,
        delimiter=arguments.delimiter,
    )  # fmt: skip


def _columns(words: list[str] | None) -> list[int | str] | int | str | None:
    names = columns(words)
    # one word may be a pattern, or the name of a matrix
    return names[0] if names is not None and len(names) == 1 else names


def _or_none(words: list[str] | None) -> Any:
    return False if words == ["none"] else _columns(words)
