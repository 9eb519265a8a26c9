"""The commands, their parser, and their error messages."""

from __future__ import annotations

import argparse
import importlib
import shutil
import sys
import textwrap
import traceback
from collections.abc import Sequence
from typing import Any, NoReturn

from .. import __version__, show_versions
from ..errors import RobotModelsError, nearest_names
from .arguments import add_options, joined
from .option_words import in_options
from .output import Report, hand_over
from .terminal import ExitStatus, ending, give_up_output, prepared, say, statuses

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

    def options(self, of_one_text: bool = False) -> list[str]:
        """The names of all options, or of those that take one text, such as a list of numbers."""
        some = [x for x in self._actions if x.nargs is None] if of_one_text else self._actions
        return [name for action in some for name in action.option_strings]


class HelpText(argparse.HelpFormatter):
    """Help formatter that fills paragraphs, except those with an indented line."""

    def __init__(self, prog: str) -> None:
        width = min(shutil.get_terminal_size().columns - 2, _WIDEST)
        super().__init__(prog, max_help_position=28, width=max(width, 40))

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        paragraphs = text.strip().split("\n\n")
        return "\n\n".join(
            part if "\n  " in f"\n{part}" else textwrap.fill(part, width, break_on_hyphens=False)
            for part in paragraphs
        )


COMMANDS = {
    "demo": "two arms from table and URDF to every direct model and every posture",
    "robots": "list the robots of the catalogue",
    "info": "print a robot's table, limits, inertia and frames",
    "igm": "all postures that bring the tool to a pose",
    "calibrate": "geometric parameters of a robot from measurements",
    "excite": "a motion for the dynamic identification of a robot",
    "identify": "dynamic parameters of a robot from logs of its motion",
    "workspace": "what a robot reaches, and in how many postures",
    "follow": "whether a path of poses can be followed, and where it breaks",
    "view": "open a robot with joint sliders in the browser",
    "export": "a model of a robot as C, Python, NumPy, CasADi or MATLAB code",
    "compile": "compile everything in advance, so that first calls are fast",
}
"""Each is the module of the same name, which is imported when it is used."""
_EXAMPLES = """\
examples:
  robotmodels robots
  robotmodels info rx90
  robotmodels igm rx90 --xyz 0.3 0.2 0.5 --rpy 0 90 45 --degrees
  robotmodels COMMAND --help"""


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command."""
    words = list(sys.argv[1:] if argv is None else argv)
    with prepared():
        try:
            return int(_run(words))
        except SystemExit as stop:  # of argparse: help, version, or a wrong argument
            return int(stop.code) if isinstance(stop.code, int) else 2


def parser_of(command: str | None) -> tuple[Parser, Parser | None]:
    """The parser, with all options of one command and the names of the others."""
    parser = Parser(
        prog="robotmodels",
        description="Kinematics, dynamics, calibration and identification of robot manipulators "
        "from their Khalil-Kleinfinger table or their URDF. SI units and radians, unless an option "
        "states otherwise.",
        epilog=f"{_EXAMPLES}\n\n{statuses()}",
    )
    parser.add_argument("--version", action="version", version=f"robotmodels {__version__}",
                        help="show the version and exit; --version -v (or --verbose) shows those "
                        "of Python and the libraries too")  # fmt: skip
    _add_traceback(parser)
    commands: Any = parser.add_subparsers(dest="command", metavar="COMMAND")
    own: Parser | None = None
    for name, summary in COMMANDS.items():
        if name == command:
            module: Any = importlib.import_module(f".{name}", __package__)
            texts = {
                "usage": getattr(module, "USAGE", None),
                "description": module.DESCRIPTION,
                "epilog": ending(module.EXAMPLES, getattr(module, "NOT_REACHED", None)),
            }
            own = commands.add_parser(name, help=summary, **texts)
            assert own is not None
            add_options(own, module.OPTIONS)
            own.set_defaults(run=module.run, options=own.options)
            _add_traceback(own)
        else:
            commands.add_parser(name, help=summary)
    return parser, own


def _add_traceback(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--traceback", action="store_true", default=argparse.SUPPRESS,
                        help="after an error, show where it came from")  # fmt: skip


def _run(words: list[str]) -> int:
    command = next((word for word in words if not word.startswith("-")), None)
    options: list[str] = []
    code: int | None = ExitStatus.DONE
    try:
        parser, own = parser_of(command)
        if own is not None:
            options = own.options()
            arguments, rest = parser.parse_known_args(joined(words, own.options(True)))
            if rest:
                own.refuse(rest)
            result = arguments.run(arguments)
            code = hand_over(result, arguments) if isinstance(result, Report) else result
        elif command is None and "--version" in words and {"-v", "--verbose"} & {*words}:
            print(show_versions())
        elif command is None:
            parser.parse_args(words)
            parser.error(f"which command? There are {', '.join(COMMANDS)}")
        else:
            near = nearest_names(command, COMMANDS)
            meant = f"Did you mean {' or '.join(near)}? " if near else ""
            parser.error(f"no command {command!r}. {meant}There are {', '.join(COMMANDS)}")
        sys.stdout.flush()
        return code or ExitStatus.DONE
    except BrokenPipeError:  # the reader (head, a pager) has seen enough
        give_up_output()
        return code or ExitStatus.DONE
    except KeyboardInterrupt:
        say("interrupted.")
        return ExitStatus.INTERRUPTED
    except Exception as error:  # noqa: BLE001  # nobody asked for a traceback at a terminal
        if "--traceback" in words:
            traceback.print_exc()
        message, status = _outcome(error, options)
        say(message)
        return status


def _outcome(error: Exception, options: Sequence[str]) -> tuple[str, ExitStatus]:
    """Message of an error, and the exit status."""
    if isinstance(error, RobotModelsError):
        return in_options(str(error), options), ExitStatus.WRONG_INPUT
    if isinstance(error, OSError):
        text = error.strerror or str(error) or type(error).__name__
        if error.filename is not None:
            return f"{text}: {error.filename}", ExitStatus.WRONG_INPUT
        give_up_output()  # perhaps a full disk behind standard output
        return f"{text}.", ExitStatus.WRONG_INPUT
    if isinstance(error, MemoryError):
        return "there is not enough memory for this.", ExitStatus.WRONG_INPUT
    message = (
        f"this is a bug: {type(error).__name__}: {error}. Please report it as an issue of the "
        "repository of robotmodels, with what the same command prints with --traceback."
    )
    return message, ExitStatus.BUG
