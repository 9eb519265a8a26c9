"""Formulas of base parameters: regrouped terms with coefficients in symbols of the table.

The rules are the same that give the numbers (`rules`), run on symbols: ``Dj``, ``RLj``, ``BLj`` for
d, r, b of row j, cosines and sines of the angles that are no multiple of 30 or 45 degrees.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from math import pi
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from ..drive import Drives
from ..geometry import PRISMATIC, REVOLUTE, constant_names
from ..model import RobotModel
from ..symbolic.angles import exact_turns
from . import rules

_LONGEST = 40
"""Largest number of operations in a printed symbolic coefficient."""
_SHOWN = 1e-6
"""Tolerance of a coefficient relative to its rule, below the printed digits."""
_GREEK = {"G": r"\gamma", "B": r"\beta", "A": r"\alpha", "TH": r"\theta"}


class Term(NamedTuple):
    """A coefficient and the standard parameters that share it."""

    coefficient: float
    text: str
    latex: str
    parameters: tuple[str, ...]


class Formula(NamedTuple):
    """A base parameter and its grouped terms."""

    name: str
    terms: tuple[Term, ...]

    @property
    def is_regrouped(self) -> bool:
        """Whether other parameters are regrouped into it; its name is printed with an R."""
        return sum(len(term.parameters) for term in self.terms) > 1


class Constant(NamedTuple):
    """A symbol of the formulas and its value."""

    text: str
    latex: str
    value: float
    unit: str


def formulas(
    names: Sequence[str],
    kept: NDArray[np.int64],
    matrix: Array,
    texts: Mapping[tuple[int, int], tuple[str, str]],
) -> tuple[Formula, ...]:
    """Terms grouped by their coefficients: texts and LaTeX of some, by row and column, or numbers.

    Shapes: kept (b,), matrix (b, p).
    """

    def term(number: int, key: tuple[str, str], value: float, members: list[int]) -> Any:
        """The term behind the keys of the order: the parameter, coefficient 1, the frames."""
        members.sort(key=lambda k: (k != number, _frame(names[k]), k))
        order = number not in members, key[0] != "", _frame(names[members[0]]), members[0]
        return *order, Term(value, *key, tuple(names[k] for k in members))

    found: list[Formula] = []
    numbers: list[int] = kept.tolist()
    for number, row in zip(numbers, matrix, strict=True):
        groups: dict[tuple[str, str], tuple[float, list[int]]] = {}
        for k in np.flatnonzero(row).tolist():
            value, key = float(row[k]), texts.get((number, k))
            if key is None:
                value, text = _number_text(value)
                key = text, text
            groups.setdefault(key, (value, []))[1].append(k)
        terms = sorted(term(number, key, *group) for key, group in groups.items())
        found.append(Formula(names[number], tuple(one[-1] for one in terms)))
    return tuple(found)


def symbolic_texts(
    model: RobotModel, drive: Drives, kept: NDArray[np.int64], matrix: Array, tolerance: float
) -> dict[tuple[int, int], tuple[str, str]]:
    """Coefficients made of symbols of the table, where these are short: text and LaTeX.

    Shapes: kept (b,), matrix (b, p).
    """
    import sympy

    rows, directions, _ = _rows_of_symbols(model, tolerance)
    terms = rules.regrouped(model, rows, directions, drive, tolerance)
    ruled = rules.regrouped(model, *rules.rows_of_numbers(model, tolerance), drive, tolerance)
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
    return texts


def constants_of(model: RobotModel, tolerance: float = rules.EXACT) -> tuple[Constant, ...]:
    """The symbols of a robot's formulas."""
    return tuple(_rows_of_symbols(model, tolerance)[2])


def _rows_of_symbols(
    model: RobotModel, tolerance: float
) -> tuple[list[rules.RowConstants], list[Array], list[Constant]]:
    """Arguments of `rules.regrouped` as formulas, without the motion of the joint; the symbols."""
    import sympy

    table, least = model.table, tolerance * rules.reach(model)
    constants: dict[str, Constant] = {}
    own = constant_names(table.symbols)

    def symbol(name: str, latex: str, value: float, unit: str) -> Any:
        if name in own:
            name = own[name]
            latex = sympy.latex(sympy.Symbol(name))
        constants[name] = Constant(name, latex, value, unit)
        return sympy.Symbol(name)

    def turned(axis: int, value: float, letter: str) -> Array:
        """Rotation about an axis; an angle that is no exact fraction of pi is a symbol."""
        quarter = round(value / (pi / 2)) * pi / 2
        turns = exact_turns(quarter if abs(value - quarter) <= tolerance else value)
        if turns is None:
            angle = symbol(f"{letter}{j}", f"{_GREEK[letter]}_{{{j}}}", value, "rad")
        else:
            angle = sympy.pi * sympy.Rational(turns.numerator, turns.denominator)
        R = np.array(sympy.eye(3), dtype=object)
        C, S = sympy.cos(angle), sympy.sin(angle)
        i, k = ((1, 2), (2, 0), (0, 1))[axis]
        R[i, i], R[k, k], R[i, k], R[k, i] = C, C, -S, S
        return R

    def length(value: float, letter: str) -> Any:
        shown = abs(value) > least
        return symbol(f"{letter}{j}", f"{letter}_{{{j}}}", value, "m") if shown else 0

    rows: list[rules.RowConstants] = []
    directions: list[Array] = []
    spans, loads = rules.motion_spans(model, tolerance), rules.loads_of(model, tolerance)
    weight = float(np.linalg.norm(model.gravity))
    columns = (table.gamma, table.b, table.beta, table.alpha, table.d, table.theta, table.r)
    values = zip(*(column.tolist() for column in columns), strict=True)
    for j, (load, row) in enumerate(zip(loads, values, strict=True), start=1):
        gamma, b, beta, alpha, d, theta, r = row
        sigma, span = table.sigma[j - 1], spans[j]
        R, P = turned(2, gamma, "G"), np.array([0, 0, length(b, "BL")], dtype=object)
        R = R @ turned(1, beta, "B") @ turned(0, alpha, "A")
        P = P + R[:, 0] * length(d, "D")
        if sigma != REVOLUTE:
            R = R @ turned(2, theta, "TH")
        if sigma != PRISMATIC:
            P = P + R[:, 2] * length(r, "RL")
        pull: Any = load
        if sigma == PRISMATIC and load and abs(abs(load) - weight) <= tolerance * weight:
            pull = symbol("G", "G", weight, "m/s^2") * (1 if load > 0 else -1)
        rows.append(rules.RowConstants(R, P, pull))
        if sigma == REVOLUTE or span.rotations is not rules.RotationRank.ONE:
            e = np.array([sympy.Integer(round(float(c))) for c in span.direction], dtype=object)
        else:
            e = directions[table.antecedent[j - 1] - 1] @ R
        directions.append(e)
    return rows, directions, list(constants.values())


def _frame(name: str) -> int:
    return int("".join(c for c in name if c.isdigit()))


def _number_text(value: float) -> tuple[float, str]:
    """A coefficient to six digits, and its text: empty for 1."""
    shown, sign = f"{abs(value):.6g}", "-" if value < 0 else ""
    return float(sign + shown), sign + ("" if shown == "1" else shown)


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
    if abs(short) == 1:
        return ("", "") if short == 1 else ("-", "-")
    text, latex = str(short).replace("**", "^"), sympy.latex(short)
    for letter, greek in _GREEK.items():
        latex = re.sub(rf"\\b{letter}_{{", lambda _, g=greek: g + "_{", latex)
    return (f"({text})", rf"\left({latex}\right)") if short.is_Add else (text, latex)
