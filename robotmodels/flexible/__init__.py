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

__all__ = ["FlexibleLink", "FlexibleRobot", "Invariants", "beam", "craig_bampton", "from_modes"]
__all__ += ["ReducedModel"]
__all__ += ["Accelerations", "SpinStatus", "ddm", "dgm", "energies", "idm", "jacobian"]
__all__ += ["link_poses", "mass_matrix"]
__all__ += ["Deflection", "DeflectionStatus", "LinearModel", "linearize", "natural_frequencies"]
__all__ += ["static_deflection", "Elastica", "elastica", "lumped"]
__all__ += ["FlexibleMotion", "FlexibleMotionStatus", "FreeBodyMotion", "free_body", "simulate"]
__all__ += ["RestStatus", "RestToRest", "joint_tracking", "regulator", "rest_to_rest"]
__all__ += ["Shaper", "input_shaper", "TipStatus", "TipTracking", "tip_tracking"]
