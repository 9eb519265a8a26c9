"""What can be measured: one kind a file, to be mixed freely in one fit (sections 1.4.4, 1.4.5)."""

from .known_distance import KnownDistance
from .measurement import Evaluation, Fixture, Linearised, Measurement, View
from .point_contact import PointContact
from .pose import Pose
from .position import Position

__all__ = [
    "Evaluation",
    "Fixture",
    "KnownDistance",
    "Linearised",
    "Measurement",
    "PointContact",
    "Pose",
    "Position",
    "View",
]
