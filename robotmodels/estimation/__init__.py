"""Estimation: numerics of linear and nonlinear models that know no robot."""

from .columns import ColumnBasis, column_basis
from .losses import Loss
from .nonlinear import fit_nonlinear
from .nonlinear_fit import FitStatus, NonlinearFit
from .prior import Prior
from .triangles import factors_by_kind, triangular_factor

__all__ = [
    "ColumnBasis",
    "column_basis",
    "factors_by_kind",
    "triangular_factor",
    "FitStatus",
    "Loss",
    "NonlinearFit",
    "Prior",
    "fit_nonlinear",
]
