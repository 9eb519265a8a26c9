"""Criteria that the freedom of a redundant robot improves: seed book section 1.3.2.4."""

from .criterion import Criterion
from .joint_limits import JointLimitCriterion
from .manipulability import ManipulabilityCriterion
from .near_limits import NearLimitCriterion
from .obstacles import ObstacleCriterion
from .posture import PostureCriterion

__all__ = [
    "Criterion",
    "JointLimitCriterion",
    "ManipulabilityCriterion",
    "NearLimitCriterion",
    "ObstacleCriterion",
    "PostureCriterion",
]
