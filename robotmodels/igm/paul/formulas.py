"""How each type of equation is written down and solved on paper."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from .expressions import ONE, UNIT, Expression, negative
from .prose import Line, equal
from .types import EquationType

if TYPE_CHECKING:
    from .plan import Step
    from .wording import Wording


@dataclass(frozen=True, slots=True)
class Solution:
    """The equations of a step, what stands for what in them, and what follows."""

    equations: tuple[Line, ...]
    definitions: tuple[Line, ...]
    formulas: tuple[Line, ...]


class _Page:
    """The symbols of one step, and lines in both kinds of print."""

    def __init__(self, step: Step, words: Wording) -> None:
        self.step, self.words, self.graph = step, words, words.graph
        self.definitions: list[Line] = []
        self.angle = [self._pair(lambda latex, u=u: words.unknown(u, latex)) for u in step.unknowns]
        self.cos = [self._symbol(u, 0) for u in step.unknowns]
        self.sin = [self._symbol(u, 1) for u in step.unknowns]

    @staticmethod
    def _pair(of) -> Line:  # noqa: ANN001
        return Line(of(False), of(True))

    def _symbol(self, number: int, which: int) -> Line:
        node = self.graph.nodes[self.words.joints.symbols(number)[which][1]]
        return Line(node.name, node.latex)

    def write(self, e: Expression) -> Line:
        return Line(*(w(e) for w in self.words.writers))

    def sum(self, *terms: tuple[Expression, Line | None]) -> Line:
        text, latex = self.words.writers
        return Line(
            text.sum([(e, s.text if s else "") for e, s in terms]),
            latex.sum([(e, s.latex if s else "") for e, s in terms]),
        )

    def short(self, e: Expression) -> Expression:
        named, lines = self.words.shortened(e)
        self.definitions += lines
        return named

    def define(self, name: str, e: Expression, latex: str = "") -> None:
        value = self.write(e)
        self.definitions.append(Line(f"{name} = {value.text}", f"{latex or name} &= {value.latex}"))


def _arc(angle: Line, y: Line, x: Line) -> Line:
    return Line(
        f"{angle.text} = atan2({y.text}, {x.text})",
        rf"{angle.latex} &= \operatorname{{atan2}}\left({y.latex}, {x.latex}\right)",
    )


def _type_2_lines(page: _Page, i: int) -> list[Line]:
    """The book's formulas, its misprint put right."""
    S, C = page.sin[i], page.cos[i]
    root, over = "sqrt(X**2 + Y**2 - Z**2)", "(X**2 + Y**2)"
    lroot, lover = r"\sqrt{X^2 + Y^2 - Z^2}", "X^2 + Y^2"
    return [
        Line(f"{S.text} = (X*Z + e*Y*{root})/{over}",
             rf"{S.latex} &= \frac{{X Z + \varepsilon Y {lroot}}}{{{lover}}}"),
        Line(f"{C.text} = (Y*Z - e*X*{root})/{over}, e = +1 or -1",
             rf"{C.latex} &= \frac{{Y Z - \varepsilon X {lroot}}}{{{lover}}}, \quad "
             r"\varepsilon = \pm 1"),
        _arc(page.angle[i], S, C),
    ]  # fmt: skip


def _over(line: Line, W: Line, single: bool) -> Line:
    """A line divided by something."""
    if W.text == "1":
        return line
    text = f"({line.text})/{W.text}" if " " in line.text else f"{line.text}/{W.text}"
    return Line(text if single else f"({line.text})/({W.text})",
                rf"\frac{{{line.latex}}}{{{W.latex}}}")  # fmt: skip


def solution_of(step: Step, words: Wording) -> Solution:
    """Equations and formulas of a step."""
    page = _Page(step, words)
    equations, formulas = _WRITERS[step.type](page)
    return Solution(tuple(equations), tuple(page.definitions), tuple(formulas))


Lines = tuple[list[Line], list[Line]]


def _one(page: _Page) -> Lines:
    X, Y = page.step.coefficients
    r = page.angle[0]
    equation = equal(page.sum((X, r)), page.write(Y))
    if X[1] == ONE:
        return [equation], [equal(r, page.write((Y[0] / X[0], Y[1])))]
    return [equation], [equal(r, _over(page.write(Y), page.write(X), False))]


