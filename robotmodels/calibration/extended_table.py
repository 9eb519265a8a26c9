"""The seven elementary motions of a row of the table, and how an error of one acts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from math import atan2, hypot
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .. import se3
from .._arrays import Array, Rebuilt, read_only
from ..errors import InvalidValueError
from ..geometry import FIXED, DHTable, link_transforms
from ..kinematics import link_poses
from ..model import RobotModel, check_model


class Element(IntEnum):
    """Elementary motions of a row, in the order in which they follow each other.

    ``Rot(z, gamma) Trans(z, b) Rot(y, beta) Rot(x, alpha) Trans(x, d) Rot(z, theta) Trans(z, r)``

    References
    ----------
    Seed book section 1.4.2, eq. [1.3]; S. Hayati, IEEE CDC 1983, for beta.

    Examples
    --------
    >>> Element.D.is_length, Element.D.word
    (True, 'd')
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


_CLEAR = 0.5
"""Sine of alpha from which the six parameters of a pose are well determined (30 degrees)."""


class SixParameters(NamedTuple):
    """Six parameters of a pose, and the constant turn that keeps them well determined.

    Attributes
    ----------
    elements : ndarray, shape (7,)
        gamma, b, beta (0), alpha, d, theta, r in rad and m.
    turn : ndarray, shape (4, 4)
        A constant quarter turn, or the identity: in front of a base, behind a tool.

    Examples
    --------
    >>> base_parameters_of(np.eye(4)).elements.round(3) + 0.0
    array([0.   , 0.   , 0.   , 1.571, 0.   , 0.   , 0.   ])
    """

    elements: Array
    turn: Array


def pose_of_elements(elements: Array) -> Array:
    """Pose of one row of the table.

    Parameters
    ----------
    elements : ndarray, shape (7,)
        gamma, b, beta, alpha, d, theta, r in rad and m.

    Returns
    -------
    ndarray, shape (4, 4)
        ``Rot(z, gamma) Trans(z, b) Rot(y, beta) Rot(x, alpha) Trans(x, d) Rot(z, theta)
        Trans(z, r)``.

    References
    ----------
    Seed book eq. [1.3].

    Examples
    --------
    >>> pose_of_elements(np.array([0.0, 1.0, 0.0, 0.0, 2.0, 0.0, 0.0]))[:3, 3]
    array([2., 0., 1.])
    """
    gamma, b, beta, alpha, d, theta, r = elements[:, None]
    row = DHTable([0], [2], gamma=gamma, b=b, beta=beta, alpha=alpha, d=d, theta=theta, r=r)
    return link_transforms(row, [])[0]


def base_parameters_of(base: Any) -> SixParameters:
    """Six parameters of the place Z of a robot in the world, ``Z = turn row(elements)``.

    Where z_0 is nearly parallel to the axis z of the world the six parameters would not describe
    small displacements along y: the world is then turned by a constant quarter about x.

    Parameters
    ----------
    base : pose, shape (4, 4)
        Z, metres.

    Returns
    -------
    SixParameters
        Elements and turn.

    References
    ----------
    Seed book section 1.4.2 (frame 0), eq. [1.10].

    Examples
    --------
    >>> found = base_parameters_of(np.eye(4))
    >>> np.allclose(found.turn @ pose_of_elements(found.elements), np.eye(4))
    True
    """
    base = se3.as_single_pose(base, "base")
    turn = _turn(base[2, 2])
    return SixParameters(read_only(_six_elements(se3.inverse(turn) @ base)), read_only(turn))


def tool_parameters_of(tool: Any) -> SixParameters:
    """Six parameters of the place E of a tool in the frame that carries it, ``E = row turn``.

    Parameters
    ----------
    tool : pose, shape (4, 4)
        E, metres.

    Returns
    -------
    SixParameters
        Elements and turn. The turn does not move the tool's origin.

    References
    ----------
    Seed book section 1.4.2 (frame n + 1), eq. [1.10].

    Examples
    --------
    >>> found = tool_parameters_of(np.eye(4))
    >>> np.allclose(pose_of_elements(found.elements) @ found.turn, np.eye(4))
    True
    """
    tool = se3.as_single_pose(tool, "tool")
    turn = _turn(tool[2, 2])
    return SixParameters(read_only(_six_elements(tool @ se3.inverse(turn))), read_only(turn))


def _turn(cosine: float) -> Array:
    return np.eye(4) if 1.0 - cosine**2 >= _CLEAR**2 else se3.rotation("x", -np.pi / 2)


