"""Geometric calibration: from measurements, or from the robot touching things (section 1.4)."""

from .differential import DifferentialModel, differential_model
from .elements import Element, ErrorLaw
from .parameters import GeometricParameter, GeometricParameters, candidate_parameters
from .six_parameters import SixParameters, base_parameters_of, pose_of_elements, tool_parameters_of
from .skeleton import Skeleton, skeleton_of

__all__ = [
    "DifferentialModel",
    "Element",
    "ErrorLaw",
    "GeometricParameter",
    "GeometricParameters",
    "SixParameters",
    "Skeleton",
    "base_parameters_of",
    "candidate_parameters",
    "differential_model",
    "pose_of_elements",
    "skeleton_of",
    "tool_parameters_of",
]
