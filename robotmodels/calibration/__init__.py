"""Geometric calibration: from measurements, or from the robot touching things (section 1.4)."""

from .differential import DifferentialModel, differential_model
from .elements import Element, ErrorLaw
from .errors_seen import BlockErrors, ErrorSummary
from .fit import fit
from .folds import AsideErrors
from .identifiable import IdentifiableParameters, Reason, identifiable_on
from .measurements import KnownDistance, Measurement, PointContact, Pose, Position
from .parameters import GeometricParameter, GeometricParameters, candidate_parameters
from .prior import ParameterPrior
from .problem import Problem, problem_of
from .result import CalibrationResult
from .six_parameters import SixParameters, base_parameters_of, pose_of_elements, tool_parameters_of
from .skeleton import Skeleton, skeleton_of
from .solve import Solution

__all__ = [
    "AsideErrors",
    "BlockErrors",
    "CalibrationResult",
    "DifferentialModel",
    "Element",
    "ErrorLaw",
    "ErrorSummary",
    "GeometricParameter",
    "GeometricParameters",
    "IdentifiableParameters",
    "KnownDistance",
    "Measurement",
    "ParameterPrior",
    "PointContact",
    "Pose",
    "Position",
    "Problem",
    "Reason",
    "SixParameters",
    "Skeleton",
    "Solution",
    "base_parameters_of",
    "candidate_parameters",
    "differential_model",
    "fit",
    "identifiable_on",
    "pose_of_elements",
    "problem_of",
    "skeleton_of",
    "tool_parameters_of",
]
