"""Formulas and sentences in two kinds of print, so that the LaTeX says what the text says."""

from __future__ import annotations

import re
from dataclasses import dataclass
from fractions import Fraction
from math import pi

from ...table_text import SMALLEST

_SPECIAL = {
    "\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}",
    "<": "$<$", ">": "$>$", "*": "$*$", "|": "$|$",
} | {c: f"\\{c}" for c in "&%$#_{}"}  # fmt: skip
_GREEK = {
    "α": r"\alpha", "β": r"\beta", "γ": r"\gamma", "θ": r"\theta", "μ": r"\mu", "π": r"\pi",
    "σ": r"\sigma",
}  # fmt: skip
_DIGITS = str.maketrans("₀₁₂₃₄₅₆₇₈₉", "0123456789")


@dataclass(frozen=True, slots=True)
class Line:
    """A formula as text and as LaTeX, the latter to stand in mathematics."""

    text: str
    latex: str


@dataclass(frozen=True, slots=True)
class Prose:
    """Words as text and as LaTeX, the latter to stand outside mathematics."""

    text: str
    latex: str


def said(words: str, *parts: Line | Prose) -> Prose:
    """A sentence; each ``{}`` of it is a formula or other words."""
    pieces = words.split("{}")
    text, latex = pieces[0], escaped(pieces[0])
    for part, piece in zip(parts, pieces[1:], strict=True):
        text += part.text + piece
        latex += f"${part.latex}$" if isinstance(part, Line) else part.latex
        latex += escaped(piece)
    return Prose(text, latex)


def joined(parts: list[Line] | list[Prose], by: str) -> Prose:
    """Formulas or words with something between them."""
    return said(by.join(["{}"] * len(parts)), *parts)


def escaped(words: str) -> str:
    """Words as LaTeX, ``code`` between backticks in a fixed width."""
    plain = "".join(_SPECIAL.get(c, c) for c in words)
    return re.sub("`([^`]*)`", r"\\texttt{\1}", plain)


def number(value: float) -> Line:
    """A number with twelve digits."""
    text = f"{value:.12g}"
    return Line(text, _powers(text))


def angle(value: float) -> Line:
    """An angle: a fraction of pi if it is one to rounding, else radians."""
    ratio = Fraction(value / pi).limit_denominator(12)
    if not ratio or abs(float(ratio) * pi - value) >= SMALLEST:
        return number(value)
    sign = "-" if ratio < 0 else ""
    top = "" if abs(ratio.numerator) == 1 else str(abs(ratio.numerator))
    if ratio.denominator == 1:
        return Line(f"{sign}{top}π", rf"{sign}{top}\pi")
    under = ratio.denominator
    return Line(f"{sign}{top}π/{under}", rf"{sign}\frac{{{top}\pi}}{{{under}}}")


def equal(left: Line, right: Line) -> Line:
    """A row of an equation environment."""
    return Line(f"{left.text} = {right.text}", f"{left.latex} &= {right.latex}")


def display(lines: list[Line]) -> str:
    """Rows in an environment of their own."""
    rows = " \\\\\n".join(line.latex for line in lines)
    return f"\\begin{{align*}}\n{rows}\n\\end{{align*}}"


def type_formula(words: str) -> Line:
    """The formula of a type of equation."""
    latex = words.replace("+-", r"\pm ").replace("theta", r"\theta")
    latex = re.sub(r"\bcos\(([^)]*)\)", r"\\cos(\1)", latex)
    latex = re.sub(r"\bsin\(([^)]*)\)", r"\\sin(\1)", latex)
    latex = re.sub(r"\b([SC])\(([^)]*)\)", r"\1_{\2}", latex)
    latex = re.sub(r"\b([A-Za-z])(\d|[ij]\b)", r"\1_{\2}", latex)
    latex = re.sub(r"(?<=[\w}]) (?=[A-Za-z])", r" \\, ", latex)
    return Line(words, latex.replace(", ", r", \; ").replace(r"\, \; ", r"\, "))


def table_latex(table: str) -> str:
    """The printed table of a robot as a LaTeX array: same columns, same cells."""
    rows = [line.strip("│").split("│") for line in table.splitlines() if line.startswith("│")]
    head, *body = [[_cell(cell.strip()) for cell in row] for row in rows]
    lines = " \\\\\n".join(" & ".join(row) for row in body)
    columns = "c|" + "c" * (len(head) - 1)
    return (
        f"\\begin{{equation*}}\n\\begin{{array}}{{{columns}}}\n{' & '.join(head)} \\\\\n"
        f"\\hline\n{lines}\n\\end{{array}}\n\\end{{equation*}}"
    )


def _cell(words: str) -> str:
    words = re.sub("[₀-₉]+", lambda m: f"_{{{m[0].translate(_DIGITS)}}}", words)
    words = re.sub(r"^([σμγαβθdbr])j$", r"\1_{j}", words)
    words = re.sub("[αβγθμπσ]", lambda m: _GREEK[m[0]], words)
    return _powers(words)


def _powers(words: str) -> str:
    return re.sub(r"(?<=\d)e([+-]?\d+)", lambda m: rf" \cdot 10^{{{int(m[1])}}}", words)
