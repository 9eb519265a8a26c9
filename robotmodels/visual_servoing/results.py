"""Bases of descriptions and results: equal by value, printed in one line."""

from __future__ import annotations

from dataclasses import fields
from operator import index
from typing import Any, ClassVar

import numpy as np

from .. import _arrays
from .._outcomes import Outcome
from ..errors import InvalidValueError


def brief(value: Any) -> str:
    """One line for a value with arrays: those of more than six numbers by their shapes."""
    given = [(f.name, getattr(value, f.name)) for f in fields(value) if f.init]
    texts = [
        f"{name}=<{entry.shape} array>"
        if isinstance(entry, np.ndarray) and entry.size > 6
        else f"{name}={' '.join(repr(entry).split())}"
        for name, entry in given
    ]
    return f"{type(value).__name__}({', '.join(texts)})"


class Value(_arrays.Value):
    """Base of descriptions."""

    __slots__ = ()
    __repr__ = brief


class Result(_arrays.Frozen):
    """Base of results: equal if their fields are, where NaN equals NaN."""

    __slots__ = ()
    _outcome: ClassVar[type[Outcome]]
    __repr__ = brief

    def _key(self) -> tuple[Any, ...]:
        return tuple(
            (e.shape, e.tolist() if e.dtype.kind == "U" else (e + 0.0).tobytes())
            if isinstance(e, np.ndarray)
            else e
            for e in (getattr(self, f.name) for f in fields(self))  # type: ignore[arg-type]
        )

    def __eq__(self, other: object) -> bool:
        return type(other) is type(self) and self._key() == other._key()  # type: ignore[attr-defined]

    def __hash__(self) -> int:
        return hash(str(self._key()))

    def reason(self, i: int | tuple[int, ...] = ()) -> str:
        """Sentence of the status, of row i in a batch."""
        codes = np.asarray(self.status)  # type: ignore[attr-defined]
        try:
            return self._outcome(index(codes[i if codes.ndim else ()])).sentence
        except (IndexError, TypeError):
            raise InvalidValueError(
                f"i: expected the index of one row of {codes.shape}, got {i!r}."
            ) from None
