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

    Parameters
    ----------
    estimate : Estimate
        Parameters with their deviations.

    Returns
    -------
    ndarray, shape (b, 2)
        Lower and upper ends, of the normal distribution.

    Examples
    --------
    >>> from robotmodels.identification.methods.estimate import Method
    >>> found = Estimate(Method.OLS, ("Fv1",), [1.0], [[0.25]], [1.0])
    >>> intervals(found).round(2)
    array([[0.02, 1.98]])
    """
    return estimate.values[:, None] + np.outer(estimate.deviations, (-_NORMAL, _NORMAL))


def parameter_units(result: IdentificationResult) -> tuple[str, ...]:
    """Units of the identified parameters.

    Parameters
    ----------
    result : IdentificationResult
        Of `fit`.

    Returns
    -------
    tuple of str, length b
        Such as ``"kg m^2"``.
    """
    table = result.base.value_table(result.whole())
    units = dict(zip(table.names, table.units, strict=True))
    return tuple(units[name] for name in result.names)


def effort_units(model: RobotModel) -> tuple[str, ...]:
    """Units of the joints' torques or forces.

    Parameters
    ----------
    model : RobotModel
        The robot.

    Returns
    -------
    tuple of str, length n
        ``"N m"`` or ``"N"``.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> effort_units(load("planar_2r"))
    ('N m', 'N m')
    """
    sigma = model.table.sigma[model.table.joint_rows]
    return tuple("N" if kind == PRISMATIC else "N m" for kind in sigma.tolist())


def kind_names(result: IdentificationResult) -> tuple[str, ...]:
    """What the kinds of equations are called: joints, or the whole robot.

    Parameters
    ----------
    result : IdentificationResult
        Of `fit`.

    Returns
    -------
    tuple of str, length m
        Names.
    """
    if result.system.form.by_joint:
        return tuple(result.model.table.joint_names)
    return ("whole robot",)


def kind_units(result: IdentificationResult) -> tuple[str, ...]:
    """Units of the residuals of the kinds of equations.

    Parameters
    ----------
    result : IdentificationResult
        Of `fit`.

    Returns
    -------
    tuple of str, length m
        ``"N m"`` or ``"N"`` of joints, else ``"W"`` or ``"J"``.
    """
    form = result.system.form
    if form.by_joint:
        return effort_units(result.model)
    return ("W",) if form is EquationForm.POWER else ("J",)


def stands_for(base: BaseParameters, name: str, width: int = _WIDTH) -> str:
    """What is regrouped into a base parameter, as far as it fits.

    Parameters
    ----------
    base : BaseParameters
        Of the robot.
    name : str
        One of its names.
    width : int
        Letters.

    Returns
    -------
    str
        A sum, which ends in dots with the number of terms that are not shown; the name alone where
        nothing is regrouped.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> from robotmodels.minimal_parameters import base_parameters
    >>> base = base_parameters(load("planar_2r"))
    >>> stands_for(base, "ZZ1"), stands_for(base, "MX2")
    ('ZZ1 + M2 + Ia1', 'MX2')
    """
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
    """A table of the parameters of each unit.

    Parameters
    ----------
    result : IdentificationResult
        Of `fit`.

    Returns
    -------
    list of ReportTable
        Name, what it stands for, value, deviation, relative deviation, interval.
    """
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
    """A number as text.

    Parameters
    ----------
    value : float
        Any.
    digits : int
        Significant ones.

    Returns
    -------
    str
        A dash for NaN.

    Examples
    --------
    >>> number(1.23456), number(-3e-7, 2), number(float("nan"))
    ('1.235', '-3e-07', '-')
    """
    if value != value:
        return "-"
    text = f"{value:.{digits}g}"
    # zeros after the point that are not digits take more room than a power of ten
    return f"{value:.{digits - 1}e}" if value and abs(value) < 1e-4 and "e" not in text else text


def percent(ratio: float) -> str:
    """A ratio as text in per cent.

    Parameters
    ----------
    ratio : float
        Not negative.

    Returns
    -------
    str
        Two digits; a dash for NaN.

    Examples
    --------
    >>> percent(0.0123), percent(0.5), percent(50.0), percent(float("nan"))
    ('1.2 %', '50 %', '> 999 %', '-')
    """
    if ratio != ratio:
        return "-"
    if ratio >= 9.995:
        return "> 999 %"
    return f"{100.0 * ratio:.2g} %" if ratio < 0.995 else f"{100.0 * ratio:.0f} %"
