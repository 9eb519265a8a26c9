"""Geometric calibration: from measurements, or from the robot touching things (section 1.4)."""

from ..file_units import AngleUnit, LengthUnit
from .bending import Bending
from .calibrated import CalibratedEnd, CalibratedRobot, calibrated_model
from .calibrated_pose import calibrated_pose
from .candidates import candidate_parameters
from .changed import IdentifiabilityChange, identifiability_change
from .corrected import corrected_igm
from .corrected_solutions import CorrectedSolutions, CorrectionStatus
from .differential import DifferentialModel, differential_model
from .elements import Compliance, Element, ErrorLaw
from .errors_seen import BlockErrors, ErrorSummary
from .file_kinds import FileKind
from .fit import fit
from .folds import AsideErrors
from .identifiable import IdentifiableParameters, Reason, identifiable_on
from .joined import side_by_side
from .joint_errors import JointErrors, encoder_transmission, joint_errors_of
from .kinds import Kind, drawn_groups
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
from .offsets import JointOffsets, PoseOffsets, joint_offsets, pose_offsets
from .parameters import GeometricParameter, GeometricParameters
from .prior import ParameterPrior
from .problem import Problem, problem_of
from .read import read_measurements
from .reading_jacobian import reading_jacobian
from .reporting.text import report_text
from .reporting.write import calibrated_urdf, result_data, write_result
from .residuals import measured_residuals
from .result import CalibrationResult
from .select import select_configurations
from .selected import SelectedConfigurations
from .six_parameters import SixParameters, base_parameters_of, pose_of_elements, tool_parameters_of
from .skeleton import Skeleton, skeleton_of
from .solve import Solution
from .structural import identifiable_parameters
from .true_errors import TrueErrors, true_errors

__all__ = [
    "AngleUnit",
    "AsideErrors",
    "AxisPosition",
    "Bending",
    "BlockErrors",
    "Box",
    "CalibratedEnd",
    "CalibratedRobot",
    "CalibrationResult",
    "CameraPose",
    "Compliance",
    "CorrectedSolutions",
    "CorrectionStatus",
    "Criterion",
    "DifferentialModel",
    "Distance",
    "Element",
    "ErrorLaw",
    "ErrorSummary",
    "FileKind",
    "FrameContact",
    "GeometricParameter",
    "GeometricParameters",
    "HalfSpace",
    "IdentifiabilityChange",
    "IdentifiableParameters",
    "JointErrors",
    "JointOffsets",
    "Kind",
    "KnownDistance",
    "LaserLine",
    "LengthUnit",
    "LinkedFrames",
    "Measurement",
    "Observability",
    "ParameterPrior",
    "PlaneContact",
    "PointContact",
    "Pose",
    "PoseOffsets",
    "Position",
    "Problem",
    "Reason",
    "RelativePose",
    "SelectedConfigurations",
    "SixParameters",
    "Skeleton",
    "Solution",
    "Sphere",
    "TrueErrors",
    "base_parameters_of",
    "calibrated_model",
    "calibrated_pose",
    "calibrated_urdf",
    "candidate_parameters",
    "clearance",
    "corrected_igm",
    "differential_model",
    "drawn_groups",
    "encoder_transmission",
    "fit",
    "identifiability_change",
    "identifiable_on",
    "identifiable_parameters",
    "joint_errors_of",
    "joint_offsets",
    "measured_residuals",
    "observability",
    "pose_of_elements",
    "pose_offsets",
    "problem_of",
    "read_measurements",
    "reading_jacobian",
    "report_text",
    "result_data",
    "select_configurations",
    "side_by_side",
    "skeleton_of",
    "tool_parameters_of",
    "true_errors",
    "write_result",
]
