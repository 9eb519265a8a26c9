"""The robot model: a value made of parts, with its Pinocchio model built from its URDF."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import se3
from .._arrays import LARGEST, Array, as_bounded, as_exact, read_only, same_value, value_hash
from ..drive import DriveMatrices, DriveParameters, Transmission, drive_matrices
from ..errors import InvalidValueError
from ..geometry import DHTable, constant_factors
from ..inertia import InertialParameters
from ..kernels import Chain
from ..urdf import NamedFrame, RobotParts, read_urdf
from ..urdf.parts import UrdfSource
from ..visual import Visual
from .other_names import no_attribute
from .part_checks import (
    check_count,
    check_name,
    check_table,
    check_tip,
    checked_postures,
    placed,
)
from .tip_text import tip_text
from .twin import PinocchioTwin

GRAVITY = (0.0, 0.0, -9.81)
"""Default gravity: the acceleration vector in the world frame, m/s^2."""

_PARTS = (
    "name", "table", "inertia", "drive", "base", "tool", "tip", "gravity", "transmission",
    "configurations", "frames", "visuals", "notes", "source",
)  # fmt: skip
_NUMERIC_PARTS = _PARTS[:9]


@dataclass(frozen=True, slots=True, eq=False, repr=False, weakref_slot=True)
class RobotModel:
    """A robot: geometry, inertia, drives, base, tool and gravity. Immutable, picklable.

    Made by `from_table` or `from_urdf`. Every computation is a function that takes the model first:
    ``dgm(model, q)``. The ``with_*`` methods return a new model with one part changed, checked as
    in `from_table`; None removes it: no mass, no drives, the identity as base or tool.

    Parameters
    ----------
    name, table, inertia, drive, base, tool, tip, gravity, transmission, configurations
        As for `from_table`, checked. ``base`` is ``Z``, the pose of R_0 in the world, and ``tool``
        ``E``, that of the tool in the tip frame, both of shape (4, 4) (book eq. [1.10]).
    frames : tuple of NamedFrame
        Frames of interest, such as every link of a source URDF.
    visuals : tuple of Visual
        Shapes of a source URDF.
    notes : tuple of str
        Parts that a reader merged, locked or left out, in sentences.
    source : UrdfSource or None
        Text and options of the URDF that it was read from; no part of equality.

    Examples
    --------
    >>> arm = RobotModel.from_table(DHTable(antecedent=[0, 1], sigma=[0, 0], d=[0, 0.3]))
    >>> arm.n, arm.frame_names
    (2, ('base', 'joint_1', 'joint_2', 'tool'))
    >>> arm.with_drive(DriveParameters(Fv=[0.5, 0.2])).drive.Fv
    array([0.5, 0.2])
    """

    name: str
    table: DHTable
    inertia: InertialParameters
    drive: DriveParameters
    base: Array
    tool: Array
    tip: int
    gravity: Array
    transmission: Transmission | None = None
    configurations: Mapping[str, Array] = field(default_factory=dict)
    frames: tuple[NamedFrame, ...] = ()
    visuals: tuple[Visual, ...] = ()
    notes: tuple[str, ...] = ()
    source: UrdfSource | None = None
    _twin: PinocchioTwin | None = field(default=None, init=False)
    _chain: Chain | None = field(default=None, init=False)
    _drives: tuple[DriveMatrices | None] | None = field(default=None, init=False)

    def __post_init__(self) -> None:
        check_table(self.table)
        check_name(self.name)
        f, n = self.table.f, self.table.n
        check_count(self.inertia, InertialParameters, "inertia", "f", f)
        check_count(self.drive, DriveParameters, "drive", "n", n)
        if self.transmission is not None:
            check_count(self.transmission, Transmission, "transmission", "n", n)
        check_tip(self.tip, f)
        set_ = object.__setattr__
        set_(self, "tip", int(self.tip))
        set_(self, "base", read_only(se3.as_single_pose(self.base, "base")))
        set_(self, "tool", read_only(se3.as_single_pose(self.tool, "tool")))
        for end in ("base", "tool"):
            as_bounded(getattr(self, end)[:3, 3], end, LARGEST)
        gravity = as_bounded(as_exact(self.gravity, (3,), "gravity"), "gravity", LARGEST)
        set_(self, "gravity", read_only(gravity))
        set_(self, "configurations", checked_postures(self.configurations, n))

    @classmethod
    def from_table(
        cls,
        table: DHTable,
        inertia: InertialParameters | None = None,
        drive: DriveParameters | None = None,
        base: ArrayLike | None = None,
        tool: ArrayLike | None = None,
        tip: int | None = None,
        gravity: ArrayLike = GRAVITY,
        transmission: Transmission | None = None,
        name: str = "robot",
        configurations: Mapping[str, ArrayLike] | None = None,
    ) -> Self:
        """Make a model from a table of geometric parameters.

        Parameters
        ----------
        table : DHTable
            f frames, n joints.
        inertia : InertialParameters, optional
            Of the f frames; default massless.
        drive : DriveParameters, optional
            Of the n joints; default none.
        base : array_like, shape (4, 4), optional
            Pose of R_0 in the world, default identity. ``pinocchio.SE3`` is accepted.
        tool : array_like, shape (4, 4), optional
            Pose of the tool in the tip frame, default identity.
        tip : int, optional
            Number of the frame that carries the tool; default the last.
        gravity : array_like, shape (3,)
            Acceleration in the world frame, m/s^2.
        transmission : Transmission, optional
            Between encoders and joints.
        name : str
            Of the robot.
        configurations : mapping of str to array_like, shape (n,), optional
            Named postures; ``"zero"`` is added.

        Raises
        ------
        ShapeError, InvalidValueError, NotARotationError, FrameNotFoundError
            Parts that do not fit each other; a base or tool that is not a pose; a tip that is
            not a frame.
        """
        check_table(table)
        return cls(
            name=name,
            table=table,
            inertia=InertialParameters.zeros(table.f) if inertia is None else inertia,
            drive=DriveParameters.zeros(table.n) if drive is None else drive,
            base=np.eye(4) if base is None else base,  # type: ignore[arg-type]
            tool=np.eye(4) if tool is None else tool,  # type: ignore[arg-type]
            tip=table.f if tip is None else tip,
            gravity=gravity,  # type: ignore[arg-type]
            transmission=transmission,
            configurations=configurations or {},  # type: ignore[arg-type]
        )

    @classmethod
    def from_urdf(
        cls,
        path_or_text: str | Path,
        base_link: str | None = None,
        tip_link: str | None = None,
        gravity: ArrayLike = GRAVITY,
        package_dirs: Iterable[str | Path] | str | Path = (),
        dynamics: bool = False,
        mimic: bool = False,
    ) -> Self:
        """Make a model from a URDF: its Khalil-Kleinfinger table is extracted.

        ``q`` keeps the URDF's sign and zero. Every link below the base is a named frame; the links
        that were merged by fixed joints are listed in ``notes``. Pose and dynamics are those of the
        URDF.

        Parameters
        ----------
        path_or_text : str or Path
            A file, or the text itself.
        base_link : str, optional
            Link whose frame is the world; default the root. Links above it are left out.
        tip_link : str, optional
            Link whose frame is the tool. Only the joints between base and tip are kept, others
            are locked at zero. Default: all joints below the base are kept; see Notes for the tool.
        gravity : array_like, shape (3,)
            Acceleration in the world frame (the axes of the base link), m/s^2.
        package_dirs : path or iterable of paths
            Folders that hold the packages of ``package://`` meshes. If given, a missing mesh is
            an error; otherwise it is one only when the robot is drawn.
        dynamics : bool
            Whether ``<dynamics damping friction>`` fill Fv and Fc.
        mimic : bool
            Whether mimic joints follow their masters: the coupling is then in ``transmission``.

        Raises
        ------
        UrdfError, MeshNotFoundError, FrameNotFoundError
            Malformed text, a DOCTYPE, xacro, a loop, an unsupported joint, with the element at
            fault and the remedy; a mesh that is not in the given folders; a link that is unknown.

        Notes
        -----
        Without ``tip_link`` the tool is the link called ``tool``. Else it is the link carried by
        the last joint of the file, or the link fixed to that, as long as there is only one. If a
        hand or gripper follows the arm, the tool is the last link before it: a hand is a point
        where the chain branches into shorter moving branches, if the two longest are equal or at
        least six joints precede it. If links fixed to that last link are called ``tool0``, ``tcp``,
        ``tool``, ``ee_link``, ``flange`` or ``hand``, the tool is the first of them in this order.
        A link of such a name also marks the end of the arm before a single finger. ``print(model)``
        names the tip and other links. Inverse models leave joints that do not move the tool at
        their reference.

        Examples
        --------
        >>> text = '''<robot name="one"><link name="base"/><link name="arm"/>
        ... <joint name="turn" type="continuous"><parent link="base"/><child link="arm"/>
        ... <axis xyz="0 0 1"/></joint></robot>'''
        >>> RobotModel.from_urdf(text).table.names
        ('turn',)
        """
        parts = read_urdf(path_or_text, base_link, tip_link, package_dirs, dynamics, mimic)
        own: dict[str, Any] = {part.name: getattr(parts, part.name) for part in fields(parts)}
        return cls(**own, gravity=gravity)  # type: ignore[arg-type]

    if not TYPE_CHECKING:  # otherwise every name would be accepted by type checkers

        def __getattr__(self, name: str) -> Any:
            raise no_attribute(type(self).__name__, name)

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

    @property
    def n(self) -> int:
        """Number of moving joints."""
        return self.table.n

    @property
    def f(self) -> int:
        """Number of frames of the table."""
        return self.table.f

    @property
    def lower(self) -> Array:
        """Lower limits of the joint variables, shape (n,), rad or m."""
        return self.table.lower

    @property
    def upper(self) -> Array:
        """Upper limits of the joint variables, shape (n,), rad or m."""
        return self.table.upper

    @property
    def frame_names(self) -> tuple[str, ...]:
        """Names that functions accept as ``frame``: base, the table's, named frames, tool."""
        return self.twin.frame_names()

    @property
    def merged_links(self) -> tuple[str, ...]:
        """Links of the source URDF that were merged into the link they are fixed to."""
        return tuple(frame.name for frame in self.frames if frame.merged)

    @property
    def twin(self) -> PinocchioTwin:
        """The Pinocchio side of the model, built at the first use."""
        if self._twin is None:
            object.__setattr__(self, "_twin", PinocchioTwin(self.parts, self.gravity))
        return self._twin  # type: ignore[return-value]

    @property
    def pin_model(self) -> Any:
        """The ``pinocchio.Model`` of the table: nq = nv = n, rigid bodies without drives.

        Its joints may be in another order, see `pin_order`; every link of a source URDF is a
        frame of it. It is shared: copy it before changing it.
        """
        return self.twin.model

    @property
    def pin_order(self) -> NDArray[np.int64]:
        """Index in Pinocchio's q and v of each joint of the table, shape (n,)."""
        return self.twin.order

    @property
    def chain(self) -> Chain:
        """The table multiplied out into the plain arrays that compiled kernels take."""
        if self._chain is None:
            object.__setattr__(self, "_chain", multiplied_out(self.table, self.base))
        return self._chain  # type: ignore[return-value]

    @property
    def drive_matrices(self) -> DriveMatrices | None:
        """Drive and coupling terms of all joints; None if every one of them is zero."""
        if self._drives is None:
            drives = drive_matrices(self.drive, self.transmission)
            idle = self.drive.is_zero and not drives.coupling.size
            object.__setattr__(self, "_drives", (None if idle else drives,))
        return self._drives[0]  # type: ignore[index]

    @property
    def parts(self) -> RobotParts:
        """Parts from which a URDF is written."""
        return RobotParts(**{part.name: getattr(self, part.name) for part in fields(RobotParts)})

    def __repr__(self) -> str:
        return f"<RobotModel {self.name!r}: {self.n} joints, {self.f} frames>"

    def __str__(self) -> str:
        head = f"{self.name}: {self.n} joints, {self.f} frames"
        text = f"{head}\n{self.table}\n{tip_text(self.parts)}"
        if not self.inertia.values.any():
            text += (
                "\nNo inertial parameters are known: links without mass, torques of drives only."
            )
        return text

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, RobotModel):
            return NotImplemented
        return all(same_value(getattr(self, p), getattr(other, p)) for p in _NUMERIC_PARTS)

    def __hash__(self) -> int:
        return value_hash(*(getattr(self, p) for p in _NUMERIC_PARTS))

    def __reduce__(self) -> tuple[Any, ...]:
        parts = [getattr(self, p) for p in _PARTS]
        parts[_PARTS.index("configurations")] = dict(self.configurations)
        return type(self), tuple(parts)


def multiplied_out(table: DHTable, base: Array) -> Chain:
    """Arrays of a table for the kernels: structure and constant transforms."""
    C = constant_factors(table)
    joint = np.full(table.f, -1, dtype=np.int64)
    joint[table.joint_rows] = np.arange(table.n)
    return Chain(
        antecedent=table.antecedent,
        sigma=table.sigma,
        joint=read_only(joint, np.int64),
        rotation=read_only(C[:, :3, :3]),
        position=read_only(C[:, :3, 3]),
        base_rotation=read_only(base[:3, :3]),
        base_position=read_only(base[:3, 3]),
    )
