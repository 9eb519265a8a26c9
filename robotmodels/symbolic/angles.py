"""Angles as sums of joint variables, named constants and exact fractions of pi."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from fractions import Fraction
from math import pi
from typing import Any

ROUNDING = 1e-13
"""Angles this close to a multiple of 30 or 45 degrees are exact; shorter lengths are zero."""


@dataclass(frozen=True, slots=True)
class Term:
    """Signed term of an angle: a joint variable, or a constant with its value."""

    symbol: Any
    letters: str  # in the names of sines and cosines
    sign: int = 1
    joint: int = 0  # number of its frame, 0 for a constant
    value: float = 0.0


@dataclass(frozen=True, slots=True)
class Angle:
    """A signed sum of joint variables, named constants and a rational multiple of pi."""

    terms: tuple[Term, ...] = ()  # joints in order, then constants
    turns: Fraction = Fraction(0)  # multiple of pi

    @property
    def joints(self) -> tuple[int, ...]:
        """Numbers of the frames whose variables it holds."""
        return tuple(t.joint for t in self.terms if t.joint)

    @property
    def quarters(self) -> int | None:
        """Number of right angles, 0 to 3; None if it is not a multiple of one."""
        if self.terms or (2 * self.turns).denominator != 1:
            return None
        return int(2 * self.turns) % 4

    @property
    def offset(self) -> float:
        """Value of the constant part, rad."""
        return float(sum(t.sign * t.value for t in self.terms)) + float(self.turns) * pi

    def times(self, sign: int) -> Angle:
        """The angle or its opposite."""
        if sign > 0:
            return self
        return Angle(tuple(replace(t, sign=-t.sign) for t in self.terms), -self.turns)

    def plus(self, other: Angle) -> Angle:
        """The sum; constants may add up to an exact angle, as two bends of an arm that cancel."""
        terms = sorted(self.terms + other.terms, key=lambda t: (not t.joint, t.joint))
        turns = self.turns + other.turns
        exact = exact_turns(sum(t.sign * t.value for t in terms))
        if exact is not None:
            terms, turns = [t for t in terms if t.joint], turns + exact
        return Angle(tuple(terms), wrapped(turns))

    def without_quarters(self) -> Angle:
        """The angle without a constant part of right angles."""
        exact = self.turns if (2 * self.turns).denominator == 1 else 0
        return replace(self, turns=self.turns - exact)

    def text(self) -> str:
        """The angle in print, such as ``θ2 + θ3 - π/2``."""
        parts = [(t.sign, greek(t.symbol.name)) for t in self.terms]
        if self.turns or not parts:
            size = abs(self.turns)
            top = "π" if size.numerator == 1 else f"{size.numerator}π" if size else "0"
            under = f"/{size.denominator}" if size.denominator > 1 else ""
            parts.append((-1 if self.turns < 0 else 1, top + under))
        return signed_sum(parts)


def exact_turns(angle: float) -> Fraction | None:
    """An angle as a fraction of pi if it is a multiple of 30 or 45 degrees to rounding."""
    k = round(angle / (pi / 12))
    if abs(angle - k * pi / 12) > ROUNDING or (k % 2 and k % 3):
        return None
    return Fraction(k, 12)


def wrapped(turns: Fraction) -> Fraction:
    """A multiple of pi brought into (-1, 1]."""
    return 1 - (1 - turns) % 2


def signed_sum(parts: Iterable[tuple[int, str]]) -> str:
    """Terms with their signs as text."""
    text = " ".join(f"{'-' if sign < 0 else '+'} {term}" for sign, term in parts)
    return text[2:] if text.startswith("+") else "-" + text[2:]


def greek(name: str) -> str:
    """A name with the letter theta instead of the word."""
    return name.replace("theta", "θ")
