"""Geometric calibration: from measurements, or from the robot touching things (section 1.4)."""

from ..obstacles import Box, Sphere
from .calibrated_robot.calibrated import CalibratedRobot, calibrated_model
from .calibrated_robot.calibrated_pose import calibrated_pose
from .combined_arms import combine_arms
from .correction.corrected import corrected_igm
from .correction.offsets import joint_offsets, pose_offsets
from .extended_table.candidates import candidate_parameters
from .extended_table.differential import differential_model
from .extended_table.elements import Compliance
from .extended_table.parameters import GeometricParameters
from .fit import fit
from .identifiability.identifiable import Reason
from .identifiability.structural import identifiable_parameters
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
from .prior import ParameterPrior
from .read import read_measurements
from .report import report
from .result import CalibrationResult
from .selection.observability import observability
from .selection.select import select_configurations
from .validation import Errors, Validation
from .write import calibrated_urdf, write_result

__all__ = [
    "AxisPosition",
    "Box",
    "CalibratedRobot",
    "CalibrationResult",
    "CameraPose",
    "Compliance",
    "Distance",
    "Errors",
    "FrameContact",
    "GeometricParameters",
    "KnownDistance",
    "LaserLine",
    "LinkedFrames",
    "Measurement",
    "ParameterPrior",
    "PlaneContact",
    "PointContact",
    "Pose",
    "Position",
    "Reason",
    "RelativePose",
    "Sphere",
    "Validation",
    "calibrated_model",
    "calibrated_pose",
    "calibrated_urdf",
    "candidate_parameters",
    "combine_arms",
    "corrected_igm",
    "differential_model",
    "fit",
    "identifiable_parameters",
    "joint_offsets",
    "observability",
    "pose_offsets",
    "read_measurements",
    "report",
    "select_configurations",
    "write_result",
]
