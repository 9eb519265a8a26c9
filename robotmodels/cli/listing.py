"""``robotmodels robots``: the names of the catalogue."""

from __future__ import annotations

import argparse
from typing import Any

from ..robots import robots


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
        "robots",
        help="list the robots of the catalogue",
        description="List the robots that `load` and the other commands know by name.",
    )
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Print one name a line.

    Parameters
    ----------
    arguments : Namespace
        Parsed arguments.

    Examples
    --------
    >>> run(argparse.Namespace())  # doctest: +ELLIPSIS
    ...rx90...
    """
    print("\n".join(robots()))
