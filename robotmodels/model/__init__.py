"""The robot model: a value made of parts, with its Pinocchio model built from its URDF."""

from .. import _docs
from .argument import as_positions, check_model
from .robot_model import GRAVITY, RobotModel
from .twin import FrameOfInterest, PinocchioTwin
from .write import to_urdf, write_urdf

__all__ = [
    "FrameOfInterest",
    "GRAVITY",
    "PinocchioTwin",
    "RobotModel",
    "as_positions",
    "check_model",
    "to_urdf",
    "write_urdf",
]

_docs.document(__name__)
