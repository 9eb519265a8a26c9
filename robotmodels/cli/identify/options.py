"""The options of ``robotmodels identify``."""

from __future__ import annotations

from typing import Any

from ..file_options import add_delimiter, add_units

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
