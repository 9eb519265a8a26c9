"""Formulas of base parameters: regrouped terms with coefficients in symbols of the table.

The rules are the same that give the numbers (`rules`), run on symbols: ``Dj``, ``RLj``, ``BLj`` for
d, r, b of row j, cosines and sines of the angles that are no multiple of 30 or 45 degrees.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import pi
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from ..drive import Drives
from ..geometry import PRISMATIC, REVOLUTE
from ..model import RobotModel
from ..symbolic_dgm._angles import exact_turns
from .rules import (
    EXACT,
    RotationRank,
    RowConstants,
    loads_of,
    motion_spans,
    reach,
    regrouped,
    rows_of_numbers,
)

_LONGEST = 40
"""Largest number of operations in a printed symbolic coefficient."""

_SHOWN = 1e-6
"""Tolerance of a coefficient relative to its rule, below the printed digits."""

_GREEK = {"G": r"\gamma", "B": r"\beta", "A": r"\alpha", "TH": r"\theta"}


@dataclass(frozen=True, slots=True)
class Term:
    """A coefficient and the standard parameters that share it."""

    coefficient: float
    text: str
    latex: str
    parameters: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Formula:
    """A base parameter and its grouped terms."""

    name: str
    terms: tuple[Term, ...]

    @property
    def is_regrouped(self) -> bool:
        """Whether other parameters are regrouped into it; its name is printed with an R."""
        return sum(len(term.parameters) for term in self.terms) > 1


def numeric_formulas(
    names: Sequence[str], kept: NDArray[np.int64], matrix: Array
) -> tuple[Formula, ...]:
    """Formulas whose coefficients are numbers. Shapes: kept (b,), matrix (b, p)."""
    return _formulas(names, kept, matrix, {})


def symbolic_formulas(
    model: RobotModel,
    drive: Drives,
    kept: NDArray[np.int64],
    matrix: Array,
    names: Sequence[str],
    tolerance: float = EXACT,
) -> tuple[Formula, ...]:
    """Formulas whose coefficients are made of the symbols of the table, where these are short.

    Shapes: kept (b,), matrix (b, p).
    """
    import sympy

    rows, directions, _ = _rows_of_symbols(model, tolerance)
    terms = regrouped(model, rows, directions, drive, tolerance)
    ruled = regrouped(model, *rows_of_numbers(model, tolerance), drive, tolerance)
    printed: dict[Any, tuple[str, str]] = {}
    texts: dict[tuple[int, int], tuple[str, str]] = {}
    for number, row in zip(kept.tolist(), matrix, strict=True):
        symbols, rule = terms.get(number, {}), ruled.get(number, {})
        for k in np.flatnonzero(row).tolist():
            formula = sympy.sympify(symbols.get(k, 0))
            off = abs(rule.get(k, 0) - row[k]) > _SHOWN * abs(row[k])
            if formula != 0 and not off and sympy.count_ops(formula) <= _LONGEST:
                if formula not in printed:
                    printed[formula] = _printed(formula)
                texts[number, k] = printed[formula]
    return _formulas(names, kept, matrix, texts)


def _formulas(
    names: Sequence[str],
    kept: NDArray[np.int64],
    matrix: Array,
    texts: Mapping[tuple[int, int], tuple[str, str]],
) -> tuple[Formula, ...]:
    """Terms grouped by their coefficients, with texts for some of them, else numbers."""
    out = []
    for number, row in zip(kept.tolist(), matrix, strict=True):
        groups: dict[tuple[float, str, str], list[int]] = {}
        for k in np.flatnonzero(row).tolist():
            if (number, k) in texts:
                text, latex = texts[number, k]
                # one term per symbol, despite rounding of the table
                same = next((key for key in groups if key[1:] == (text, latex)), None)
                groups.setdefault(same or (float(row[k]), text, latex), []).append(k)
            else:
                shown, text = _number_text(float(row[k]))
                groups.setdefault((shown, text, text), []).append(k)
        out.append(_formula(names, number, groups))
    return tuple(out)


@dataclass(frozen=True, slots=True)
class Constant:
    """A symbol of the formulas and its value."""

    text: str
    latex: str
    value: float
    unit: str


def constants_of(model: RobotModel, tolerance: float = EXACT) -> tuple[Constant, ...]:
    """The symbols of a robot's formulas."""
    return tuple(_rows_of_symbols(model, tolerance)[2])


