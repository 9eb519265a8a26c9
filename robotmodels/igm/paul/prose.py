"""Formulas and sentences in two kinds of print, so that the LaTeX says what the text says."""

from __future__ import annotations

import re
from dataclasses import dataclass
from fractions import Fraction
from math import pi

from ...latex_text import escaped, powers
from ...table_text import SMALLEST


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


def number(value: float) -> Line:
    """A number with twelve digits."""
    text = f"{value:.12g}"
    return Line(text, powers(text))


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
