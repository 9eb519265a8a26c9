"""Angles as sums of joint variables, named constants and exact fractions of a turn."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from fractions import Fraction
from math import pi
from typing import Any

ROUNDING = 1e-13
"""Angles this close to a multiple of 30 or 45 degrees are it; shorter lengths are zero."""


@dataclass(frozen=True, slots=True)
class Term:
    """A part of an angle with its sign: a joint variable, or a constant with its value."""

    symbol: Any
    letters: str  # in the names of sines and cosines
    latex: str
    sign: int = 1
    joint: int = 0  # number of its frame, 0 for a constant
    value: float = 0.0


@dataclass(frozen=True, slots=True)
class Angle:
    """A signed sum of joint variables, named constants and a rational multiple of pi."""

    joints: tuple[Term, ...] = ()
    constants: tuple[Term, ...] = ()
    turns: Fraction = Fraction(0)

    @property
    def terms(self) -> tuple[Term, ...]:
        return self.joints + self.constants

    @property
    def is_zero(self) -> bool:
        return not self.terms and not self.turns

    @property
    def quarters(self) -> int | None:
        """How many right angles it is, 0 to 3; None if it is something else."""
        if self.terms or (2 * self.turns).denominator != 1:
            return None
        return int(2 * self.turns) % 4

    def times(self, sign: int) -> Angle:
        if sign > 0:
            return self

        def turned(terms: tuple[Term, ...]) -> tuple[Term, ...]:
            return tuple(replace(t, sign=-t.sign) for t in terms)

        return Angle(turned(self.joints), turned(self.constants), -self.turns)

    def plus(self, other: Angle) -> Angle:
        joints = tuple(sorted(self.joints + other.joints, key=lambda t: t.joint))
        constants = self.constants + other.constants
        turns = self.turns + other.turns
        # constants may add up to something exact, as the two bends of an arm that cancel
        exact = exact_turns(sum(t.sign * t.value for t in constants))
        if exact is not None:
            constants, turns = (), turns + exact
        return Angle(joints, constants, wrapped(turns))

    def text(self, latex: bool = False) -> str:
        parts = [(t.sign, t.latex if latex else greek(t.symbol.name)) for t in self.terms]
        if self.turns or not parts:
            parts.append((-1 if self.turns < 0 else 1, _turns_text(abs(self.turns), latex)))
        return signed_sum(parts)


def exact_turns(angle: float) -> Fraction | None:
    """An angle as a fraction of pi if it is a multiple of 30 or 45 degrees to rounding."""
    k = round(angle / (pi / 12))
    if abs(angle - k * pi / 12) > ROUNDING or (k % 2 and k % 3):
        return None
    return Fraction(k, 12)


def wrapped(turns: Fraction) -> Fraction:
    """A fraction of pi in (-1, 1]."""
    return 1 - (1 - turns) % 2


def _turns_text(turns: Fraction, latex: bool) -> str:
    letter = r"\pi" if latex else "π"
    top = letter if turns.numerator == 1 else f"{turns.numerator}{letter}" if turns else "0"
    if turns.denominator == 1:
        return top
    return rf"\frac{{{top}}}{{{turns.denominator}}}" if latex else f"{top}/{turns.denominator}"


def signed_sum(parts: Iterable[tuple[int, str]]) -> str:
    out = ""
    for sign, text in parts:
        if out:
            out += f" {'-' if sign < 0 else '+'} {text}"
        else:
            out = f"-{text}" if sign < 0 else text
    return out


def greek(name: str) -> str:
    return name.replace("theta", "θ")
