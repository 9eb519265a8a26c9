"""Options as text, and arguments that commands share: the robot, numbers, postures, columns."""

from __future__ import annotations

import argparse
import re
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from .._arrays import Array
from ..errors import InvalidValueError, nearest_names
from ..geometry import REVOLUTE
from ..model import RobotModel
from ..robots import load

SHARED = {
    "robot": """
robot [] a name of the catalogue (rx90, erd:ur5), a .urdf or a SYMORO .par file
@urdf""",
    "robot_option": """
--robot [required] a name of the catalogue (rx90, erd:ur5), a .urdf or a SYMORO .par file
@urdf""",
    "urdf": """
--base-link [] URDF only: link whose frame is the world
--tip-link [] URDF only: link whose frame is the tool
--package-dir FOLDER [repeated] URDF only: folder that holds packages with meshes; may be repeated
--mimic [flag] URDF only: mimic joints follow the joint they mimic; without it they are
    independent""",
    "units": """
--angles [rad|deg =rad] unit of angles in the files
--lengths [m|mm =m] unit of lengths, also of prismatic joints, in the files""",
    "delimiter": r"""
--delimiter CHARACTER [character] between cells, \t for a tab (default: ; tab or , as found)""",
    "mask": """
--mask NUMBERS [] 1 or 0 for each of x y z rx ry rz: what has to be met; or one of the words
    position, xyz (the same) and orientation""",
    "degrees": """
--degrees [flag] angles in degrees, those given and those printed""",
    "no_limits": """
--no-limits [flag] leave the joint limits out""",
    "output": """
what is handed over:
--out FOLDER [path] write files into this folder (made if it is not there)
@json
@quiet""",
    "json": """
--json [flag] print JSON in place of text; null is what is not finite or not known""",
    "quiet": """
--quiet [flag] no progress bar (there is none either where standard error is not a terminal)""",
}
"""Options of several commands."""
_OPTION = re.compile(r"(\S+)(?: (.+?))? \[(.*?)\] (.+)")


def add_options(parser: argparse.ArgumentParser, text: str) -> None:
    """Add arguments of a text: ``--name METAVAR [traits] help``; indented lines go on."""
    # Traits: flag, required, repeated, a number of words (an integer, + or *), int, float, path,
    # character, choices (a|b), and at last the default (=a). A line that ends with a colon begins
    # a group, @name stands for options of SHARED.
    group: Any = parser
    while "@" in text:
        text = re.sub(r"^@(\w+)$", lambda match: SHARED[match[1]].strip(), text, flags=re.MULTILINE)
    for lines in re.split(r"\n(?! )", text.strip()):
        entry = " ".join(lines.split())
        if entry.endswith(":"):
            group = parser.add_argument_group(entry[:-1])
            continue
        found = _OPTION.fullmatch(entry)
        assert found is not None, entry
        name, metavar, traits, words = found.groups()
        if not traits.endswith("=") and "=" in traits and "default" not in words:
            words += " (default: %(default)s)"
        group.add_argument(name, help=words, **_settings(metavar, traits))


def _settings(metavar: str | None, traits: str) -> dict[str, Any]:
    """Settings of an argument."""
    types: dict[str, Any] = {"int": int, "float": float, "path": Path, "character": _character}
    words, equals, default = traits.partition("=")
    settings: dict[str, Any] = {}
    for word in words.split():
        if word == "flag":
            settings["action"] = "store_true"
        elif word == "repeated":
            settings |= {"action": "append", "default": []}
        elif word == "required":
            settings["required"] = True
        elif word in types:
            settings["type"] = types[word]
        elif "|" in word:
            settings["choices"] = [settings.get("type", str)(x) for x in word.split("|")]
        else:
            settings["nargs"] = int(word) if word.isdecimal() else word
    if equals:
        many = "nargs" in settings
        settings["default"] = default.split() if many else settings.get("type", str)(default)
    if metavar is not None:
        many = isinstance(settings.get("nargs"), int)
        settings["metavar"] = tuple(metavar.split()) if many else metavar
    return settings


