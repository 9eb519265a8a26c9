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
    """How far the work is, drawn over the same line again and again.

    Parameters
    ----------
    doing : str
        What is being done.
    stream : text stream
        Where it is drawn.
    """

    doing: str
    stream: TextIO
    _started: float = field(default_factory=time.monotonic)
    _drawn: float = -1.0

    def fraction(self, done: float) -> None:
        """Draw.

        Parameters
        ----------
        done : float
            From 0 to 1.
        """
        self._draw(done, f"{100.0 * done:3.0f} %", self.doing)

    def steps(self, done: int, of: int, doing: str = "") -> None:
        """Draw a number of steps.

        Parameters
        ----------
        done : int
            Steps.
        of : int
            All of them.
        doing : str
            What this one is.
        """
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
    """Add the option that leaves the bar away.

    Parameters
    ----------
    parser : ArgumentParser
        Of a command.

    Examples
    --------
    >>> parser = argparse.ArgumentParser()
    >>> add_quiet(parser)
    >>> parser.parse_args(["--quiet"]).quiet
    True
    """
    parser.add_argument("--quiet", action="store_true",
                        help="no progress bar (there is none either where standard error is not "
                        "a terminal)")  # fmt: skip


@contextlib.contextmanager
def progress(arguments: argparse.Namespace, doing: str) -> Iterator[Bar | None]:
    """A bar while some work lasts.

    Parameters
    ----------
    arguments : Namespace
        With ``quiet``.
    doing : str
        What is being done.

    Yields
    ------
    Bar or None
        None where nobody looks.

    Examples
    --------
    >>> with progress(argparse.Namespace(quiet=True), "counting") as bar:
    ...     bar is None
    True
    """
    stream = sys.stderr
    if arguments.quiet or stream is None or not stream.isatty():
        yield None
        return
    bar = Bar(doing, stream)
    try:
        yield bar
    finally:
        bar.clear()
