"""Parts that all explanations share: formulas in numbers, and a document in text and in LaTeX."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from math import prod
from typing import Any

import numpy as np

from .._arrays import Array
from ..latex_text import escaped, meaning_latex
from .notation import Notation

_WIDEST = 96
"""Characters of a row of a matrix; a wider one is printed entry by entry."""


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
                value = prod(of)
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
        notation.check_new_names()
        self.notation = notation
        self._text = [title]
        self._latex = [rf"\textbf{{{escaped(title)}}}"]

    def of(self, draft: Any) -> Any:
        """The explanation with all blocks as its text and LaTeX."""
        return replace(draft, text="\n\n".join(self._text), latex="\n\n".join(self._latex))

    def add(self, text: str, latex: str = "") -> None:
        """Add a block; without ``latex`` it is a sentence."""
        self._text.append(text)
        self._latex.append(latex or prose(text))

    def add_lines(self, heading: str, lines: Iterable[str], latex: str) -> None:
        """A heading with lines in text, and with their formulas in LaTeX."""
        text = "\n".join([heading, *(f"  {line}" for line in lines)])
        self.add(text, f"{prose(heading)}\n\n{latex}")

    def add_symbols(
        self, shown: Iterable[Any], abbreviations: Sequence[tuple[Any, Any]], every: bool = False
    ) -> None:
        """Constants (those that occur, or every one) and abbreviations."""
        tex = self.notation.tex
        formulas = [*shown, *(meaning for _, meaning in abbreviations)]
        occur = set().union(*(x.free_symbols for x in formulas))
        lines, rows = [], []
        for c in self.notation.constants:
            if every or c.symbol in occur:
                name, value = c.symbol.name, f"{c.value:.10g}"
                lines.append(f"{name} = {value} {c.unit} ({c.meaning})")
                unit = rf" \, \mathrm{{{c.unit}}} \quad ({meaning_latex(c.meaning)})"
                rows.append((tex(name), tex(value) + unit))
        if rows:
            self.add_lines("Constants", lines, aligned(rows))
        meanings = [(s.name, self.notation.meanings[s]) for s, _ in abbreviations]
        if meanings:
            rows = [(tex(name), tex(meaning)) for name, meaning in meanings]
            self.add_lines("Abbreviations", map(" = ".join, meanings), aligned(rows))

    def add_transform(self, name: str, motion: str, M: Any, meaning: str = "") -> None:
        """A step ``name = motion = matrix``, entry by entry where it is wide."""
        factors = motion if "(" in motion else motion.replace(" ", "*")
        symbol, factors = self.notation.tex(name), self.notation.tex(factors)
        text, latex = self._pose(symbol, factors, M, every=False)
        if meaning:
            name, latex = f"{name}, {meaning},", f"${symbol}$, {prose(meaning)}\n\n{latex}"
        self.add(f"{name} = {motion} =\n{text}", latex)

    def add_components(self, name: str, M: Any, product: str, rest: str) -> None:
        """A result: its matrix if that is not wide, then its components."""
        of, symbol = self.notation.tex(product.replace(" ", "*")), self.notation.tex(name or "T")
        text, latex = self._pose(symbol, of, M, every=True)
        title = f"{symbol} = {of}" if name else of
        heading = f"Components of {f'{name} = ' if name else ''}{product}{rest}"
        self.add(f"{heading}\n\n{text}", f"Components of ${title}${prose(rest)}\n\n{latex}")

    def _pose(self, left: str, right: str, M: Any, every: bool) -> tuple[str, str]:
        """The matrix of a pose, its components where that is wide, or both, as text and LaTeX."""
        cells = self._cells(M)
        text, latex = [], []
        if not _is_wide(cells):
            text.append("\n".join(_bracketed(cells)))
            body = f"\\begin{{bmatrix}}\n{self._rows_latex(cells)}\n\\end{{bmatrix}}"
            latex.append(equations([f"{left} = {right} =\n{body}"]))
        if every or not text:
            names = [(v, a, cells[i][j]) for j, v in enumerate("snaP") for i, a in enumerate("xyz")]
            indent = "" if every else "  "
            text.append("\n".join(f"{indent}{v}{a} = {cell}" for v, a, cell in names))
            rows = [(f"{v}_{a}", self.notation.tex(cell)) for v, a, cell in names]
            latex.append(aligned([(left, right), *rows]))
        return "\n\n".join(text), "\n\n".join(latex)

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
        matrix = equations([f"{self.notation.tex(name)} =\n\\left[\\begin{{array}}{body}"])
        self.add(heading)
        self._text.append("\n".join(lines))
        self._latex.append(matrix)

    def _cells(self, M: Any) -> list[list[str]]:
        return [[self.notation.text(v) for v in M[i, :]] for i in range(M.shape[0])]

    def _rows_latex(self, cells: list[list[str]]) -> str:
        return " \\\\\n".join(" & ".join(map(self.notation.tex, row)) for row in cells)


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


def aligned(rows: Iterable[tuple[str, str]]) -> str:
    """Equations below each other in LaTeX."""
    body = " \\\\\n".join(f"{left} &= {right}" for left, right in rows)
    return f"\\begin{{align*}}\n{body}\n\\end{{align*}}"


def equations(bodies: Iterable[str]) -> str:
    """Displayed equations in LaTeX."""
    lines = (f"\\begin{{equation*}}\n{body}\n\\end{{equation*}}" for body in bodies)
    return "\n\n".join(lines)
