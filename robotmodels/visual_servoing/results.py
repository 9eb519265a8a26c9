"""Bases of descriptions and results: equal by value, printed in one line."""

from __future__ import annotations

from dataclasses import fields
from operator import index
from typing import Any, ClassVar

import numpy as np

from .. import _arrays
from .._arrays import Array
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
            (e.shape, (e + 0.0 if e.dtype.kind == "f" else e).tobytes())
            if isinstance(e, np.ndarray)
            else e
            for e in (getattr(self, f.name) for f in fields(self))  # type: ignore[arg-type]
        )

    def __eq__(self, other: object) -> bool:
        return type(other) is type(self) and self._key() == other._key()  # type: ignore[attr-defined]

    def __hash__(self) -> int:
        return hash(self._key())

    def reason(self, i: int | tuple[int, ...] = ()) -> str:
        """Sentence of the status, of row i in a batch."""
        codes = np.asarray(self.status)  # type: ignore[attr-defined]
        try:
            return self._outcome(index(codes[i if codes.ndim else ()])).sentence
        except (IndexError, TypeError):
            raise InvalidValueError(
                f"i: expected the index of one row of {codes.shape}, got {i!r}."
            ) from None


def taken(x: Array, order: Any) -> Array:
    """Rows of solutions in an order. Shapes: x (..., S, *core), order (..., s)."""
    core = (1,) * (x.ndim - order.ndim)
    return np.take_along_axis(x, order.reshape(*order.shape, *core), order.ndim - 1)


def packed(valid: Any, *solutions: Array) -> list[Any]:
    """Flags and solutions with the valid rows first and NaN in the others, as few as possible."""
    order = np.argsort(~valid, axis=-1, kind="stable")
    order = order[..., : int(valid.sum(axis=-1).max(initial=0))]
    kept = taken(valid, order)
    core = [(1,) * (x.ndim - kept.ndim) for x in solutions]
    return [kept] + [
        np.where(kept.reshape(*kept.shape, *k), taken(x, order), np.nan)
        for x, k in zip(solutions, core, strict=True)
    ]
