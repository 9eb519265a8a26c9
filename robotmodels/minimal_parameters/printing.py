"""The table of base parameters as the book prints it, as text and as LaTeX."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING

from ..drive import drive_kinds
from ..geometry import PRISMATIC
from ..latex_text import escaped, powers
from .alignment import aligned_robot
from .formulas import Constant, Formula, constants_of

if TYPE_CHECKING:
    from .result import BaseParameters

_WIDTH = 100
_LONGEST = 180
"""Letters of a formula, beyond which its numbers are easier to read."""


def table_text(base: BaseParameters) -> str:
    """The base parameters, their formulas, the symbols' values, and what is not determined."""
    lines = [_heading(base), *(_wrapped("", note) for note in base.notes)]
    regrouped = _shown(base)
    if regrouped:
        lines.append(
            "Regrouped (R: in place of the sum, of which no motion shows the terms apart):"
        )
    width = max((len(formula.name) for formula, _ in regrouped), default=0) + 1
    for formula, numbers in regrouped:
        lines.append(_equation(f"  {formula.name + 'R':<{width}} = ", formula))
        if formula != numbers and any(c.isalpha() for t in formula.terms for c in t.text):
            lines.append(_equation(f"  {'':<{width}} = ", numbers))
    if used := _used(base):
        said = ", ".join(f"{c.text} = {c.value:.6g} {c.unit}" for c in used)
        lines.append(_wrapped("  with ", said))
    if base.alone:
        lines.append(_wrapped("Alone, as they are: ", ", ".join(base.alone)))
    if base.no_effect:
        lines.append(_wrapped("Without effect: ", ", ".join(base.no_effect)))
    if base.neglected:
        lines.append(_wrapped(f"{_neglected(base)}: ", ", ".join(base.neglected)))
    lines.append(_wrapped("Units: ", _units(base)))
    if base.gap is not None:
        said = (
            f"of the longest column, the least kept one has {base.gap[0]:.1e} beyond the others, "
            f"what is not kept at most {base.gap[1]:.1e}."
        )
        lines.append(_wrapped(f"Rank {len(base)}: ", said))
    return "\n".join(lines)


def _heading(base: BaseParameters) -> str:
    return (
        f"{base.model.name}: {len(base)} base parameters of {len(base.parameter_names)} "
        f"standard ones ({base.method.value})"
    )


def _neglected(base: BaseParameters) -> str:
    part = max(base.tolerance, base.angle)
    return f"Neglected, about {part:.0e} of the largest torque or less"


def _shown(base: BaseParameters) -> list[tuple[Formula, Formula]]:
    """What is regrouped, and the same in numbers; numbers alone where symbols fill lines."""
    pairs = zip(base.formulas, base.numbers, strict=True)
    return [
        (numbers if len(_sum_text(formula)) > _LONGEST else formula, numbers)
        for formula, numbers in pairs
        if formula.is_regrouped
    ]


def _equation(label: str, formula: Formula) -> str:
    """A line, or several that are broken between terms."""
    line = label + _sum_text(formula)
    if len(line) <= _WIDTH:
        return line
    # brackets of a factor are not broken, unless they alone are longer than the line
    return textwrap.fill(
        line, _WIDTH, subsequent_indent=" " * (len(label) + 2), break_long_words=False,
        break_on_hyphens=False, drop_whitespace=True,
    )  # fmt: skip


def _units(base: BaseParameters) -> str:
    """Units of the kinds that there are."""
    slides = base.model.table.sigma[base.model.table.joint_rows] == PRISMATIC
    said = ["XX to ZZ kg m^2, MX to MZ kg m, M kg"]
    kinds = {kind.value for kind in drive_kinds(base.drive)}
    forces = [kind for kind in ("Fc", "offset") if kind in kinds]
    for joints, mark, units in (
        (~slides, "", ("kg m^2", "N m s/rad", "N m")),
        (slides, "of prismatic joints ", ("kg", "N s/m", "N")),
    ):
        parts = [f"Ia {units[0]}"] * ("Ia" in kinds) + [f"Fv {units[1]}"] * ("Fv" in kinds)
        parts += [f"{' and '.join(forces)} {units[2]}"] * bool(forces)
        if joints.any() and parts:
            said.append(mark + ", ".join(parts))
    return "; ".join(said)


