"""The types of equations that Paul's method comes down to: one row for each.

Columns: name, equation (``formula``), most solutions (``branches``), rank among the types that are
found (``rank``), function that prints the solution (``write``), code of the equation that the
kernel solves (``kernel``), coefficients that must not all be zero (``amplitude``), the kernel's
coefficients from the type's (``arguments``). The LaTeX is made from the equation by `typeset`.

Source: W. Khalil, E. Dombre, *Modeling, Identification and Control of Robots*, section 4.4 and
appendix 1, for the types.
"""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from typing import Any

from . import formulas, layout
from .expressions import UNIT, ZERO, Expression, negative

Arguments = Callable[..., tuple[Expression, ...]]


def _same(*coefficients: Expression) -> tuple[Expression, ...]:
    return coefficients


class EquationType(Enum):
    """Types of equations, numbered as in the literature; two more that lead to a polynomial."""

    title: str
    formula: str
    branches: int
    rank: int
    write: formulas.Writer
    kernel: int
    amplitude: tuple[int, ...]
    arguments: Arguments

    TYPE_1 = "type 1", "X r = Y", 1, 0, formulas.type_1, layout.LENGTH, (0,)
    TYPE_2 = "type 2", "X S + Y C = Z", 2, 3, formulas.type_2, layout.ONE_EQUATION, (0, 1)
    TYPE_2_ZERO = (
        *("type 2 with Z = 0", "X S + Y C = 0", 2, 2, formulas.type_2_zero),
        *(layout.OPPOSITE_ANGLES, (0, 1), lambda X, Y: (negative(Y), X)),
    )
    TYPE_3 = (
        *("type 3", "X1 S + Y1 C = Z1, X2 S + Y2 C = Z2", 1, 0, formulas.type_3),
        *(layout.TWO_EQUATIONS, (0, 1, 3, 4)),
    )
    TYPE_3_DIRECT = (
        *("type 3 with X1 = Y2, Y1 = X2 = 0", "X1 S = Z1, X1 C = Z2", 1, 0, formulas.type_3_direct),
        *(layout.ANGLE, (0,), lambda X1, Z1, Z2: (Z1, Z2)),
    )
    TYPE_4 = (
        *("type 4", "X1 r S = Y1, X2 r C = Y2", 2, 0, formulas.type_4),
        *(layout.LENGTH_TIMES_ANGLE, (0, 2)),
    )
    TYPE_5 = (
        *("type 5", "X1 S = Y1 + Z1 r, X2 C = Y2 + Z2 r", 2, 2, formulas.type_5),
        *(layout.LENGTH_AND_ANGLE, (0, 3)),
    )
    TYPE_6 = (
        *("type 6", "W Sj = X Ci + Y Si + Z1, W Cj = X Si - Y Ci + Z2", 2, 3, formulas.type_6),
        *(layout.TWO_ANGLES, (0,), lambda W, *others: (ZERO, W, *others, negative(UNIT))),
    )
    TYPE_7 = (
        "type 7",
        "W1 Cj + W2 Sj = X Ci + Y Si + Z1, +-(W1 Sj - W2 Cj) = X Si - Y Ci + Z2",
        *(2, 4, formulas.type_7, layout.TWO_ANGLES, (0, 1)),
    )
    TYPE_8 = (
        *("type 8", "X Ci + Y C(i+j) = Z1, X Si + Y S(i+j) = Z2", 2, 1, formulas.type_8),
        *(layout.TWO_ANGLES, (0, 1)),
        lambda X, Y, Z1, Z2: (Y, ZERO, negative(X), ZERO, Z1, Z2, UNIT),
    )
    QUARTIC = (
        *("polynomial", "a0 + a1 C + a2 S + a3 cos(2 theta) + a4 sin(2 theta) = 0", 4, 6),
        *(formulas.quartic, layout.QUARTIC, ()),
    )
    POLYNOMIAL = (
        *("polynomial", "a0 + a1 r + a2 r^2 + a3 r^3 + a4 r^4 = 0", 4, 5),
        *(formulas.polynomial, layout.POLYNOMIAL, ()),
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
