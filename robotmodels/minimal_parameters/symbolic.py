"""Base parameters by Khalil's rules."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from ..model import RobotModel
from ..regressors import parameter_names
from .numeric import base_columns
from .result import BaseMethod, BaseParameters
from .rules import regrouped, rows_of_numbers


def base_by_rules(model: RobotModel, drive: bool) -> BaseParameters:
    """Base parameters by the rules of `robotmodels.minimal_parameters.rules`.

    Parameters
    ----------
    model : RobotModel
        The robot.
    drive : bool
        Whether drive parameters are among the standard ones. Those of coupled motors follow no
        rule: they are looked at in numbers.

    Returns
    -------
    BaseParameters
        Method symbolic.

    References
    ----------
    Seed book section 1.5.3.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> len(base_by_rules(load("rx90"), drive=True))
    58
    """
    found = regrouped(model, *rows_of_numbers(model), drive)
    p = len(parameter_names(model, drive))
    ruled = 10 * model.f + (4 * model.n if drive else 0)
    kept = np.array(sorted(found), dtype=np.int64)
    matrix = np.zeros((len(kept), p))
    for row, number in zip(matrix, kept, strict=True):
        for k, coefficient in found[int(number)].items():
            row[k] = coefficient
    if p > ruled:
        kept, matrix = _with_couplings(model, kept, matrix, ruled)
    return BaseParameters(model, drive, kept, matrix, BaseMethod.SYMBOLIC)


def _with_couplings(
    model: RobotModel, kept: NDArray[np.int64], matrix: Array, ruled: int
) -> tuple[NDArray[np.int64], Array]:
    """Add the columns of coupled motors: kept, or combinations of the others."""
    basis = base_columns(model, drive=True)
    own = basis.kept[basis.kept >= ruled]
    numbers = np.concatenate((kept, own))
    whole = np.vstack((matrix, np.zeros((len(own), matrix.shape[1]))))
    rows = np.searchsorted(basis.kept, numbers)
    whole[:, ruled:] = basis.coefficients[rows][:, ruled:]
    return numbers, whole
