"""Rank and singular configurations: lost directions, self-motions, the nearest ones.

Seed book sections 1.3.1.4 and 1.3.2.3.
"""

from .frames import LostDirections
from .nearest import NearestSingularities, NearestStatus, SearchOutcome, nearest_singularity
from .rank import JacobianRank, OperationalDimension, jacobian_rank, operational_dimension
from .report import (
    SingularityFlags,
    SingularityReport,
    SingularityStatus,
    classify_singularity,
    singularity_flags,
)
from .self_motion import SelfMotion, SelfMotionKind, WorkspaceSide

__all__ = [
    "JacobianRank",
    "LostDirections",
    "NearestSingularities",
    "NearestStatus",
    "OperationalDimension",
    "SearchOutcome",
    "SelfMotion",
    "SelfMotionKind",
    "SingularityFlags",
    "SingularityReport",
    "SingularityStatus",
    "WorkspaceSide",
    "classify_singularity",
    "jacobian_rank",
    "nearest_singularity",
    "operational_dimension",
    "singularity_flags",
]
