"""Arguments of the command line, and what a person reads when something is wrong with them."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence

from .. import __version__
from ..errors import RobotModelsError
from . import calibrate, demo, excite, identify, igm, info, listing, view
from .numbers import joined


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command.

    Parameters
    ----------
    argv : sequence of str, optional
        Arguments; default those of the process.

    Returns
    -------
    int
        0 if it worked, 1 if a pose is not reached, a fit has not converged or no motion keeps its
        limits, 2 if an argument was wrong.

    Examples
    --------
    >>> main(["info", "rx90"])  # doctest: +ELLIPSIS
    rx90: 6 joints, 6 frames...
    0
    """
    parser = argparse.ArgumentParser(
        prog="robotmodels",
        description="Kinematics and dynamics of robot manipulators from their Khalil-Kleinfinger "
        "table or their URDF.",
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for module in (demo, listing, info, igm, calibrate, excite, identify, view):
        module.add_command(commands)
    parser.add_argument("--version", action="version", version=__version__)
    arguments = parser.parse_args(joined(sys.argv[1:] if argv is None else argv))
    code: int | None = 0
    try:
        code = arguments.run(arguments)
        sys.stdout.flush()
    except RobotModelsError as error:
        print(f"robotmodels: {error}", file=sys.stderr)
        return 2
    except OSError as error:
        if not isinstance(error, BrokenPipeError):
            print(f"robotmodels: {error.strerror}: {error.filename}", file=sys.stderr)
            return 2
        # the reader (head, a pager) has seen enough; keep Python from complaining at exit
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return code or 0
