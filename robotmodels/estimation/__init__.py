"""Estimation: linear and nonlinear least squares, independent of robots."""

from .. import _docs
from .columns import ColumnBasis, column_basis
from .covariance import CorrelatedCovariance, correlated_covariance
from .diagnostics import FitDiagnostics, ResidualTest, confidence_intervals, fit_diagnostics
from .estimate import Estimate, EstimateStatus
from .factor import TriangularFactors
from .losses import Loss
from .nonlinear import FitStatus, NonlinearFit, fit_nonlinear
from .prior import Prior

__all__ = [
    "ColumnBasis",
    "FitDiagnostics",
    "FitStatus",
    "Loss",
    "NonlinearFit",
    "Prior",
    "ResidualTest",
    "column_basis",
    "confidence_intervals",
    "CorrelatedCovariance",
    "Estimate",
    "EstimateStatus",
    "TriangularFactors",
    "correlated_covariance",
    "fit_diagnostics",
    "fit_nonlinear",
]

_docs.document(__name__)
