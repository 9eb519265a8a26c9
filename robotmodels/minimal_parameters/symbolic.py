"""Base parameters by Khalil's rules.

Source: Seed book section 1.5.3.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from ..drive import DriveKind, Drives, drive_kinds
from ..estimation import ColumnBasis
from ..estimation.columns import NOTHING
from ..friction import Friction
from ..model import RobotModel
from ..regressors import parameter_names
from .motion_span import EARTH, reach
from .numeric import (
    base_columns,
    natural_sizes,
    rank_warnings,
    residual_torque,
    residual_warning,
    torque_factor,
)
from .result import BaseMethod, BaseParameters
from .rules import regrouped, rows_of_numbers

_FINEST, _COARSEST = 1e-13, 1e-2
"""Range of relative sines and lengths that may be zero or not: the numeric method decides there."""


def base_by_rules(
    model: RobotModel,
    drive: Drives,
    tolerance: float = NOTHING,
    friction: Friction | None = None,
    notes: tuple[str, ...] = (),
) -> BaseParameters:
    """Base parameters by the rules of `robotmodels.minimal_parameters.rules`."""
    kinds = drive_kinds(drive)
    kept, matrix = _by_rules(model, kinds, tolerance, friction, _FINEST)
    base = BaseParameters(
        model=model,
        drive=kinds,
        kept=kept,
        matrix=matrix,
        method=BaseMethod.SYMBOLIC,
        friction=friction,
        tolerance=tolerance,
        notes=notes,
    )
    if _is_clear(model, kinds, tolerance, kept):
        return base
    kept, matrix = _by_rules(model, kinds, tolerance, friction, tolerance)
    basis, neglected = base_columns(model, kinds, tolerance=tolerance, friction=friction)
    if not _holds(model, kinds, tolerance, friction, basis, kept, matrix):
        kept, matrix = basis.kept, np.asarray(basis.coefficients)
    base = replace(base, kept=kept, matrix=matrix, neglected=neglected)
    missed, names = residual_torque(base), base.parameter_names
    warnings = rank_warnings(names, basis, tolerance, False) + residual_warning(missed, tolerance)
    return replace(base, notes=(*notes, *warnings), missed=missed)


def _by_rules(
    model: RobotModel,
    drive: tuple[DriveKind, ...],
    tolerance: float,
    friction: Friction | None,
    exact: float,
) -> tuple[NDArray[np.int64], Array]:
    """Kept parameters (b,) and combinations (b, p), with angles up to ``exact`` taken as zero.

    Columns without a rule (coupled motors, friction models) are added numerically.
    """
    terms = regrouped(model, *rows_of_numbers(model, exact), drive, exact)
    p = len(parameter_names(model, drive, friction))
    ruled = 10 * model.f + model.n * len(drive)
    kept = np.array(sorted(terms), dtype=np.int64)
    matrix = np.zeros((len(kept), p))
    for row, number in zip(matrix, kept, strict=True):
        for k, coefficient in terms[int(number)].items():
            row[k] = coefficient
    sizes = natural_sizes(model, drive, friction)
    matrix[abs(matrix * sizes) <= tolerance * sizes[kept][:, None]] = 0.0
    if p > ruled:
        basis = base_columns(model, drive, tolerance=tolerance, friction=friction).basis
        whole = basis.coefficients.copy()
        if np.array_equal(kept, basis.kept[basis.kept < ruled]):
            whole[:, :ruled] = 0.0
            whole[: len(kept), :ruled] = matrix[:, :ruled]
        kept, matrix = basis.kept, whole
    return kept, matrix


def _is_clear(
    model: RobotModel, drive: tuple[DriveKind, ...], tolerance: float, kept: NDArray[np.int64]
) -> bool:
    """Whether the kept parameters are the same for all zero tolerances in the range."""
    if tolerance > NOTHING:
        return False
    table = model.table
    lengths = np.abs(np.concatenate((table.d, table.r, table.b))) / reach(model)
    sizes = np.append(lengths, np.linalg.norm(model.gravity) / EARTH)
    if ((sizes > _FINEST) & (sizes < _COARSEST)).any():
        return False
    coarse = regrouped(model, *rows_of_numbers(model, _COARSEST), drive, _COARSEST)
    ruled = 10 * model.f + model.n * len(drive)
    return sorted(coarse) == kept[kept < ruled].tolist()


def _holds(
    model: RobotModel,
    drive: tuple[DriveKind, ...],
    tolerance: float,
    friction: Friction | None,
    basis: ColumnBasis,
    kept: NDArray[np.int64],
    matrix: Array,
) -> bool:
    """Whether the combinations of the rules reproduce the torques."""
    if not np.array_equal(kept, basis.kept):
        return False
    if (matrix.any(axis=0) != basis.coefficients.any(axis=0)).any():
        return False
    sizes = natural_sizes(model, drive, friction)
    W = torque_factor(model, drive, friction=friction) * sizes
    missed = W - W[:, kept] @ (matrix * sizes / sizes[kept][:, None])
    longest = np.sqrt((W * W).sum(axis=0)).max(initial=0.0)
    return bool(np.sqrt((missed * missed).sum(axis=0)).max(initial=0.0) <= tolerance * longest)
