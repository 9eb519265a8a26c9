"""Members of enums at the border: given as they are, or by their names in words."""

from __future__ import annotations

from enum import Enum
from typing import Any, TypeVar

from .errors import InvalidValueError

E = TypeVar("E", bound=Enum)


def chosen(kind: type[E], value: Any, name: str) -> E:
    """A member of an enum: the member itself, or its name in any case, with ``-``, ``_`` or blanks.

    Parameters
    ----------
    kind : type
        The enum.
    value : member or str
        What the caller passed.
    name : str
        Used in error messages.

    Returns
    -------
    member
        Of ``kind``.

    Raises
    ------
    InvalidValueError
        Something else; the message lists the members.

    Examples
    --------
    >>> class Law(Enum):
    ...     BANG_BANG = 1
    ...     CUBIC = 2
    >>> chosen(Law, "bang-bang", "law")
    <Law.BANG_BANG: 1>
    """
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
