"""Dynamic identification: from a log to the parameters of a robot that predict its torques.

Book section 1.6.
"""

from .. import _docs
from ..estimation.covariance import correlated_covariance
from ..logs import Log, check_log, read_log
from ..minimal_parameters import CenterOfMassBox, CenterOfMassEllipsoid
from .closed_loop import (
    Controller,
    Didim,
    Instrumental,
    OutputError,
    hausman_test,
    simulated_log,
    tuned_controller,
)
from .comparison import compare_methods
from .delay import synchronisation
from .drive_gains import identify_drive_gains
from .equations import equations, reduce_equations
from .excitation import ExcitingTrajectory, exciting_trajectory, write_trajectory
from .fit import fit
from .friction import fit_friction
from .loads import KnownPayload, LoadedLog
from .methods.linear import Irls, Ols, Ridge, Robust, Total, Wls
from .methods.sequential import Recursive, Sequential
from .payload import identify_payload
from .processing import choose_processing
from .report import report
from .result import IdentificationResult, consistent_robot, predicted_torque, validate
from .result_file import write_result
from .signals import Processing
from .validation import Errors, Validation

__all__ = ["CenterOfMassBox", "CenterOfMassEllipsoid", "Controller", "Didim", "Errors"]
__all__ += ["ExcitingTrajectory", "IdentificationResult", "Instrumental", "Irls", "KnownPayload"]
__all__ += ["LoadedLog", "Log", "Ols", "OutputError", "Processing", "Recursive", "Ridge", "Robust"]
__all__ += ["Sequential", "Total", "Validation", "Wls", "check_log", "choose_processing"]
__all__ += ["compare_methods", "consistent_robot", "correlated_covariance", "equations"]
__all__ += ["exciting_trajectory", "fit", "fit_friction", "hausman_test", "identify_drive_gains"]
__all__ += ["identify_payload", "predicted_torque", "read_log", "reduce_equations", "report"]
__all__ += ["simulated_log", "synchronisation", "tuned_controller", "validate", "write_result"]
__all__ += ["write_trajectory"]

_docs.document(__name__)
