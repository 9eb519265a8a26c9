"""Results: read-only, compared by value, with NaN rows where nothing was found."""

from __future__ import annotations

from dataclasses import fields
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from .._arrays import Rebuilt, value_hash
from .._outcomes import Outcome
from ..errors import InvalidValueError


class Result(Rebuilt):
    """Base of results; of batches they have a ``status`` (...) and perhaps ``valid`` (..., S)."""

    __slots__ = ()
    outcomes: ClassVar[type[Outcome]]

    def __post_init__(self) -> None:
        for value in self._values:
            if isinstance(value, np.ndarray):
                value.flags.writeable = False

    @property
    def _values(self) -> tuple[Any, ...]:
        return tuple(getattr(self, f.name) for f in fields(self))  # type: ignore[arg-type]

    @property
    def count(self) -> NDArray[np.int64]:
        """Number of solutions of each row, shape (...)."""
        return self.valid.sum(axis=-1)  # type: ignore[attr-defined]

    def reason(self, i: int | tuple[int, ...] = ()) -> str:
        """Outcome of row i as a sentence; i is left out for a single row."""
        status = np.asarray(self.status)  # type: ignore[attr-defined]
        try:
            return self.outcomes(int(status[i])).sentence
        except (IndexError, TypeError):
            raise InvalidValueError(
                f"i: expected the index of a row of a batch of shape {status.shape}, got {i!r:.40}."
            ) from None

    def __eq__(self, other: object) -> bool:
        return type(other) is type(self) and all(map(_same, self._values, other._values))  # type: ignore[attr-defined]

    def __hash__(self) -> int:
        return value_hash(type(self).__name__, *self._values)

    def __repr__(self) -> str:
        named = zip((f.name for f in fields(self)), self._values, strict=True)  # type: ignore[arg-type]
        shapes = [f"{name} {x.shape}" for name, x in named if isinstance(x, np.ndarray)]
        return f"<{type(self).__name__}: {', '.join(shapes)}>"


def _same(a: Any, b: Any) -> bool:
    """Equality of fields; NaN equals NaN."""
    return np.array_equal(a, b, equal_nan=np.asarray(a).dtype.kind == "f")
