"""Estimation: numerics of linear and nonlinear models that know no robot."""

from .columns import ColumnBasis, column_basis
from .coverage import Coverage, coverage
from .diagnostics import (
    FitDiagnostics,
    Linearity,
    ResidualTest,
    confidence_intervals,
    fit_diagnostics,
    linearity,
)
from .folds import held_out, k_folds, leave_one_group_out
from .leverage import Leverage, leverage
from .losses import Loss
from .nonlinear import fit_nonlinear
from .nonlinear_fit import FitStatus, NonlinearFit
from .prior import Prior
from .strength import StrengthSelection, select_strength
from .triangles import factors_by_kind, triangular_factor
from .variance_components import VarianceComponents, variance_components

__all__ = [
    "ColumnBasis",
    "column_basis",
    "factors_by_kind",
    "triangular_factor",
    "Coverage",
    "FitDiagnostics",
    "FitStatus",
    "Leverage",
    "Linearity",
    "Loss",
    "NonlinearFit",
    "Prior",
    "ResidualTest",
    "StrengthSelection",
    "VarianceComponents",
    "confidence_intervals",
    "coverage",
    "fit_diagnostics",
    "fit_nonlinear",
    "held_out",
    "k_folds",
    "leave_one_group_out",
    "leverage",
    "linearity",
    "select_strength",
    "variance_components",
]
