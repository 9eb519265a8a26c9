"""Geometric calibration: from measurements, or from the robot touching things (section 1.4)."""

from .calibrated import (
    CalibratedEnd,
    CalibratedRobot,
    calibrated_model,
    calibrated_pose,
    calibrated_urdf,
)
from .changed import IdentifiabilityChange, identifiability_change
from .differential import DifferentialModel, differential_model
from .elements import Compliance, Element, ErrorLaw
from .errors_seen import BlockErrors, ErrorSummary
from .fit import fit
from .folds import AsideErrors
from .identifiable import IdentifiableParameters, Reason, identifiable_on
from .joined import side_by_side
from .joint_errors import JointErrors, encoder_transmission, joint_errors_of
from .kinds import Kind
from .measurements import (
    AxisPosition,
    CameraPose,
    Distance,
    FrameContact,
    KnownDistance,
    LaserLine,
    LinkedFrames,
    Measurement,
    PlaneContact,
    PointContact,
    Pose,
    Position,
    RelativePose,
)
from .observability import Criterion, Observability, observability
from .obstacles import Box, HalfSpace, Sphere, clearance
from .parameters import GeometricParameter, GeometricParameters, candidate_parameters
from .prior import ParameterPrior
from .problem import Problem, problem_of
from .result import CalibrationResult
from .select import select_configurations
from .selected import SelectedConfigurations
from .six_parameters import SixParameters, base_parameters_of, pose_of_elements, tool_parameters_of
from .skeleton import Skeleton, skeleton_of
from .solve import Solution
from .structural import identifiable_parameters

__all__ = [
    "AsideErrors",
    "AxisPosition",
    "BlockErrors",
    "Box",
    "CalibratedEnd",
    "CalibratedRobot",
    "CalibrationResult",
    "CameraPose",
    "Compliance",
    "Criterion",
    "DifferentialModel",
    "Distance",
    "Element",
    "ErrorLaw",
    "ErrorSummary",
    "FrameContact",
    "GeometricParameter",
    "GeometricParameters",
    "HalfSpace",
    "IdentifiabilityChange",
    "IdentifiableParameters",
    "JointErrors",
    "Kind",
    "KnownDistance",
    "LaserLine",
    "LinkedFrames",
    "Measurement",
    "Observability",
    "ParameterPrior",
    "PlaneContact",
    "PointContact",
    "Pose",
    "Position",
    "Problem",
    "Reason",
    "RelativePose",
    "SelectedConfigurations",
    "SixParameters",
    "Skeleton",
    "Solution",
    "Sphere",
    "base_parameters_of",
    "calibrated_model",
    "calibrated_pose",
    "calibrated_urdf",
    "candidate_parameters",
    "clearance",
    "differential_model",
    "encoder_transmission",
    "fit",
    "identifiability_change",
    "identifiable_on",
    "identifiable_parameters",
    "joint_errors_of",
    "observability",
    "pose_of_elements",
    "problem_of",
    "select_configurations",
    "side_by_side",
    "skeleton_of",
    "tool_parameters_of",
]
