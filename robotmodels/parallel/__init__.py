"""Parallel robots (chapter 2): geometric models, statics, singularities, workspaces, dynamics."""

from .direct import (
    AssemblyModes,
    AssemblyStatus,
    PlatformPoses,
    PoseStatus,
    assembly_modes,
    dgm,
)
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

__all__ = [
    "AssemblyModes",
    "AssemblyStatus",
    "Family",
    "ForceStatus",
    "LegForces",
    "LegSolutions",
    "LegStatus",
    "LoopedPlatform",
    "MotionStatus",
    "ParallelMotion",
    "ParallelRobot",
    "PlatformPoses",
    "PlatformWorkspace",
    "PoseStatus",
    "Singularity",
    "SingularityKind",
    "assembly_modes",
    "classify_singularity",
    "condition",
    "ddm",
    "delta",
    "determinant",
    "dgm",
    "dkm",
    "dkm_second_order",
    "energies",
    "five_bar",
    "from_loops",
    "gough",
    "gough_symmetric",
    "idm",
    "igm",
    "ikm",
    "ikm_second_order",
    "inverse_jacobian",
    "inverse_jacobian_rate",
    "leg_forces",
    "maneuverability",
    "planar_3rpr",
    "planar_3rrr",
    "simulate",
    "stiffness",
    "workspace",
]
