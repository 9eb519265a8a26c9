"""Geometric calibration: from measurements, or from the robot touching things (section 1.4)."""

from .differential import DifferentialModel, differential_model
from .elements import Element, ErrorLaw
from .identifiable import IdentifiableParameters, Reason, identifiable_on
from .measurements import KnownDistance, Measurement, PointContact, Pose, Position
from .parameters import GeometricParameter, GeometricParameters, candidate_parameters
from .problem import Problem, problem_of
from .six_parameters import SixParameters, base_parameters_of, pose_of_elements, tool_parameters_of
from .skeleton import Skeleton, skeleton_of

__all__ = [
    "DifferentialModel",
    "Element",
    "ErrorLaw",
    "GeometricParameter",
    "GeometricParameters",
    "IdentifiableParameters",
    "KnownDistance",
    "Measurement",
    "PointContact",
    "Pose",
    "Position",
    "Problem",
    "Reason",
    "SixParameters",
    "Skeleton",
    "base_parameters_of",
    "candidate_parameters",
    "differential_model",
    "identifiable_on",
    "pose_of_elements",
    "problem_of",
    "skeleton_of",
    "tool_parameters_of",
]
