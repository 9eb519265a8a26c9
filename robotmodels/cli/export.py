"""``robotmodels export``: a model of a robot as source code."""

from __future__ import annotations

import argparse

from .arguments import column, robot_of

EXAMPLES = """\
examples:
  robotmodels export rx90 idm --parameters base --out rx90_idm.c
  robotmodels export rx90 igm --language matlab
  robotmodels export arm.urdf torque_regressor --language numpy --out arm.py"""
DESCRIPTION = """\
Write a model of a robot as one self-contained file of straight-line code, and print its operations;
without --out, print the code."""
OPTIONS = """\
@robot
model [] dgm, jacobian, igm, idm, ddm, mass_matrix, bias, gravity_torque, torque_regressor or
    base_regressor
--language [] c, python, numpy, casadi or matlab (default: by the name of the file, else c)
--parameters [=numbers] dynamic parameters: numbers of the model, symbols or base symbols
--geometry [=numbers] geometric parameters: numbers or symbols
--no-drive [flag] leave rotors, friction and offsets out
--wrench [flag] idm, bias, ddm: with a wrench of the tool as an input
--frame [] dgm, jacobian: name or number of a frame (default: the tool)
--out FILE [] file that is written"""


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
