"""The robot model: a value made of parts, with its Pinocchio twin built from its URDF."""

from __future__ import annotations

import threading
import warnings
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, Self

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from . import se3
from ._arrays import Array, as_exact, read_only, same_value, value_hash
from .drive import DriveMatrices, DriveParameters, Transmission, drive_matrices
from .errors import FrameNotFoundError, InvalidValueError, ShapeError, UrdfError, UrdfWarning
from .geometry import FIXED, NOT_XML, DHTable, constant_factors
from .inertia import InertialParameters
from .kernels import Chain
from .urdf import TOOL, NamedFrame, RobotParts, read_urdf, urdf_text
from .urdf.write import holds_inertia, link_names
from .visual import Visual

GRAVITY = (0.0, 0.0, -9.81)
"""Default gravity: the acceleration vector in the world frame, m/s^2."""

_LONGEST_CHAIN = 100
"""Joints up to which single calls go through Pinocchio, whose scratch data grow with n cubed."""

_SMALLEST_MASS = 1e-12

_PARTS = (
    "name", "table", "inertia", "drive", "base", "tool", "tip", "gravity", "transmission",
    "configurations", "frames", "visuals", "notes",
)  # fmt: skip
_NUMERIC_PARTS = _PARTS[:9]
_FRAME_KINDS = frozenset((str, int, type(None)))


@dataclass(frozen=True, slots=True)
class FrameOfInterest:
    """A frame whose pose or Jacobian can be asked for.

    Parameters
    ----------
    parent : int
        Number of the table's frame it is fixed to; 0 is R_0.
    path : ndarray of int, shape (k,)
        Numbers of the table's frames from the base to the parent.
    rotation : ndarray, shape (3, 3)
        Axes in the parent frame.
    position : ndarray, shape (3,)
        Origin in the parent frame, metres.
    pin_id : int
        Number of the same frame in the Pinocchio model.

    Examples
    --------
    >>> RobotModel.from_table(DHTable(antecedent=[0, 1], sigma=[0, 0])).twin.frame(2).path
    array([1, 2])
    """

    parent: int
    path: NDArray[np.int64]
    rotation: Array
    position: Array
    pin_id: int

    @property
    def kernel_arguments(self) -> tuple[NDArray[np.int64], Array, Array]:
        """What compiled kernels take: path, rotation, position."""
        return self.path, self.rotation, self.position


