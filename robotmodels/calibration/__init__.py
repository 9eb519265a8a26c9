"""Geometric calibration: from measurements, or from the robot touching things (section 1.4)."""

from ..file_units import AngleUnit, LengthUnit
from ..obstacles import Box, Sphere
from .candidates import candidate_parameters
from .differential import differential_model
from .errors_seen import BlockErrors, ErrorSummary
from .extended_table import (
    Element,
    ExtendedTable,
    extend_table,
)
from .fit import fit
from .folds import AsideErrors
from .identifiable import (
    IdentifiableParameters,
    Reason,
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
from .observability import Criterion, Observability, observability
from .offsets import JointOffsets, PoseOffsets, joint_offsets, pose_offsets
from .other_tool import PredictedError, other_tool_error
from .parameters import Compliance, ErrorLaw, GeometricParameter, GeometricParameters
from .prior import ParameterPrior
from .read import read_measurements
from .reporting.text import report_text
from .reporting.write import calibrated_urdf, result_data, write_result
from .residuals import measured_residuals
from .result import CalibrationResult
from .robot import (
    CalibratedRobot,
    calibrated_model,
    calibrated_pose,
)
from .selection import SelectedConfigurations, select_configurations
from .solve import Solution
from .true_errors import TrueErrors, true_errors

__all__ = [
    "AngleUnit",
    "AsideErrors",
    "AxisPosition",
    "BlockErrors",
    "Box",
    "CalibratedRobot",
    "CalibrationResult",
    "CameraPose",
    "Compliance",
    "CorrectedSolutions",
    "CorrectionStatus",
    "Criterion",
    "Distance",
    "Element",
    "ErrorLaw",
    "ErrorSummary",
    "FrameContact",
    "GeometricParameter",
    "GeometricParameters",
    "IdentifiableParameters",
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
    "ExtendedTable",
    "Solution",
    "Sphere",
    "TrueErrors",
    "calibrated_model",
    "calibrated_pose",
    "calibrated_urdf",
    "candidate_parameters",
    "corrected_igm",
    "differential_model",
    "fit",
    "identifiable_parameters",
    "joint_offsets",
    "measured_residuals",
    "observability",
    "other_tool_error",
    "pose_offsets",
    "read_measurements",
    "report_text",
    "result_data",
    "select_configurations",
    "side_by_side",
    "extend_table",
    "true_errors",
    "write_result",
]
