"""What can be measured: one kind a file, to be mixed freely in one fit (sections 1.4.4, 1.4.5)."""

from .axis_position import AxisPosition
from .camera_pose import CameraPose
from .dilations import length_is_known
from .distance import Distance
from .frame_contact import FrameContact
from .known_distance import KnownDistance
from .labelled import Labelled
from .laser_line import LaserLine
from .linked_frames import LinkedFrames
from .lonely import LonelyLabel, lonely_labels
from .measurement import Evaluation, Fixture, Linearised, Measurement, View
from .plane_contact import PlaneContact
from .point_contact import PointContact
from .pose import Pose
from .position import Position
from .relative_pose import RelativePose

__all__ = [
    "AxisPosition",
    "CameraPose",
    "Distance",
    "Evaluation",
    "Fixture",
    "FrameContact",
    "KnownDistance",
    "Labelled",
    "LaserLine",
    "Linearised",
    "LinkedFrames",
    "LonelyLabel",
    "Measurement",
    "PlaneContact",
    "PointContact",
    "Pose",
    "Position",
    "RelativePose",
    "View",
    "length_is_known",
    "lonely_labels",
]
