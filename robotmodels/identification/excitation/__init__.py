"""Exciting trajectories: motions that show the base parameters of a robot.

Seed book section 1.6.2.3.
"""

from .basis import MotionBasis, MotionKind
from .bounds import excitation_limits
from .boxes import WorkspaceBox
from .criterion import ExcitationCriterion
from .exciting import exciting_trajectory
from .files import read_coefficients, write_coefficients, write_trajectory
from .kept import ExcitationLimits
from .quality import ExcitationQuality
from .result import ExcitationStart, ExcitationStatus, ExcitingTrajectory

__all__ = [
    "ExcitationCriterion",
    "ExcitationLimits",
    "ExcitationQuality",
    "ExcitationStart",
    "ExcitationStatus",
    "ExcitingTrajectory",
    "MotionBasis",
    "MotionKind",
    "WorkspaceBox",
    "excitation_limits",
    "exciting_trajectory",
    "read_coefficients",
    "write_coefficients",
    "write_trajectory",
]
