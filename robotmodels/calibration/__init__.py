"""Geometric calibration: from measurements, or from the robot touching things (section 1.4)."""

from ..file_units import AngleUnit, LengthUnit
from ..obstacles import Box, Sphere
from .calibrated_robot.bending import Bending
from .calibrated_robot.calibrated import CalibratedEnd, CalibratedRobot, calibrated_model
from .calibrated_robot.calibrated_pose import calibrated_pose
from .calibrated_robot.joint_errors import JointErrors, encoder_transmission, joint_errors_of
from .calibrated_robot.reading_jacobian import reading_jacobian
from .correction.corrected import corrected_igm
from .correction.corrected_solutions import CorrectedSolutions, CorrectionStatus
from .correction.offsets import JointOffsets, PoseOffsets, joint_offsets, pose_offsets
from .errors_seen import BlockErrors, ErrorSummary
from .extended_table.candidates import candidate_parameters
from .extended_table.differential import DifferentialModel, differential_model
from .extended_table.elements import Compliance, Element, ErrorLaw
from .extended_table.parameters import GeometricParameter, GeometricParameters
from .extended_table.six_parameters import (
    SixParameters,
    base_parameters_of,
    pose_of_elements,
    tool_parameters_of,
)
from .extended_table.skeleton import Skeleton, skeleton_of
from .fit import fit
from .folds import AsideErrors
from .identifiability.changed import IdentifiabilityChange, identifiability_change
from .identifiability.identifiable import IdentifiableParameters, Reason, identifiable_on
from .identifiability.structural import identifiable_parameters
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
from .other_tool import PredictedError, other_tool_error
from .prior import ParameterPrior
from .read import read_measurements
from .reporting.text import report_text
from .reporting.write import calibrated_urdf, result_data, write_result
from .residuals import measured_residuals
from .result import CalibrationResult
from .selection.observability import Criterion, Observability, observability
from .selection.select import select_configurations
from .selection.selected import SelectedConfigurations
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
    "FrameContact",
    "GeometricParameter",
    "GeometricParameters",
    "IdentifiabilityChange",
    "IdentifiableParameters",
    "JointErrors",
    "JointOffsets",
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
