"""LaTeX of formulas and sentences, made from their text, so that both say the same.

The text of a formula is Python: its syntax tree is written as LaTeX.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import pi

from ...latex_text import escaped, powers
from ...table_text import SMALLEST

_OPERATORS = {ast.Add: " + ", ast.Sub: " - ", ast.Mult: r" \, "}
_SIGNS, _SIGNS_LATEX = ", e = +1 or -1", r", \quad \varepsilon = \pm 1"
_SQUARED, _SQUARED_LATEX = "squared and added: ", r" \quad \text{(squared and added)}"


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


class Typesetter:
    """LaTeX of formulas and of sentences with formulas."""

    def formula(self, text: str) -> Line:
        """An expression, or an equation with what stands before and behind it."""
        body, after = text, ""
        for mark, latex in ((_SIGNS, _SIGNS_LATEX), (_SQUARED, _SQUARED_LATEX)):
            if mark in body:
                body, after = body.replace(mark, ""), latex
        body, colon, words = body.partition(": ")
        if colon:
            after = rf": \text{{{words}}}"
        sides = re.split("( [=<>] )", body)
        sides[::2] = [self._side(side) for side in sides[::2]]
        return Line(text, "".join(sides) + after)

    def _side(self, text: str) -> str:
        prime = "'" if text.endswith("'") else ""
        source = text.removesuffix("'")
        wrapped = prime and source.startswith("(")
        tree = ast.parse(source, mode="eval").body
        latex = self._node(tree, source.encode(), bare=not wrapped)
        return latex + prime

    def _node(self, node: ast.expr, source: bytes, bare: bool = False) -> str:
        """LaTeX of a node, in parentheses where its text is."""
        if not bare:
            start, end = node.col_offset, node.end_col_offset or 0
            if source[start - 1 : start] == b"(" and source[end : end + 1] == b")":
                return rf"\left({self._node(node, source, True)}\right)"
        if isinstance(node, ast.UnaryOp):
            return f"-{self._node(node.operand, source)}"
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Div):
            top, under = (self._node(part, source, True) for part in (node.left, node.right))
            return rf"\frac{{{top}}}{{{under}}}"
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow):
            base, power = self._node(node.left, source), self._node(node.right, source)
            return f"{base}^{{{power}}}"
        if isinstance(node, ast.BinOp):
            between = _OPERATORS[type(node.op)]
            return self._node(node.left, source) + between + self._node(node.right, source)
        if isinstance(node, ast.Call):
            assert isinstance(node.func, ast.Name)
            arguments = ", ".join(self._node(a, source, True) for a in node.args)
            if node.func.id == "sqrt":
                return rf"\sqrt{{{arguments}}}"
            if node.func.id == "atan2":
                return rf"\operatorname{{atan2}}\left({arguments}\right)"
            return rf"\{node.func.id}({arguments})"
        if isinstance(node, ast.Name):
            return self.symbol(node.id)
        return powers(ast.get_source_segment(source.decode(), node) or "")

    def symbol(self, name: str) -> str:
        """A letter with its number as an index."""
        greek = {"e": r"\varepsilon", "π": r"\pi"}
        if name in greek:
            return greek[name]
        letters = name.rstrip("0123456789ij")
        index = name[len(letters) :]
        letters = letters.replace("θ", r"\theta")
        return f"{letters}_{{{index}}}" if index else letters

    def sentence(self, words: str, *parts: Line | Prose | str) -> Prose:
        """A sentence; each ``{}`` of it is a formula or other words."""
        pieces = words.split("{}")
        text, latex = pieces[0], escaped(pieces[0])
        for part, piece in zip(parts, pieces[1:], strict=True):
            part = self.formula(part) if isinstance(part, str) else part
            text += part.text + piece
            latex += f"${part.latex}$" if isinstance(part, Line) else part.latex
            latex += escaped(piece)
        return Prose(text, latex)

    def joined(self, parts: Sequence[Line | Prose | str], by: str) -> Prose:
        """Formulas or words with something between them."""
        return self.sentence(by.join(["{}"] * len(parts)), *parts)


def number(value: float) -> str:
    """A number with twelve digits."""
    return f"{value:.12g}"


def angle(value: float) -> str:
    """A positive angle: a fraction of pi if it is one to rounding, else radians."""
    ratio = Fraction(value / pi).limit_denominator(12)
    if not ratio or abs(float(ratio) * pi - value) >= SMALLEST:
        return number(value)
    top = "π" if ratio.numerator == 1 else f"{ratio.numerator}π"
    return top if ratio.denominator == 1 else f"{top}/{ratio.denominator}"


def display(rows: Sequence[str]) -> str:
    """Rows of LaTeX in an environment of their own, aligned at their equals signs."""
    aligned = [re.sub(" ([=:]) |: ", lambda m: f" &{m[0].strip()} ", row, count=1) for row in rows]
    return "\\begin{align*}\n" + " \\\\\n".join(aligned) + "\n\\end{align*}"


def type_formula(words: str) -> Line:
    """The formula of a type of equation, in the notation of the literature."""
    latex = words.replace("+-", r"\pm ").replace("theta", r"\theta")
    latex = re.sub(r"\bcos\(([^)]*)\)", r"\\cos(\1)", latex)
    latex = re.sub(r"\bsin\(([^)]*)\)", r"\\sin(\1)", latex)
    latex = re.sub(r"\b([SC])\(([^)]*)\)", r"\1_{\2}", latex)
    latex = re.sub(r"\b([A-Za-z])(\d|[ij]\b)", r"\1_{\2}", latex)
    latex = re.sub(r"(?<=[\w}]) (?=[A-Za-z])", r" \\, ", latex)
    return Line(words, latex.replace(", ", r", \; ").replace(r"\, \; ", r"\, "))


def matrices(words: str) -> Line:
    """A product of matrices, or an equation between two."""
    latex = re.sub(r"(\d+)T(\d+)", r"{}^{\1}\\mathbf{T}_{\2}", words)
    latex = re.sub(r"(?<!\{)\b([UZTE])(0?)(?=\b|\^)", r"\\mathbf{\1}\2", latex)
    latex = latex.replace("U}0", "U}_0").replace("^-1", "^{-1}").replace(" ", r" \, ")
    return Line(words, latex.replace(r" \, = \, ", " = "))
