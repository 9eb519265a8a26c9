"""Singular positions as plain text and as LaTeX."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ...latex_text import escaped
from ._chain import SymbolicChain
from ._jacobian_printing import (
    constant_lines,
    constants_latex,
    matrix_latex,
    matrix_lines,
    reduced_name,
    reduced_name_latex,
    row_names,
)
from .singularity_explanation import SingularityExplanation, SingularityFactor

_MOST_MINORS = 40
_LONGEST = 300
_LONG = "a long polynomial"

Powers = tuple[tuple[SingularityFactor, int], ...]
MinorWords = tuple[tuple[int, ...], tuple[int, ...], Powers]
"""Joints left out, rows, and the factors with their powers."""


def explanation_text(
    e: SingularityExplanation, constant: Any, minors: Sequence[MinorWords], chain: SymbolicChain
) -> str:
    """All of it as plain text."""
    out = [f"Singular positions of {e.robot}: motion of {e.frame}", "", e.status.value]
    shown = _shown(e, constant)
    out += constant_lines(e.numbers, chain.notation, shown)
    if e.matrix is not None:
        name = reduced_name(e.projection, e.intermediate, chain.path[-1])
        out += ["", f"Third matrix {name} (projection {e.projection}, intermediate frame "
                f"{e.intermediate}), {e.task}", ""]  # fmt: skip
        names = [f"joint {j}" for j in chain.path if j in chain.joints]
        out += matrix_lines(e.matrix, chain.notation, names, row_names(e.rows))
        words = [chain.notation.text(constant)] if constant != 1 or not e.factors else []
        words += [_power_text(f) for f in e.factors]
        out += ["", f"Its determinant is {_joined(words)}"]
    if minors:
        out += ["", f"Minors of the third matrix ({e.task}), up to constants"]
        out += [f"  {_minor_words(m)}: {_joined(_minor_factors(m))}" for m in minors[:_MOST_MINORS]]
    if e.factors:
        out += ["", "Factors"]
    for factor in e.factors:
        out += ["", f"{factor.kind.value}: {factor.text} = 0"]
        out += [f"  {words}" for words in (factor.meaning, factor.solution) if words]
    if minors:
        out += ["", "Singular positions"]
        out += [f"  {c.kind.value}: {c.text}" for c in e.conditions] or ["  none"]
    elif e.matrix is not None and not e.factors:
        out += ["", "It is a constant: there are no singular positions."]
    return "\n".join(out)


def _shown(e: SingularityExplanation, constant: Any) -> list[Any]:
    out = [f.expression for f in e.factors if f.expression is not None]
    return [*out, *(x for x in (e.matrix, constant) if x is not None)]


def _power_text(factor: SingularityFactor) -> str:
    return _power(factor.text, factor.power)


def _power(text: str, exponent: int) -> str:
    if exponent == 1:
        return text
    return f"{text}**{exponent}" if text.isidentifier() else f"({text})**{exponent}"


def _joined(words: Sequence[str]) -> str:
    if len(words) == 1:
        return words[0]
    whole = " * ".join(f"({w})" if " " in w else w for w in words)
    return f"-{whole[5:]}" if whole.startswith("-1 * ") else whole


def _minor_words(minor: MinorWords) -> str:
    left_out, rows, _ = minor
    if left_out:
        joints = " and ".join(map(str, left_out))
        return f"without joint {joints}" if len(left_out) == 1 else f"without joints {joints}"
    return f"rows {', '.join(row_names(rows))}"


def _minor_factors(minor: MinorWords) -> list[str]:
    words = [(f.text if len(f.text) <= _LONGEST else _LONG, k) for f, k in minor[2]]
    return [_power(text, k) for text, k in words] or ["1"]


def explanation_latex(
    e: SingularityExplanation, constant: Any, minors: Sequence[MinorWords], chain: SymbolicChain
) -> str:
    """The same as paragraphs and amsmath environments."""
    notation = chain.notation
    title = escaped(f"Singular positions of {e.robot}: motion of {e.frame}")
    blocks = [rf"\textbf{{{title}}}", escaped(e.status.value)]
    blocks += constants_latex(e.numbers, notation, _shown(e, constant))
    if e.matrix is not None:
        name = reduced_name_latex(e.projection, e.intermediate, chain.path[-1])
        blocks.append(escaped(f"Third matrix, {e.task}"))
        blocks.append(matrix_latex(name, e.matrix, notation))
        words = [notation.text(constant, latex=True)] if constant != 1 or not e.factors else []
        words += [_power_latex(f, f.power) for f in e.factors]
        blocks.append(_equation(rf"\det = {_joined_latex(words)}"))
    if minors:
        blocks.append(escaped(f"Minors of the third matrix ({e.task}), up to constants"))
        for minor in minors[:_MOST_MINORS]:
            factors = [
                _power_latex(f, k) if len(f.text) <= _LONGEST else rf"\text{{{_LONG}}}"
                for f, k in minor[2]
            ] or ["1"]
            blocks.append(_equation(rf"\text{{{_minor_words(minor)}: }} {_joined_latex(factors)}"))
    for factor in e.factors:
        words = escaped(f"{factor.kind.value}: {factor.meaning}".rstrip(": "))
        blocks.append(words)
        blocks.append(_equation(f"{factor.latex} = 0"))
        if factor.solution_latex:
            blocks.append(_equation(factor.solution_latex))
    if minors:
        blocks.append("Singular positions")
        for condition in e.conditions:
            both = r" \text{ and } ".join(f"{f.latex} = 0" for f in condition.factors)
            blocks.append(_equation(both))
        if not e.conditions:
            blocks.append("None.")
    elif e.matrix is not None and not e.factors:
        blocks.append("It is a constant: there are no singular positions.")
    return "\n\n".join(blocks)


def _power_latex(factor: SingularityFactor, power: int) -> str:
    if power == 1:
        return factor.latex
    if factor.text.isidentifier():
        return f"{factor.latex}^{{{power}}}"
    return rf"\left({factor.latex}\right)^{{{power}}}"


def _joined_latex(words: Sequence[str]) -> str:
    if len(words) == 1:
        return words[0]
    sums = [" + " in w or " - " in w or w.startswith("-") for w in words]
    both = zip(words, sums, strict=True)
    whole = [rf"\left({w}\right)" if long and k else w for k, (w, long) in enumerate(both)]
    if whole[0] == "-1":
        return "-" + r" \, ".join(whole[1:])
    if sums[0] and (" + " in whole[0] or " - " in whole[0]):
        whole[0] = rf"\left({whole[0]}\right)"
    return r" \, ".join(whole)


def _equation(body: str) -> str:
    return f"\\begin{{equation*}}\n{body}\n\\end{{equation*}}"
