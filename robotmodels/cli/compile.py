"""``robotmodels compile``: compile everything in advance."""

from __future__ import annotations

import argparse
import time
from typing import Any

from ..kernels.prepare import compile_all
from .output import add_quiet, progress
from .terminal import ending

_EXAMPLES = """\
examples:
  robotmodels compile
  robotmodels compile --processes 2"""


def add_command(commands: Any) -> None:
    """Add the command to the parser."""
    parser = commands.add_parser(
        "compile",
        description="Compile all functions that are otherwise compiled when they are first "
        "called, and keep them for later processes. Needed once after an installation or an "
        "update, and never for the results.",
        epilog=ending(_EXAMPLES),
    )
    parser.add_argument(
        "--processes", type=int, metavar="N", help="processes beside each other (default: all)"
    )
    add_quiet(parser)
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> None:
    """Compile, with a progress bar."""
    start = time.monotonic()
    with progress(arguments, "compiling") as bar:
        count, folder = compile_all(arguments.processes, None if bar is None else bar.steps)
    place = "They could not be kept." if folder is None else f"They are kept in {folder}."
    print(f"{count} functions are ready, after {time.monotonic() - start:.0f} s. {place}")
