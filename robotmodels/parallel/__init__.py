"""Parallel robots (chapter 2): geometric models, statics, singularities, workspaces, dynamics.

Throughout, ``robot`` has m legs and is a `ParallelRobot` or a `LoopedPlatform`; ``T`` (..., 4, 4)
are poses of the platform in the world; ``q`` (..., m) actuated lengths (not strokes), m, or angles,
rad; ``mode`` (...) numbers working modes as `igm` does, default 0. Twists [v; w] and wrenches
[f; m] (..., 6) of the platform, m/s, rad/s, N and N m, are taken at its origin in world axes;
wrenches act on the environment. Arrays of the wrong shape, NaN, and poses that the platform cannot
have or the legs do not reach raise ShapeError, InvalidValueError or NotARotationError.
"""

from .. import _docs
from .direct import AssemblyModes, AssemblyStatus, PlatformPoses, PoseStatus, assembly_modes, dgm
from .dynamics import MotionStatus, ParallelMotion, ddm, energies, idm, simulate
from .families import delta, five_bar, gough, gough_symmetric, planar_3rpr, planar_3rrr
from .legs import LegSolutions, LegStatus, igm
from .looped import LoopedPlatform, from_loops
from .robot import Family, ParallelRobot
from .singularities import Singularity, SingularityKind, classify_singularity
from .velocities import (
    ForceStatus,
    LegForces,
    condition,
    determinant,
    dkm,
    dkm_second_order,
    ikm,
    ikm_second_order,
    inverse_jacobian,
    inverse_jacobian_rate,
    leg_forces,
    maneuverability,
    stiffness,
)
from .workspace import PlatformWorkspace, workspace

__all__ = ["Family", "ParallelRobot", "LoopedPlatform", "gough", "gough_symmetric", "planar_3rpr"]
__all__ += ["planar_3rrr", "five_bar", "delta", "from_loops"]
__all__ += ["igm", "dgm", "assembly_modes", "LegSolutions", "LegStatus", "PlatformPoses"]
__all__ += ["PoseStatus", "AssemblyModes", "AssemblyStatus"]
__all__ += ["inverse_jacobian", "inverse_jacobian_rate", "ikm", "dkm", "ikm_second_order"]
__all__ += ["dkm_second_order", "determinant"]
__all__ += ["leg_forces", "LegForces", "ForceStatus", "stiffness", "maneuverability", "condition"]
__all__ += ["classify_singularity", "Singularity", "SingularityKind", "workspace"]
__all__ += ["PlatformWorkspace"]
__all__ += ["idm", "ddm", "energies", "simulate", "ParallelMotion", "MotionStatus"]

_docs.document(__name__)
