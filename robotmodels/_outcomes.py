"""Outcomes of the mathematics: small numbers, a row each, whose value is a sentence."""

from __future__ import annotations

from enum import IntEnum
from typing import Self


class Outcome(IntEnum):
    """Base of status codes: a number that fits int8 and the sentence a person reads."""

    sentence: str

    def __new__(cls, value: int, sentence: str = "") -> Self:
        """Attach the sentence to the number."""
        outcome = int.__new__(cls, value)
        outcome._value_ = value
        outcome.sentence = sentence
        return outcome
