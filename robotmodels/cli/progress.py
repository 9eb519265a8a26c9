"""A bar for long work: on standard error, and only where a person looks at it."""

from __future__ import annotations

import argparse
import contextlib
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TextIO

_CELLS = 30
_WIDTH = 79  # of a narrow terminal, less one so that no line is broken
_OFTEN = 0.05  # s


@dataclass(slots=True)
class Bar:
    """Progress bar on one line of the terminal."""

    doing: str
    stream: TextIO
    _started: float = field(default_factory=time.monotonic)
    _drawn: float = -1.0

    def fraction(self, done: float) -> None:
        """Draw."""
        self._draw(done, f"{100.0 * done:3.0f} %", self.doing)

    def steps(self, done: int, of: int, doing: str = "") -> None:
        """Draw a number of steps."""
        text = f"{self.doing}: {doing}" if doing else self.doing
        self._draw(done / of if of else 1.0, f"{done}/{of}", text)

    def clear(self) -> None:
        """Take the bar away."""
        if self._drawn >= 0.0:
            self.stream.write("\r" + " " * _WIDTH + "\r")
            self.stream.flush()

    def _draw(self, done: float, count: str, doing: str) -> None:
        now = time.monotonic()
        if now - self._drawn < _OFTEN and done < 1.0:
            return
        self._drawn = now
        full = round(_CELLS * min(max(done, 0.0), 1.0))
        seconds = f"{now - self._started:.0f} s"
        line = f"[{'#' * full}{'.' * (_CELLS - full)}] {count} {seconds}  {doing}"
        self.stream.write("\r" + line[:_WIDTH].ljust(_WIDTH))
        self.stream.flush()


def add_quiet(parser: argparse.ArgumentParser) -> None:
    """Add the option that turns the progress bar off."""
    parser.add_argument("--quiet", action="store_true",
                        help="no progress bar (there is none either where standard error is not "
                        "a terminal)")  # fmt: skip


@contextlib.contextmanager
def progress(arguments: argparse.Namespace, doing: str) -> Iterator[Bar | None]:
    """Context that shows a progress bar."""
    stream = sys.stderr
    if arguments.quiet or stream is None or not stream.isatty():
        yield None
        return
    bar = Bar(doing, stream)
    try:
        yield bar
    finally:
        bar.clear()
