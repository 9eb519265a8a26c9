"""Inverse kinematic models: joint velocities and accelerations that give a motion of the tool.

Seed book section 1.3.2.
"""

from ...obstacles import Plane, Sphere
from .bounds import JointBounds
from .criteria import (
    Criterion,
    JointLimitCriterion,
    ManipulabilityCriterion,
    NearLimitCriterion,
    ObstacleCriterion,
    PostureCriterion,
)
from .ikm import ikm, ikm_second_order
from .methods import DampedInverse, Damping, FilteredInverse, InverseMethod, PseudoInverse
from .solution import IKMSolution, IKMStatus
from .tasks import (
    DistanceTask,
    FunctionTask,
    JointTask,
    LinearTask,
    PositionTask,
    Task,
    TwistTask,
)

__all__ = [
    "Criterion",
    "DampedInverse",
    "Damping",
    "DistanceTask",
    "FilteredInverse",
    "FunctionTask",
    "IKMSolution",
    "IKMStatus",
    "InverseMethod",
    "JointBounds",
    "JointLimitCriterion",
    "JointTask",
    "LinearTask",
    "ManipulabilityCriterion",
    "NearLimitCriterion",
    "ObstacleCriterion",
    "Plane",
    "PositionTask",
    "PostureCriterion",
    "PseudoInverse",
    "Sphere",
    "Task",
    "TwistTask",
    "ikm",
    "ikm_second_order",
]
