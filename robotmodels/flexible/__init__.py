"""Flexible robots (chapter 7): elastic links and joints, their dynamics and control."""

from .beams import beam
from .control import RestStatus, RestToRest, joint_tracking, regulator, rest_to_rest
from .linear import (
    Deflection,
    DeflectionStatus,
    LinearModel,
    linearize,
    natural_frequencies,
    static_deflection,
)
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
from .modes import ReducedModel, craig_bampton, from_modes
from .references import Elastica, elastica, lumped
from .robot import FlexibleRobot
from .shaper import Shaper, input_shaper
from .simulate import FlexibleMotion, FlexibleMotionStatus, FreeBodyMotion, free_body, simulate
from .tip import TipStatus, TipTracking, tip_tracking

__all__ = [
    "Accelerations",
    "Deflection",
    "DeflectionStatus",
    "Elastica",
    "FlexibleLink",
    "FlexibleMotion",
    "FlexibleMotionStatus",
    "FlexibleRobot",
    "FreeBodyMotion",
    "Invariants",
    "LinearModel",
    "ReducedModel",
    "RestStatus",
    "RestToRest",
    "Shaper",
    "SpinStatus",
    "TipStatus",
    "TipTracking",
    "beam",
    "craig_bampton",
    "ddm",
    "dgm",
    "elastica",
    "energies",
    "free_body",
    "from_modes",
    "idm",
    "input_shaper",
    "jacobian",
    "joint_tracking",
    "linearize",
    "link_poses",
    "lumped",
    "mass_matrix",
    "natural_frequencies",
    "regulator",
    "rest_to_rest",
    "simulate",
    "static_deflection",
    "tip_tracking",
]