def _two_zero(page: _Page) -> Lines:
    X, Y = page.step.coefficients
    theta = page.angle[0]
    equation = equal(page.sum((X, page.sin[0]), (Y, page.cos[0])), Line("0", "0"))
    wrap = theta if " " not in theta.text else Line(f"({theta.text})", rf"({theta.latex})")
    other = Line(f"{wrap.text}' = {wrap.text} + π", rf"{wrap.latex}' &= {wrap.latex} + \pi")
    return [equation], [_arc(theta, page.write(negative(Y)), page.write(X)), other]


def _two(page: _Page) -> Lines:
    X, Y, Z = page.step.coefficients
    equation = equal(page.sum((X, page.sin[0]), (Y, page.cos[0])), page.write(Z))
    for name, e in (("X", X), ("Y", Y), ("Z", Z)):
        page.define(name, e)
    return [equation], _type_2_lines(page, 0)


def _three_direct(page: _Page) -> Lines:
    W, A, B = page.step.coefficients
    S, C = page.sin[0], page.cos[0]
    equations = [equal(page.sum((W, S)), page.write(A)), equal(page.sum((W, C)), page.write(B))]
    if W == UNIT:
        return equations, [_arc(page.angle[0], S, C)]
    return equations, [_arc(page.angle[0], page.write(A), page.write(B))]


def _three(page: _Page) -> Lines:
    X1, Y1, Z1, X2, Y2, Z2 = page.step.coefficients
    S, C = page.sin[0], page.cos[0]
    equations = [equal(page.sum((X1, S), (Y1, C)), page.write(Z1)),
                 equal(page.sum((X2, S), (Y2, C)), page.write(Z2))]  # fmt: skip
    product, add = page.graph.product, page.graph.sum
    X1, Y1, Z1, X2, Y2, Z2 = (page.short(e) for e in (X1, Y1, Z1, X2, Y2, Z2))

    def cross(a: Expression, b: Expression, c: Expression, d: Expression) -> Expression:
        return add((product(a, b), negative(product(c, d))))

    page.define("D", cross(X1, Y2, X2, Y1))
    D = Line("D", "D")
    top = page.write(cross(Z1, Y2, Z2, Y1)), page.write(cross(X1, Z2, X2, Z1))
    formulas = [equal(S, _over(top[0], D, True)), equal(C, _over(top[1], D, True))]
    return equations, [*formulas, _arc(page.angle[0], S, C)]


def _four(page: _Page) -> Lines:
    X1, Y1, X2, Y2 = page.step.coefficients
    r, theta = page.angle
    S, C = page.sin[1], page.cos[1]

    def times(a: Line) -> Line:
        return Line(f"{r.text}*{a.text}", rf"{r.latex} \, {a.latex}")

    equations = [equal(page.sum((X1, times(S))), page.write(Y1)),
                 equal(page.sum((X2, times(C))), page.write(Y2))]  # fmt: skip
    for name, e in (("X1", X1), ("Y1", Y1), ("X2", X2), ("Y2", Y2)):
        page.define(name, e, f"{name[0]}_{name[1]}")
    length = Line(f"{r.text} = e*sqrt((Y1/X1)**2 + (Y2/X2)**2), e = +1 or -1",
                  rf"{r.latex} &= \varepsilon \sqrt{{(Y_1/X_1)^2 + (Y_2/X_2)^2}}, \quad "
                  r"\varepsilon = \pm 1")  # fmt: skip
    y = Line(f"Y1/(X1*{r.text})", rf"Y_1/(X_1 {r.latex})")
    x = Line(f"Y2/(X2*{r.text})", rf"Y_2/(X_2 {r.latex})")
    return equations, [length, _arc(theta, y, x)]


def _five(page: _Page) -> Lines:
    X1, Y1, Z1, X2, Y2, Z2 = page.step.coefficients
    r, theta = page.angle
    S, C = page.sin[1], page.cos[1]
    equations = [equal(page.sum((X1, S)), page.sum((Y1, None), (Z1, r))),
                 equal(page.sum((X2, C)), page.sum((Y2, None), (Z2, r)))]  # fmt: skip
    for name, e in zip(("X1", "Y1", "Z1", "X2", "Y2", "Z2"), page.step.coefficients, strict=True):
        page.define(name, e, f"{name[0]}_{name[1]}")
    square = Line(f"((Y1 + Z1*{r.text})/X1)**2 + ((Y2 + Z2*{r.text})/X2)**2 = 1",
                  rf"\left(\frac{{Y_1 + Z_1 {r.latex}}}{{X_1}}\right)^2 + "
                  rf"\left(\frac{{Y_2 + Z_2 {r.latex}}}{{X_2}}\right)^2 &= 1")  # fmt: skip
    y = Line(f"(Y1 + Z1*{r.text})/X1", rf"(Y_1 + Z_1 {r.latex})/X_1")
    x = Line(f"(Y2 + Z2*{r.text})/X2", rf"(Y_2 + Z_2 {r.latex})/X_2")
    return equations, [square, _arc(theta, y, x)]


