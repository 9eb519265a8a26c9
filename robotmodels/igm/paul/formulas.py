"""How each type of equation is written down and solved on paper."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from .expressions import ONE, UNIT, Expression, negative


@dataclass(slots=True)
class Page:
    """Symbols of one step, and its lines: the equations, what stands for what, what follows.

    ``words`` is the `PlanText` of the whole plan.
    """

    words: Any
    coefficients: tuple[Expression, ...]
    unknowns: tuple[int, ...]
    angle: tuple[str, ...]
    cos: tuple[str, ...]
    sin: tuple[str, ...]
    equations: list[str] = field(default_factory=list)
    definitions: list[str] = field(default_factory=list)
    formulas: list[str] = field(default_factory=list)

    def sum(self, *terms: tuple[Expression, str]) -> str:
        """Expressions times symbols, added."""
        return self.words.sum(*terms)

    def write(self, e: Expression) -> str:
        """An expression."""
        return self.words.write(e)

    def short(self) -> list[Expression]:
        """The coefficients, long ones with a name of their own."""
        return [self.words.short(e, self.definitions) for e in self.coefficients]

    def define(self, names: str, values: Sequence[Expression]) -> None:
        """Names of expressions."""
        self.definitions += [
            f"{n} = {self.write(e)}" for n, e in zip(names.split(), values, strict=True)
        ]

    def arc(self, i: int, y: str, x: str) -> None:
        """An unknown angle by its sine and cosine, or multiples of them."""
        self.formulas.append(f"{self.angle[i]} = atan2({y}, {x})")

    def type_2(self) -> None:
        """The book's formulas, its misprint put right."""
        S, C, root, under = self.sin[0], self.cos[0], "sqrt(X**2 + Y**2 - Z**2)", "(X**2 + Y**2)"
        self.formulas += [
            f"{S} = (X*Z + e*Y*{root})/{under}",
            f"{C} = (Y*Z - e*X*{root})/{under}, e = +1 or -1",
        ]
        self.arc(0, S, C)

    def squared(self, X: Expression, Y: Expression, Z1: Expression, Z2: Expression,
                widths: list[Expression]) -> None:  # fmt: skip
        """Types 6 and 7 squared and added: X Si + Y Ci = Z with other X, Y, Z."""
        product, add = self.words.graph.product, self.words.graph.sum
        two = (2.0, ONE)
        self.definitions.append(f"squared and added: X*{self.sin[0]} + Y*{self.cos[0]} = Z")
        squares = [negative(product(e, e)) for e in (X, Y, Z1, Z2)]
        self.define("X Y Z", (
            add((product(two, Z1, Y), product(two, Z2, X))),
            add((product(two, Z1, X), negative(product(two, Z2, Y)))),
            add([*widths, *squares]),
        ))  # fmt: skip
        self.type_2()


Writer = Callable[[Page], None]


def _over(text: str, W: str) -> str:
    """A sum or product divided by a symbol or number."""
    if W == "1":
        return text
    return f"({text})/{W}" if " " in text else f"{text}/{W}"


def _factor(text: str) -> str:
    return f"({text})" if " " in text or text.startswith("-") else text


def type_1(page: Page) -> None:
    """``X r = Y``."""
    X, Y = page.coefficients
    r = page.angle[0]
    page.equations.append(f"{page.sum((X, r))} = {page.write(Y)}")
    value = page.write((Y[0] / X[0], Y[1]))
    page.formulas.append(
        f"{r} = {value}" if X[1] == ONE else f"{r} = ({page.write(Y)})/({page.write(X)})"
    )


def type_2_zero(page: Page) -> None:
    """``X S + Y C = 0``."""
    X, Y = page.coefficients
    theta = page.angle[0]
    page.equations.append(f"{page.sum((X, page.sin[0]), (Y, page.cos[0]))} = 0")
    page.arc(0, page.write(negative(Y)), page.write(X))
    both = _factor(theta)
    page.formulas.append(f"{both}' = {both} + π")


