"""Kinds of measurement that the rows of a file can hold."""

from __future__ import annotations

from enum import Enum
from typing import Any

from .._choices import chosen
from .measurements import (
    Distance,
    FrameContact,
    Measurement,
    PlaneContact,
    PointContact,
    Pose,
    Position,
    RelativePose,
)


class FileKind(Enum):
    """What a row of a file holds besides readings; the value is the sentence.

    Examples
    --------
    >>> FileKind.POINT_CONTACT.is_contact
    True
    """

    POSITION = "position of the end"
    POSE = "pose of the end"
    ORIENTATION = "orientation of the end"
    DISTANCE = "length from a pivot, or between two positions of the end"
    RELATIVE_POSE = "pose of the end relative to the end at other readings"
    POINT_CONTACT = "nothing: a point is touched"
    FRAME_CONTACT = "nothing: a pose is reached again"
    PLANE_CONTACT = "nothing: a plane is touched"

    @property
    def is_contact(self) -> bool:
        """Whether the row is of readings alone, and perhaps a label."""
        return self in CONTACTS

    @property
    def has_orientation(self) -> bool:
        """Whether an orientation is measured."""
        return self in (FileKind.POSE, FileKind.ORIENTATION, FileKind.RELATIVE_POSE)


CONTACTS = {
    FileKind.POINT_CONTACT: PointContact, FileKind.FRAME_CONTACT: FrameContact,
    FileKind.PLANE_CONTACT: PlaneContact,
}  # fmt: skip
_CLASSES: dict[type[Measurement], FileKind] = {
    Position: FileKind.POSITION, Pose: FileKind.POSE, Distance: FileKind.DISTANCE,
    RelativePose: FileKind.RELATIVE_POSE, **{c: kind for kind, c in CONTACTS.items()},
}  # fmt: skip


def as_file_kind(value: Any, name: str = "kind") -> FileKind:
    """A kind given as a member, by its name, or as the class of its measurements."""
    if isinstance(value, type) and value in _CLASSES:
        return _CLASSES[value]
    return chosen(FileKind, value, name)
