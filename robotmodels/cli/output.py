"""Output of a command: text or JSON, files in a folder, and a bar for long work."""

from __future__ import annotations

import argparse
import contextlib
import errno
import json
import os
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .._json_data import json_data
from ..errors import InvalidValueError, MissingExtraError
from .terminal import ExitStatus, say


@dataclass(frozen=True, slots=True)
class Report:
    """Result of a command as text, JSON and files; ``head`` is what is printed beside files."""

    text: str
    data: Any
    is_reached: bool = True
    head: str = ""
    write: Callable[[Path], Sequence[str]] | None = None


def hand_over(report: Report, arguments: argparse.Namespace) -> ExitStatus:
    """Write the requested files, and print."""
    written: list[Path] = []
    if report.write is not None and arguments.out is not None:
        folder = arguments.out
        folder.mkdir(parents=True, exist_ok=True)
        written = [folder / name for name in report.write(folder)]
    if arguments.json:
        print_json(report.data() if callable(report.data) else report.data)
    else:
        print(
            "\n".join([report.head if written else report.text, *(f"wrote {p}" for p in written)])
        )
    return ExitStatus.DONE if report.is_reached else ExitStatus.NOT_REACHED


def check_output(arguments: argparse.Namespace) -> None:
    """Refuse a folder that cannot be written before the work, not after it."""
    if arguments.out is None:
        return
    there = next(path for path in (arguments.out, *arguments.out.absolute().parents)
                 if path.exists())  # fmt: skip
    if not there.is_dir():
        raise InvalidValueError(f"--out: {str(there)!r} is a file; give a folder.")
    if not os.access(there, os.W_OK | os.X_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(there))


def with_extra(path: Path, write: Callable[[], None]) -> list[str]:
    """Write a file that needs an optional package, or note that it is missing."""
    try:
        write()
    except MissingExtraError as error:
        say(f"no {path.name}: {error}")
        return []
    return [path.name]


def print_json(data: Any) -> None:
    """Print data as JSON that any reader takes."""
    # a terminal without Unicode gets escapes, which mean the same
    unicode = str(getattr(sys.stdout, "encoding", "") or "").lower().startswith("utf")
    print(json.dumps(json_data(data), ensure_ascii=not unicode, allow_nan=False, indent=2))


_CELLS = 30
_WIDTH = 79  # of a narrow terminal, less one so that no line is broken
_OFTEN = 0.05  # s
Bar = Callable[[float], None]
"""Draws a progress bar, given the fraction that is done."""


@contextlib.contextmanager
def progress(arguments: argparse.Namespace, doing: str) -> Iterator[Bar | None]:
    """Context with a progress bar on one line of the terminal, which it takes away at its end."""
    stream = sys.stderr
    if arguments.quiet or stream is None or not stream.isatty():
        yield None
        return
    started, drawn = time.monotonic(), -1.0

    def draw(done: float) -> None:
        nonlocal drawn
        now = time.monotonic()
        if now - drawn < _OFTEN and done < 1.0:
            return
        drawn = now
        bar = "#" * round(_CELLS * min(max(done, 0.0), 1.0))
        line = f"[{bar:.<{_CELLS}}] {100.0 * done:3.0f} % {now - started:.0f} s  {doing}"
        stream.write("\r" + line[:_WIDTH].ljust(_WIDTH))
        stream.flush()

    try:
        yield draw
    finally:
        if drawn >= 0.0:
            stream.write("\r" + " " * _WIDTH + "\r")
            stream.flush()