def robot_of(arguments: argparse.Namespace) -> RobotModel:
    """Load the robot of the command line."""
    name, options = arguments.robot, ("base_link", "tip_link", "package_dir", "mimic")
    if not any(getattr(arguments, option) for option in options):
        return load(name)
    if Path(name).suffix.lower() not in (".urdf", ".xml", ".xacro"):
        raise InvalidValueError(
            f"--base-link, --tip-link, --package-dir and --mimic are for URDF files, got {name!r}."
        )
    return RobotModel.from_urdf(
        name, arguments.base_link, arguments.tip_link, package_dirs=arguments.package_dir,
        mimic=arguments.mimic,
    )  # fmt: skip


def joined(argv: Sequence[str], options: Collection[str]) -> list[str]:
    """Put numbers behind one of the options into one word, ``--q -1 1e-3`` into ``--q=-1,1e-3``."""
    words: list[str] = []
    for word in argv:
        option, equals, taken = words[-1].partition("=") if words else ("", "", "")
        if option in options and _is_list(word) and (not equals or _is_list(taken)):
            words[-1] += f"{',' if equals else '='}{word}"
        else:
            words.append(word)
    return words


def numbers(text: str, count: int | Sequence[int], option: str) -> Array:
    """Numbers of an option. Shapes: -> (count,)."""
    counts = (count,) if isinstance(count, int) else tuple(count)
    try:
        values = np.array([float(word) for word in _words(text)])
    except ValueError:
        values = np.empty(0)
    if values.size not in counts or not np.isfinite(values).all():
        wanted = " or ".join(map(str, counts))
        what = "finite number" + "s" * (counts != (1,))
        raise InvalidValueError(f"{option}: expected {wanted} {what}, got {text!r}.")
    return values


def joint_numbers(text: str | None, n: int | Sequence[int], option: str) -> Array | float | None:
    """One number for all joints, or one for each (or another count of numbers)."""
    if text is None:
        return None
    values = numbers(text, sorted({1, n}) if isinstance(n, int) else n, option)
    return float(values[0]) if len(values) == 1 else values


def posture(text: str, model: RobotModel, option: str, degrees: bool) -> Array:
    """Joint variables from numbers, or from the name of a configuration of the robot."""
    named = model.configurations.get(text)
    if named is not None:
        return named
    try:
        q = numbers(text, model.n, option)
    except InvalidValueError:
        names = ", ".join(model.configurations)
        near = nearest_names(text, model.configurations)
        meant = f" Did you mean {near[0]!r}?" if near else ""
        raise InvalidValueError(
            f"{option}: expected {model.n} numbers, or the name of a configuration ({names}), "
            f"got {text!r}.{meant}"
        ) from None
    return np.deg2rad(q, out=q, where=revolute(model)) if degrees else q


def revolute(model: RobotModel) -> np.ndarray:
    """Which joints are revolute, whose variables may be in degrees."""
    return model.table.sigma[model.table.joint_rows] == REVOLUTE


def _words(text: str) -> list[str]:
    for mark in "[],":
        text = text.replace(mark, " ")
    return text.split()


def _is_list(word: str) -> bool:
    """Whether a word of the command line holds nothing but numbers."""
    try:
        return bool([float(number) for number in _words(word)])
    except ValueError:
        return False


def column(word: str) -> int | str:
    """Column by its number or its name."""
    return int(word) if word.lstrip("-").isdecimal() else word


def given(arguments: argparse.Namespace, *names: str) -> dict[str, Any]:
    """Some of the arguments by their names, as they are."""
    return {name: getattr(arguments, name) for name in names}


def columns(words: list[str] | None) -> list[int | str] | None:
    """Columns of an option that may be missing."""
    return None if words is None else [column(word) for word in words]


def _character(text: str) -> str:
    return text.replace(r"\t", "\t")
