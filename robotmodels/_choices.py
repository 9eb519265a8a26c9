"""Members of enums and instances of types in arguments."""

from __future__ import annotations

from enum import Enum
from typing import Any, TypeVar

from .errors import InvalidValueError

E = TypeVar("E", bound=Enum)
R = TypeVar("R")


def chosen(kind: type[E], value: Any, name: str) -> E:
    """Member of an enum from itself or from its name, in any case, with ``-``, ``_`` or blanks."""
    if isinstance(value, kind):
        return value
    if isinstance(value, str):
        word = value.strip().upper().replace("-", "_").replace(" ", "_")
        if word in kind.__members__:
            return kind[word]
    words = ", ".join(repr(member.lower()) for member in kind.__members__)
    raise InvalidValueError(
        f"{name}: expected one of {words}, or a member of {kind.__name__}, got {value!r:.80}."
    )


def one_of(value: Any, words: tuple[str, ...], name: str) -> str:
    """One of several words, exactly as they are written."""
    if not isinstance(value, str) or value not in words:
        listed = ", ".join(map(repr, words))
        raise InvalidValueError(f"{name}: expected one of {listed}, got {value!r:.60}.")
    return value


def as_instance(value: Any, kind: type[R], name: str, advice: str = "") -> R:
    """The value if it is of the expected type."""
    if not isinstance(value, kind):
        article = "an" if kind.__name__[0] in "AEIOU" else "a"
        raise InvalidValueError(
            f"{name}: expected {article} {kind.__name__}{advice}, got {type(value).__name__}."
        )
    return value
