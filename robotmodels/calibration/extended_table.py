"""The extended table: row 0 places the robot, rows f + 1 and on the measured ends (1.4.2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from math import atan2, hypot

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array, Frozen
from ..errors import InvalidValueError
from ..geometry import FIXED
from ..kinematics import link_poses
from ..model import RobotModel, check_model
from ..se3 import rotation, translation

Frame = str | int | None
"""A frame of a model: a name, a number, or None for the tool."""
_LEAST_SIZE = 1e-12  # sum of all lengths of a robot that counts as zero, m
_LEAST_SINE = 0.5  # of alpha at which the six parameters of a pose need no quarter turn


class Element(IntEnum):
    """Elementary motions of a row, eq. [1.3] with Hayati's beta, in their order.

    ``Rot(z, gamma) Trans(z, b) Rot(y, beta) Rot(x, alpha) Trans(x, d) Rot(z, theta) Trans(z, r)``
    """

    GAMMA = 0
    B = 1
    BETA = 2
    ALPHA = 3
    D = 4
    THETA = 5
    R = 6

    @property
    def is_length(self) -> bool:
        """Whether it is a translation, in metres."""
        return self in (Element.B, Element.D, Element.R)

    @property
    def word(self) -> str:
        """Name of the element as in the table's columns."""
        return self.name.lower()


JOINT_VARIABLE = (Element.THETA, Element.R, None)  # element that is the joint variable, by sigma
_AXIS = (2, 2, 1, 0, 0, 2, 2)  # axis (x, y, z) of each element


@dataclass(frozen=True, slots=True, eq=False)
class ExtendedTable(Frozen):
    """The table of a robot with its base as row 0 and each measured end as a row behind."""

    model: RobotModel
    frames: tuple[Frame, ...]
    """The measured ends; None is the tool."""
    nominal: Array
    """gamma, b, beta, alpha, d, theta, r of each row (rad, m), shape (R, 7)."""
    antecedent: NDArray[np.int64]
    """Antecedent row, shape (R,); -1 for row 0."""
    sigma: NDArray[np.int64]
    """0 revolute, 1 prismatic, 2 fixed, shape (R,)."""
    joint: NDArray[np.int64]
    """Number of the joint in q (from 0), -1 if fixed, shape (R,)."""
    before: Array
    """Constant turn in front of row 0, shape (4, 4)."""
    after: Array
    """Constant turn behind each end, shape (number of ends, 4, 4)."""

    @property
    def rows(self) -> int:
        """Number of rows: base, frames of the robot, ends."""
        return len(self.sigma)

    @property
    def size(self) -> float:
        """Sum of the lengths of the robot, m, the scale of its corrections; 1 if all are zero."""
        lengths = self.nominal[1:, [Element.B, Element.D, Element.R]]
        size = float(np.abs(lengths).sum())
        return size if size > _LEAST_SIZE else 1.0

    @property
    def expected_error(self) -> float:
        """Expected error of a length, m: 1 mm from 1 m to 10 m of size, else in proportion."""
        return 1e-3 * max(min(self.size, 1.0), 0.1 * self.size)

    def end_row(self, frame: Frame) -> int:
        """Row of a measured end; InvalidValueError for any other frame."""
        if frame not in self.frames:
            raise InvalidValueError(
                f"frame: expected one of the measured ends {self.frames}, got {frame!r}."
            )
        return 1 + self.model.f + self.frames.index(frame)

    def path(self, frame: Frame) -> NDArray[np.int64]:
        """Rows from the base (0) to a measured end."""
        return self.path_to(self.end_row(frame))

    def path_to(self, row: int) -> NDArray[np.int64]:
        """Rows from the base (0) to a row."""
        rows = [row]
        while rows[-1] > 0:
            rows.append(int(self.antecedent[rows[-1]]))
        return np.array(rows[::-1], dtype=np.int64)

    def row_name(self, row: int) -> str:
        """Base, name of a frame, or end."""
        f = self.model.f
        if row == 0:
            return "base"
        if row <= f:
            return self.model.table.names[row - 1]
        frame = self.frames[row - 1 - f]
        return "tool" if frame is None else f"end {frame}"


def extend_table(model: RobotModel, frames: Sequence[Frame] = (None,)) -> ExtendedTable:
    """Extend the table of a robot by its base and the measured ends, each once."""
    check_model(model)
    frames = tuple(frames)
    if not frames or len(set(frames)) < len(frames):
        raise InvalidValueError(f"frames: expected one or more ends, each once, got {frames}.")
    table = model.table
    base, before = six_parameters_of(model.base, is_base=True)
    ends = [frame_place(model, frame) for frame in frames]
    tools, after = zip(*(six_parameters_of(pose, is_base=False) for _, pose in ends), strict=True)
    columns = [getattr(table, element.word) for element in Element]
    fixed = [FIXED] * len(ends)
    return ExtendedTable(
        model=model,
        frames=frames,
        nominal=np.vstack([base, np.column_stack(columns), *tools]),
        antecedent=np.array([-1, *table.antecedent, *(parent for parent, _ in ends)], np.int64),
        sigma=np.array([FIXED, *table.sigma, *fixed], np.int64),
        joint=np.array([-1, *model.chain.joint, *(-1 for _ in ends)], np.int64),
        before=before,
        after=np.array(after),
    )


