"""Messages of the package in the words of the command line: options in place of arguments."""

from __future__ import annotations

import re
import shlex
from collections.abc import Collection

_WHOLE = (
    ("transmission=model.transmission", "--motor-side"),
    ("transmission=", "--motor-side"),
    ("checked=False", "--no-check"),
    ("time=False", "--time none"),
    ("velocities=False", "--velocities none"),
    ("accelerations=False", "--accelerations none"),
    ("times='ms', 'us' or 'ns'", "--times ms, us or ns"),
    ("base=False", "--fixed-base"),
    ("tool=False", "--fixed-tool"),
    (" of read_log", ""),
    ("All names: robots().", "All names: robotmodels robots."),
    ("use RobotModel.from_urdf(path, base_link, tip_link)",
     "give its path, with --base-link and --tip-link"),
    ("Measure a distance (KnownDistance, Distance)", "Give a distance (--known-distance)"),
    ("Choose configurations with select_configurations", "Measure other postures"),
    (" (named=...)", " (in Python: named=...)"),
    ("Give the model masses (with_inertia)", "Give the URDF of the robot masses (<inertial>)"),
    ("Pass metres: multiply", "In metres: multiply"),
)  # fmt: skip
"""Words of the package, and the option of the same meaning."""
_OTHER_NAMES = {
    "position_references": "--references",
    "rng": "--seed",
    "baseline": "--random",
    "position_tolerance": "--tolerance",
    "orientation_tolerance": "--tolerance",
    "kind": "--orientation",  # where --kind is one of the words of the command line
}
"""Arguments whose option has another name."""
_ARGUMENT = re.compile(
    r"(?<![\w-])([a-z_]+)="
    r"(?:\[\.{3}\]|\(\.{3}\)|\.{3}|True|\(([^()]*)\)|'([^']*)'|([0-9]+(?:\.[0-9]+)?))?"
)
_FIRST = re.compile(r"^([a-z_]+)(?=: )")


def in_options(message: str, options: Collection[str]) -> str:
    """Replace the argument names in a message by the options of a command."""
    for words, option in _WHOLE:
        if not option.startswith("--") or option.split()[0] in options:
            message = message.replace(words, option)

    def option_of(name: str) -> str | None:
        candidates = (_OTHER_NAMES.get(name), "--" + name.replace("_", "-"))
        return next((option for option in candidates if option in options), None)

    def with_value(match: re.Match[str]) -> str:
        name, words, word, number = match.groups()
        option = option_of(name)
        if option is None:
            return match.group()
        values = [shlex.quote(word)] if word else [number] if number else []
        values += [each.strip(" '") for each in (words or "").split(",") if each.strip(" '")]
        return " ".join([option, *values])

    message = _ARGUMENT.sub(with_value, message)
    return _FIRST.sub(lambda match: option_of(match[1]) or match[1], message)
