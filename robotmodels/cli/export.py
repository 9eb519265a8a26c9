"""``robotmodels export``: a model of a robot as source code."""

from __future__ import annotations

import argparse
from typing import Any

from .arguments import add_source, column, robot_of
from .terminal import ending

_EXAMPLES = """\
examples:
  robotmodels export rx90 idm --parameters base --out rx90_idm.c
  robotmodels export rx90 igm --language matlab
  robotmodels export arm.urdf torque_regressor --language numpy --out arm.py"""


def add_command(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "export",
        description="Write a model of a robot as one self-contained file of straight-line code, "
        "and print its operations; without --out, print the code.",
        epilog=ending(_EXAMPLES),
    )
    add_source(parser)
    parser.add_argument("model", help="dgm, jacobian, igm, idm, ddm, mass_matrix, bias, "
                        "gravity_torque, torque_regressor or base_regressor")  # fmt: skip
    parser.add_argument("--language", help="c, python, numpy, casadi or matlab (default: by the "
                        "name of the file, else c)")  # fmt: skip
    parser.add_argument("--parameters", default="numbers",
                        help="dynamic parameters: numbers of the model, symbols or base symbols "
                        "(default: %(default)s)")  # fmt: skip
    parser.add_argument("--geometry", default="numbers",
                        help="geometric parameters: numbers or symbols (default: "
                        "%(default)s)")  # fmt: skip
    parser.add_argument("--no-drive", action="store_true",
                        help="leave rotors, friction and offsets out")  # fmt: skip
    parser.add_argument("--wrench", action="store_true",
                        help="idm, bias, ddm: with a wrench of the tool as an input")  # fmt: skip
    parser.add_argument("--frame", help="dgm, jacobian: name or number of a frame (default: the "
                        "tool)")  # fmt: skip
    parser.add_argument("--out", metavar="FILE", help="file that is written")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Write or print the code."""
    from ..export import program, write

    frame = None if arguments.frame is None else column(arguments.frame)
    made = program(
        robot_of(arguments), arguments.model, arguments.parameters, arguments.geometry,
        not arguments.no_drive, arguments.wrench, frame,
    )  # fmt: skip
    if arguments.out is None:
        print(made.code(arguments.language or "c"), end="")
        return
    write(made, arguments.out, arguments.language)
    counts = ", ".join(f"{number} {word}" for word, number in made.count._asdict().items())
    print(f"{arguments.out}: {made.name}, {counts}")