def type_2(page: Page) -> None:
    """``X S + Y C = Z``."""
    X, Y, Z = page.coefficients
    page.equations.append(f"{page.sum((X, page.sin[0]), (Y, page.cos[0]))} = {page.write(Z)}")
    page.define("X Y Z", (X, Y, Z))
    page.type_2()


def type_3_direct(page: Page) -> None:
    """``X1 S = Z1, X1 C = Z2``."""
    W, A, B = page.coefficients
    S, C = page.sin[0], page.cos[0]
    a, b = page.write(A), page.write(B)
    page.equations += [f"{page.sum((W, S))} = {a}", f"{page.sum((W, C))} = {b}"]
    page.arc(0, *(S, C) if W == UNIT else (a, b))


def type_3(page: Page) -> None:
    """``X1 S + Y1 C = Z1, X2 S + Y2 C = Z2``."""
    S, C = page.sin[0], page.cos[0]
    X1, Y1, Z1, X2, Y2, Z2 = page.coefficients
    page.equations += [
        f"{page.sum((X, S), (Y, C))} = {page.write(Z)}" for X, Y, Z in ((X1, Y1, Z1), (X2, Y2, Z2))
    ]
    X1, Y1, Z1, X2, Y2, Z2 = page.short()
    product, add = page.words.graph.product, page.words.graph.sum

    def cross(a: Expression, b: Expression, c: Expression, d: Expression) -> Expression:
        return add((product(a, b), negative(product(c, d))))

    page.define("D", [cross(X1, Y2, X2, Y1)])
    page.formulas += [
        f"{S} = {_over(page.write(cross(Z1, Y2, Z2, Y1)), 'D')}",
        f"{C} = {_over(page.write(cross(X1, Z2, X2, Z1)), 'D')}",
    ]
    page.arc(0, S, C)


def type_4(page: Page) -> None:
    """``X1 r S = Y1, X2 r C = Y2``."""
    X1, Y1, X2, Y2 = page.coefficients
    r, S, C = page.angle[0], page.sin[1], page.cos[1]
    page.equations += [f"{page.sum((X1, f'{r}*{S}'))} = {page.write(Y1)}",
                       f"{page.sum((X2, f'{r}*{C}'))} = {page.write(Y2)}"]  # fmt: skip
    page.define("X1 Y1 X2 Y2", page.coefficients)
    page.formulas.append(f"{r} = e*sqrt((Y1/X1)**2 + (Y2/X2)**2), e = +1 or -1")
    page.arc(1, f"Y1/(X1*{r})", f"Y2/(X2*{r})")


def type_5(page: Page) -> None:
    """``X1 S = Y1 + Z1 r, X2 C = Y2 + Z2 r``."""
    X1, Y1, Z1, X2, Y2, Z2 = page.coefficients
    r, S, C = page.angle[0], page.sin[1], page.cos[1]
    page.equations += [f"{page.sum((X1, S))} = {page.sum((Y1, ''), (Z1, r))}",
                       f"{page.sum((X2, C))} = {page.sum((Y2, ''), (Z2, r))}"]  # fmt: skip
    page.define("X1 Y1 Z1 X2 Y2 Z2", page.coefficients)
    page.formulas.append(f"((Y1 + Z1*{r})/X1)**2 + ((Y2 + Z2*{r})/X2)**2 = 1")
    page.arc(1, f"(Y1 + Z1*{r})/X1", f"(Y2 + Z2*{r})/X2")


def _right_sides(page: Page, X: Expression, Y: Expression, Z1: Expression,
                 Z2: Expression) -> tuple[str, str]:  # fmt: skip
    S, C = page.sin[0], page.cos[0]
    return page.sum((X, C), (Y, S), (Z1, "")), page.sum((X, S), (negative(Y), C), (Z2, ""))


