"""Rank and singular configurations: what is lost, what still moves, where the next one is.

Seed book sections 1.3.1.4 and 1.3.2.3.
"""

from .boundary import WorkspaceSide
from .classification import classify_singularity
from .flags import SingularityFlags, SingularityStatus, singularity_flags
from .frames import LostDirections
from .motion import SelfMotion, SelfMotionKind
from .nearest import nearest_singularity
from .nearest_result import NearestSingularities, NearestStatus, SearchOutcome
from .rank import JacobianRank, OperationalDimension, jacobian_rank, operational_dimension
from .report import SingularityReport

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
