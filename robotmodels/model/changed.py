"""The same robot with one part changed: every change is a new model."""

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
        """The same robot with other geometric parameters.

        Parameters
        ----------
        table : DHTable
            As many frames and joints; lengths in metres, angles in radians.

        Returns
        -------
        RobotModel
            A new model; this one stays as it is.

        Raises
        ------
        ShapeError, InvalidValueError
            It does not fit the table's frames and joints, or is of another kind.

        Examples
        --------
        >>> from robotmodels.model import RobotModel
        >>> arm = RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]))
        >>> arm.with_table(arm.table.replace(r=[0.2])).table.r
        array([0.2])
        """
        return replace(self, table=table)

    def with_inertia(self, inertia: InertialParameters | None) -> Self:
        """The same robot with other inertial parameters.

        Parameters
        ----------
        inertia : InertialParameters or None
            Of the f frames; None makes it massless.

        Returns
        -------
        RobotModel
            A new model; this one stays as it is.

        Raises
        ------
        ShapeError, InvalidValueError
            It does not fit the table's frames and joints, or is of another kind.

        Examples
        --------
        >>> from robotmodels.model import RobotModel
        >>> arm = RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]))
        >>> arm.with_inertia(None).inertia.f
        1
        """
        return replace(
            self, inertia=InertialParameters.zeros(self.table.f) if inertia is None else inertia
        )

    def with_drive(self, drive: DriveParameters | None) -> Self:
        """The same robot with other drive parameters.

        Parameters
        ----------
        drive : DriveParameters or None
            Of the n joints; None takes them away.

        Returns
        -------
        RobotModel
            A new model; this one stays as it is.

        Raises
        ------
        ShapeError, InvalidValueError
            It does not fit the table's frames and joints, or is of another kind.

        Examples
        --------
        >>> from robotmodels.model import RobotModel
        >>> arm = RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]))
        >>> arm.with_drive(DriveParameters(Fv=[0.5])).drive.Fv
        array([0.5])
        """
        return replace(self, drive=DriveParameters.zeros(self.table.n) if drive is None else drive)

    def with_base(self, base: ArrayLike | None) -> Self:
        """The same robot standing elsewhere.

        Parameters
        ----------
        base : array_like, shape (4, 4), or None
            Pose of R_0 in the world, metres; None is the identity.

        Returns
        -------
        RobotModel
            A new model; this one stays as it is.

        Raises
        ------
        ShapeError, InvalidValueError, NotARotationError
            Not a pose.

        Examples
        --------
        >>> from robotmodels.model import RobotModel
        >>> arm = RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]))
        >>> from robotmodels import se3
        >>> arm.with_base(se3.translation(0, 0, 0.5)).base[2, 3]
        np.float64(0.5)
        """
        return replace(self, base=np.eye(4) if base is None else base)

    def with_tool(self, tool: ArrayLike | None, tip: int | None = None) -> Self:
        """The same robot with another tool.

        Parameters
        ----------
        tool : array_like, shape (4, 4), or None
            Pose of the tool in the tip frame, metres; None is the identity.
        tip : int, optional
            Number of the frame that carries it; default the present one.

        Returns
        -------
        RobotModel
            A new model; this one stays as it is.

        Raises
        ------
        ShapeError, InvalidValueError, NotARotationError, FrameNotFoundError
            Not a pose, or no such frame.

        Examples
        --------
        >>> from robotmodels.model import RobotModel
        >>> arm = RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]))
        >>> from robotmodels import se3
        >>> arm.with_tool(se3.translation(0.1, 0, 0)).tool[0, 3]
        np.float64(0.1)
        """
        tool = np.eye(4) if tool is None else tool
        return replace(self, tool=tool, tip=self.tip if tip is None else tip)

    def with_gravity(self, gravity: ArrayLike) -> Self:
        """The same robot under another gravity.

        Parameters
        ----------
        gravity : array_like, shape (3,)
            Acceleration in the world frame, m/s^2.

        Returns
        -------
        RobotModel
            A new model; this one stays as it is.

        Raises
        ------
        ShapeError, InvalidValueError
            Not three finite numbers.

        Examples
        --------
        >>> from robotmodels.model import RobotModel
        >>> arm = RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]))
        >>> arm.with_gravity([0, 0, 0]).gravity
        array([0., 0., 0.])
        """
        return replace(self, gravity=gravity)

    def with_transmission(self, transmission: Transmission | None) -> Self:
        """The same robot with another transmission between encoders and joints.

        Parameters
        ----------
        transmission : Transmission or None
            Of the n joints; None takes it away.

        Returns
        -------
        RobotModel
            A new model; this one stays as it is.

        Raises
        ------
        ShapeError, InvalidValueError
            It does not fit the table's frames and joints, or is of another kind.

        Examples
        --------
        >>> from robotmodels.model import RobotModel
        >>> arm = RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]))
        >>> arm.with_transmission(Transmission([[0.01]])).transmission.n
        1
        """
        return replace(self, transmission=transmission)

    def with_configurations(self, configurations: Mapping[str, ArrayLike]) -> Self:
        """The same robot with other named postures.

        Parameters
        ----------
        configurations : mapping of str to array_like, shape (n,)
            Joint variables, rad or m; ``"zero"`` is added.

        Returns
        -------
        RobotModel
            A new model; this one stays as it is.

        Raises
        ------
        ShapeError, InvalidValueError
            A posture of the wrong length, or no mapping.

        Examples
        --------
        >>> from robotmodels.model import RobotModel
        >>> arm = RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]))
        >>> sorted(arm.with_configurations({"up": [1.5]}).configurations)
        ['up', 'zero']
        """
        return replace(self, configurations=configurations)

    def with_frames(self, frames: Mapping[str, ArrayLike], frame: str | int | None = None) -> Self:
        """The same robot with more named frames: markers, targets, further tools.

        They can be asked for and measured by their names, as ``Position(q, p, frame="marker_1")``.

        Parameters
        ----------
        frames : mapping of str to array_like, shape (3,) or (4, 4)
            By name the position (axes are those of ``frame``) or the pose, metres.
        frame : str or int, optional
            Frame in which these are given, and to whose body they are fixed; default the tool.

        Returns
        -------
        RobotModel
            A new model; this one stays as it is.

        Raises
        ------
        ShapeError, InvalidValueError, NotARotationError, FrameNotFoundError
            No mapping; a name that is taken; neither a position nor a pose; no such frame.

        Examples
        --------
        >>> from robotmodels.model import RobotModel
        >>> arm = RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]))
        >>> arm.with_frames({"marker_1": [0, 0, 0.1], "marker_2": [0, 0.1, 0]}).frame_names
        ('base', 'joint_1', 'marker_1', 'marker_2', 'tool')
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
