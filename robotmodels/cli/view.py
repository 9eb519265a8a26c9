"""``robotmodels view``: draw a robot into an offline page."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from .numbers import posture
from .source import add_source, robot_of


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
        "view",
        help="draw a robot into an offline page",
        description="Draw a robot in one configuration and save the scene as one HTML file that "
        "any browser opens without a network.",
    )
    add_source(parser)
    parser.add_argument("--q", metavar="NUMBERS", help="joint variables in rad and m, or the name "
                        "of a configuration; default zero")  # fmt: skip
    parser.add_argument("--degrees", action="store_true", help="revolute joints of --q in degrees")
    parser.add_argument("--out", type=Path, help="file to write; default NAME.html")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Draw and save.

    Parameters
    ----------
    arguments : Namespace
        Parsed arguments.

    Examples
    --------
    >>> import tempfile
    >>> parser = argparse.ArgumentParser()
    >>> add_command(parser.add_subparsers())
    >>> with tempfile.TemporaryDirectory() as folder:  # doctest: +ELLIPSIS
    ...     run(parser.parse_args(["view", "rx90", "--out", f"{folder}/arm.html"]))
    Scene of rx90 at q = [0. 0. 0. 0. 0. 0.] written to ...
    """
    from ..viz import show

    model = robot_of(arguments)
    q = posture(arguments.q or "zero", model, "--q", arguments.degrees)
    path = arguments.out or Path(f"{model.name}.html")
    show(model, q).save(path)
    print(f"Scene of {model.name} at q = {np.array2string(q, precision=4)} written to {path}")