class PinocchioTwin:
    """The Pinocchio model of a robot and each thread's scratch data for it.

    Parameters
    ----------
    parts : RobotParts
        The robot.
    gravity : ndarray, shape (3,)
        Acceleration in the world frame, m/s^2.

    Examples
    --------
    >>> twin = RobotModel.from_table(DHTable(antecedent=[0], sigma=[0])).twin
    >>> twin.model.nq
    1
    """

    __slots__ = (
        "_frames", "_parts", "_scratch", "base_is_massless", "in_table_order",
        "model", "names", "order", "serves_dynamics", "serves_poses",
    )  # fmt: skip

    def __init__(self, parts: RobotParts, gravity: Array) -> None:
        # mimic joints stay independent here: the coupling is the transmission's. Drives are ours,
        # and bodies whose digits a URDF would lose are the kernels'
        kept = [holds_inertia(row) and _keeps_digits(row) for row in parts.inertia.values]
        bodies = replace(
            parts,
            transmission=None,
            drive=DriveParameters.zeros(parts.table.n),
            inertia=InertialParameters(parts.inertia.values * np.reshape(kept, (-1, 1))),
        )
        text = urdf_text(bodies, visuals=False)
        self.model: Any = pin.buildModelFromXML(text)
        self.model.gravity.linear = np.array(gravity)
        self.order: NDArray[np.int64] = read_only(
            [self.model.idx_qs[self.model.getJointId(name)] for name in parts.table.joint_names],
            np.int64,
        )
        self.in_table_order = bool((self.order == np.arange(parts.table.n)).all())
        self.serves_poses = parts.table.n <= _LONGEST_CHAIN
        self.serves_dynamics = self.serves_poses and all(kept)
        table, fixed = parts.table, parts.table.sigma == FIXED
        on_base = [j for j in range(table.f) if all(fixed[i - 1] for i in table.path(j + 1))]
        self.base_is_massless = not parts.inertia.values[on_base].any()
        self.names = link_names(parts)
        self._parts = parts
        self._frames: dict[str | int | None, FrameOfInterest] = {}
        self._scratch = threading.local()

    def data(self) -> Any:
        """Scratch data of the calling thread, a ``pin.Data``."""
        try:
            return self._scratch.data
        except AttributeError:
            self._scratch.data = self.model.createData()
            return self._scratch.data

    def to_pin(self, x: Array) -> Array:
        """Reorder a joint vector of shape (n,) from the table's order to Pinocchio's."""
        if self.in_table_order:
            return x
        y = np.empty_like(x)
        y[self.order] = x
        return y

    def from_pin(self, x: Array) -> Array:
        """Reorder the last axis of what Pinocchio returned (a copy of its own) to the table's."""
        return np.ascontiguousarray(x if self.in_table_order else x[..., self.order])

    def frame(self, frame: str | int | None) -> FrameOfInterest:
        """Look a frame up by name, by number, or as None: the tool."""
        # True and 1.0 are equal to 1 as keys, but they are not frame numbers
        if frame.__class__ not in _FRAME_KINDS:
            return self._find(frame)
        try:
            return self._frames[frame]
        except KeyError:
            found = self._find(frame)
            self._frames[frame] = found
            return found

    def _find(self, frame: str | int | None) -> FrameOfInterest:
        parts, names = self._parts, self.names
        if isinstance(frame, bool) or not isinstance(frame, (str, int, np.integer, type(None))):
            raise FrameNotFoundError(
                "frame", frame, self.frame_names(), "Give a name, a number, or None for the tool."
            )
        if frame is None or frame == names.tool:
            return self._point(parts.tip, parts.tool, names.tool)
        if not isinstance(frame, str):
            if not 0 <= frame <= parts.table.f:
                raise FrameNotFoundError(
                    "frame number", int(frame), map(str, range(parts.table.f + 1)),
                    "Frames are numbered 1 to f as in the table; 0 is the base.",
                )  # fmt: skip
            return self._point(int(frame), np.eye(4), names.frames[int(frame)])
        for named in parts.frames:
            if named.name == frame:
                return self._point(named.parent, named.pose, named.name)
        if frame == names.frames[0]:
            return self._find(0)
        if frame in parts.table.names:
            return self._find(parts.table.names.index(frame) + 1)
        raise FrameNotFoundError("frame", frame, self.frame_names())

    def frame_names(self) -> tuple[str, ...]:
        """Every name `frame` knows, without repetition."""
        named = (frame.name for frame in self._parts.frames)
        names = (self.names.frames[0], *self._parts.table.names, *named, self.names.tool)
        return tuple(dict.fromkeys(names))

    def _point(self, parent: int, pose: Array, link: str) -> FrameOfInterest:
        return FrameOfInterest(
            parent=parent,
            path=read_only(self._parts.table.path(parent), np.int64),
            rotation=read_only(pose[:3, :3]),
            position=read_only(pose[:3, 3]),
            pin_id=int(self.model.getFrameId(link, pin.FrameType.BODY)),
        )


