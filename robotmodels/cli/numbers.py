"""Lists of numbers on the command line: ``--q 0.1 -0.5``, ``--q 0.1,-0.5`` and ``--q=-0.5,0.1``."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .._arrays import Array
from ..errors import InvalidValueError, nearest_names
from ..geometry import REVOLUTE
from ..model import RobotModel

NUMBER_OPTIONS = (
    "--q", "--q-ref", "--xyz", "--rpy", "--matrix", "--mask", "--tolerance", "--arm-angle",
    "--sigma", "--prior", "--velocity", "--acceleration", "--torque-limits", "--box", "--keep-out",
    "--gears", "--drive-gains", "--signs", "--offsets", "--dead-band", "--kp", "--kd", "--delay",
    "--dt", "--cutoff", "--edges", "--test-share",
    "--held-out", "--duration", "--rate",
)  # fmt: skip
"""Options that take numbers, which may be negative."""


def joined(argv: Sequence[str]) -> list[str]:
    """Put the numbers behind an option into one word, ``--q -1 1e-3`` into ``--q=-1,1e-3``."""
    words: list[str] = []
    rest = list(argv)
    while rest:
        word = rest.pop(0)
        taken: list[str] = []
        if word in NUMBER_OPTIONS:
            while rest and _is_list(rest[0]):
                taken.append(rest.pop(0))
        words.append(f"{word}={','.join(taken)}" if taken else word)
    return words


def numbers(text: str, count: int | Sequence[int], option: str, positive: bool = False) -> Array:
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
    if positive and not (values > 0.0).all():
        raise InvalidValueError(f"{option}: expected positive numbers, got {text!r}.")
    return values


def joint_numbers(
    text: str | None, n: int, option: str, positive: bool = False
) -> Array | float | None:
    """One number for all joints, or one for each."""
    if text is None:
        return None
    values = numbers(text, sorted({1, n}), option, positive)
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
