"""Errors and warnings: each states the expected value, the given value and the remedy."""

from __future__ import annotations

import copyreg
import difflib
from collections.abc import Iterable

__all__ = [
    "FrameNotFoundError",
    "InertiaError",
    "InvalidValueError",
    "LoopError",
    "MeshNotFoundError",
    "MissingExtraError",
    "NotARotationError",
    "ParFileError",
    "RobotModelsError",
    "RobotModelsWarning",
    "RobotNotFoundError",
    "ShapeError",
    "SingularMassMatrixError",
    "TableError",
    "UrdfError",
    "UrdfWarning",
]


class RobotModelsError(Exception):
    """Base of every error this package raises on purpose."""


class ShapeError(RobotModelsError, ValueError):
    """An array has the wrong shape."""


class InvalidValueError(RobotModelsError, ValueError):
    """A value is not allowed: NaN, infinity, a wrong kind, an unknown option."""


class NotARotationError(InvalidValueError):
    """The upper left 3x3 block of a pose is not a rotation matrix."""


class TableError(RobotModelsError, ValueError):
    """A geometric table contradicts itself: antecedents, joint types, limits or names."""


class InertiaError(RobotModelsError, ValueError):
    """Inertial or drive parameters that are impossible."""


class SingularMassMatrixError(RobotModelsError, ValueError):
    """The direct dynamic model has no solution: the mass matrix cannot be inverted."""


class LoopError(RobotModelsError, ValueError):
    """Closures or actuated joints of a looped robot that do not determine its motion."""


class UrdfError(RobotModelsError, ValueError):
    """A URDF cannot be read or written."""


class MeshNotFoundError(UrdfError, FileNotFoundError):
    """A mesh file that a URDF names is not where it was looked for."""


class ParFileError(RobotModelsError, ValueError):
    """A SYMORO ``.par`` file cannot be read."""


class MissingExtraError(RobotModelsError, ImportError):
    """An optional package is not installed."""


_LISTED = 12
"""Most names in a message."""


class _NameNotFoundError(RobotModelsError, KeyError):
    """A name is unknown; the nearest known ones are in the message and in ``nearest``."""

    def __init__(self, kind: str, name: object, known: Iterable[str], advice: str = "") -> None:
        known = tuple(known)
        self.name = name
        self.known = known
        self.nearest = tuple(nearest_names(str(name), known))
        hint = f" Did you mean {_listed(self.nearest)}?" if self.nearest else ""
        few = known if len(known) <= _LISTED or not self.nearest else ()
        left = len(few) - _LISTED
        shown = _listed(few[:_LISTED]) + (f" and {left} more" if left > 0 else "")
        listing = f" Known: {shown}." if few or not known else ""
        super().__init__(f"No {kind} {name!r}.{hint}{listing} {advice}".rstrip())

    def __str__(self) -> str:  # KeyError would show the repr of the sentence
        return str(self.args[0])

    def __reduce__(self) -> tuple[object, ...]:  # the message is built from other arguments
        return copyreg.__newobj__, (type(self), self.args[0]), self.__dict__  # type: ignore[attr-defined]


class FrameNotFoundError(_NameNotFoundError):
    """The model has no frame of this name or number."""


class RobotNotFoundError(_NameNotFoundError):
    """The catalogue has no robot of this name."""


class RobotModelsWarning(UserWarning):
    """Base of the warnings of this package."""


class UrdfWarning(RobotModelsWarning):
    """A URDF cannot hold a property of a model, or a model one of a URDF."""


def nearest_names(name: str, known: Iterable[str], count: int = 3) -> list[str]:
    """The known names closest to a misspelt one, ignoring case."""
    by_key = {k.lower(): k for k in known}
    return [by_key[k] for k in difflib.get_close_matches(name.lower(), by_key, count, 0.5)]


def _listed(names: Iterable[str]) -> str:
    return ", ".join(repr(n) for n in names) or "none"
