"""The three matrices as plain text and as LaTeX, and what other explanations print with them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ...latex_text import escaped, meaning_latex, powers
from ...symbolic_dgm._notation import Notation
from ._numbers import FormulaNumbers

_WIDEST = 100  # characters in a row: a wider matrix is printed column by column
_ROWS = ("vx", "vy", "vz", "wx", "wy", "wz")


def constant_lines(numbers: FormulaNumbers, notation: Notation, shown: Sequence[Any]) -> list[str]:
    """Constants and abbreviations that occur in some expressions."""
    constants = _used(numbers, notation, shown)
    out = []
    if constants:
        out += ["", "Constants"]
        out += [f"  {c.symbol.name} = {c.value:.10g} {c.unit} ({c.meaning})" for c in constants]
    if numbers.abbreviations:
        out += ["", "Abbreviations"]
        out += [f"  {s.name} = {notation.meanings[s][0]}" for s, _ in numbers.abbreviations]
    return out


def constants_latex(numbers: FormulaNumbers, notation: Notation, shown: Sequence[Any]) -> list[str]:
    """The same as amsmath environments."""
    values = [
        (
            notation.latex[c.symbol],
            rf"{powers(f'{c.value:.10g}')} \, \mathrm{{{c.unit}}} \quad "
            rf"({meaning_latex(c.meaning)})",
        )
        for c in _used(numbers, notation, shown)
    ]
    meanings = [(notation.latex[s], notation.meanings[s][1]) for s, _ in numbers.abbreviations]
    out = []
    for heading, lines in (("Constants", values), ("Abbreviations", meanings)):
        if lines:
            body = " \\\\\n".join(f"{left} &= {right}" for left, right in lines)
            out += [heading, f"\\begin{{align*}}\n{body}\n\\end{{align*}}"]
    return out


def _used(numbers: FormulaNumbers, notation: Notation, shown: Sequence[Any]) -> list[Any]:
    symbols: set[Any] = set().union(*(expr.free_symbols for expr in shown))
    for _, meaning in numbers.abbreviations:
        symbols |= meaning.free_symbols
    return [c for c in notation.constants if c.symbol in symbols]


def row_names(rows: Sequence[int]) -> list[str]:
    """Of rows of a Jacobian by number."""
    return [_ROWS[row] for row in rows]


def matrix_lines(
    matrix: Any, notation: Notation, column_names: Sequence[str], row_names: Sequence[str] = _ROWS
) -> list[str]:
    """A matrix in brackets; one that is too wide by its entries, without the zeros."""
    rows, columns = matrix.shape
    cells = [[notation.text(matrix[i, j]) for j in range(columns)] for i in range(rows)]
    widths = [max(len(row[j]) for row in cells) for j in range(columns)]
    if sum(widths) + 2 * columns <= _WIDEST:
        left = "⎡" + "⎢" * (rows - 2) + "⎣" if rows > 1 else "["
        right = "⎤" + "⎥" * (rows - 2) + "⎦" if rows > 1 else "]"
        lines = ["  ".join(f"{c:>{w}}" for c, w in zip(row, widths, strict=True)) for row in cells]
        return [f"  {a} {line} {b}" for a, line, b in zip(left, lines, right, strict=True)]
    out = []
    for j in range(columns):
        out.append(f"  {column_names[j]}")
        out += [
            f"    {row_names[i]} = {cells[i][j]}" for i in range(rows) if cells[i][j] != "0"
        ] or ["    0"]
    return out


def matrix_latex(name: str, matrix: Any, notation: Notation) -> str:
    """A matrix as a displayed equation."""
    rows, columns = matrix.shape
    body = " \\\\\n".join(
        " & ".join(notation.text(matrix[i, j], latex=True) for j in range(columns))
        for i in range(rows)
    )
    # more than ten columns need another counter of amsmath; an array has no such limit
    return (
        f"\\begin{{equation*}}\n{name} =\n\\left[\\begin{{array}}{{{'c' * columns}}}\n{body}\n"
        "\\end{array}\\right]\n\\end{equation*}"
    )


def frame_letter(name: str) -> str:
    """Of a frame's name in an index: its number, or E for the frame that is explained."""
    return name[2:] if name.startswith("R_") and name[2:].isdigit() else "E"


def reduced_name(projection: str, intermediate: str, last: int) -> str:
    """Such as ``3J6,4``."""
    return f"{frame_letter(projection)}J{last},{frame_letter(intermediate)}"


def reduced_name_latex(projection: str, intermediate: str, last: int) -> str:
    """The same in LaTeX."""
    i, j = frame_letter(projection), frame_letter(intermediate)
    return rf"{{}}^{{{i}}}\mathbf{{J}}_{{{last},{j}}}"


def jacobian_text(e: Any, last: int, column_names: Sequence[str], notation: Notation) -> str:
    """The three matrices as plain text; ``e`` is the explanation without its texts."""
    i, j = frame_letter(e.projection), frame_letter(e.intermediate)
    name = reduced_name(e.projection, e.intermediate, last)
    out = [
        f"Jacobian of {e.robot}: motion of {e.frame} in the world",
        "",
        f"J = diag({i}R, {i}R) [1, -[L]x; 0, 1] {name} with projection frame {e.projection} and "
        f"intermediate frame {e.intermediate}",
    ]
    shown = [e.rotation, e.lever, e.reduced]
    out += constant_lines(e.numbers, notation, shown)
    out += ["", f"{i}R, the axes of {e.projection} in the world", ""]
    out += matrix_lines(e.rotation, notation, ("s", "n", "a"), ("x", "y", "z"))
    out += ["", f"L, from O_{j} to the origin of {e.frame}, in the axes of {e.projection}", ""]
    out += [f"  L{a} = {notation.text(v)}" for a, v in zip("xyz", e.lever, strict=True)]
    out += ["", f"{name}, rows vx, vy, vz, wx, wy, wz", ""]
    out += matrix_lines(e.reduced, notation, column_names)
    return "\n".join(out)


def jacobian_latex(e: Any, last: int, notation: Notation) -> str:
    """The same as paragraphs and amsmath environments."""
    i = frame_letter(e.projection)
    name = reduced_name_latex(e.projection, e.intermediate, last)
    R = rf"\mathbf{{R}}_{{{i}}}"
    title = escaped(f"Jacobian of {e.robot}: motion of {e.frame} in the world")
    product = (
        rf"\mathbf{{J}} = \begin{{bmatrix}} {R} & \mathbf{{0}} \\ \mathbf{{0}} & {R} "
        r"\end{bmatrix}"
        r" \begin{bmatrix} \mathbf{1} & -\hat{\mathbf{L}} \\ \mathbf{0} & \mathbf{1} "
        rf"\end{{bmatrix}} {name}"
    )
    blocks = [rf"\textbf{{{title}}}", f"\\begin{{equation*}}\n{product}\n\\end{{equation*}}"]
    blocks += constants_latex(e.numbers, notation, [e.rotation, e.lever, e.reduced])
    blocks += [
        escaped(f"The axes of {e.projection} in the world"),
        matrix_latex(R, e.rotation, notation),
        escaped(f"From the origin of {e.intermediate} to that of {e.frame}, in the axes of "
                f"{e.projection}"),
        matrix_latex(r"\mathbf{L}", e.lever, notation),
        "The third matrix",
        matrix_latex(name, e.reduced, notation),
    ]  # fmt: skip
    return "\n\n".join(blocks)
