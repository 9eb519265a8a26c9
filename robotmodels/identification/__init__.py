"""Dynamic identification: from a log file to a robot that predicts its torques.

Seed book section 1.6.
"""

from ..logs import Log, LogSource, RefusedRows
from .correlated import CorrelatedCovariance, correlated_covariance
from .equations import Block, EquationForm, Equations, equations
from .estimate import Estimate, EstimateStatus, Method
from .filters import central_differences, decimation_window, zero_phase
from .fit import fit
from .least_squares import ordinary, reweighted, weighted
from .prediction import predicted_torque
from .processing import Processing, choose_processing
from .reduction import Reduction, reduce_equations
from .result import IdentificationResult
from .signals import Signals, signals
from .validation import Validation, validate

__all__ = [
    "Block",
    "CorrelatedCovariance",
    "EquationForm",
    "Equations",
    "Estimate",
    "EstimateStatus",
    "IdentificationResult",
    "Log",
    "LogSource",
    "Method",
    "Processing",
    "Reduction",
    "RefusedRows",
    "Signals",
    "Validation",
    "central_differences",
    "choose_processing",
    "correlated_covariance",
    "decimation_window",
    "equations",
    "fit",
    "ordinary",
    "predicted_torque",
    "reduce_equations",
    "reweighted",
    "signals",
    "validate",
    "weighted",
    "zero_phase",
]
