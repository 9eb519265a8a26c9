"""Kinds of measurement, which can be combined in one fit (sections 1.4.4, 1.4.5)."""

from .base import (
    Contact,
    Evaluation,
    Fixture,
    Labelled,
    Linearised,
    Measurement,
    View,
    scale_is_observable,
    single_observations,
    whitened,
)
from .contacts import FrameContact, LaserLine, PlaneContact, PointContact
from .fields import FileRow
from .links import KnownDistance, LinkedFrames
from .poses import CameraPose, Orientation, Pose, RelativePose
from .positions import AxisPosition, Distance, Position

__all__ = [
    "AxisPosition",
    "CameraPose",
    "Contact",
    "Distance",
    "Evaluation",
    "FileRow",
    "Fixture",
    "FrameContact",
    "KnownDistance",
    "Labelled",
    "LaserLine",
    "Linearised",
    "LinkedFrames",
    "Measurement",
    "Orientation",
    "PlaneContact",
    "PointContact",
    "Pose",
    "Position",
    "RelativePose",
    "View",
    "scale_is_observable",
    "single_observations",
    "whitened",
]
