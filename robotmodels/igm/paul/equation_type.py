"""The types of equations that Paul's method comes down to.

Source: W. Khalil, E. Dombre, *Modeling, Identification and Control of Robots*, section 4.4 and
appendix 1, for the types.
"""

from __future__ import annotations

from enum import Enum


class EquationType(Enum):
    """Types of equations, numbered as in the literature; two more that lead to a polynomial."""

    formula: str
    code: int
    branches: int

    TYPE_1 = "type 1", "X r = Y", 1, 1
    TYPE_2 = "type 2", "X S + Y C = Z", 2, 2
    TYPE_2_ZERO = "type 2 with Z = 0", "X S + Y C = 0", 9, 2
    TYPE_3 = "type 3", "X1 S + Y1 C = Z1, X2 S + Y2 C = Z2", 3, 1
    TYPE_3_DIRECT = "type 3 with X1 = Y2, Y1 = X2 = 0", "X1 S = Z1, X1 C = Z2", 10, 1
    TYPE_4 = "type 4", "X1 r S = Y1, X2 r C = Y2", 4, 2
    TYPE_5 = "type 5", "X1 S = Y1 + Z1 r, X2 C = Y2 + Z2 r", 5, 2
    TYPE_6 = "type 6", "W Sj = X Ci + Y Si + Z1, W Cj = X Si - Y Ci + Z2", 6, 2
    TYPE_7 = (
        "type 7", "W1 Cj + W2 Sj = X Ci + Y Si + Z1, +-(W1 Sj - W2 Cj) = X Si - Y Ci + Z2", 7, 2,
    )  # fmt: skip
    TYPE_8 = "type 8", "X Ci + Y C(i+j) = Z1, X Si + Y S(i+j) = Z2", 8, 2
    QUARTIC = "polynomial", "a0 + a1 C + a2 S + a3 cos(2 theta) + a4 sin(2 theta) = 0", 11, 4
    POLYNOMIAL = "polynomial", "a0 + a1 r + a2 r^2 + a3 r^3 + a4 r^4 = 0", 12, 4

    def __new__(cls, title: str, formula: str, code: int, branches: int):  # noqa: ANN204
        """Attach the formula, the number the kernel knows it by and the most solutions."""
        one = object.__new__(cls)
        one._value_ = (title, code)
        one.formula, one.code, one.branches = formula, code, branches
        return one

    @property
    def title(self) -> str:
        """Its name."""
        return self.value[0]
