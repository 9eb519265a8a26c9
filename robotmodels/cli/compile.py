"""``robotmodels compile``: compile everything in advance."""

from __future__ import annotations

import argparse
import time

from ..kernels.prepare import compile_all
from .output import progress

EXAMPLES = """\
examples:
  robotmodels compile
  robotmodels compile --processes 2"""
DESCRIPTION = """\
Compile all functions that are otherwise compiled when they are first called, and keep them for
later processes. Needed once after an installation or an update, and never for the results."""
OPTIONS = """\
--processes N [int] processes beside each other (default: all)
@quiet"""


def run(arguments: argparse.Namespace) -> None:
    """Compile, with a progress bar."""
    start = time.monotonic()
    with progress(arguments, "compiling") as bar:
        count, folder = compile_all(arguments.processes, bar and (lambda k, of, _: bar(k / of)))
    place = "They could not be kept." if folder is None else f"They are kept in {folder}."
    print(f"{count} functions are ready, after {time.monotonic() - start:.0f} s. {place}")
