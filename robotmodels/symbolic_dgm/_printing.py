"""The derivation as plain text and as LaTeX."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

from ..latex_text import escaped, meaning_latex, powers, table_latex
from ._notation import Notation
from .result import DirectModelExplanation, SymbolicTransform

_WIDEST = 88  # characters in the four columns: what is wider is printed by component
_COMPONENTS = tuple(vector + axis for vector in "snaP" for axis in "xyz")


def derivation_text(e: DirectModelExplanation, table: str, notation: Notation) -> str:
    """The derivation as plain text."""
    last = e.product.name[1:]
    chain = " ".join(t.name for t in e.factors) or "1"
    out = [f"Direct geometric model of {e.robot}: pose of {e.frame} in the world", "", table]
    if notation.constants:
        out += ["", "Constants"]
        out += [
            f"  {c.symbol.name} = {c.value:.10g} {c.unit} ({c.meaning})" for c in notation.constants
        ]
    if e.abbreviations:
        out += ["", "Abbreviations"]
        for symbol, _ in e.abbreviations:
            out.append(f"  {symbol.name} = {notation.meanings[symbol][0]}")
    if e.factors:
        out += ["", "Transformation of each row, T(a(j), j) [1.3]"]
    for step in e.factors:
        out += ["", f"{step.name} = {step.motion} =", *_matrix_text(step.matrix, notation)]
    if len(e.products) > 1:
        out += ["", "Products from the right"]
        for step in e.products[:-1]:
            out += ["", f"{step.name} = {step.motion} =", *_matrix_text(step.matrix, notation)]
    out += ["", f"Components of 0{last} = {chain} [1.4]: its columns are s, n, a, P", ""]
    out += _result_text(e.product.matrix, notation)
    if e.base or e.tool:
        for step, what in ((e.base, "R_0 in the world"), (e.tool, f"{e.frame} in R_{last[1:]}")):
            if step:
                out += ["", f"{step.name}, the pose of {what}, = {step.motion} ="]
                out += _matrix_text(step.matrix, notation)
        whole = " ".join(t.name for t in (e.base, e.product, e.tool) if t)
        out += ["", f"Components of {whole} [1.10], the pose of {e.frame} in the world", ""]
        out += _result_text(e.pose, notation)
    return "\n".join(out)


def _result_text(matrix: Any, notation: Notation) -> list[str]:
    """A result: the components, below the matrix if that is not too wide."""
    components = _components_text(matrix, notation)
    if _is_wide(matrix, notation):
        return components
    return [*_matrix_text(matrix, notation), "", *components]


def _is_wide(matrix: Any, notation: Notation) -> bool:
    return sum(_widths(matrix, notation)) > _WIDEST


def _widths(matrix: Any, notation: Notation) -> list[int]:
    return [max(len(notation.text(v)) for v in matrix[:, j]) for j in range(4)]


def _matrix_text(matrix: Any, notation: Notation) -> list[str]:
    if _is_wide(matrix, notation):
        return [f"  {line}" for line in _components_text(matrix, notation)]
    cells = [[notation.text(matrix[i, j]) for j in range(4)] for i in range(4)]
    widths = _widths(matrix, notation)
    lines = ["  ".join(f"{c:>{w}}" for c, w in zip(row, widths, strict=True)) for row in cells]
    return [f"  {a} {line} {b}" for a, line, b in zip("⎡⎢⎢⎣", lines, "⎤⎥⎥⎦", strict=True)]


def _components_text(matrix: Any, notation: Notation) -> list[str]:
    return [
        f"{name} = {notation.text(matrix[k % 3, k // 3])}" for k, name in enumerate(_COMPONENTS)
    ]


def derivation_latex(
    e: DirectModelExplanation, table: str, motions: Sequence[str], notation: Notation
) -> str:
    """The same as paragraphs and amsmath environments; ``motions`` of the factors, Z and E."""
    title = escaped(f"Direct geometric model of {e.robot}: pose of {e.frame} in the world")
    blocks = [rf"\textbf{{{title}}}", table_latex(table)]
    meanings = [(notation.latex[s], notation.meanings[s][1]) for s, _ in e.abbreviations]
    values = [
        (
            notation.latex[c.symbol],
            rf"{powers(f'{c.value:.10g}')} \, \mathrm{{{c.unit}}} \quad "
            rf"({meaning_latex(c.meaning)})",
        )
        for c in notation.constants
    ]
    for heading, lines in (("Constants", values), ("Abbreviations", meanings)):
        if lines:
            blocks += [heading, _aligned(lines)]
    *rows, Z, E = motions
    if e.factors:
        blocks.append(r"Transformation of each row, $\mathbf{T}(a(j), j)$ [1.3]")
    blocks += [
        _matrix_latex(step, motion, notation) for step, motion in zip(e.factors, rows, strict=True)
    ]
    if len(e.products) > 1:
        blocks.append("Products from the right")
    for step in e.products[:-1]:
        factors = r" \, ".join(map(_name_latex, step.motion.split()))
        blocks.append(_matrix_latex(step, factors, notation))
    chain = r" \, ".join(_name_latex(t.name) for t in e.factors) or "1"
    blocks.append(
        rf"Components of ${_name_latex(e.product.name)} = {chain}$ [1.4]: its columns are $s$, "
        "$n$, $a$, $P$"
    )
    blocks += _result_latex(replace(e.product, motion=chain), notation)
    if e.base or e.tool:
        last, frame = e.product.name[2:], escaped(e.frame)
        steps = (e.base, Z, "$R_{0}$ in the world"), (e.tool, E, f"{frame} in $R_{{{last}}}$")
        for step, motion, what in steps:
            if step:
                blocks.append(f"${_name_latex(step.name)}$, the pose of {what}")
                blocks.append(_matrix_latex(step, motion, notation))
        whole = [_name_latex(t.name) for t in (e.base, e.product, e.tool) if t]
        of = r" \, ".join(whole)
        blocks.append(f"Components of ${of}$ [1.10], the pose of {frame} in the world")
        blocks += _result_latex(SymbolicTransform("T", of, e.pose), notation)
    return "\n\n".join(blocks)


def _result_latex(result: SymbolicTransform, notation: Notation) -> list[str]:
    """A result: the components, after the matrix if that is not too wide."""
    components = _components_latex(result.name, result.motion, result.matrix, notation)
    if _is_wide(result.matrix, notation):
        return [components]
    return [_matrix_latex(result, result.motion, notation), components]


def _name_latex(name: str) -> str:
    if "T" not in name or name == "T":
        return rf"\mathbf{{{name}}}"
    of, frame = name.split("T")
    return rf"{{}}^{{{of}}}\mathbf{{T}}_{{{frame}}}"


def _matrix_latex(step: SymbolicTransform, motion: str, notation: Notation) -> str:
    M = step.matrix
    if _is_wide(M, notation):
        return _components_latex(step.name, motion, M, notation)
    rows = (" & ".join(notation.text(v, latex=True) for v in M[i, :]) for i in range(4))
    body = " \\\\\n".join(rows)
    return (
        f"\\begin{{equation*}}\n{_name_latex(step.name)} = {motion} =\n"
        f"\\begin{{bmatrix}}\n{body}\n\\end{{bmatrix}}\n\\end{{equation*}}"
    )


def _components_latex(name: str, motion: str, matrix: Any, notation: Notation) -> str:
    lines = [(_name_latex(name), motion)]
    for k, component in enumerate(_COMPONENTS):
        expr = matrix[k % 3, k // 3]
        lines.append((f"{component[0]}_{component[1]}", notation.text(expr, latex=True)))
    return _aligned(lines)


def _aligned(lines: Iterable[tuple[str, str]]) -> str:
    body = " \\\\\n".join(f"{left} &= {right}" for left, right in lines)
    return f"\\begin{{align*}}\n{body}\n\\end{{align*}}"
