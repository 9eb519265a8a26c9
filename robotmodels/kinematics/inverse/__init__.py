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
from .distance_task import DistanceTask
from .function_task import FunctionTask
from .ikm import ikm
from .joint_task import JointTask
from .levels import Level, LevelVelocities, level_velocities
from .linear_task import LinearTask
from .methods import DampedInverse, Damping, FilteredInverse, InverseMethod, PseudoInverse
from .position_task import PositionTask
from .second_order import ikm_second_order
from .solution import IKMSolution
from .status import IKMStatus
from .tasks import Task
from .twist_task import TwistTask

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
    "Level",
    "LevelVelocities",
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
    "level_velocities",
]
