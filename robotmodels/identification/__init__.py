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
from .closed_loop import (
    ClosedLoop,
    Controller,
    HausmanResult,
    Output,
    SimulatedEstimate,
    didim,
    hausman_test,
    instrumental,
    output_error,
    simulated_log,
    tuned_controller,
)
from .comparison import ComparedFit, MethodComparison, compare_methods
from .consistency.bounds import CentreBound, CentreBox, CentreEllipsoid
from .consistency.fit_consistent import fit_consistent
from .consistency.identified_robot import consistent_robot, prior_bodies
from .consistency.result import ConsistentFit, ConsistentStatus
from .consistency.urdf_parity import UrdfParity, urdf_parity
from .correlated import CorrelatedCovariance, correlated_covariance
from .equations import Block, EquationForm, Equations, equations
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
from .fit import fit
from .friction_models.comparison import FrictionComparison, FrictionForm, compare_friction
from .friction_models.load_friction import LoadFrictionFit, LoadFrictionStatus, fit_load_friction
from .friction_models.stribeck import StribeckFit, StribeckStatus, fit_stribeck
from .methods.essential import Essential, EssentialRule, essential
from .methods.estimate import Estimate, EstimateStatus, Method
from .methods.least_squares import ordinary, reweighted, weighted
from .methods.recursive import RecursiveEstimate, RecursiveHistory, recursive
from .methods.ridge import RidgeEstimate, ridge, segments, select_ridge_strength
from .methods.robust import Outliers, RobustEstimate, robust
from .methods.sequential import SequentialEstimate, SequentialStep, sequential
from .methods.total import TotalEstimate, TotalStatus, total
from .prediction import predicted_torque
from .preparation.filters import central_differences, decimation_window, zero_phase
from .preparation.joint_checks import check_joints
from .preparation.processing import Processing, choose_processing
from .preparation.signals import Signals, signals
from .preparation.synchronisation import Synchronisation, SynchronisationStatus, synchronisation
from .reporting.residuals import ResidualDiagnostics, residual_diagnostics
from .reporting.text import report_text
from .reporting.weak_parameters import (
    WrongSign,
    not_seen,
    strong_correlations,
    understatement,
    wrong_signs,
)
from .reporting.write import read_estimate, write_result
from .result import IdentificationResult
from .scale.many_robots import reduce_many
from .scale.reduction import Reduction, reduce_equations
from .several_logs.drive_gains import identify_drive_gains
from .several_logs.drive_gains_result import DriveGains, GainMethod, GainStatus
from .several_logs.known_payload import KnownPayload, LoadedLog
from .several_logs.payload import PayloadEstimate, PayloadStatus, identify_payload
from .validation import Validation, validate

__all__ = [
    "Block",
    "CentreBound",
    "CentreBox",
    "CentreEllipsoid",
    "ClosedLoop",
    "ComparedFit",
    "ConsistentFit",
    "ConsistentStatus",
    "Controller",
    "CorrelatedCovariance",
    "DriveGains",
    "EquationForm",
    "Equations",
    "Essential",
    "EssentialRule",
    "Estimate",
    "EstimateStatus",
    "ExcitationCriterion",
    "ExcitationLimits",
    "ExcitationQuality",
    "ExcitationStart",
    "ExcitationStatus",
    "ExcitingTrajectory",
    "FindingKind",
    "FrictionComparison",
    "FrictionForm",
    "GainMethod",
    "GainStatus",
    "HausmanResult",
    "IdentificationResult",
    "KnownPayload",
    "LoadFrictionFit",
    "LoadFrictionStatus",
    "LoadedLog",
    "Log",
    "LogFinding",
    "LogFormat",
    "LogSource",
    "Method",
    "MethodComparison",
    "MotionBasis",
    "MotionKind",
    "Outliers",
    "Output",
    "PayloadEstimate",
    "PayloadStatus",
    "Processing",
    "RecursiveEstimate",
    "RecursiveHistory",
    "Reduction",
    "RefusedRows",
    "ResidualDiagnostics",
    "RidgeEstimate",
    "RobustEstimate",
    "SequentialEstimate",
    "SequentialStep",
    "Severity",
    "Signals",
    "SimulatedEstimate",
    "StribeckFit",
    "StribeckStatus",
    "Synchronisation",
    "SynchronisationStatus",
    "TotalEstimate",
    "TotalStatus",
    "UrdfParity",
    "Validation",
    "WorkspaceBox",
    "WrongSign",
    "central_differences",
    "check_joints",
    "check_log",
    "choose_processing",
    "compare_friction",
    "compare_methods",
    "consistent_robot",
    "correlated_covariance",
    "decimation_window",
    "didim",
    "equations",
    "essential",
    "excitation_limits",
    "exciting_trajectory",
    "fit",
    "fit_consistent",
    "fit_load_friction",
    "fit_stribeck",
    "hausman_test",
    "identify_drive_gains",
    "identify_payload",
    "instrumental",
    "join_logs",
    "not_seen",
    "ordinary",
    "output_error",
    "predicted_torque",
    "prior_bodies",
    "read_coefficients",
    "read_estimate",
    "read_log",
    "recursive",
    "reduce_equations",
    "reduce_many",
    "report_text",
    "residual_diagnostics",
    "reweighted",
    "ridge",
    "robust",
    "segments",
    "select_ridge_strength",
    "sequential",
    "signals",
    "simulated_log",
    "strong_correlations",
    "synchronisation",
    "total",
    "tuned_controller",
    "understatement",
    "urdf_parity",
    "validate",
    "weighted",
    "with_delay",
    "write_coefficients",
    "write_result",
    "write_trajectory",
    "wrong_signs",
    "zero_phase",
]
