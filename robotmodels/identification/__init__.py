"""Dynamic identification: from a log file to a robot that predicts its torques.

Seed book section 1.6.
"""

from ..logs import (
    FindingKind,
    Log,
    LogFinding,
    LogFormat,
    LogSource,
    RefusedRows,
    Severity,
    check_log,
    join_logs,
    read_log,
    with_delay,
)
from .consistent import fit_consistent
from .consistent_bounds import CentreBound, CentreBox, CentreEllipsoid
from .consistent_result import ConsistentFit, ConsistentStatus
from .consistent_urdf import UrdfParity, urdf_parity
from .correlated import CorrelatedCovariance, correlated_covariance
from .equations import Block, EquationForm, Equations, equations
from .estimate import Estimate, EstimateStatus, Method
from .excitation import (
    ExcitationCriterion,
    ExcitationLimits,
    ExcitationQuality,
    ExcitationStart,
    ExcitationStatus,
    ExcitingTrajectory,
    MotionBasis,
    MotionKind,
    WorkspaceBox,
    excitation_limits,
    exciting_trajectory,
    read_coefficients,
    write_coefficients,
    write_trajectory,
)
from .filters import central_differences, decimation_window, zero_phase
from .fit import fit
from .joint_checks import check_joints
from .least_squares import ordinary, reweighted, weighted
from .prediction import predicted_torque
from .processing import Processing, choose_processing
from .reduction import Reduction, reduce_equations
from .result import IdentificationResult
from .signals import Signals, signals
from .synchronisation import Synchronisation, SynchronisationStatus, synchronisation
from .validation import Validation, validate

__all__ = [
    "Block",
    "CentreBound",
    "CentreBox",
    "CentreEllipsoid",
    "ConsistentFit",
    "ConsistentStatus",
    "CorrelatedCovariance",
    "EquationForm",
    "Equations",
    "Estimate",
    "EstimateStatus",
    "ExcitationCriterion",
    "ExcitationLimits",
    "ExcitationQuality",
    "ExcitationStart",
    "ExcitationStatus",
    "ExcitingTrajectory",
    "FindingKind",
    "IdentificationResult",
    "Log",
    "LogFinding",
    "LogFormat",
    "LogSource",
    "Method",
    "MotionBasis",
    "MotionKind",
    "Processing",
    "Reduction",
    "RefusedRows",
    "Severity",
    "Signals",
    "Synchronisation",
    "SynchronisationStatus",
    "UrdfParity",
    "Validation",
    "WorkspaceBox",
    "central_differences",
    "check_joints",
    "check_log",
    "choose_processing",
    "correlated_covariance",
    "decimation_window",
    "equations",
    "excitation_limits",
    "exciting_trajectory",
    "fit",
    "fit_consistent",
    "join_logs",
    "ordinary",
    "predicted_torque",
    "read_coefficients",
    "read_log",
    "reduce_equations",
    "reweighted",
    "signals",
    "synchronisation",
    "urdf_parity",
    "validate",
    "weighted",
    "with_delay",
    "write_coefficients",
    "write_trajectory",
    "zero_phase",
]
