"""``robotmodels view``: draw a robot into an offline page."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InvalidValueError
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
    parser.add_argument("--q", help="joint variables separated by commas, or the name of a "
                        "configuration; default zero")  # fmt: skip
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
    >>> configuration("0.1, 0.2", 2, [0, 0], False)
    array([0.1, 0.2])
    """
    from ..viz import show

    model = robot_of(arguments)
    named = model.configurations.get(arguments.q or "zero")
    sigma = model.table.sigma[model.table.joint_rows]
    q = named if named is not None else configuration(
        arguments.q, model.n, sigma, arguments.degrees
    )  # fmt: skip
    path = arguments.out or Path(f"{model.name}.html")
    show(model, q).save(path)
    print(f"Scene of {model.name} at q = {np.array2string(q, precision=4)} written to {path}")


def configuration(text: str, n: int, sigma: Any, degrees: bool) -> np.ndarray:
    """Joint variables from text.

    Parameters
    ----------
    text : str
        Numbers separated by commas.
    n : int
        How many there must be.
    sigma : sequence of int, length n
        Joint types.
    degrees : bool
        Whether revolute joints are in degrees.

    Returns
    -------
    ndarray, shape (n,)
        Radians and metres.

    Raises
    ------
    InvalidValueError
        Something else than n numbers.

    Examples
    --------
    >>> configuration("180", 1, [0], True).round(6)
    array([3.141593])
    """
    try:
        q = np.array([float(word) for word in text.split(",")])
    except ValueError:
        q = np.empty(0)
    if q.size != n:
        raise InvalidValueError(
            f"--q: expected {n} numbers separated by commas or the name of a configuration, "
            f"got {text!r}."
        )
    return np.where(np.asarray(sigma) == 0, np.deg2rad(q), q) if degrees else q
