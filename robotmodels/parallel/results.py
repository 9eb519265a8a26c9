"""Results of this room: read-only, compared by value, with NaN rows where nothing was found."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np

from .._arrays import Frozen, value_hash
from ..errors import InvalidValueError


class Result(Frozen):
    """Base of results of batches."""

    __slots__ = ()

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        names = [f.name for f in fields(self)]  # type: ignore[arg-type]
        return all(_same(getattr(self, name), getattr(other, name)) for name in names)

    def __repr__(self) -> str:
        parts = [(f.name, getattr(self, f.name)) for f in fields(self)]  # type: ignore[arg-type]
        shapes = [f"{name} {np.shape(x)}" for name, x in parts if isinstance(x, np.ndarray)]
        return f"<{type(self).__name__}: {', '.join(shapes)}>"

    def __hash__(self) -> int:
        values = [getattr(self, f.name) for f in fields(self)]  # type: ignore[arg-type]
        return value_hash(type(self).__name__, *values)


def _same(a: Any, b: Any) -> bool:
    """Equality of fields; NaN equals NaN."""
    if isinstance(a, np.ndarray) and isinstance(b, np.ndarray):
        return np.array_equal(a, b, equal_nan=a.dtype.kind == "f" and b.dtype.kind == "f")
    return bool(a == b)


def at_index(array: Any, i: int | tuple[int, ...]) -> Any:
    """One element of a batch."""
    try:
        element = np.asarray(array)[i]
    except (IndexError, TypeError):
        element = None
    if element is None or np.ndim(element):
        raise InvalidValueError(
            f"i: expected the index of one row of a batch of shape {np.shape(array)}, got {i!r:.40}."
        )
    return element
