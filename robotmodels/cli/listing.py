"""``robotmodels robots``: the names of the catalogue."""

from __future__ import annotations

import argparse
from typing import Any

from ..robots import robots, title


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
    """Print each name with what it stands for.

    Parameters
    ----------
    arguments : Namespace
        Parsed arguments.

    Examples
    --------
    >>> run(argparse.Namespace())  # doctest: +ELLIPSIS
    lab_rr ...
    """
    names = robots()
    width = max(map(len, names))
    for name in names:
        print(f"{name:<{width}}  {title(name)}")
