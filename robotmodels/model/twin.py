"""The Pinocchio side of a robot: its model, each thread's scratch data, and its frames."""

from __future__ import annotations

import threading
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from .._arrays import Array, read_only
from ..drive import DriveParameters
from ..errors import FrameNotFoundError
from ..geometry import FIXED
from ..inertia import InertialParameters
from ..urdf import RobotParts, urdf_text
from ..urdf.write import keeps_inertia, link_names

_LONGEST_CHAIN = 100
"""Joints up to which single calls go through Pinocchio, whose scratch data grow with n cubed."""
_FRAME_KINDS = frozenset((str, int, type(None)))


@dataclass(frozen=True, slots=True)
class FrameOfInterest:
    """A frame whose pose or Jacobian can be computed.

    Parameters
    ----------
    parent, pin_id : int
        Number of the table's frame it is fixed to (0 is R_0), and its own in the Pinocchio model.
    path : ndarray of int, shape (k,)
        Numbers of the table's frames from the base to the parent.
    rotation, position : ndarray, shapes (3, 3), (3,)
        Axes and origin in the parent frame, metres.
    """

    parent: int
    path: NDArray[np.int64]
    rotation: Array
    position: Array
    pin_id: int

    @property
    def kernel_arguments(self) -> tuple[NDArray[np.int64], Array, Array]:
        """Arguments of compiled kernels: path, rotation, position."""
        return self.path, self.rotation, self.position


class PinocchioTwin:
    """The Pinocchio model of a robot and each thread's scratch data for it.

    Parameters
    ----------
    parts : RobotParts
        The robot.
    gravity : ndarray, shape (3,)
        Acceleration in the world frame, m/s^2.
    """

    __slots__ = (
        "_frames", "_parts", "_scratch", "angles_to_check", "base_is_massless", "in_table_order",
        "model", "names", "order", "serves_dynamics", "serves_poses", "torques_warn",
    )  # fmt: skip

    def __init__(self, parts: RobotParts, gravity: Array) -> None:
        # mimic joints stay independent here: the coupling is the transmission's. Drives are ours,
        # and bodies whose digits a URDF would lose are the kernels'
        kept = [keeps_inertia(row) for row in parts.inertia.values]
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
        # one warning where the torques of a robot without masses and drives are computed
        d = parts.drive
        given, t = [parts.inertia.values, d.Ia, d.Fv, d.Fc, d.offset], parts.transmission
        given += [] if t is None else [t.Iam, t.Fvm, t.Fcm]
        self.angles_to_check = 100  # calls: one warning where angles look like degrees
        self.torques_warn = not any(np.any(values) for values in given)
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
        """Reorder the last axis of a result of Pinocchio (in a copy) to the table's order."""
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
        """Every name that `frame` accepts, without repetition."""
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
