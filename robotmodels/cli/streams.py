"""Standard output and error: terminals without Unicode, readers that stop, warnings in one line."""

from __future__ import annotations

import codecs
import contextlib
import io
import os
import sys
import warnings
from collections.abc import Iterator
from typing import Any

from ..errors import RobotModelsWarning

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