@dataclass(frozen=True, slots=True, eq=False, repr=False, weakref_slot=True)
class RobotModel:
    """A robot: geometry, inertia, drives, base, tool and gravity. Immutable, picklable.

    Made by `from_table` or `from_urdf`, changed by the ``with_*`` methods, which return a new
    model. Every computation is a function that takes the model first: ``dgm(model, q)``.

    Parameters
    ----------
    name : str
        Of the robot.
    table : DHTable
        Geometric parameters.
    inertia : InertialParameters
        Of the f frames.
    drive : DriveParameters
        Of the n joints.
    base : ndarray, shape (4, 4)
        ``Z``: pose of R_0 in the world (seed eq. [1.10]).
    tool : ndarray, shape (4, 4)
        ``E``: pose of the tool in the tip frame.
    tip : int
        Number of the frame that carries the tool.
    gravity : ndarray, shape (3,)
        Acceleration of gravity in the world frame, m/s^2.
    transmission : Transmission or None
        Between encoders and joints.
    configurations : mapping of str to ndarray, shape (n,)
        Named postures; ``"zero"`` is always there.
    frames : tuple of NamedFrame
        Frames of interest, such as every link of a source URDF.
    visuals : tuple of Visual
        Shapes of a source URDF.
    notes : tuple of str
        What a reader merged, locked or left out, in sentences.

    References
    ----------
    Seed book sections 1.2 and 1.5.

    Examples
    --------
    >>> arm = RobotModel.from_table(DHTable(antecedent=[0, 1], sigma=[0, 0], d=[0, 0.3]))
    >>> arm.n, arm.frame_names
    (2, ('base', 'joint_1', 'joint_2', 'tool'))
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
    _twin: PinocchioTwin | None = field(default=None, init=False)
    _chain: Chain | None = field(default=None, init=False)
    _drives: tuple[DriveMatrices | None] | None = field(default=None, init=False)

    def __post_init__(self) -> None:
        if not isinstance(self.table, DHTable):
            raise InvalidValueError(
                f"table: expected a DHTable, got {type(self.table).__name__}; build one with "
                "DHTable.from_rows(...)."
            )
        if not isinstance(self.name, str) or not self.name:
            raise InvalidValueError(f"name: expected a text that is not empty, got {self.name!r}.")
        if NOT_XML.search(self.name):
            raise InvalidValueError(
                f"name: {self.name!r} holds a control character; a URDF cannot hold it."
            )
        f, n = self.table.f, self.table.n
        _check_count(self.inertia, InertialParameters, "inertia", "f", f)
        _check_count(self.drive, DriveParameters, "drive", "n", n)
        if self.transmission is not None:
            _check_count(self.transmission, Transmission, "transmission", "n", n)
        if not isinstance(self.tip, (int, np.integer)) or not 1 <= self.tip <= f:
            raise FrameNotFoundError(
                "frame number", self.tip, map(str, range(1, f + 1)), "tip is a number, 1 to f."
            )
        set_ = object.__setattr__
        set_(self, "tip", int(self.tip))
        set_(self, "base", read_only(se3.as_single_pose(self.base, "base")))
        set_(self, "tool", read_only(se3.as_single_pose(self.tool, "tool")))
        set_(self, "gravity", read_only(as_exact(self.gravity, (3,), "gravity")))
        if not isinstance(self.configurations, Mapping):
            raise InvalidValueError(
                "configurations: expected a mapping of names to joint vectors, got "
                f"{type(self.configurations).__name__}."
            )
        postures = {"zero": np.zeros(n), **self.configurations}
        if np.any(postures["zero"]):
            raise InvalidValueError("configuration 'zero' is q = 0; give yours another name.")
        set_(self, "configurations", MappingProxyType({
            key: read_only(as_exact(value, (n,), f"configuration {key!r}"))
            for key, value in postures.items()
        }))  # fmt: skip

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

        Returns
        -------
        RobotModel
            The model.

        Raises
        ------
        ShapeError, InvalidValueError, NotARotationError, FrameNotFoundError
            Parts that do not fit each other; a base or tool that is not a pose; a tip that is
            not a frame.

        Examples
        --------
        >>> table = DHTable.from_rows([{"sigma": 0}, {"sigma": 0, "d": 0.3}])
        >>> RobotModel.from_table(table, tool=se3.translation(0.2, 0, 0), name="planar").n
        2
        """
        if not isinstance(table, DHTable):
            raise InvalidValueError(
                f"table: expected a DHTable, got {type(table).__name__}; build one with "
                "DHTable.from_rows(...)."
            )
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

        ``q`` keeps the URDF's sign and zero. Every link below the base is a named frame; the
        links that were merged by fixed joints are listed in ``notes``. Pose and dynamics are
        those of the URDF to rounding.

        Parameters
        ----------
        path_or_text : str or Path
            A file, or the text itself.
        base_link : str, optional
            Link whose frame is the world; default the root. What is above it is left out.
        tip_link : str, optional
            Link whose frame is the tool. Only the joints between base and tip are kept, others
            are locked at zero. Default: all joints below the base; the tool is the link called
            ``tool``, else the link carried by the last joint, or what alone is fixed to it.
        gravity : array_like, shape (3,)
            Acceleration in the world frame (the axes of the base link), m/s^2.
        package_dirs : path or iterable of paths
            Folders that hold the packages of ``package://`` meshes. If given, a missing mesh is
            an error; otherwise it is one only when the robot is drawn.
        dynamics : bool
            Whether ``<dynamics damping friction>`` fill Fv and Fc.
        mimic : bool
            Whether mimic joints follow their masters: the coupling is then in ``transmission``.

        Returns
        -------
        RobotModel
            The model.

        Raises
        ------
        UrdfError
            Malformed text, a DOCTYPE, xacro, a loop, a zero axis, a negative mass, an unsupported
            joint; with the element at fault and what to do.
        MeshNotFoundError
            A mesh is not in the given package folders.
        FrameNotFoundError
            ``base_link`` or ``tip_link`` is unknown, or the tip is not below the base.

        Examples
        --------
        >>> text = '''<robot name="one"><link name="base"/><link name="arm"/>
        ... <joint name="turn" type="continuous"><parent link="base"/><child link="arm"/>
        ... <axis xyz="0 0 1"/></joint></robot>'''
        >>> RobotModel.from_urdf(text).table.names
        ('turn',)
        """
        parts = read_urdf(path_or_text, base_link, tip_link, package_dirs, dynamics, mimic)
        return cls(
            name=parts.name, table=parts.table, inertia=parts.inertia, drive=parts.drive,
            base=parts.base, tool=parts.tool, tip=parts.tip,
            gravity=gravity,  # type: ignore[arg-type]
            transmission=parts.transmission, frames=parts.frames, visuals=parts.visuals,
            notes=parts.notes,
        )  # fmt: skip

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
            C = constant_factors(self.table)
            joint = np.full(self.f, -1, dtype=np.int64)
            joint[self.table.joint_rows] = np.arange(self.n)
            chain = Chain(
                antecedent=self.table.antecedent,
                sigma=self.table.sigma,
                joint=read_only(joint, np.int64),
                rotation=read_only(C[:, :3, :3]),
                position=read_only(C[:, :3, 3]),
                base_rotation=read_only(self.base[:3, :3]),
                base_position=read_only(self.base[:3, 3]),
            )
            object.__setattr__(self, "_chain", chain)
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
        """What a URDF is written from."""
        return RobotParts(
            name=self.name, table=self.table, base=self.base, tool=self.tool, tip=self.tip,
            inertia=self.inertia, drive=self.drive, transmission=self.transmission,
            frames=self.frames, visuals=self.visuals, notes=self.notes,
        )  # fmt: skip

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
        >>> arm = RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]))
        >>> arm.with_inertia(None).inertia.f
        1
        """
        return replace(
            self, inertia=InertialParameters.zeros(self.f) if inertia is None else inertia
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
        >>> arm = RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]))
        >>> arm.with_drive(DriveParameters(Fv=[0.5])).drive.Fv
        array([0.5])
        """
        return replace(self, drive=DriveParameters.zeros(self.n) if drive is None else drive)

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
        >>> arm = RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]))
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
        >>> arm = RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]))
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
        >>> arm = RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]))
        >>> sorted(arm.with_configurations({"up": [1.5]}).configurations)
        ['up', 'zero']
        """
        return replace(self, configurations=configurations)

    def __repr__(self) -> str:
        return f"<RobotModel {self.name!r}: {self.n} joints, {self.f} frames>"

    def __str__(self) -> str:
        text = f"{self.name}: {self.n} joints, {self.f} frames\n{self.table}"
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