def _six(page: _Page) -> Lines:
    W, X, Y, Z1, Z2 = (page.short(e) for e in page.step.coefficients)
    (Si, Sj), (Ci, Cj) = page.sin, page.cos
    one = page.sum((X, Ci), (Y, Si), (Z1, None))
    two = page.sum((X, Si), (negative(Y), Ci), (Z2, None))
    equations = [equal(page.sum((W, Sj)), one), equal(page.sum((W, Cj)), two)]
    product = page.graph.product
    _squares(page, [product(W, W)], X, Y, Z1, Z2)
    width = page.write(W)
    last = _arc(page.angle[1], _over(one, width, True), _over(two, width, True))
    return equations, [*_type_2_lines(page, 0), last]


def _squares(page: _Page, widths: list[Expression], X: Expression, Y: Expression, Z1: Expression,
             Z2: Expression) -> None:  # fmt: skip
    """Types 6 and 7 squared and added: X Si + Y Ci = Z with other X, Y, Z."""
    product, add = page.graph.product, page.graph.sum
    two = (2.0, ONE)
    S, C = page.sin[0], page.cos[0]
    page.definitions.append(Line(f"squared and added: X*{S.text} + Y*{C.text} = Z",
                                 rf"X \, {S.latex} + Y \, {C.latex} &= Z \quad "
                                 r"\text{(squared and added)}"))  # fmt: skip
    page.define("X", add((product(two, Z1, Y), product(two, Z2, X))))
    page.define("Y", add((product(two, Z1, X), negative(product(two, Z2, Y)))))
    squares = [negative(product(e, e)) for e in (X, Y, Z1, Z2)]
    page.define("Z", add([*widths, *squares]))


def _seven(page: _Page) -> Lines:
    W1, W2, X, Y, Z1, Z2, sense = (page.short(e) for e in page.step.coefficients)
    (Si, Sj), (Ci, Cj) = page.sin, page.cos
    product = page.graph.product
    one = page.sum((X, Ci), (Y, Si), (Z1, None))
    two = page.sum((X, Si), (negative(Y), Ci), (Z2, None))
    equations = [equal(page.sum((W1, Cj), (W2, Sj)), one),
                 equal(page.sum((product(sense, W1), Sj), (negative(product(sense, W2)), Cj)),
                       two)]  # fmt: skip
    widths = [product(W1, W1), product(W2, W2)]
    _squares(page, widths, X, Y, Z1, Z2)
    first, second = Line("R1", "R_1"), Line("R2", "R_2")
    # W1^2 + W2^2 times sine and cosine of the second angle
    y = page.sum((W2, first), (product(sense, W1), second))
    x = page.sum((W1, first), (negative(product(sense, W2)), second))

    return equations, [
        *_type_2_lines(page, 0), equal(first, one), equal(second, two), _arc(page.angle[1], y, x),
    ]  # fmt: skip


