"""Flexible robots (chapter 7): elastic links and joints, their dynamics and control."""

from .beams import beam
from .link import FlexibleLink, Invariants
from .models import (
    Accelerations,
    SpinStatus,
    ddm,
    dgm,
    energies,
    idm,
    jacobian,
    link_poses,
    mass_matrix,
)
from .robot import FlexibleRobot

__all__ = [
    "Accelerations",
    "FlexibleLink",
    "FlexibleRobot",
    "Invariants",
    "SpinStatus",
    "beam",
    "ddm",
    "dgm",
    "energies",
    "idm",
    "jacobian",
    "link_poses",
    "mass_matrix",
]