def _rows_of_symbols(
    model: RobotModel, tolerance: float
) -> tuple[list[RowConstants], list[Array], list[Constant]]:
    """Arguments of `regrouped` as formulas, without the motion of the joint."""
    import sympy

    table, spans = model.table, motion_spans(model, tolerance)
    symbols = _Symbols(tolerance, tolerance * reach(model))
    rows: list[RowConstants] = []
    directions: list[Array] = []
    weight = float(np.linalg.norm(model.gravity))
    for j, load in enumerate(loads_of(model, tolerance), start=1):
        own, sigma = spans[j], table.sigma[j - 1]
        T = symbols.turned(2, table.gamma, "G", j) @ symbols.shifted(2, table.b, "BL", j)
        T = T @ symbols.turned(1, table.beta, "B", j) @ symbols.turned(0, table.alpha, "A", j)
        T = T @ symbols.shifted(0, table.d, "D", j)
        if sigma != REVOLUTE:
            T = T @ symbols.turned(2, table.theta, "TH", j)
        if sigma != PRISMATIC:
            T = T @ symbols.shifted(2, table.r, "RL", j)
        pull: Any = load
        if sigma == PRISMATIC and load and abs(abs(load) - weight) <= tolerance * weight:
            pull = symbols.gravity(weight) * (1 if load > 0 else -1)
        rows.append(RowConstants(T[:3, :3], T[:3, 3], pull))
        if sigma == REVOLUTE or own.rotations is not RotationRank.ONE:
            e = np.array([sympy.Integer(round(float(c))) for c in own.direction], dtype=object)
        else:
            e = directions[table.antecedent[j - 1] - 1] @ T[:3, :3]
        directions.append(e)
    return rows, directions, symbols.constants


class _Symbols:
    """Elementary motions as symbolic matrices; exact values remain numbers."""

    def __init__(self, angle: float, length: float) -> None:
        self.angle, self.length = angle, length
        self.constants: list[Constant] = []

    def turned(self, axis: int, column: Array, letter: str, j: int) -> Array:
        import sympy

        value = float(column[j - 1])
        T = np.array(sympy.eye(4), dtype=object)
        turns = _turns(value, self.angle)
        if turns is None:
            angle: Any = self._symbol(letter, _GREEK[letter], j, value, "rad")
        else:
            angle = sympy.pi * sympy.Rational(turns.numerator, turns.denominator)
        C, S = sympy.cos(angle), sympy.sin(angle)
        i, k = ((1, 2), (2, 0), (0, 1))[axis]
        T[i, i], T[k, k], T[i, k], T[k, i] = C, C, -S, S
        return T

    def shifted(self, axis: int, column: Array, letter: str, j: int) -> Array:
        import sympy

        T = np.array(sympy.eye(4), dtype=object)
        value = float(column[j - 1])
        if abs(value) > self.length:
            T[axis, 3] = self._symbol(letter, letter, j, value, "m")
        return T

    def gravity(self, weight: float) -> Any:
        import sympy

        if all(constant.text != "G" for constant in self.constants):
            self.constants.append(Constant("G", "G", weight, "m/s^2"))
        return sympy.Symbol("G")

    def _symbol(self, letter: str, latex: str, j: int, value: float, unit: str) -> Any:
        import sympy

        symbol = sympy.Symbol(f"{letter}{j}")
        self.constants.append(Constant(str(symbol), f"{latex}_{{{j}}}", value, unit))
        return symbol


def _number_text(value: float) -> tuple[float, str]:
    """A coefficient to six digits, and its text: empty for 1."""
    shown, sign = f"{abs(value):.6g}", "-" if value < 0 else ""
    return float(sign + shown), sign + ("" if shown == "1" else shown)


def _turns(angle: float, tolerance: float) -> Fraction | None:
    """An angle as a fraction of pi if it is one to rounding, or a right one to the tolerance."""
    quarter = round(angle / (pi / 2))
    return exact_turns(quarter * pi / 2 if abs(angle - quarter * pi / 2) <= tolerance else angle)


def _formula(
    names: Sequence[str], number: int, groups: dict[tuple[float, str, str], list[int]]
) -> Formula:
    """Order of terms: the parameter, those with the coefficient 1, the others by frame."""

    def order(k: int) -> tuple[int, int]:
        frame = int("".join(c for c in names[k] if c.isdigit()))
        return frame, k

    terms = []
    for (value, text, latex), members in groups.items():
        members.sort(key=lambda k: (k != number, *order(k)))
        shown = tuple(names[k] for k in members)
        terms.append(
            (number not in members, text != "", *order(members[0]), value, text, latex, shown)
        )
    terms.sort()
    return Formula(names[number], tuple(Term(v, t, x, shown) for *_, v, t, x, shown in terms))


def _printed(formula: Any) -> tuple[str, str]:
    """The shortest form of a coefficient, as text and LaTeX; empty for 1."""
    import sympy

    plain = sympy.expand(formula)
    for cosine in sorted(plain.atoms(sympy.cos), key=str):
        sine = sympy.sin(cosine.args[0])
        others = [
            sympy.expand(plain.subs(a**2, 1 - b**2)) for a, b in ((cosine, sine), (sine, cosine))
        ]
        plain = min((plain, *others), key=sympy.count_ops)
    short = min((plain, sympy.factor_terms(plain)), key=sympy.count_ops)
    if short == 1:
        return "", ""
    if short == -1:
        return "-", "-"
    text, latex = str(short).replace("**", "^"), sympy.latex(short)
    for letter, greek in _GREEK.items():
        latex = re.sub(rf"\\b{letter}_{{", lambda _, g=greek: g + "_{", latex)
    if short.is_Add:
        text, latex = f"({text})", rf"\left({latex}\right)"
    return text, latex