def frame_place(model: RobotModel, frame: Frame) -> tuple[int, Array]:
    """Row that carries a frame of the model, and the pose of the frame there."""
    if frame is None:
        return model.tip, model.tool  # without Pinocchio, which takes longer than a small fit
    place, pose = model.twin.frame(frame), np.eye(4)
    pose[:3, :3], pose[:3, 3] = place.rotation, place.position
    return place.parent, pose


# --- the six parameters of a pose -----------------------------------------------------------------


def pose_of_elements(elements: Array) -> Array:
    """Pose of one row from its seven elements, eq. [1.3]."""
    gamma, b, beta, alpha, d, theta, r = map(float, elements)
    before_x = rotation("z", gamma) @ translation(0.0, 0.0, b) @ rotation("y", beta)
    after_x = translation(d, 0.0, 0.0) @ rotation("z", theta) @ translation(0.0, 0.0, r)
    return before_x @ rotation("x", alpha) @ after_x


def six_parameters_of(pose: Array, *, is_base: bool) -> tuple[Array, Array]:
    """Elements (7,) of a pose with beta = 0, and the constant turn (4, 4) that goes with them.

    ``pose = turn row(elements)`` of a base, ``row(elements) turn`` of a tool, eq. [1.10]. The turn
    is a quarter turn about x where z is nearly parallel to that of the reference, else none.
    """
    if 1.0 - pose[2, 2] ** 2 >= _LEAST_SINE**2:
        return _six_elements(pose), np.eye(4)
    turn, back = rotation("x", -np.pi / 2), rotation("x", np.pi / 2)
    return _six_elements(back @ pose if is_base else pose @ back), turn


def _six_elements(T: Array) -> Array:
    """Elements of a pose with beta = 0."""
    R, p = T[:3, :3], T[:3, 3]
    alpha = atan2(hypot(R[0, 2], R[1, 2]), R[2, 2])
    gamma = atan2(R[0, 2], -R[1, 2])
    theta = atan2(R[2, 0], R[2, 1])
    x = np.array([np.cos(gamma), np.sin(gamma), 0.0])
    b, d, r = np.linalg.solve(np.column_stack([[0.0, 0.0, 1.0], x, R[:, 2]]), p)
    return np.array([gamma, b, 0.0, alpha, d, theta, r])


# --- gravity --------------------------------------------------------------------------------------


def gravity_loads(
    table: ExtendedTable, q: Array, elements: Sequence[tuple[int, Element, int]]
) -> Array:
    """Gravity along elements (row, element, row that carries the load): moments and forces.

    Shapes: q (N, n), K elements -> (N, K), N m or N. Book section 1.5.1.1.
    """
    model = table.model
    T = link_poses(model, q)
    mass = model.inertia.values[:, 9]
    moment = (T[..., :3, :3] @ model.inertia.values[:, 6:9, None])[..., 0]
    moment += mass[:, None] * T[..., :3, 3]
    carried: dict[int, list[int]] = {row: [] for row in range(table.rows)}
    for body in range(model.f):
        for row in table.path_to(body + 1):
            carried[int(row)].append(body)
    loads = np.empty((len(q), len(elements)))
    for k, (row, element, carrier) in enumerate(elements):
        bodies = carried[carrier]
        axis, origin = _axis(table, T, row, element)
        total = mass[bodies].sum()
        if element.is_length:
            force = total * axis
        else:
            force = np.cross(axis, moment[:, bodies].sum(axis=1) - total * origin)
        loads[:, k] = force @ model.gravity
    return loads


def _axis(table: ExtendedTable, T: Array, row: int, element: Element) -> tuple[Array, Array]:
    """World direction and origin of an element at every configuration, shapes (N, 3)."""
    if element >= Element.THETA and 1 <= row <= table.model.f:
        # theta and r are along z_j, before and after the motion of the joint
        return T[:, row - 1, :3, 2], T[:, row - 1, :3, 3]
    antecedent = int(table.antecedent[row])
    if antecedent > 0:
        start = T[:, antecedent - 1]
    else:
        start = np.broadcast_to(table.model.base if row else table.before, (len(T), 4, 4))
    before = np.where(np.arange(len(Element)) < element, table.nominal[row], 0.0)
    place = start @ pose_of_elements(before)
    return place[:, :3, _AXIS[element]], place[:, :3, 3]
