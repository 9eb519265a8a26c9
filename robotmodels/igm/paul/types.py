"""The types of equations that Paul's method comes down to, and the formulas that solve each.

`EquationType` is the table, one row for each type: name, equation (``formula``), most solutions
(``branches``), rank among the types that are found (``rank``), function that prints the solution
(``write``), code of the equation that the kernel solves (``kernel``), coefficients that must not
all be zero (``amplitude``), the kernel's coefficients from the type's (``arguments``). LaTeX is
made from the printed formulas by `typeset`.

Source: W. Khalil, E. Dombre, *Modeling, Identification and Control of Robots*, section 4.4 and
appendix 1, for the types.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

from . import layout
from .expressions import ONE, UNIT, ZERO, Expression, negative

_TWO = (2.0, ONE)


@dataclass(slots=True)
class Page:
    """Symbols and lines of one step: equations, definitions of symbols, formulas.

    ``words`` is the `PlanText` of the whole plan, ``formula`` that of the type.
    """

    words: Any
    formula: str
    coefficients: tuple[Expression, ...]
    unknowns: tuple[int, ...]
    angle: tuple[str, ...]
    cos: tuple[str, ...]
    sin: tuple[str, ...]
    equations: list[str] = field(default_factory=list)
    definitions: list[str] = field(default_factory=list)
    formulas: list[str] = field(default_factory=list)

    def equate(self, values: Sequence[Expression]) -> list[str]:
        """The formula of the type with its coefficients and unknowns put in; the right sides."""
        of = dict(zip(dict.fromkeys(re.findall(r"[WXYZ]\d?", self.formula)), values, strict=False))
        of["0"], symbols = ZERO, {"r": self.angle[0]}
        for index, place in (("", -1), ("i", 0), ("j", -1), ("(i+j)", -1)):
            symbols |= {f"S{index}": self.sin[place], f"C{index}": self.cos[place]}
        for equation in self.formula.split(", "):
            sides = []
            for side in equation.split(" = "):
                # the last coefficient of type 7 is the sign of a side
                both, side = (values[-1], side[3:-1]) if side[0] == "+" else (UNIT, side)
                terms = []
                for term in re.split(r" (?=[+-] )", side):
                    name, *unknowns = term.lstrip("+- ").split()
                    e = self.words.graph.product(both, of[name])
                    product = "*".join(symbols[u] for u in unknowns)
                    terms.append((negative(e) if term[0] == "-" else e, product))
                sides.append(self.write.sum(*terms))
            self.equations.append(" = ".join(sides))
        return [equation.split(" = ")[1] for equation in self.equations]

    @property
    def write(self) -> Any:
        """Text of expressions."""
        return self.words.write

    def short(self) -> list[Expression]:
        """The coefficients, long ones with a name of their own."""
        return [self.words.short(e, self.definitions) for e in self.coefficients]

    def define(self, names: str, *values: Expression) -> None:
        """Names of expressions."""
        for name, e in zip(names.split(), values, strict=True):
            self.definitions.append(f"{name} = {self.write(e)}")

    def arc(self, i: int, y: str, x: str) -> None:
        """An unknown angle by its sine and cosine, or multiples of them."""
        self.formulas.append(f"{self.angle[i]} = atan2({y}, {x})")

    def type_2(self) -> None:
        """The book's formulas, its misprint put right."""
        S, C, root, under = self.sin[0], self.cos[0], "sqrt(X**2 + Y**2 - Z**2)", "(X**2 + Y**2)"
        self.formulas += [
            f"{S} = (X*Z + e*Y*{root})/{under}",
            f"${C} = (Y*Z - e*X*{root})/{under}$, $e = +1 or -1$",
        ]
        self.arc(0, S, C)

    def squared(self, *coefficients: Expression) -> None:
        """Types 6 and 7 squared and added: X Si + Y Ci = Z with other X, Y, Z."""
        *widths, X, Y, Z1, Z2 = coefficients
        graph = self.words.graph
        self.definitions.append(f"squared and added: $X*{self.sin[0]} + Y*{self.cos[0]} = Z$")
        squares = [graph.product(W, W) for W in widths]
        squares += [negative(graph.product(e, e)) for e in (X, Y, Z1, Z2)]
        self.define(
            "X Y Z", graph.dot((_TWO, Z1, Y), (_TWO, Z2, X)),
            graph.dot((_TWO, Z1, X), (negative(_TWO), Z2, Y)),
            graph.sum(squares),
        )  # fmt: skip
        self.type_2()


def _over(text: str, W: str) -> str:
    """A sum or product divided by a symbol or number."""
    return text if W == "1" else f"{_factor(text, '')}/{W}"


