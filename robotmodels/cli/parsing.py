"""The parser of arguments: help that fits the terminal, errors in one line with near names."""

from __future__ import annotations

import argparse
import shutil
import textwrap
from collections.abc import Sequence
from typing import Any, NoReturn

from ..errors import nearest_names
from .exit_status import ExitStatus

_WIDEST = 100  # columns


class Parser(argparse.ArgumentParser):
    """Argument parser without abbreviated options."""

    def __init__(self, **settings: Any) -> None:
        settings.setdefault("formatter_class", HelpText)
        settings.setdefault("allow_abbrev", False)
        super().__init__(**settings)

    def error(self, message: str) -> NoReturn:
        """Print an error in one line and exit."""
        if message.startswith("argument -"):
            message = message.removeprefix("argument ")
        line = " ".join(message.split())
        end = "" if line[-1] in ".?" else "."
        self.exit(ExitStatus.WRONG_INPUT, f"robotmodels: {line}{end} See {self.prog} --help.\n")

    def refuse(self, words: Sequence[str]) -> NoReturn:
        """Exit with an error about unknown arguments."""
        option = words[0].partition("=")[0]
        if not option.startswith("-"):
            self.error(f"nothing takes {words[0]!r}")
        near = nearest_names(option, self.options())
        meant = f" Did you mean {' or '.join(near)}?" if near else ""
        self.error(f"no option {option}.{meant}")

    def options(self) -> list[str]:
        """The names of all options."""
        return [name for action in self._actions for name in action.option_strings]


class HelpText(argparse.HelpFormatter):
    """Help formatter that fills paragraphs, except those with an indented line."""

    def __init__(self, prog: str) -> None:
        width = min(shutil.get_terminal_size().columns - 2, _WIDEST)
        super().__init__(prog, max_help_position=28, width=max(width, 40))

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        paragraphs = []
        for paragraph in text.strip().split("\n\n"):
            if any(line.startswith("  ") for line in paragraph.splitlines()):
                paragraphs.append(textwrap.indent(paragraph, indent))
            else:
                paragraphs.append(
                    textwrap.fill(
                        " ".join(paragraph.split()), width, initial_indent=indent,
                        subsequent_indent=indent, break_on_hyphens=False,
                    )
                )  # fmt: skip
        return "\n\n".join(paragraphs)
