"""URDF: parts of a robot to text, and text to parts. Independent of `RobotModel` and Pinocchio."""

from .. import _docs
from .parts import TOOL, NamedFrame, RobotParts
from .read import read_urdf
from .write import urdf_text

__all__ = ["TOOL", "NamedFrame", "RobotParts", "read_urdf", "urdf_text"]

_docs.document(__name__)
