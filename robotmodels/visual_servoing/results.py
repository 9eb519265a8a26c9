"""Results: read-only, equal by value, printed in one line."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np

from .._arrays import Frozen, value_hash
from ..errors import InvalidValueError

_SHOWN = 6  # numbers of an array that are printed


class Result(Frozen):
    """Base of results: equal if their fields are, where NaN equals NaN."""

    __slots__ = ()

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        pairs = [(getattr(self, f.name), getattr(other, f.name)) for f in fields(self)]  # type: ignore[arg-type]
        return all(
            np.array_equal(a, b, equal_nan=a.dtype.kind == "f")
            if isinstance(a, np.ndarray) and isinstance(b, np.ndarray)
            else bool(a == b)
            for a, b in pairs
        )

    def __hash__(self) -> int:
        return value_hash(*(getattr(self, f.name) for f in fields(self)))  # type: ignore[arg-type]

    def __repr__(self) -> str:
        return brief(self)


def code_of(status: Any, i: Any) -> int:
    """Code of row i of a batch of codes, or the code of one result."""
    codes = np.asarray(status)
    try:
        code = np.asarray(codes[i] if codes.ndim else codes)
    except (IndexError, TypeError):
        code = np.zeros(1)
    if code.ndim:
        raise InvalidValueError(f"i: expected the index of one row of {codes.shape}, got {i!r}.")
    return int(code)


def brief(value: Any) -> str:
    """One line for a value with arrays: those of more than six numbers by their shapes."""
    parts = []
    for f in fields(value):
        if f.init:
            entry = getattr(value, f.name)
            long = isinstance(entry, np.ndarray) and entry.size > _SHOWN
            text = f"<{entry.shape} array>" if long else f"{entry!r}"
            parts.append(f"{f.name}={' '.join(text.split())}")
    return f"{type(value).__name__}({', '.join(parts)})"