def _factor(text: str, signs: str = "-") -> str:
    return f"({text})" if " " in text or text[0] in signs else text


def _type_1(page: Page) -> None:
    X, Y = page.coefficients
    page.equate((X, Y))
    value = page.write((Y[0] / X[0], Y[1]))
    if X[1] != ONE:
        value = f"({page.write(Y)})/({page.write(X)})"
    page.formulas.append(f"{page.angle[0]} = {value}")


def _type_2_zero(page: Page) -> None:
    X, Y = page.coefficients
    page.equate((X, Y))
    page.arc(0, page.write(negative(Y)), page.write(X))
    both = _factor(page.angle[0])
    page.formulas.append(f"{both}' = {both} + π")


def _type_2(page: Page) -> None:
    page.equate(page.coefficients)
    page.define("X Y Z", *page.coefficients)
    page.type_2()


def _type_3_direct(page: Page) -> None:
    sides = page.equate(page.coefficients)
    page.arc(0, *((page.sin[0], page.cos[0]) if page.coefficients[0] == UNIT else sides))


def _type_3(page: Page) -> None:
    page.equate(page.coefficients)
    X1, Y1, Z1, X2, Y2, Z2 = page.short()
    det = page.words.graph.determinant
    page.define("D", det(X1, Y1, X2, Y2))
    for symbol, e in (page.sin[0], det(Z1, Y1, Z2, Y2)), (page.cos[0], det(X1, Z1, X2, Z2)):
        page.formulas.append(f"{symbol} = {_over(page.write(e), 'D')}")
    page.arc(0, page.sin[0], page.cos[0])


def _type_4(page: Page) -> None:
    r = page.angle[0]
    page.equate(page.coefficients)
    page.define("X1 Y1 X2 Y2", *page.coefficients)
    page.formulas.append(f"${r} = e*sqrt((Y1/X1)**2 + (Y2/X2)**2)$, $e = +1 or -1$")
    page.arc(1, f"Y1/(X1*{r})", f"Y2/(X2*{r})")


def _type_5(page: Page) -> None:
    r = page.angle[0]
    page.equate(page.coefficients)
    page.define("X1 Y1 Z1 X2 Y2 Z2", *page.coefficients)
    page.formulas.append(f"((Y1 + Z1*{r})/X1)**2 + ((Y2 + Z2*{r})/X2)**2 = 1")
    page.arc(1, f"(Y1 + Z1*{r})/X1", f"(Y2 + Z2*{r})/X2")


def _type_6(page: Page) -> None:
    values = page.short()
    sides, width = page.equate(values), page.write(values[0])
    page.squared(*values)
    page.arc(1, *(_over(side, width) for side in sides))


def _type_7(page: Page) -> None:
    *values, sense = page.short()
    sides, sum_ = page.equate((*values, sense)), page.write.sum
    page.squared(*values)
    page.formulas += [f"R{i} = {side}" for i, side in enumerate(sides, 1)]
    # W1^2 + W2^2 times sine and cosine of the second angle
    W1, W2 = values[:2]
    left, right = (page.words.graph.product(sense, e) for e in (W1, negative(W2)))
    page.arc(1, sum_((W2, "R1"), (left, "R2")), sum_((W1, "R1"), (right, "R2")))


def _type_8(page: Page) -> None:
    X, Y, Z1, Z2 = values = page.short()
    x, y = map(_factor, page.equate(values))
    name, sign, C, S = page.words.difference(*page.unknowns)
    graph, write = page.words.graph, page.write
    squares = graph.dot((Z1, Z1), (Z2, Z2), (negative(X), X), (negative(Y), Y))
    page.formulas += [
        f"{C} = ({write(squares)})/({write(graph.product(_TWO, X, Y))})",
        f"${S} = e*sqrt(1 - {C}**2)$, $e = +1 or -1$",
        f"{name} = atan2({S}, {C})",
        f"k1 = {write.sum((X, ''), (Y, C))}",
        f"k2 = {write.sum((graph.product((sign, ONE), Y), S))}",
    ]
    page.arc(0, f"k1*{y} - k2*{x}", f"k1*{x} + k2*{y}")


def _quartic(page: Page) -> None:
    theta, C, S = page.angle[0], page.cos[0], page.sin[0]
    for i, e in enumerate(page.coefficients):
        page.define(f"a{i}", page.words.short(e, page.definitions))
    page.equations.append(f"a0 + a1*{C} + a2*{S} + a3*cos(2*({theta})) + a4*sin(2*({theta})) = 0")
    page.formulas.append(f"${theta}$: the real ones of up to four roots")


