"""Flexible robots (chapter 7): elastic links and joints, their dynamics and control.

Throughout, ``arm`` is a `FlexibleRobot` of n joints and m elastic coordinates; ``q, v, a`` (..., n)
are positions, velocities and accelerations of its motors, rad or m, ``e, e_v`` (..., m) elastic
coordinates and their velocities, default zero, ``tau`` (..., n) torques of the motors, N m or N;
``wrench`` (..., 6) is the force and moment of the tool on the environment at the tool point in
world axes. Leading axes are batch axes. Arguments of the wrong shape, with NaN or out of range
raise ShapeError or InvalidValueError; a coordinate that moves no inertia, such as a flexible joint
without rotor inertia, SingularMassMatrixError.
"""

from .. import _docs
from .beams import beam
from .control import (
    RestStatus,
    RestToRest,
    Shaper,
    input_shaper,
    joint_tracking,
    regulator,
    rest_to_rest,
)
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

_docs.document(__name__)
