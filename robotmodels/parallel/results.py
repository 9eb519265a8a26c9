"""Results of this room: read-only, compared by value, with NaN rows where nothing was found."""

from __future__ import annotations

from dataclasses import fields
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from .._arrays import Frozen, value_hash
from .._outcomes import Outcome
from ..errors import InvalidValueError


class Result(Frozen):
    """Base of results; of batches they have a ``status`` (...) and perhaps ``valid`` (..., S)."""

    __slots__ = ()
    outcomes: ClassVar[type[Outcome]]

    @property
    def count(self) -> NDArray[np.int64]:
        """Number of solutions of each row, shape (...)."""
        return self.valid.sum(axis=-1)  # type: ignore[attr-defined]

    def reason(self, i: int | tuple[int, ...] = ()) -> str:
        """Outcome of row i as a sentence; i is left out for a single row."""
        return self.outcomes(int(at_index(self.status, i))).sentence  # type: ignore[attr-defined]

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return all(map(_same, _values(self), _values(other)))

    def __repr__(self) -> str:
        names = [f.name for f in fields(self)]  # type: ignore[arg-type]
        shapes = [
            f"{name} {np.shape(value)}"
            for name, value in zip(names, _values(self), strict=True)
            if isinstance(value, np.ndarray)
        ]
        return f"<{type(self).__name__}: {', '.join(shapes)}>"

    def __hash__(self) -> int:
        return value_hash(type(self).__name__, *_values(self))


def _values(result: Any) -> list[Any]:
    """Fields of a result."""
    return [getattr(result, f.name) for f in fields(result)]


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
            f"i: expected the index of a row of a batch of shape {np.shape(array)}, got {i!r:.40}."
        )
    return element