def _eight(page: _Page) -> Lines:
    X, Y, Z1, Z2 = (page.short(e) for e in page.step.coefficients)
    (Si, Sj), (Ci, Cj) = page.sin, page.cos
    equations = [equal(page.sum((X, Ci), (Y, Cj)), page.write(Z1)),
                 equal(page.sum((X, Si), (Y, Sj)), page.write(Z2))]  # fmt: skip
    words, graph = page.words, page.graph
    i, j = (words.joints.unknowns[u] for u in page.step.unknowns)
    rest = [t for t in j.terms if t not in i.terms]
    sign = rest[0][1]
    names = [
        sum_of([(words.variable(m, latex), s * sign) for m, s in rest]) for latex in (False, True)
    ]
    difference = Line(*names)
    C = Line(f"cos({names[0]})", rf"\cos({names[1]})")
    S = Line(f"sin({names[0]})", rf"\sin({names[1]})")
    if len(rest) == 1:
        frame = words.joints.frame(rest[0][0])
        C = Line(f"C{frame}", f"C_{{{frame}}}")
        S = Line(f"S{frame}", f"S_{{{frame}}}")
    product, add = graph.product, graph.sum
    squares = [product(Z1, Z1), product(Z2, Z2), negative(product(X, X)), negative(product(Y, Y))]
    top, bottom = page.write(add(squares)), page.write(product((2.0, ONE), X, Y))
    cosine = equal(C, _over(top, bottom, False))
    sine = Line(
        f"{S.text} = e*sqrt(1 - {C.text}**2), e = +1 or -1",
        rf"{S.latex} &= \varepsilon \sqrt{{1 - {C.latex}^2}}, \quad \varepsilon = \pm 1",
    )
    k1, k2 = Line("k1", "k_1"), Line("k2", "k_2")
    lines = [
        equal(k1, page.sum((X, None), (Y, C))), equal(k2, page.sum((product((sign, ONE), Y), S))),
    ]  # fmt: skip
    y, x = page.write(Z2), page.write(Z1)
    arc = _arc(page.angle[0], Line(f"k1*{_in(y.text)} - k2*{_in(x.text)}",
                                   f"k_1 {_in(y.latex)} - k_2 {_in(x.latex)}"),
               Line(f"k1*{_in(x.text)} + k2*{_in(y.text)}",
                    f"k_1 {_in(x.latex)} + k_2 {_in(y.latex)}"))  # fmt: skip
    return equations, [cosine, sine, _arc(difference, S, C), *lines, arc]


def _in(words: str) -> str:
    return f"({words})" if " " in words or words.startswith("-") else words


def sum_of(parts: list[tuple[str, float]]) -> str:
    """Names with signs, the first one positive."""
    out = ""
    for name, sign in parts:
        out += f" {'-' if sign < 0 else '+'} {name}" if out else name
    return out


def _quartic(page: _Page) -> Lines:
    theta, C, S = page.angle[0], page.cos[0], page.sin[0]
    names = [f"a{i}" for i in range(5)]
    for name, e in zip(names, page.step.coefficients, strict=True):
        page.define(name, page.short(e), f"a_{name[1]}")
    line = Line(
        f"a0 + a1*{C.text} + a2*{S.text} + a3*cos(2*({theta.text})) + a4*sin(2*({theta.text})) = 0",
        rf"a_0 + a_1 {C.latex} + a_2 {S.latex} + a_3 \cos 2({theta.latex}) + "
        rf"a_4 \sin 2({theta.latex}) &= 0",
    )
    return [line], [
        Line(
            f"{theta.text}: the real ones of up to four roots",
            rf"{theta.latex} &: \text{{the real ones of up to four roots}}",
        )
    ]


def _polynomial(page: _Page) -> Lines:
    r = page.angle[0]
    used = [(f"a{i}", i, e) for i, e in enumerate(page.step.coefficients) if e[0]]
    for name, _, e in used:
        page.define(name, page.short(e), f"a_{name[1]}")
    text = " + ".join(n if not i else f"{n}*{r.text}" + (f"**{i}" if i > 1 else "")
                      for n, i, _ in used)  # fmt: skip
    latex = " + ".join(f"a_{i}" + (f" {r.latex}^{{{i}}}" if i else "") for _, i, _ in used)
    degree = max(i for _, i, _ in used)
    return [Line(f"{text} = 0", rf"{latex} &= 0")], [
        Line(f"{r.text}: the real ones of {degree} roots",
             rf"{r.latex} &: \text{{the real ones of {degree} roots}}")
    ]  # fmt: skip


_WRITERS = {
    EquationType.TYPE_1: _one,
    EquationType.TYPE_2: _two,
    EquationType.TYPE_2_ZERO: _two_zero,
    EquationType.TYPE_3: _three,
    EquationType.TYPE_3_DIRECT: _three_direct,
    EquationType.TYPE_4: _four,
    EquationType.TYPE_5: _five,
    EquationType.TYPE_6: _six,
    EquationType.TYPE_7: _seven,
    EquationType.TYPE_8: _eight,
    EquationType.QUARTIC: _quartic,
    EquationType.POLYNOMIAL: _polynomial,
}
