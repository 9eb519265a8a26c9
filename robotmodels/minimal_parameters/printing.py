"""The table of base parameters as the book prints it, as text and as LaTeX."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

from .formulas import Constant, Formula, constants_of

if TYPE_CHECKING:
    from .result import BaseParameters


def table_text(base: BaseParameters) -> str:
    """The base parameters, their formulas, the symbols' values, and what is not determined.

    Parameters
    ----------
    base : BaseParameters
        What is printed.

    Returns
    -------
    str
        Lines: a heading, one formula per parameter (those that stand for themselves together at the
        end), then the constants, then the parameters without effect.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> from robotmodels.minimal_parameters import base_parameters
    >>> print(table_text(base_parameters(load("lab_rrt"), drive=False)).splitlines()[1])
      ZZ1R = ZZ1 + YY2 + ZZ3
    """
    lines = [
        f"{base.model.name}: {len(base)} base parameters of {len(base.parameter_names)} "
        f"standard ones ({base.method.value})"
    ]
    for formula, numbers in zip(base.formulas, base.numbers, strict=True):
        if formula.is_regrouped:
            lines.append(f"  {formula.name}R = {_sum_text(formula)}")
            if formula != numbers and any(c.isalpha() for t in formula.terms for c in t.text):
                lines.append(f"  {' ' * len(formula.name)}  = {_sum_text(numbers)}")
    own = [formula.name for formula in base.formulas if not formula.is_regrouped]
    if own:
        lines.append(f"  as they are: {', '.join(own)}")
    if used := _used(base):
        lines.append("  " + ", ".join(f"{c.text} = {c.value:.6g} {c.unit}" for c in used))
    if base.no_effect:
        lines.append(f"without effect: {', '.join(base.no_effect)}")
    if base.gap is not None:
        lines.append(
            f"rank {len(base)}: kept columns {base.gap[0]:.1e}, dependent {base.gap[1]:.1e}"
        )
    return "\n".join(lines)


def table_latex(base: BaseParameters) -> str:
    r"""The same in LaTeX: an ``align*`` of the formulas and lines of words.

    Parameters
    ----------
    base : BaseParameters
        What is printed.

    Returns
    -------
    str
        Needs amsmath.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> from robotmodels.minimal_parameters import base_parameters
    >>> print(base_parameters(load("planar_2r"), drive=False).latex.splitlines()[1])
    ZZ_{1R} &= ZZ_{1} + D_{2}^{2} \, M_{2}
    """
    regrouped = [formula for formula in base.formulas if formula.is_regrouped]
    own = [formula.name for formula in base.formulas if not formula.is_regrouped]
    out = []
    if regrouped:
        body = " \\\\\n".join(
            f"{_symbol(formula.name, 'R')} &= {_sum_latex(formula)}" for formula in regrouped
        )
        out.append(f"\\begin{{align*}}\n{body}\n\\end{{align*}}")
    if own:
        out.append("As they are: " + ", ".join(f"${_symbol(name)}$" for name in own))
    if used := _used(base):
        out.append(", ".join(rf"${c.latex} = {c.value:.6g}\,\mathrm{{{c.unit}}}$" for c in used))
    if base.no_effect:
        out.append("Without effect: " + ", ".join(f"${_symbol(n)}$" for n in base.no_effect))
    return "\n\n".join(out)


def _used(base: BaseParameters) -> Sequence[Constant]:
    """The constants that occur in the formulas."""
    from .result import BaseMethod

    if base.method is not BaseMethod.SYMBOLIC:
        return ()
    words = {
        word
        for formula in base.formulas
        for term in formula.terms
        for word in re.findall(r"[A-Z]+\d*", term.text)
    }
    return [constant for constant in constants_of(base.model, base.tolerance) if constant.text in words]


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
        sign, factor = _sign(term.latex)
        names = " + ".join(_symbol(name) for name in term.parameters)
        if (factor or sign) and len(term.parameters) > 1:
            names = rf"\left({names}\right)"
        out += _joined(out, sign) + (rf"{factor} \, {names}" if factor else names)
    return out


def _sign(text: str) -> tuple[str, str]:
    return ("-", text[1:]) if text.startswith("-") else ("", text)


def _joined(before: str, sign: str) -> str:
    if not before:
        return sign
    return " - " if sign else " + "


def _symbol(name: str, mark: str = "") -> str:
    letters = name.rstrip("0123456789")
    number = name[len(letters) :]
    kind = rf"\mathrm{{{letters}}}" if letters[-1].islower() else letters
    return f"{kind}_{{{number}{mark}}}"
