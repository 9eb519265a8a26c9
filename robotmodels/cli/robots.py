"""``robotmodels robots``: the names of the catalogue."""

from __future__ import annotations

import argparse
import shutil
import sys
import textwrap

from ..robots import robots, title
from .output import print_json

EXAMPLES = """\
examples:
  robotmodels robots
  robotmodels robots --json

Names that begin with erd: come from the files of example-robot-data."""
DESCRIPTION = """\
List the robots that `load` and the other commands know by name."""
OPTIONS = """\
@json"""


def run(arguments: argparse.Namespace) -> None:
    """Print each name with its robot."""
    names = robots()
    if arguments.json:
        print_json([{"name": name, "title": title(name)} for name in names])
        return
    width = max(map(len, names)) + 2
    # pipes get a line for each robot, terminals lines that fit
    columns = shutil.get_terminal_size().columns if sys.stdout.isatty() else 10_000
    for name in names:
        text = f"{name:<{width}}{title(name).removeprefix('example-robot-data: ')}"
        print(textwrap.fill(text, columns, subsequent_indent=" " * width, break_on_hyphens=False))