def check_model(model: object) -> None:
    """Refuse what is not a model, with a hint for what it is.

    Parameters
    ----------
    model : object
        First argument of a public function.

    Raises
    ------
    InvalidValueError
        It is a name, a table, a Pinocchio model or something else.

    Examples
    --------
    >>> check_model(RobotModel.from_table(DHTable(antecedent=[0], sigma=[0])))
    """
    if isinstance(model, RobotModel):
        return
    hint = "build one with RobotModel.from_table(...), RobotModel.from_urdf(...) or load(...)"
    if isinstance(model, (str, Path)):
        hint = f"load it first: load({str(model)!r}), or RobotModel.from_urdf(path) for a file"
    elif isinstance(model, DHTable):
        hint = "make one of the table: RobotModel.from_table(table)"
    elif isinstance(model, pin.Model):
        hint = "Pinocchio's models are no input; RobotModel.from_urdf(...) reads their URDF"
    raise InvalidValueError(f"model: expected a RobotModel, got {type(model).__name__}; {hint}.")


def to_urdf(model: RobotModel) -> str:
    """URDF text of a model; also called export.

    Full-precision numbers, so that reading it back gives the same poses, Jacobians and torques.
    The tool is the link called ``tool``, which `RobotModel.from_urdf` takes for it again. Named
    configurations are no part of a URDF.

    Parameters
    ----------
    model : RobotModel
        The robot.

    Returns
    -------
    str
        The text; the same model always gives the same text.

    Raises
    ------
    UrdfError
        A transmission ties joints together in a way that a URDF cannot say, so that the text
        would describe a robot with other poses.

    Warns
    -----
    UrdfWarning
        Lists what has no place in a URDF: rotor inertia, torque offsets, gravity other than
        9.81 m/s^2 downwards, inertia that no body has, passive joints, transmissions.

    Examples
    --------
    >>> arm = RobotModel.from_table(DHTable(antecedent=[0, 1], sigma=[0, 0], d=[0, 0.3]))
    >>> to_urdf(arm).splitlines()[1]
    '<robot name="robot">'
    """
    check_model(model)
    text = urdf_text(model.parts)
    lost = _lost_in_urdf(model)
    if lost:
        warnings.warn(
            f"A URDF has no place for {'; '.join(lost)}. Keep the model (pickle) to keep them.",
            UrdfWarning,
            stacklevel=2,
        )
    return text


