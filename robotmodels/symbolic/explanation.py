"""Parts that all explanations share: formulas in numbers, and a document in text and in LaTeX."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .._arrays import Array
from ..latex_text import escaped, meaning_latex
from .notation import Notation

_WIDEST = 96
"""Characters of a row of a matrix; a wider one is printed entry by entry."""
COMPONENTS = tuple(vector + axis for vector in "snaP" for axis in "xyz")


@dataclass(frozen=True, slots=True, eq=False)
class FormulaNumbers:
    """Values of the symbols of formulas, for one robot."""

    variables: tuple[Any, ...]
    abbreviations: tuple[tuple[Any, Any], ...]
    constants: tuple[tuple[Any, float], ...]

    def known(self, q: Array) -> dict[Any, Any]:
        """Values of the symbols, vectorised over the leading axes of q (..., n)."""
        known: dict[Any, Any] = dict(self.constants)
        known |= {symbol: q[..., i] for i, symbol in enumerate(self.variables)}
        for symbol, meaning in self.abbreviations:
            known[symbol] = _number(meaning, known)
        return known

    def values(self, expr: Any, q: Array) -> Array:
        """Values (...) of an expression."""
        return np.zeros(q.shape[:-1]) + _number(expr, self.known(q))

    def matrix(self, entries: Any, q: Array) -> Array:
        """Values (..., rows, columns) of a matrix of expressions."""
        known = self.known(q)
        out = np.empty((*q.shape[:-1], *entries.shape))
        for i, j in np.ndindex(*entries.shape):
            out[..., i, j] = _number(entries[i, j], known)
        return out


def _number(expr: Any, known: dict[Any, Any]) -> Any:
    """Value of an expression; ``known`` has those of the symbols and keeps those of the parts."""
    value = known.get(expr)
    if value is None:
        if expr.is_number:
            value = float(expr)
        elif expr.is_Pow and expr.exp.is_Integer:
            value = _number(expr.base, known) ** int(expr.exp)
        else:
            of = [_number(arg, known) for arg in expr.args]
            if expr.is_Add:
                value = sum(of)
            elif expr.is_Mul:
                value = of[0]
                for factor in of[1:]:
                    value = value * factor
            else:  # the only functions of the abbreviations
                value = {"cos": np.cos, "sin": np.sin}[expr.func.__name__](of[0])
        known[expr] = value
    return value


def frame_label(frame: str | int | None) -> str:
    """A frame in a sentence."""
    return "the tool" if frame is None else frame if isinstance(frame, str) else f"R_{frame}"


class Document:
    """An explanation block by block, as plain text and as LaTeX."""

    def __init__(self, title: str, notation: Notation) -> None:
        self.notation = notation
        self._text = [title]
        self._latex = [rf"\textbf{{{escaped(title)}}}"]

    @property
    def text(self) -> str:
        """All blocks as plain text."""
        return "\n\n".join(self._text)

    @property
    def latex(self) -> str:
        """All blocks as LaTeX."""
        return "\n\n".join(self._latex)

    def add(self, text: str, latex: str = "") -> None:
        """Add a block; without ``latex`` it is a sentence."""
        self._text.append(text)
        self._latex.append(latex or prose(text))

    def add_lines(self, heading: str, lines: Sequence[str], formulas: Sequence[str]) -> None:
        """A heading with lines in text, and formulas in LaTeX."""
        latex = "\n\n".join([prose(heading), *map(equation, formulas)])
        self.add("\n".join([heading, *(f"  {line}" for line in lines)]), latex)

    def add_symbols(
        self, shown: Iterable[Any], abbreviations: Sequence[tuple[Any, Any]], every: bool = False
    ) -> None:
        """Constants (those that occur, or every one) and abbreviations."""
        tex = self.notation.tex
        occur = set().union(
            *(x.free_symbols for x in shown), *(x.free_symbols for _, x in abbreviations)
        )
        used = [c for c in self.notation.constants if every or c.symbol in occur]
        if used:
            values = [(c, f"{c.symbol.name} = {c.value:.10g} {c.unit}") for c in used]
            rows = [
                (tex(c.symbol.name), rf"{tex(f'{c.value:.10g}')} \, \mathrm{{{c.unit}}} \quad "
                 rf"({meaning_latex(c.meaning)})")
                for c in used
            ]  # fmt: skip
            lines = [f"  {value} ({c.meaning})" for c, value in values]
            self.add("\n".join(["Constants", *lines]), f"Constants\n\n{aligned(rows)}")
        if abbreviations:
            meanings = [(s.name, self.notation.meanings[s]) for s, _ in abbreviations]
            lines = [f"  {name} = {meaning}" for name, meaning in meanings]
            rows = [(tex(name), tex(meaning)) for name, meaning in meanings]
            self.add("\n".join(["Abbreviations", *lines]), f"Abbreviations\n\n{aligned(rows)}")

    def add_transform(self, name: str, motion: str, M: Any, meaning: str = "") -> None:
        """A step ``name = motion = matrix``, entry by entry where it is wide."""
        cells = self._cells(M)
        factors = motion if "(" in motion else motion.replace(" ", "*")
        equal = f"{self.notation.tex(name)} = {self.notation.tex(factors)}"
        latex = f"${self.notation.tex(name)}$, {prose(meaning)}\n\n" if meaning else ""
        left = f"{name}, {meaning}," if meaning else name
        if _is_wide(cells):
            lines = [f"  {line}" for line in _components(cells)]
            latex += self._components_latex(equal, cells)
        else:
            lines = _bracketed(cells)
            latex += self._matrix_latex(equal, cells)
        self.add("\n".join([f"{left} = {motion} =", *lines]), latex)

    def add_components(self, name: str, M: Any, product: str, rest: str) -> None:
        """A result: its matrix if that is not wide, then its components."""
        cells = self._cells(M)
        of = self.notation.tex(product.replace(" ", "*"))
        title = f"{self.notation.tex(name)} = {of}" if name else of
        equal = f"{self.notation.tex(name or 'T')} = {of}"
        lines, latex = _components(cells), self._components_latex(equal, cells)
        if not _is_wide(cells):
            lines = [*_bracketed(cells), "", *lines]
            latex = f"{self._matrix_latex(equal, cells)}\n\n{latex}"
        heading = f"Components of {f'{name} = ' if name else ''}{product}{rest}"
        latex = f"Components of ${title}${prose(rest)}\n\n{latex}"
        self.add("\n".join([heading, "", *lines]), latex)

    def add_matrix(
        self, heading: str, name: str, M: Any, rows: Sequence[str], columns: Sequence[str]
    ) -> None:
        """A matrix; column by column and without its zeros where it is wide."""
        cells = self._cells(M)
        lines = _bracketed(cells)
        if _is_wide(cells):
            lines = []
            for j, column in enumerate(columns):
                entries = [f"    {rows[i]} = {r[j]}" for i, r in enumerate(cells) if r[j] != "0"]
                lines += [f"  {column}", *(entries or ["    0"])]
        # more than ten columns need another counter of amsmath; an array has no such limit
        body = f"{{{'c' * M.shape[1]}}}\n{self._rows_latex(cells)}\n\\end{{array}}\\right]"
        matrix = equation(f"{self.notation.tex(name)} =\n\\left[\\begin{{array}}{body}")
        self.add(heading)
        self._text.append("\n".join(lines))
        self._latex.append(matrix)

    def _cells(self, M: Any) -> list[list[str]]:
        return [[self.notation.text(v) for v in M[i, :]] for i in range(M.shape[0])]

    def _rows_latex(self, cells: list[list[str]]) -> str:
        return " \\\\\n".join(" & ".join(map(self.notation.tex, row)) for row in cells)

    def _matrix_latex(self, equal: str, cells: list[list[str]]) -> str:
        body = self._rows_latex(cells)
        return equation(f"{equal} =\n\\begin{{bmatrix}}\n{body}\n\\end{{bmatrix}}")

    def _components_latex(self, equal: str, cells: list[list[str]]) -> str:
        left, right = equal.split(" = ", 1)
        parts = [line.split(" = ") for line in _components(cells)]
        rows = [(f"{a[0]}_{a[1]}", self.notation.tex(b)) for a, b in parts]
        return aligned([(left, right), *rows])


def prose(text: str) -> str:
    """A sentence in LaTeX, frames typeset."""
    return re.sub(r"\bR\\_(\d+)", r"$R_{\1}$", escaped(text))


def _is_wide(cells: list[list[str]]) -> bool:
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    return sum(widths) + 2 * len(widths) > _WIDEST


def _bracketed(cells: list[list[str]]) -> list[str]:
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    lines = ["  ".join(f"{c:>{w}}" for c, w in zip(row, widths, strict=True)) for row in cells]
    ends = ["⎡⎤", *["⎢⎥"] * (len(cells) - 2), "⎣⎦"] if len(cells) > 1 else ["[]"]
    return [f"  {left} {line} {right}" for (left, right), line in zip(ends, lines, strict=True)]


def _components(cells: list[list[str]]) -> list[str]:
    return [f"{name} = {cells[k % 3][k // 3]}" for k, name in enumerate(COMPONENTS)]


def aligned(rows: Iterable[tuple[str, str]]) -> str:
    """Equations below each other in LaTeX."""
    body = " \\\\\n".join(f"{left} &= {right}" for left, right in rows)
    return f"\\begin{{align*}}\n{body}\n\\end{{align*}}"


def equation(body: str) -> str:
    """A displayed equation in LaTeX."""
    return f"\\begin{{equation*}}\n{body}\n\\end{{equation*}}"
