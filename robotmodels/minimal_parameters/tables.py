"""Tables of base parameters: their formulas as the book prints them, and their values."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array, Rebuilt, read_only
from ..errors import nearest_names
from ..geometry import PRISMATIC
from ..latex_text import escaped, powers
from ..regressors.columns import plain_name
from ..table_text import boxed
from .alignment import aligned_robot
from .formulas import Constant, Formula, constants_of

_WIDTH = 100
_LONGEST = 180
"""Longest symbolic formula, characters."""
_UNITS = {"M": "kg", "MX": "kg m", "MY": "kg m", "MZ": "kg m", "Kc": "N/m", "Pc": "N"}
"""Units of links and of gravity compensators; the other kinds of upper case are inertias."""
_TURNING = {"Ia": "kg m^2", "Fv": "N m s/rad"}
_SLIDING = {"Ia": "kg", "Fv": "N s/m"}


def base_text(base: Any) -> str:
    """The table of the book: base parameters, values of the symbols, and the other parameters."""
    rows, used, lists = _content(base)
    lines = [_heading(base), *(_filled(note, 2) for note in base.notes)]
    if rows:
        lines.append("Regrouped (R: in place of the sum, whose terms are not identifiable alone):")
    width = max((len(formula.name) for formula, _ in rows), default=0) + 1
    for formula, numbers in rows:
        symbolic = any(c.isalpha() for term in formula.terms for c in term.text)
        for name, one in ((formula.name + "R", formula), ("", numbers)):
            if name or (formula != numbers and symbolic):
                label = f"  {name:<{width}} = "
                lines.append(_filled(label + _sum(one), len(label) + 2))
    if used:
        values = ", ".join(f"{c.text} = {c.value:.6g} {c.unit}" for c in used)
        lines.append(_filled(f"  with {values}", 7))
    parts = [(label, ", ".join(names)) for label, names in lists if names]
    parts.append(("Units", _units(base)))
    if base.gap is not None:
        parts.append((
            f"Rank {len(base)}",
            f"of the longest column, the least kept one has {base.gap[0]:.1e} beyond the others, "
            f"what is not kept at most {base.gap[1]:.1e}.",
        ))  # fmt: skip
    lines += [_filled(f"{label}: {words}", min(len(label) + 2, 10)) for label, words in parts]
    return "\n".join(lines)


def base_latex(base: Any) -> str:
    """The same in LaTeX: an ``align*`` of the formulas and lines of words."""
    rows, used, lists = _content(base)
    out = [rf"\textbf{{{escaped(_heading(base))}}}", *(escaped(note) for note in base.notes)]
    sums = [f"{_symbol(f.name, 'R')} &= {_sum(f, True)}" for f, _ in rows]
    if sums:
        out.append("\\begin{align*}\n" + " \\\\\n".join(sums) + "\n\\end{align*}")
    if used:
        values = (rf"${c.latex} = {powers(f'{c.value:.6g}')}\,\mathrm{{{c.unit}}}$" for c in used)
        out.append("with " + ", ".join(values))
    for label, names in lists:
        if names:
            out.append(f"{label}: " + ", ".join(f"${_symbol(name)}$" for name in names))
    out.append("Units: " + re.sub(r"\^(\d)", r"$^\1$", _units(base)))
    return "\n\n".join(out)


def _heading(base: Any) -> str:
    counts = f"{len(base)} base parameters of {len(base.parameter_names)} standard ones"
    return f"{base.model.name}: {counts} ({base.method.value})"


def _content(base: Any) -> tuple[list[tuple[Formula, Formula]], list[Constant], list[Any]]:
    """Regrouped parameters: symbolic (numeric where too long), and numeric; symbols; lists."""
    rows = [
        (numbers if len(_sum(formula)) > _LONGEST else formula, numbers)
        for formula, numbers in zip(base.formulas, base.numbers, strict=True)
        if formula.is_regrouped
    ]
    texts = " ".join(term.text for formula, _ in rows for term in formula.terms)
    words, neglected = set(re.findall(r"[A-Z]+\d*", texts)), max(base.tolerance, base.angle)
    lists = [
        ("Alone, as they are", base.alone),
        ("Without effect", base.no_effect),
        (f"Neglected, about {neglected:.0e} of the largest torque or less", base.neglected),
    ]
    if base.method.value == "numeric":
        return rows, [], lists
    constants = constants_of(aligned_robot(base.model, base.angle)[0], base.tolerance)
    return rows, [constant for constant in constants if constant.text in words], lists


def _units(base: Any) -> str:
    """Units of the parameters."""
    units = "XX to ZZ kg m^2, MX to MZ kg m, M kg"
    if base.drive:
        slides = base.model.table.sigma[base.model.table.joint_rows] == PRISMATIC
        if not slides.all():
            units += "; Ia kg m^2, Fv N m s/rad, Fc and offset N m"
        if slides.any():
            units += "; of prismatic joints Ia kg, Fv N s/m, Fc and offset N"
    return units


def _filled(line: str, indent: int) -> str:
    return textwrap.fill(
        line, _WIDTH, subsequent_indent=" " * indent, break_long_words=False, break_on_hyphens=False
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


# --- values --------------------------------------------------------------------------------------


class KeptNames(dict[str, Any]):
    """Dictionary by parameter names that also accepts printed names (``ZZ1R``)."""

    def __missing__(self, name: object) -> Any:
        if isinstance(name, str) and (plain := plain_name(name, self)) in self:
            return self[plain]
        near = nearest_names(str(name), tuple(self))
        hint = f" Did you mean {', '.join(near)}?" if near else ""
        raise KeyError(f"No base parameter {name!r}.{hint} It may be regrouped or without effect.")


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class BaseValues(Rebuilt, Mapping[str, float]):
    """Values of base parameters by name; prints as a table. Read-only.

    Parameters
    ----------
    names, printed, units : tuple of str
        Standard names of the b kept parameters; the same with an R where others are regrouped into
        them; units.
    numbers : ndarray, shape (b,)
        Values.
    """

    names: tuple[str, ...]
    printed: tuple[str, ...]
    numbers: Any
    units: tuple[str, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "numbers", read_only(self.numbers))

    def __getitem__(self, name: str) -> float:
        return KeptNames(zip(self.names, self.numbers.tolist(), strict=True))[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def __len__(self) -> int:
        return len(self.names)

    def __str__(self) -> str:
        values = [f"{x:.6g}" for x in self.numbers.tolist()]
        columns = (("parameter", self.printed), ("value", values), ("unit", self.units))
        return boxed([(heading, list(column)) for heading, column in columns])

    def __repr__(self) -> str:
        return f"<BaseValues: {len(self)} base parameters>"


def base_values(
    names: tuple[str, ...], matrix: Array, sigma: NDArray[np.int64], values: Array
) -> BaseValues:
    """Base parameters with their values and units.

    Shapes: matrix (b, p), sigma (f,), values (b,).
    """
    several = (matrix != 0.0).sum(axis=1) > 1
    printed = (f"{n}R" if more else n for n, more in zip(names, several, strict=True))
    return BaseValues(names, tuple(printed), values, tuple(_unit(name, sigma) for name in names))


def _unit(name: str, sigma: NDArray[np.int64]) -> str:
    kind = name.rstrip("0123456789")
    if kind.isupper() or kind in _UNITS:
        return _UNITS.get(kind, "kg m^2")
    slides = int(sigma[int(name[len(kind) :]) - 1]) == PRISMATIC
    units = _SLIDING if slides else _TURNING
    return units.get(kind[:2], "N" if slides else "N m")  # Iam, Fvm, Fvp as Ia, Fv
