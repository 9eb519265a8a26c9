"""Parameters of an identification as tables of text."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..._arrays import Array
from ...geometry import PRISMATIC
from ...minimal_parameters import BaseParameters
from ...model import RobotModel
from ...table_text import ReportTable, table_of
from ..equations import EquationForm
from ..methods.estimate import Estimate
from .weak_parameters import NOT_SEEN

if TYPE_CHECKING:
    from ..result import IdentificationResult

_NORMAL = 1.959964
_WIDTH = 29
"""Of what a parameter stands for, so that the table has 100 columns."""
_NOTHING = 1e-9


def intervals(estimate: Estimate) -> Array:
    """Intervals that hold the truth with 95 % probability, each parameter by itself.

    Shapes: -> (b, 2).
    """
    return estimate.values[:, None] + np.outer(estimate.deviations, (-_NORMAL, _NORMAL))


def parameter_units(result: IdentificationResult) -> tuple[str, ...]:
    """Units of the identified parameters."""
    table = result.base.value_table(result.whole())
    units = dict(zip(table.names, table.units, strict=True))
    return tuple(units[name] for name in result.names)


def effort_units(model: RobotModel) -> tuple[str, ...]:
    """Units of the joints' torques or forces."""
    sigma = model.table.sigma[model.table.joint_rows]
    return tuple("N" if kind == PRISMATIC else "N m" for kind in sigma.tolist())


def kind_names(result: IdentificationResult) -> tuple[str, ...]:
    """Names of the kinds of equations: joints, or the whole robot."""
    if result.system.form.by_joint:
        return tuple(result.model.table.joint_names)
    return ("whole robot",)


def kind_units(result: IdentificationResult) -> tuple[str, ...]:
    """Units of the residuals of the kinds of equations."""
    form = result.system.form
    if form.by_joint:
        return effort_units(result.model)
    return ("W",) if form is EquationForm.POWER else ("J",)


def stands_for(base: BaseParameters, name: str, width: int = _WIDTH) -> str:
    """Standard parameters regrouped into a base parameter, as a text of limited width."""
    row = base.matrix[base.names.index(name)]
    names = base.parameter_names
    own = names.index(name)
    size = float(np.abs(row).max())
    terms = [own, *(k for k in np.flatnonzero(np.abs(row) > _NOTHING * size) if k != own)]
    words = []
    for k in terms:
        c = float(row[k])
        factor = "" if abs(abs(c) - 1.0) < _NOTHING else f"{abs(c):.3g} "
        words.append(("- " if c < 0.0 else "+ ") + factor + names[k])
    for shown in range(len(words), 0, -1):
        text = " ".join(words[:shown]).removeprefix("+ ")
        text += "" if shown == len(words) else f" ... {len(words) - shown} more"
        if len(text) <= width:
            return text
    return text


def parameter_tables(result: IdentificationResult) -> list[ReportTable]:
    """A table of the parameters of each unit."""
    estimate, base = result.estimate, result.base
    ends = intervals(estimate)
    units = parameter_units(result)
    several = dict(zip(base.names, (base.matrix != 0.0).sum(axis=1) > 1, strict=True))
    tables = []
    for unit in dict.fromkeys(units):
        rows = []
        for k, name in enumerate(result.names):
            if units[k] != unit:
                continue
            relative = float(estimate.relative_deviations[k])
            star = "*" if relative > NOT_SEEN else ""
            rows.append(
                (f"{name}R" if several[name] else name, stands_for(base, name),
                 number(estimate.values[k]), number(estimate.deviations[k], 2),
                 f"{percent(relative)}{star}", number(ends[k, 0]), number(ends[k, 1]))
            )  # fmt: skip
        headings = (unit, "stands for", "value", "std", "rel.", "95 % from", "to")
        tables.append(table_of(headings, rows))
    return tables


def number(value: float, digits: int = 4) -> str:
    """A number as text."""
    if value != value:
        return "-"
    text = f"{value:.{digits}g}"
    # zeros after the point that are not digits take more room than a power of ten
    return f"{value:.{digits - 1}e}" if value and abs(value) < 1e-4 and "e" not in text else text


def percent(ratio: float) -> str:
    """A ratio as text in per cent."""
    if ratio != ratio:
        return "-"
    if ratio >= 9.995:
        return "> 999 %"
    return f"{100.0 * ratio:.2g} %" if ratio < 0.995 else f"{100.0 * ratio:.0f} %"
