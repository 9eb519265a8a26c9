"""Checks of the parts of a robot: types, sizes, and that they fit each other."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from .. import se3
from .._arrays import Array, as_exact, read_only
from ..errors import FrameNotFoundError, InvalidValueError, ShapeError
from ..geometry import NOT_XML, DHTable


def check_table(table: object) -> None:
    """Refuse anything but a table."""
    if not isinstance(table, DHTable):
        raise InvalidValueError(
            f"table: expected a DHTable, got {type(table).__name__}; build one with "
            "DHTable.from_rows(...)."
        )


def check_name(name: object) -> None:
    """Refuse a name that a URDF cannot hold."""
    if not isinstance(name, str) or not name:
        raise InvalidValueError(f"name: expected a text that is not empty, got {name!r:.80}.")
    if NOT_XML.search(name):
        raise InvalidValueError(
            f"name: {name!r:.80} holds a control character; a URDF cannot hold it."
        )


def check_tip(tip: object, f: int) -> None:
    """Refuse anything but the number of one of f frames."""
    if not isinstance(tip, (int, np.integer)) or not 1 <= tip <= f:
        raise FrameNotFoundError(
            "frame number", tip, map(str, range(1, f + 1)), "tip is a number, 1 to f."
        )


def check_count(part: Any, kind: type, name: str, letter: str, expected: int) -> None:
    """Refuse parameters of another kind, or of another number of frames (f) or joints (n)."""
    if not isinstance(part, kind):
        raise InvalidValueError(f"{name}: expected {kind.__name__}, got {type(part).__name__}.")
    got = getattr(part, letter)
    if got != expected:
        what = "frames" if letter == "f" else "moving joints"
        raise ShapeError(
            f"{name}: expected parameters of the {expected} {what} of the table, got {got}."
        )


def checked_postures(configurations: object, n: int) -> Mapping[str, Array]:
    """Named postures of n joints that nobody can change, ``"zero"`` among them."""
    if not isinstance(configurations, Mapping):
        raise InvalidValueError(
            "configurations: expected a mapping of names to joint vectors, got "
            f"{type(configurations).__name__}."
        )
    postures = {"zero": np.zeros(n), **configurations}
    if np.any(postures["zero"]):
        raise InvalidValueError("configuration 'zero' is q = 0; give yours another name.")
    return MappingProxyType({
        key: read_only(as_exact(value, (n,), f"configuration {key!r}"))
        for key, value in postures.items()
    })  # fmt: skip


def placed(value: Any, name: str) -> Array:
    """A pose (4, 4) from itself, or from a position (3,)."""
    if not hasattr(value, "homogeneous") and np.shape(value) != (4, 4):
        return se3.translation(*as_exact(value, (3,), name))
    return se3.as_single_pose(value, name)
