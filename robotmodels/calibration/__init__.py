"""Geometric calibration: from measurements, or from the robot touching things (section 1.4)."""

from ..file_units import AngleUnit, LengthUnit
from ..obstacles import Box, Sphere
from .candidates import candidate_parameters
from .differential import DifferentialModel, differential_model
from .errors_seen import BlockErrors, ErrorSummary
from .extended_table import (
    Element,
    SixParameters,
    Skeleton,
    base_parameters_of,
    pose_of_elements,
    skeleton_of,
    tool_parameters_of,
)
from .file_kinds import FileKind
from .fit import fit
from .folds import AsideErrors
from .identifiable import (
    IdentifiabilityChange,
    IdentifiableParameters,
    Reason,
    identifiability_change,
    identifiable_on,
    identifiable_parameters,
)
from .inverse import CorrectedSolutions, CorrectionStatus, corrected_igm
from .joined import side_by_side
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
from .measurements.kinds import Kind, drawn_groups
from .offsets import JointOffsets, PoseOffsets, joint_offsets, pose_offsets
from .other_tool import PredictedError, other_tool_error
from .parameters import Compliance, ErrorLaw, GeometricParameter, GeometricParameters
from .prior import ParameterPrior
from .problem import Problem, problem_of
from .read import read_measurements
from .reporting.text import report_text
from .reporting.write import calibrated_urdf, result_data, write_result
from .residuals import measured_residuals
from .result import CalibrationResult
from .robot import (
    Bending,
    CalibratedEnd,
    CalibratedRobot,
    JointErrors,
    calibrated_model,
    calibrated_pose,
    encoder_transmission,
    joint_errors_of,
    reading_jacobian,
)
from .selection import (
    Criterion,
    Observability,
    SelectedConfigurations,
    observability,
    select_configurations,
)
from .solve import Solution
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
    "PredictedError",
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
    "other_tool_error",
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