def _six_elements(T: Array) -> Array:
    R, p = T[:3, :3], T[:3, 3]
    alpha = atan2(hypot(R[0, 2], R[1, 2]), R[2, 2])
    gamma = atan2(R[0, 2], -R[1, 2])
    theta = atan2(R[2, 0], R[2, 1])
    x = np.array([np.cos(gamma), np.sin(gamma), 0.0])
    b, d, r = np.linalg.solve(np.column_stack([[0.0, 0.0, 1.0], x, R[:, 2]]), p)
    return np.array([gamma, b, 0.0, alpha, d, theta, r])


Frame = str | int | None
"""A frame of a model: a name, a number, or None for the tool."""
_NO_LENGTH = 1e-12
"""All lengths of a robot together that are put down to rounding, m."""


@dataclass(frozen=True, slots=True, eq=False)
class Skeleton(Rebuilt):
    """The table of a robot with its base as row 0 and each measured end as a row behind.

    Parameters
    ----------
    model : RobotModel
        The robot, f frames and n joints.
    frames : tuple
        The measured ends; None is the tool.
    nominal : ndarray, shape (R, 7)
        gamma, b, beta, alpha, d, theta, r of each row (rad, m); R = 1 + f + number of ends.
    antecedent : ndarray of int, shape (R,)
        Row that a row stands on; -1 for row 0.
    sigma, joint : ndarray of int, shape (R,)
        0 revolute, 1 prismatic, 2 fixed; number of the joint in q (from 0), -1 if fixed.
    before : ndarray, shape (4, 4)
        Constant turn in front of row 0.
    after : ndarray, shape (number of ends, 4, 4)
        Constant turn behind each end.

    References
    ----------
    Seed book section 1.4.2.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> skeleton_of(load("rx90")).nominal.shape
    (8, 7)
    """

    model: RobotModel
    frames: tuple[Frame, ...]
    nominal: Array
    antecedent: NDArray[np.int64]
    sigma: NDArray[np.int64]
    joint: NDArray[np.int64]
    before: Array
    after: Array

    def __post_init__(self) -> None:
        for name in ("antecedent", "sigma", "joint"):
            object.__setattr__(self, name, read_only(getattr(self, name), np.int64))
        for name in ("nominal", "before", "after"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    @property
    def rows(self) -> int:
        """Number of rows: base, frames of the table, ends."""
        return len(self.sigma)

    @property
    def size(self) -> float:
        """A length that deviations are compared with, m: the robot stretched out; 1 without any."""
        lengths = self.nominal[1:, [Element.B, Element.D, Element.R]]
        size = float(np.abs(lengths).sum())
        return size if size > _NO_LENGTH else 1.0

    def end_row(self, frame: Frame) -> int:
        """Row of a measured end.

        Parameters
        ----------
        frame : str, int or None
            As given to `skeleton_of`.

        Returns
        -------
        int
            Number of the row.

        Raises
        ------
        InvalidValueError
            The frame is not one of the ends.
        """
        if frame not in self.frames:
            raise InvalidValueError(
                f"frame: expected one of the measured ends {self.frames}, got {frame!r}."
            )
        return 1 + self.model.f + self.frames.index(frame)

    def path(self, frame: Frame) -> NDArray[np.int64]:
        """Rows from the world to an end.

        Parameters
        ----------
        frame : str, int or None
            One of the ends.

        Returns
        -------
        ndarray of int, shape (k,)
            Numbers of rows, the base's (0) first.
        """
        rows = [self.end_row(frame)]
        while rows[-1] > 0:
            rows.append(int(self.antecedent[rows[-1]]))
        return np.array(rows[::-1], dtype=np.int64)

    def row_name(self, row: int) -> str:
        """What a row stands for, in words.

        Parameters
        ----------
        row : int
            Its number.

        Returns
        -------
        str
            The base, a frame of the table, or an end.
        """
        f = self.model.f
        if row == 0:
            return "base"
        if row <= f:
            return self.model.table.names[row - 1]
        frame = self.frames[row - 1 - f]
        return "tool" if frame is None else f"end {frame}"


def skeleton_of(model: RobotModel, frames: Sequence[Frame] = (None,)) -> Skeleton:
    """Extend the table of a robot by its base and the ends that are measured.

    Parameters
    ----------
    model : RobotModel
        The robot.
    frames : sequence of str, int or None
        The measured ends, each once; None is the tool.

    Returns
    -------
    Skeleton
        The extended table.

    Raises
    ------
    InvalidValueError, FrameNotFoundError
        Not a model; no end or the same twice; an unknown frame.

    References
    ----------
    Seed book section 1.4.2.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> skeleton_of(load("rx90")).path(None)
    array([0, 1, 2, 3, 4, 5, 6, 7])
    """
    check_model(model)
    frames = tuple(frames)
    if not frames or len(set(frames)) < len(frames):
        raise InvalidValueError(f"frames: expected one or more ends, each once, got {frames}.")
    table = model.table
    base = base_parameters_of(model.base)
    ends = [_end(model, frame) for frame in frames]
    tools = [tool_parameters_of(end.pose) for end in ends]
    columns = (
        table.gamma, table.b, table.beta, table.alpha, table.d, table.theta, table.r,
    )  # fmt: skip
    fixed = [FIXED] * len(ends)
    return Skeleton(
        model=model,
        frames=frames,
        nominal=np.vstack([base.elements, np.column_stack(columns), *(t.elements for t in tools)]),
        antecedent=np.concatenate([[-1], table.antecedent, [end.parent for end in ends]]),
        sigma=np.concatenate([[FIXED], table.sigma, fixed]),
        joint=np.concatenate([[-1], model.chain.joint, [-1] * len(ends)]),
        before=base.turn,
        after=np.array([t.turn for t in tools]),
    )


class _End(NamedTuple):
    parent: int
    pose: Array


def _end(model: RobotModel, frame: Frame) -> _End:
    if frame is None:
        return _End(model.tip, model.tool)  # without Pinocchio, which takes longer than a small fit
    end = model.twin.frame(frame)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = end.rotation, end.position
    return _End(end.parent, pose)


def gravity_loads(
    skeleton: Skeleton, q: Array, elements: Sequence[tuple[int, Element, int]]
) -> Array:
    """Forces of gravity along elements: moments about rotations, forces along translations.

    Shapes: q (N, n) -> (N, K).
    """
    model = skeleton.model
    T = link_poses(model, q)
    mass = model.inertia.values[:, 9]
    moment = T[..., :3, :3] @ model.inertia.values[:, 6:9, None]
    moment = moment[..., 0] + mass[:, None] * T[..., :3, 3]
    carried = _carried(skeleton)
    loads = np.empty((len(q), len(elements)))
    for k, (row, element, carrier) in enumerate(elements):
        axis, origin = _axis(skeleton, T, row, element)
        bodies = carried[carrier]
        total = mass[bodies].sum()
        if element.is_length:
            moved = total * axis
        else:
            moved = np.cross(axis, moment[:, bodies].sum(axis=1) - total * origin)
        loads[:, k] = moved @ model.gravity
    return loads


def _axis(skeleton: Skeleton, T: Array, row: int, element: Element) -> tuple[Array, Array]:
    """World direction and origin of an element at every configuration, shapes (N, 3)."""
    if element in (Element.THETA, Element.R) and 1 <= row <= skeleton.model.f:
        # theta and r are along z_j, with the joint's own motion done or not
        return T[:, row - 1, :3, 2], T[:, row - 1, :3, 3]
    before = np.where(np.arange(len(Element)) < element, skeleton.nominal[row], 0.0)
    antecedent = int(skeleton.antecedent[row])
    if row == 0:
        start = np.broadcast_to(skeleton.before, (len(T), 4, 4))
    elif antecedent == 0:
        start = np.broadcast_to(skeleton.model.base, (len(T), 4, 4))
    else:
        start = T[:, antecedent - 1]
    there = start @ pose_of_elements(before)
    return there[:, :3, _DIRECTIONS[element]], there[:, :3, 3]


_DIRECTIONS = {
    Element.GAMMA: 2,
    Element.B: 2,
    Element.BETA: 1,
    Element.ALPHA: 0,
    Element.D: 0,
    Element.THETA: 2,
    Element.R: 2,
}


def _carried(skeleton: Skeleton) -> dict[int, list[int]]:
    """Bodies (from 0) that each row moves, the base's row all of them."""
    f = skeleton.model.f
    carried: dict[int, list[int]] = {row: [] for row in range(skeleton.rows)}
    for body in range(f):
        row = body + 1
        while row >= 0:
            carried[row].append(body)
            row = int(skeleton.antecedent[row])
    return carried
