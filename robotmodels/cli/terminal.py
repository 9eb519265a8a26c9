"""The command's ends at the terminal: exit statuses, streams, warnings, interrupts."""

from __future__ import annotations

import codecs
import contextlib
import io
import os
import sys
import textwrap
import warnings
from collections.abc import Iterator
from enum import IntEnum
from typing import Any

from ..errors import RobotModelsWarning


class ExitStatus(IntEnum):
    """The number that a command returns to the shell, and its meaning as a sentence."""

    sentence: str

    DONE = 0, "done"
    NOT_REACHED = 1, "no solution: a pose out of reach, a fit that has not converged, no motion"
    WRONG_INPUT = 2, "an argument or a file is wrong, or an optional package is missing"
    BUG = 70, "an error inside robotmodels; --traceback shows where"
    INTERRUPTED = 130, "interrupted (Ctrl-C)"

    def __new__(cls, value: int, sentence: str) -> ExitStatus:
        """Attach the sentence."""
        one = int.__new__(cls, value)
        one._value_, one.sentence = value, sentence
        return one


def statuses() -> str:
    """Every exit status with its meaning, for ``robotmodels --help``."""
    lines = (
        textwrap.fill(f"  {one.value:<4} {one.sentence}", 78, subsequent_indent=" " * 7)
        for one in ExitStatus
    )
    return "\n".join(["exit status:", *lines])


def ending(examples: str, not_reached: str | None = None) -> str:
    """End of a command's help: examples and exit statuses."""
    middle = "" if not_reached is None else f"1 {not_reached}, "
    return f"{examples}\n\nExit status: 0 done, {middle}2 an argument or a file is wrong."


_PLAIN = str.maketrans(
    {"│": "|", "─": "-", "σ": "s", "α": "a", "β": "b", "γ": "g", "μ": "m", "θ": "t", "π": "pi",
     "√": "sqrt", "²": "2", "³": "3", "·": ".", "×": "x", "±": "+-", "∞": "inf", "°": " deg"}
    | dict.fromkeys("┌┬┐├┼┤└┴┘", "+")
    | dict(zip("₀₁₂₃₄₅₆₇₈₉", "0123456789", strict=True))
)  # fmt: skip


def _plain(error: UnicodeError) -> tuple[str, int]:
    """Characters that a terminal cannot show, in ones that it can."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    text = error.object[error.start : error.end].translate(_PLAIN)
    return text.encode("ascii", "backslashreplace").decode("ascii"), error.end


codecs.register_error("robotmodels-plain", _plain)


def say(text: str) -> None:
    """Print a line to the terminal, outside of the command's output."""
    if sys.stderr is not None:
        print(f"robotmodels: {' '.join(text.split())}", file=sys.stderr)


@contextlib.contextmanager
def prepared() -> Iterator[None]:
    """Context: streams that accept any character, warnings printed as lines."""
    if sys.stdout is None:  # closed by the shell; at exit nothing is left to be closed
        sys.stdout = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115
    streams = [s for s in (sys.stdout, sys.stderr) if isinstance(s, io.TextIOWrapper)]
    before = [stream.errors for stream in streams]
    for stream in streams:
        stream.reconfigure(errors="robotmodels-plain")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("always", RobotModelsWarning)
            shown = warnings.showwarning

            def show(message: Any, category: type[Warning], *place: Any, **more: Any) -> None:
                if issubclass(category, RobotModelsWarning):
                    say(f"warning: {message}")
                else:
                    shown(message, category, *place, **more)

            warnings.showwarning = show
            yield
    finally:
        for stream, errors in zip(streams, before, strict=True):
            stream.reconfigure(errors=errors)


def give_up_output() -> None:
    """Nothing more can be written: keep Python from complaining about it at exit."""
    with contextlib.suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