def _wrapped(label: str, words: str) -> str:
    indent = " " * min(len(label), 10) if label else "  "
    return textwrap.fill(
        label + words, _WIDTH, subsequent_indent=indent, break_long_words=False,
        break_on_hyphens=False,
    )  # fmt: skip


def table_latex(base: BaseParameters) -> str:
    """LaTeX of the base parameters: an ``align*`` of the formulas and lines of words."""
    regrouped = [formula for formula, _ in _shown(base)]
    out = [rf"\textbf{{{escaped(_heading(base))}}}", *(escaped(note) for note in base.notes)]
    if regrouped:
        body = " \\\\\n".join(
            f"{_symbol(formula.name, 'R')} &= {_sum_latex(formula)}" for formula in regrouped
        )
        out.append(f"\\begin{{align*}}\n{body}\n\\end{{align*}}")
    if used := _used(base):
        said = (rf"${c.latex} = {_number(c.value)}\,\mathrm{{{c.unit}}}$" for c in used)
        out.append("with " + ", ".join(said))
    if base.alone:
        out.append("Alone, as they are: " + ", ".join(f"${_symbol(name)}$" for name in base.alone))
    if base.no_effect:
        out.append("Without effect: " + ", ".join(f"${_symbol(n)}$" for n in base.no_effect))
    if base.neglected:
        names = ", ".join(f"${_symbol(name)}$" for name in base.neglected)
        out.append(f"{_neglected(base)}: {names}")
    units = re.sub(r"\^(\d)", r"$^\1$", _units(base))
    out.append(f"Units: {units}")
    return "\n\n".join(out)


def _used(base: BaseParameters) -> Sequence[Constant]:
    """The constants that occur in the formulas."""
    from .result import BaseMethod

    if base.method is not BaseMethod.SYMBOLIC:
        return ()
    words = {
        word
        for formula, _ in _shown(base)
        for term in formula.terms
        for word in re.findall(r"[A-Z]+\d*", term.text)
    }
    return [
        constant
        for constant in constants_of(aligned_robot(base.model, base.angle).model, base.tolerance)
        if constant.text in words
    ]


def _sum_text(formula: Formula) -> str:
    out = ""
    for term in formula.terms:
        sign, factor = _sign(term.text)
        names = " + ".join(term.parameters)
        if (factor or sign) and len(term.parameters) > 1:
            names = f"({names})"
        out += _joined(out, sign) + (f"{factor}*{names}" if factor else names)
    return out


def _sum_latex(formula: Formula) -> str:
    out = ""
    for term in formula.terms:
        sign, factor = _sign(powers(term.latex))
        names = " + ".join(_symbol(name) for name in term.parameters)
        if (factor or sign) and len(term.parameters) > 1:
            names = rf"\left({names}\right)"
        out += _joined(out, sign) + (rf"{factor} \, {names}" if factor else names)
    return out


def _number(value: float) -> str:
    return powers(f"{value:.6g}")


def _sign(text: str) -> tuple[str, str]:
    return ("-", text[1:].lstrip()) if text.startswith("-") else ("", text)


def _joined(before: str, sign: str) -> str:
    if not before:
        return sign
    return " - " if sign else " + "


def _symbol(name: str, mark: str = "") -> str:
    letters = name.rstrip("0123456789")
    number = name[len(letters) :]
    kind = rf"\mathrm{{{letters}}}" if letters[-1].islower() else letters
    return f"{kind}_{{{number}{mark}}}"
