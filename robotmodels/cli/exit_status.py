"""How a command ends, for shells: the one place that gives the numbers a meaning."""

from __future__ import annotations

import textwrap
from enum import IntEnum


class ExitStatus(IntEnum):
    """The number that a command returns to the shell."""

    DONE = 0
    NOT_REACHED = 1
    WRONG_INPUT = 2
    BUG = 70
    INTERRUPTED = 130

    @property
    def sentence(self) -> str:
        """What the number means, in words."""
        return _SENTENCES[self]


_SENTENCES = {
    ExitStatus.DONE: "done",
    ExitStatus.NOT_REACHED: "the mathematics has no answer: a pose out of reach, a fit that has "
    "not converged or predicts badly, no motion within the limits",
    ExitStatus.WRONG_INPUT: "an argument or a file is wrong, or an optional package is missing",
    ExitStatus.BUG: "an error inside robotmodels; --traceback shows where",
    ExitStatus.INTERRUPTED: "interrupted (Ctrl-C)",
}


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