def type_6(page: Page) -> None:
    """``W Sj = X Ci + Y Si + Z1, W Cj = X Si - Y Ci + Z2``."""
    W, X, Y, Z1, Z2 = page.short()
    one, two = _right_sides(page, X, Y, Z1, Z2)
    page.equations += [
        f"{page.sum((W, page.sin[1]))} = {one}", f"{page.sum((W, page.cos[1]))} = {two}",
    ]  # fmt: skip
    page.squared(X, Y, Z1, Z2, [page.words.graph.product(W, W)])
    width = page.write(W)
    page.arc(1, _over(one, width), _over(two, width))


def type_7(page: Page) -> None:
    """``W1 Cj + W2 Sj = X Ci + Y Si + Z1, +-(W1 Sj - W2 Cj) = X Si - Y Ci + Z2``."""
    W1, W2, X, Y, Z1, Z2, sense = page.short()
    S, C = page.sin[1], page.cos[1]
    product = page.words.graph.product
    one, two = _right_sides(page, X, Y, Z1, Z2)
    left, right = product(sense, W1), negative(product(sense, W2))
    page.equations += [
        f"{page.sum((W1, C), (W2, S))} = {one}", f"{page.sum((left, S), (right, C))} = {two}",
    ]  # fmt: skip
    page.squared(X, Y, Z1, Z2, [product(W1, W1), product(W2, W2)])
    page.formulas += [f"R1 = {one}", f"R2 = {two}"]
    # W1^2 + W2^2 times sine and cosine of the second angle
    page.arc(1, page.sum((W2, "R1"), (left, "R2")), page.sum((W1, "R1"), (right, "R2")))


def type_8(page: Page) -> None:
    """``X Ci + Y C(i+j) = Z1, X Si + Y S(i+j) = Z2``."""
    X, Y, Z1, Z2 = page.short()
    (Si, Sj), (Ci, Cj) = page.sin, page.cos
    x, y = page.write(Z1), page.write(Z2)
    page.equations += [
        f"{page.sum((X, Ci), (Y, Cj))} = {x}", f"{page.sum((X, Si), (Y, Sj))} = {y}",
    ]  # fmt: skip
    name, sign, C, S = page.words.difference(*page.unknowns)
    product, add = page.words.graph.product, page.words.graph.sum
    squares = [product(Z1, Z1), product(Z2, Z2), negative(product(X, X)), negative(product(Y, Y))]
    under = page.write(product((2.0, ONE), X, Y))
    x, y = _factor(x), _factor(y)
    page.formulas += [
        f"{C} = ({page.write(add(squares))})/({under})",
        f"{S} = e*sqrt(1 - {C}**2), e = +1 or -1",
        f"{name} = atan2({S}, {C})",
        f"k1 = {page.sum((X, ''), (Y, C))}",
        f"k2 = {page.sum((product((sign, ONE), Y), S))}",
    ]
    page.arc(0, f"k1*{y} - k2*{x}", f"k1*{x} + k2*{y}")


def quartic(page: Page) -> None:
    """``a0 + a1 C + a2 S + a3 cos(2 theta) + a4 sin(2 theta) = 0``."""
    theta = page.angle[0]
    for i, e in enumerate(page.coefficients):
        page.define(f"a{i}", [page.words.short(e, page.definitions)])
    page.equations.append(
        f"a0 + a1*{page.cos[0]} + a2*{page.sin[0]} + a3*cos(2*({theta})) + a4*sin(2*({theta})) = 0"
    )
    page.formulas.append(f"{theta}: the real ones of up to four roots")


def polynomial(page: Page) -> None:
    """``a0 + a1 r + a2 r^2 + a3 r^3 + a4 r^4 = 0``."""
    r, terms, degree = page.angle[0], [], 0
    for i, e in enumerate(page.coefficients):
        if e[0]:
            page.define(f"a{i}", [page.words.short(e, page.definitions)])
            terms.append(f"a{i}" + f"*{r}" * (i > 0) + f"**{i}" * (i > 1))
            degree = i
    page.equations.append(f"{' + '.join(terms)} = 0")
    page.formulas.append(f"{r}: the real ones of {degree} roots")