def write_urdf(model: RobotModel, path: str | Path) -> None:
    """Write a model as a URDF file, see `to_urdf`.

    Parameters
    ----------
    model : RobotModel
        The robot.
    path : str or Path
        The file; its folder must exist.

    Raises
    ------
    UrdfError
        As `to_urdf`, or the file cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> arm = RobotModel.from_table(DHTable(antecedent=[0], sigma=[0]))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_urdf(arm, Path(folder) / "arm.urdf")
    """
    text = to_urdf(model)
    try:
        Path(path).write_text(text, encoding="utf-8")
    except OSError as error:
        raise UrdfError(f"cannot write {str(path)!r}: {error.strerror}.") from None


def _lost_in_urdf(model: RobotModel) -> list[str]:
    lost = []
    if model.drive.Ia.any():
        lost.append("the rotor inertias Ia")
    if (model.drive.Fv < 0).any() or (model.drive.Fc < 0).any():
        lost.append("negative friction")
    if model.drive.offset.any():
        lost.append("the torque offsets")
    if not np.array_equal(model.gravity, GRAVITY):
        lost.append(f"gravity {model.gravity.tolist()}")
    names = [
        name
        for name, row in zip(model.table.names, model.inertia.values, strict=True)
        if not (holds_inertia(row) and _keeps_digits(row))
    ]
    if names:
        lost.append(
            f"the inertia of {', '.join(names)} (mass negative, or too small for its moments)"
        )
    if (model.table.mu[model.table.joint_rows] == 0).any():
        lost.append("passive joints (mu = 0)")
    tool = model.twin.names.tool
    if tool != TOOL:
        lost.append(f"the tool's name, taken by a link: read it back with tip_link={tool!r}")
    K = model.transmission
    if K is not None and K.is_invertible:
        lost.append("the transmission (the text's joints are the table's, not the encoders)")
    return lost


def _keeps_digits(row: Array) -> bool:
    """Whether ten parameters survive the way through the centre of mass, where a URDF has them.

    First moments over hardly any mass, as identification may give them, put the centre of mass
    far away: the tensor about it is so large that the digits of the one about the origin cancel.
    """
    M, moments = row[9], row[6:9]
    if 0.0 < M < _SMALLEST_MASS:
        return False  # Pinocchio takes masses below its epsilon for zero in sums
    # up to two digits, for a robot of about a metre
    return bool(moments @ moments <= 100.0 * M * (np.abs(row[:6]).sum() + M))


def _check_count(part: Any, kind: type, name: str, letter: str, expected: int) -> None:
    if not isinstance(part, kind):
        raise InvalidValueError(f"{name}: expected {kind.__name__}, got {type(part).__name__}.")
    got = getattr(part, letter)
    if got != expected:
        what = "frames" if letter == "f" else "moving joints"
        raise ShapeError(
            f"{name}: expected parameters of the {expected} {what} of the table, got {got}."
        )
