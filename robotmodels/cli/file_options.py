"""Options of the commands that read files of numbers: units, and what is between cells."""

from __future__ import annotations

import argparse
from typing import Any


def add_units(files: Any) -> None:
    """Add the options for the units of angles and lengths."""
    for option, units, of in (
        ("--angles", ("rad", "deg"), "angles"),
        ("--lengths", ("m", "mm"), "lengths, also of prismatic joints,"),
    ):
        files.add_argument(option, choices=units, default=units[0],
                           help=f"unit of {of} in the files (default: %(default)s)")  # fmt: skip


def add_delimiter(files: Any) -> None:
    """Add the option of the delimiter."""
    files.add_argument("--delimiter", type=_character, metavar="CHARACTER",
                       help=r"between cells, \t for a tab (default: ; tab or , as "
                       "found)")  # fmt: skip


def _character(text: str) -> str:
    text = text.replace(r"\t", "\t")
    if len(text) != 1:
        raise argparse.ArgumentTypeError(f"expected one character, got {text!r}")
    return text
