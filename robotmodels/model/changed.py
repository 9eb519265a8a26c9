"""The same robot with one part changed.

Every method returns a new model; the old one stays as it is. A part that does not fit the frames
and joints of the table, or is of another kind, raises ShapeError or InvalidValueError; a matrix
that is no pose raises NotARotationError, an unknown frame FrameNotFoundError. None removes a part:
no mass, no drives, no transmission, the identity as base or tool.

Examples
--------
>>> from robotmodels import se3
>>> from robotmodels.model import RobotModel
>>> arm = RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]))
>>> arm.with_table(arm.table.replace(r=[0.2])).table.r
array([0.2])
>>> arm.with_drive(DriveParameters(Fv=[0.5])).drive.Fv
array([0.5])
>>> arm.with_base(se3.translation(0, 0, 0.5)).base[2, 3]
np.float64(0.5)
>>> sorted(arm.with_configurations({"up": [1.5]}).configurations)
['up', 'zero']
>>> arm.with_frames({"marker_1": [0, 0, 0.1], "marker_2": [0, 0.1, 0]}).frame_names
('base', 'joint_1', 'marker_1', 'marker_2', 'tool')
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import Field, replace
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from ..drive import DriveParameters, Transmission
from ..errors import InvalidValueError
from ..geometry import DHTable
from ..inertia import InertialParameters
from ..urdf import NamedFrame
from .part_checks import check_name, placed

if TYPE_CHECKING:
    from .twin import PinocchioTwin


class Changeable:
    """Base of immutable models with `with_*` methods."""

    __slots__ = ()

    if TYPE_CHECKING:  # a dataclass with these parts
        __dataclass_fields__: ClassVar[dict[str, Field[Any]]]
        table: DHTable
        tip: int
        frames: tuple[NamedFrame, ...]

        @property
        def twin(self) -> PinocchioTwin:
            """The Pinocchio side of the model."""
            ...

    def with_table(self, table: DHTable) -> Self:
        """The same robot with other geometric parameters, of as many frames and joints."""
        return replace(self, table=table)

    def with_inertia(self, inertia: InertialParameters | None) -> Self:
        """The same robot with other inertial parameters of its f frames."""
        return replace(
            self, inertia=InertialParameters.zeros(self.table.f) if inertia is None else inertia
        )

    def with_drive(self, drive: DriveParameters | None) -> Self:
        """The same robot with other drive parameters of its n joints."""
        return replace(self, drive=DriveParameters.zeros(self.table.n) if drive is None else drive)

    def with_base(self, base: ArrayLike | None) -> Self:
        """The same robot elsewhere: pose of R_0 in the world, shape (4, 4), metres."""
        return replace(self, base=np.eye(4) if base is None else base)

    def with_tool(self, tool: ArrayLike | None, tip: int | None = None) -> Self:
        """The same robot with another tool: its pose in the frame ``tip``, shape (4, 4), metres.

        ``tip`` is the number of the frame, the present one by default.
        """
        tool = np.eye(4) if tool is None else tool
        return replace(self, tool=tool, tip=self.tip if tip is None else tip)

    def with_gravity(self, gravity: ArrayLike) -> Self:
        """The same robot under another gravity: acceleration in world axes, shape (3,), m/s^2."""
        return replace(self, gravity=gravity)

    def with_transmission(self, transmission: Transmission | None) -> Self:
        """The same robot with another transmission between motors and its n joints."""
        return replace(self, transmission=transmission)

    def with_configurations(self, configurations: Mapping[str, ArrayLike]) -> Self:
        """The same robot with other named configurations, each of shape (n,), rad or m.

        ``"zero"`` is added.
        """
        return replace(self, configurations=configurations)

    def with_frames(self, frames: Mapping[str, ArrayLike], frame: str | int | None = None) -> Self:
        """The same robot with more named frames: markers, targets, further tools.

        ``frames`` gives by name the position, shape (3,), with the axes of ``frame``, or the pose,
        shape (4, 4), in ``frame`` (default: the tool), metres. They are fixed to its body, and
        their names serve as frames everywhere, as in ``Position(q, p, frame="marker_1")``.
        """
        if not isinstance(frames, Mapping):
            raise InvalidValueError(
                "frames: expected a mapping of names to positions or poses, such as "
                f"{{'marker_1': [0, 0, 0.1]}}, got {type(frames).__name__}."
            )
        at, taken = self.twin.frame(frame), self.twin.frame_names()
        place = np.eye(4)
        place[:3, :3], place[:3, 3] = at.rotation, at.position
        for name in frames:
            check_name(name)
            if name in taken:
                raise InvalidValueError(
                    f"frames: the name {name!r} is taken; the frames are "
                    f"{', '.join(taken)}. Give another name."
                )
        new = tuple(
            NamedFrame(name, at.parent, place @ placed(value, f"frames[{name!r}]"))
            for name, value in frames.items()
        )
        return replace(self, frames=(*self.frames, *new))
