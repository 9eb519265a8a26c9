"""Parts of a robot that is read from a URDF or written to one."""

from __future__ import annotations

from dataclasses import dataclass, field

from .._arrays import Array, read_only
from ..drive import DriveParameters, Transmission
from ..geometry import DHTable
from ..inertia import InertialParameters
from ..visual import Visual

TOOL = "tool"
"""Name of the link that is the tool of a robot in the URDF files of this package."""


@dataclass(frozen=True, slots=True, eq=False)
class NamedFrame:
    """A frame of interest fixed to a link: a link of a source URDF, a flange, a named tool.

    Parameters
    ----------
    name : str
        Unique among the frames of a robot.
    parent : int
        Number of the frame it is fixed to; 0 is R_0.
    pose : ndarray, shape (4, 4)
        In that frame.
    merged : bool
        Whether it was a link of its own in the source, whose inertia is now part of another one's.
    """

    name: str
    parent: int
    pose: Array
    merged: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "pose", read_only(self.pose))


@dataclass(frozen=True, slots=True)
class UrdfSource:
    """The URDF that a robot was read from."""

    text: str = field(repr=False)
    """The file's text."""
    base_link: str | None
    """Link given as the base; None for the root."""
    tip_link: str | None
    """Link given as the tip; None if it was chosen by the reader."""
    tool_link: str
    """Link whose frame is the tool."""


@dataclass(frozen=True, slots=True)
class RobotParts:
    """All parts of a robot, those that a URDF cannot hold included.

    Parameters
    ----------
    name, table, base, tool, tip, inertia, drive, transmission, frames, visuals, notes, source
        As for `RobotModel`: base and tool of shape (4, 4), f frames and n joints.
    """

    name: str
    table: DHTable
    base: Array
    tool: Array
    tip: int
    inertia: InertialParameters
    drive: DriveParameters
    transmission: Transmission | None = None
    frames: tuple[NamedFrame, ...] = ()
    visuals: tuple[Visual, ...] = ()
    notes: tuple[str, ...] = ()
    source: UrdfSource | None = None