def _polynomial(page: Page) -> None:
    r, terms, degree = page.angle[0], [], 0
    for i, e in enumerate(page.coefficients):
        if e[0]:
            page.define(f"a{i}", page.words.short(e, page.definitions))
            terms.append(f"a{i}" + f"*{r}" * (i > 0) + f"**{i}" * (i > 1))
            degree = i
    page.equations.append(f"{' + '.join(terms)} = 0")
    page.formulas.append(f"${r}$: the real ones of {degree} roots")


Arguments = Callable[..., tuple[Expression, ...]]


def _same(*coefficients: Expression) -> tuple[Expression, ...]:
    return coefficients


class EquationType(Enum):
    """Types of equations, numbered as in the literature; two more that lead to a polynomial."""

    title: str
    formula: str
    branches: int
    rank: int
    write: Callable[[Page], None]
    kernel: int
    amplitude: tuple[int, ...]
    arguments: Arguments

    TYPE_1 = "type 1", "X r = Y", 1, 0, _type_1, layout.LENGTH, (0,)
    TYPE_2 = "type 2", "X S + Y C = Z", 2, 3, _type_2, layout.ONE_EQUATION, (0, 1)
    TYPE_2_ZERO = (
        *("type 2 with Z = 0", "X S + Y C = 0", 2, 2, _type_2_zero),
        *(layout.OPPOSITE_ANGLES, (0, 1), lambda X, Y: (negative(Y), X)),
    )
    TYPE_3 = (
        *("type 3", "X1 S + Y1 C = Z1, X2 S + Y2 C = Z2", 1, 0, _type_3),
        *(layout.TWO_EQUATIONS, (0, 1, 3, 4)),
    )
    TYPE_3_DIRECT = (
        *("type 3 with X1 = Y2, Y1 = X2 = 0", "X1 S = Z1, X1 C = Z2", 1, 0, _type_3_direct),
        *(layout.ANGLE, (0,), lambda X1, Z1, Z2: (Z1, Z2)),
    )
    TYPE_4 = (
        *("type 4", "X1 r S = Y1, X2 r C = Y2", 2, 0, _type_4),
        *(layout.LENGTH_TIMES_ANGLE, (0, 2)),
    )
    TYPE_5 = (
        *("type 5", "X1 S = Y1 + Z1 r, X2 C = Y2 + Z2 r", 2, 2, _type_5),
        *(layout.LENGTH_AND_ANGLE, (0, 3)),
    )
    TYPE_6 = (
        *("type 6", "W Sj = X Ci + Y Si + Z1, W Cj = X Si - Y Ci + Z2", 2, 3, _type_6),
        *(layout.TWO_ANGLES, (0,), lambda W, *others: (ZERO, W, *others, negative(UNIT))),
    )
    TYPE_7 = (
        "type 7",
        "W1 Cj + W2 Sj = X Ci + Y Si + Z1, +-(W1 Sj - W2 Cj) = X Si - Y Ci + Z2",
        *(2, 4, _type_7, layout.TWO_ANGLES, (0, 1)),
    )
    TYPE_8 = (
        *("type 8", "X Ci + Y C(i+j) = Z1, X Si + Y S(i+j) = Z2", 2, 1, _type_8),
        *(layout.TWO_ANGLES, (0, 1)),
        lambda X, Y, Z1, Z2: (Y, ZERO, negative(X), ZERO, Z1, Z2, UNIT),
    )
    QUARTIC = (
        *("polynomial", "a0 + a1 C + a2 S + a3 cos(2 theta) + a4 sin(2 theta) = 0", 4, 6),
        *(_quartic, layout.QUARTIC, ()),
    )
    POLYNOMIAL = (
        *("polynomial", "a0 + a1 r + a2 r^2 + a3 r^3 + a4 r^4 = 0", 4, 5),
        *(_polynomial, layout.POLYNOMIAL, ()),
    )

    def __new__(cls, title: str, formula: str, *columns: Any):  # noqa: ANN204
        """Attach the columns of the table."""
        one = object.__new__(cls)
        one._value_ = one.title, one.formula = title, formula
        one.branches, one.rank, one.write, one.kernel, one.amplitude, *arguments = columns
        one.arguments = arguments[0] if arguments else _same
        return one

    @property
    def markup(self) -> str:
        """Its name and equation as markup of `typeset`."""
        name, _, case = self.title.partition(" with ")
        case = case and f" with ${case.replace(', ', '$, $')}$"
        return f"{name}{case}: ${self.formula.replace(', ', '$, $')}$"
