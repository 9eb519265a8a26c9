"""The table of base parameters as the book prints it, as text and as LaTeX."""

from __future__ import annotations

import re
import textwrap
from typing import NamedTuple

from ..latex_text import escaped, powers
from .formulas import Constant, Formula

_WIDTH = 100
_LONGEST = 180
"""Longest symbolic formula, characters."""


class BaseTable(NamedTuple):
    """Content of the table: sentences, pairs of symbolic and numeric formulas, lists of names."""

    heading: str
    notes: tuple[str, ...]
    formulas: tuple[tuple[Formula, Formula], ...]
    constants: tuple[Constant, ...]
    lists: tuple[tuple[str, tuple[str, ...]], ...]
    units: str
    rank: str


def table_text(table: BaseTable) -> str:
    """The base parameters, their formulas, the values of the symbols, and the other parameters."""
    lines = [table.heading, *(_wrapped("", note) for note in table.notes)]
    rows = _shown(table)
    if rows:
        lines.append("Regrouped (R: in place of the sum, whose terms are not identifiable alone):")
    width = max((len(formula.name) for formula, _ in rows), default=0) + 1
    for formula, numbers in rows:
        lines.append(_equation(f"  {formula.name + 'R':<{width}} = ", formula))
        if formula != numbers and any(c.isalpha() for t in formula.terms for c in t.text):
            lines.append(_equation(f"  {'':<{width}} = ", numbers))
    if used := _used(table):
        values = ", ".join(f"{c.text} = {c.value:.6g} {c.unit}" for c in used)
        lines.append(_wrapped("  with ", values))
    lines += [_wrapped(f"{label}: ", ", ".join(names)) for label, names in table.lists if names]
    lines.append(_wrapped("Units: ", table.units))
    if table.rank:
        label, _, words = table.rank.partition(": ")
        lines.append(_wrapped(f"{label}: ", words))
    return "\n".join(lines)


def table_latex(table: BaseTable) -> str:
    """LaTeX of the base parameters: an ``align*`` of the formulas and lines of words."""
    out = [rf"\textbf{{{escaped(table.heading)}}}", *(escaped(note) for note in table.notes)]
    rows = [f"{_symbol(f.name, 'R')} &= {_sum(f, True)}" for f, _ in _shown(table)]
    if rows:
        out.append("\\begin{align*}\n" + " \\\\\n".join(rows) + "\n\\end{align*}")
    if used := _used(table):
        values = (rf"${c.latex} = {powers(f'{c.value:.6g}')}\,\mathrm{{{c.unit}}}$" for c in used)
        out.append("with " + ", ".join(values))
    for label, names in table.lists:
        if names:
            out.append(f"{label}: " + ", ".join(f"${_symbol(name)}$" for name in names))
    out.append("Units: " + re.sub(r"\^(\d)", r"$^\1$", table.units))
    return "\n\n".join(out)


def _shown(table: BaseTable) -> list[tuple[Formula, Formula]]:
    """Regrouped parameters: symbolic (numeric where too long), and numeric."""
    return [
        (numbers if len(_sum(formula)) > _LONGEST else formula, numbers)
        for formula, numbers in table.formulas
        if formula.is_regrouped
    ]


def _used(table: BaseTable) -> list[Constant]:
    """The constants that occur in the formulas."""
    texts = " ".join(term.text for formula, _ in _shown(table) for term in formula.terms)
    words = set(re.findall(r"[A-Z]+\d*", texts))
    return [constant for constant in table.constants if constant.text in words]


def _equation(label: str, formula: Formula) -> str:
    """A line, or several that are broken between terms."""
    line = label + _sum(formula)
    if len(line) <= _WIDTH:
        return line
    return _filled(line, " " * (len(label) + 2))


def _wrapped(label: str, words: str) -> str:
    return _filled(label + words, " " * min(len(label), 10) if label else "  ")


def _filled(line: str, indent: str) -> str:
    return textwrap.fill(
        line, _WIDTH, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False
    )


def _sum(formula: Formula, latex: bool = False) -> str:
    """The terms of a formula with their signs."""
    out, times = "", r" \, " if latex else "*"
    for term in formula.terms:
        text = powers(term.latex) if latex else term.text
        sign, factor = ("-", text[1:].lstrip()) if text.startswith("-") else ("", text)
        names = " + ".join(_symbol(name) if latex else name for name in term.parameters)
        if text and len(term.parameters) > 1:
            names = rf"\left({names}\right)" if latex else f"({names})"
        out += (" - " if sign else " + ") if out else sign
        out += factor + times + names if factor else names
    return out


def _symbol(name: str, mark: str = "") -> str:
    letters = name.rstrip("0123456789")
    kind = rf"\mathrm{{{letters}}}" if letters[-1].islower() else letters
    return f"{kind}_{{{name[len(letters) :]}{mark}}}"
