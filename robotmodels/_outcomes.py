"""Outcomes of the mathematics: small numbers, a row each, whose value is a sentence."""

from __future__ import annotations

from enum import IntEnum
from operator import index
from typing import ClassVar, Self

import numpy as np

from ._arrays import Frozen, Value
from .errors import InvalidValueError


class Outcome(IntEnum):
    """Base of status codes: a number that fits int8 and a sentence that explains it."""

    sentence: str

    def __new__(cls, value: int, sentence: str = "") -> Self:
        """Attach the sentence to the number."""
        outcome = int.__new__(cls, value)
        outcome._value_ = value
        outcome.sentence = sentence
        return outcome


class Result(Frozen, Value):
    """Base of results whose ``status`` is an `Outcome`, or codes of one, shape (...).

    Arrays are read-only, and results are equal if their fields are.
    """

    __slots__ = ()
    outcomes: ClassVar[type[Outcome]]

    def outcome(self, i: int | tuple[int, ...] = ()) -> Outcome:
        """Outcome of row i; i is left out for a single row."""
        status = self.status  # type: ignore[attr-defined]
        if isinstance(status, Outcome):
            return status
        codes = np.asarray(status)
        try:  # a single row is also the first of one
            return self.outcomes(index(codes[() if codes.ndim == 0 and i in (0, (0,)) else i]))
        except (IndexError, TypeError, ValueError):
            raise InvalidValueError(
                f"i: expected the index of one row among {codes.shape}, got {i!r:.40}."
            ) from None

    def reason(self, i: int | tuple[int, ...] = ()) -> str:
        """Outcome of row i as a sentence; i is left out for a single row."""
        return self.outcome(i).sentence

    def __repr__(self) -> str:
        """The sentence of a single row or the count of the outcomes of several, then the fields."""
        single = np.ndim(self.status) == 0  # type: ignore[attr-defined]
        summary = self.reason() if single else f"{self.counted}."
        return f"<{type(self).__name__}: {summary} {self._texts(Outcome, Value)}>"

    @property
    def counted(self) -> str:
        """Number of rows with each outcome, in words."""
        codes, numbers = np.unique(self.status, return_counts=True)  # type: ignore[attr-defined]
        pairs = zip(codes, numbers, strict=True)
        return ", ".join(f"{m} {self.outcomes(int(c)).name}" for c, m in pairs) or "empty"
