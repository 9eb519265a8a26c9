"""The extended table: frame 0 places the robot, frames f + 1 and on the tools that are measured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array, Rebuilt, read_only
from ...errors import InvalidValueError
from ...geometry import FIXED
from ...model import RobotModel, check_model
from .elements import Element
from .six_parameters import base_parameters_of, tool_parameters_of

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
