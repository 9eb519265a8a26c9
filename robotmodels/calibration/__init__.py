"""Geometric calibration from measurements or contacts (book section 1.4).

Common arguments:

- ``model``: the nominal `RobotModel`, n joints; ``q (..., n)``: readings of its joints, rad or m.
- ``frame``: the measured end, a name or a number of a frame; None is the tool.
- ``parameters``: `GeometricParameters`, or names of some of those that `candidate_parameters` makes
  of ``base, tool, gains, couplings, compliance, eccentricity``; default all.
- ``known_lengths``, ``known``: names of parameters that are known and stay as they are. Contacts,
  measurements without a length, need one of ``known_lengths``, which gives the scale.
- ``corrections (P,)``: xi, added to the nominal values of P parameters; m, rad or their unit.
- ``sigma``: standard deviations of the rows of a measurement, m or rad.
- ``robot``: a `CalibratedRobot`, or the `CalibrationResult` that holds it.
- ``mask, mask_axes, lock``: as `igm`. ``rng``: a generator or a seed. ``progress``: a function that
  is called with the fraction done; True writes it to the log (`logging`).
"""

from .. import _docs
from ..obstacles import Box, Sphere
from .candidates import candidate_parameters
from .combined_arms import combine_arms
from .differential import differential_model
from .fit import fit
from .identifiable import IdentifiableParameters, Reason, identifiable_parameters
from .inverse import JointOffsets, PoseOffsets, corrected_igm, joint_offsets, pose_offsets
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
from .observability import Observability, observability
from .parameters import Compliance, GeometricParameters
from .prior import ParameterPrior
from .read import read_measurements
from .report import report
from .result import CalibrationResult
from .robot import CalibratedRobot, calibrated_model, calibrated_pose
from .selection import SelectedConfigurations, select_configurations
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
    "IdentifiableParameters",
    "JointOffsets",
    "KnownDistance",
    "LaserLine",
    "LinkedFrames",
    "Measurement",
    "Observability",
    "ParameterPrior",
    "PlaneContact",
    "PointContact",
    "Pose",
    "PoseOffsets",
    "Position",
    "Reason",
    "RelativePose",
    "SelectedConfigurations",
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

_docs.document(__name__)
