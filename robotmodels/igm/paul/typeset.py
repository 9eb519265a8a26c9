"""LaTeX of explanations, made from their text, so that both have the same content.

A line of an explanation is markup: words, with formulas between dollar signs. Its text is the
markup without the signs. A formula is Python, whose syntax tree is written as LaTeX, a product of
matrices such as ``1T0 U0``, or a formula of the literature such as ``X S + Y C = Z``.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Mapping, Sequence

from ...latex_text import escaped, powers

_OPERATORS = {ast.Add: " + ", ast.Sub: " - ", ast.Mult: r" \, ", ast.MatMult: r" \times "}
_PYTHON = (
    (r"\+1 or -1", "pm*1"), (r"\+-", "pm*"), (r"\^", "**"), (" x ", "@"), (r"(\d)π", r"\1*π"),
    (r"(?<=[\w)]) (?=[A-Za-z(])", "*"),
)  # fmt: skip
"""Abbreviations of formulas in print, and their Python."""
_MATRICES = re.compile(r"((\d+T\d+|U0|T|[ZE](\^-1)?|1|=)( |$))+")
_LETTERS = {"e": r"\varepsilon", "π": r"\pi", "pm": r"\pm", "theta": r"\theta"}


def plain(markup: str) -> str:
    """The text of markup."""
    return markup.replace("$", "")


def display(rows: Sequence[str]) -> str:
    """Rows of LaTeX in an environment of their own, aligned at their equals signs."""
    aligned = " \\\\\n".join(row.replace(" = ", " &= ", 1) for row in rows)
    return f"\\begin{{align*}}\n{aligned}\n\\end{{align*}}"


class Typesetter:
    """Writes LaTeX; ``symbols`` has the LaTeX of names."""

    def __init__(self, symbols: Mapping[str, str]) -> None:
        self.symbols = symbols

    def prose(self, markup: str) -> str:
        """A sentence, to stand outside mathematics."""
        parts = markup.split("$")
        parts[::2] = map(escaped, parts[::2])
        parts[1::2] = [f"${self.formula(part)}$" for part in parts[1::2]]
        return "".join(parts)

    def rows(self, lines: Sequence[str]) -> str:
        """Lines that are formulas, or words and formulas, in an environment of their own."""
        every = [line.split("$") if "$" in line else ["", line] for line in lines]
        for parts in every:
            parts[::2] = [rf"\text{{{part}}}" if part else "" for part in parts[::2]]
            parts[1::2] = map(self.formula, parts[1::2])
        return display(["".join(parts) for parts in every])

    def formula(self, text: str) -> str:
        """A formula, to stand in mathematics."""
        if _MATRICES.fullmatch(text):
            latex = re.sub(r"(\d+)T(\d+)", r"{}^{\1}\\mathbf{T}_{\2}", text)
            latex = re.sub(r"(?<!\{)\b([UZTE])(0?)(?=\b|\^)", r"\\mathbf{\1}_{\2}", latex)
            latex = latex.replace("_{}", "").replace("^-1", "^{-1}")
            return latex.replace(" ", r" \, ").replace(r" \, = \, ", " = ")
        for words, python in _PYTHON:
            text = re.sub(words, python, text)
        sides = re.split("( [=<>] )", text)
        sides[::2] = map(self._side, sides[::2])
        return "".join(sides)

    def _side(self, text: str) -> str:
        source = text.removesuffix("'")
        prime = text[len(source) :]
        tree = ast.parse(source, mode="eval").body
        return self._node(tree, source.encode(), bare=not prime) + prime

    def _node(self, node: ast.expr, source: bytes, bare: bool = False) -> str:
        """LaTeX of a node, in parentheses where its text is."""
        if not bare:
            start, end = node.col_offset, node.end_col_offset or 0
            if source[start - 1 : start] == b"(" and source[end : end + 1] == b")":
                return rf"\left({self._node(node, source, True)}\right)"
        if isinstance(node, ast.UnaryOp):
            return f"-{self._node(node.operand, source)}"
        if isinstance(node, ast.BinOp):
            is_fraction = isinstance(node.op, ast.Div)
            a, b = (self._node(part, source, is_fraction) for part in (node.left, node.right))
            if is_fraction or isinstance(node.op, ast.Pow):
                return rf"\frac{{{a}}}{{{b}}}" if is_fraction else f"{a}^{{{b}}}"
            return a + _OPERATORS[type(node.op)] + b
        if isinstance(node, ast.Call):
            assert isinstance(node.func, ast.Name)
            name, arguments = node.func.id, [self._node(a, source, True) for a in node.args]
            if name in "SC":  # of the angle i + j
                return f"{name}_{{{arguments[0]}}}"
            if name == "sqrt":
                return rf"\sqrt{{{arguments[0]}}}"
            function = rf"\operatorname{{{name}}}\left" if name == "atan2" else rf"\{name}\left"
            return rf"{function}({', '.join(arguments)}\right)"
        if isinstance(node, ast.Name):
            return self.symbols.get(node.id) or _letter(node.id)
        return powers(ast.get_source_segment(source.decode(), node) or "")


def _letter(name: str) -> str:
    """A letter with its number as an index."""
    letters = name.rstrip("0123456789ij") or name
    index = name[len(letters) :]
    latex = _LETTERS.get(letters, letters.replace("θ", r"\theta"))
    return f"{latex}_{{{index}}}" if index else latex
