"""Grids of cells over a workspace, and which of them are reached in infinitely many postures."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from math import pi, tau
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_count, as_mask
from .._arrays.tasks import Workers
from ..errors import InvalidValueError
from ..geometry import REVOLUTE
from ..igm import igm_numeric
from ..igm.loop import joint_chain
from ..kinematics import dgm
from ..model import RobotModel
from . import arms
from .arms import Flags, Ints, JointSpace, SectionArm

SECTIONS = ("auto", "plane", "space")
SAMPLES = 400000
_EXTENT = 20000  # samples that find the extent of a workspace
_GRID = 160
_MARGIN = 0.02
_CHUNK = 50000
_MOST_BYTES = 1e9
_CELL_BYTES = 170
_ROUNDS = 60


@dataclass(frozen=True, slots=True, eq=False)
class Space:
    """Coordinates of a workspace: ``frame`` (4, 4) maps (u, v, w) to the world.

    ``kind`` is half plane (u the distance from the first axis), plane or space.
    """

    kind: str
    frame: Array

    @property
    def dimensions(self) -> int:
        """2 or 3."""
        return 3 if self.kind == "space" else 2

    def world(self, points: Array) -> Array:
        """World positions (N, 3) of points (N, 2 or 3)."""
        return np.asarray(points @ self.frame[:3, : points.shape[-1]].T + self.frame[:3, 3])

    def of_world(self, positions: Array) -> Array:
        """Coordinates (N, 2 or 3) of world positions (N, 3)."""
        local = (positions - self.frame[:3, 3]) @ self.frame[:3, :3]
        if self.kind == "half plane":
            return np.column_stack((np.hypot(local[:, 0], local[:, 2]), local[:, 1]))
        return np.asarray(local[:, : self.dimensions])

    def is_section(self, arm: SectionArm | None) -> bool:
        """Whether the coordinates are those of the section of an arm."""
        if arm is None or self.kind != ("half plane" if arm.radial else "plane"):
            return False
        return np.allclose(self.frame, arm.frame, rtol=0.0, atol=1e-9 * max(arm.size, 1.0))

    def turning_axis(self, joints: JointSpace) -> Array | None:
        """Point (2,) at which the first axis crosses a plane, if it turns freely."""
        chain = joint_chain(joints.model)
        D, first = joints.model.base @ chain.D[0], chain.columns[0]
        across = self.kind == "plane" and abs(D[:3, 2] @ self.frame[:3, 2]) > 1.0 - 1e-12
        if not across or joints.free is not None or not joints.ranges([])[1][first]:
            return None
        return self.of_world(D[None, :3, 3])[0]


@dataclass(frozen=True, slots=True, eq=False)
class Cells(Space):
    """A grid of cells: centres (N, d), sides (d,), cells along each coordinate."""

    points: Array
    size: Array
    shape: tuple[int, ...]

    def numbers(self, points: Array) -> tuple[Ints, Flags]:
        """Numbers of the cells that hold points (N, d), those that are in one, and which are."""
        low = self.points[0] - 0.5 * self.size if len(self.points) else np.zeros(len(self.size))
        with np.errstate(invalid="ignore"):
            cell = np.floor((points - low) / self.size)
        inside = np.all((cell >= 0) & (cell < self.shape), axis=1)
        at = np.ravel_multi_index(tuple(cell[inside].astype(int).T), self.shape)
        return np.asarray(at), np.asarray(inside)

    def measures(self) -> tuple[Array, Array]:
        """Area and volume of each cell; NaN for what is not defined."""
        cell, none = float(np.prod(self.size)), np.full(len(self.points), np.nan)
        if self.kind == "space":
            return none, np.full(len(self.points), cell)
        sweep = 2.0 * pi * self.points[:, 0] if self.kind == "half plane" else none
        return np.full(len(self.points), cell), sweep * cell

    def poses(self, R: Array) -> Array:
        """World poses (N, 4, 4) of the cells in an orientation (3, 3)."""
        T = np.tile(np.eye(4), (len(self.points), 1, 1))
        T[:, :3, :3], T[:, :3, 3] = R, self.world(self.points)
        return T


def space_of(
    joints: JointSpace, section: str, turned: bool, mask: ArrayLike | str | None
) -> Space | None:
    """Coordinates of the workspace of an arm; None if it is a curve or a surface in space.

    ``turned``: whether a turn of the first joint leaves the question as it is.
    """
    model, rows = joints.model, None if mask is None else as_mask(mask)
    chain = joint_chain(model)
    if chain.k < 2:
        return None
    if rows is not None and rows[:3].sum() == 2:
        normal = np.eye(3)[int(np.argmin(rows[:3]))]
    else:
        normal = arms.plane_normal(model)
    if normal is not None:
        if section == "space":
            raise InvalidValueError(
                f"section: expected 'auto' or 'plane' for {model.name}, whose workspace lies in a "
                "plane, got 'space'."
            )
        frame = np.eye(4)
        frame[:3, :3] = arms.axes_along(normal)
        e3 = frame[:3, 2]
        frame[:3, 3] = e3 * (e3 @ dgm(model, np.zeros(model.n))[:3, 3])
        return Space("plane", frame)
    if chain.k < 3:
        return None
    first = int(chain.columns[0])
    circle = chain.sigma[0] == REVOLUTE and (
        not joints.limits or not model.upper[first] - model.lower[first] < tau - 1e-9
    )
    if section == "plane" and not (circle and turned):
        raise InvalidValueError(
            f"section: {model.name} has no plane that represents its workspace: its first joint "
            "does not turn freely, or obstacles or an orientation are not symmetric about its "
            "axis; use section='space'."
        )
    if not (circle and turned) or section == "space":
        return Space("space", np.eye(4))
    arm = arms.section_arm(model)
    frame = arms.axis_frames(model.base @ chain.D[0], True)[1] if arm is None else arm.frame
    return Space("half plane", frame)


def checked_resolution(value: Any, default: int, dimensions: int) -> int:
    """Cells along each axis, whose grid fits into 1 GB."""
    most = int((_MOST_BYTES / _CELL_BYTES) ** (1.0 / max(dimensions, 1)))
    return default if value is None else as_count(value, "resolution", 2, most)


def cells_of(joints: JointSpace, space: Space, resolution: int | None, default: int) -> Cells:
    """Cells over the reach of an arm."""
    count = checked_resolution(resolution, default, space.dimensions)
    arm = arms.section_arm(joints.model)
    if arm is not None and space.is_section(arm):
        last = arm.columns[1:]
        axes = [np.linspace(low, high, _GRID) for low, high in joints.ranges(last)[0][last]]
        x = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
        points = arm.values(x)[:, :2]
    else:
        q = JointSpace(joints.model, joints.limits).samples(_EXTENT)
        points = space.of_world(dgm(joints.model, q)[:, :3, 3])
    low, high = points.min(axis=0), points.max(axis=0)
    axis = space.turning_axis(joints)
    if axis is not None:  # a disc about the axis, whose cells come in eights of one distance
        size = np.full(2, np.abs(points - axis).max())
        low, high = axis - size, axis + size
    room = _MARGIN * max(float((high - low).max()), 1e-9)
    low, high = low - room, high + room
    if space.kind == "half plane":
        low[0] = max(low[0], 0.0)
    size = (high - low) / count
    axes = [a + h * (np.arange(count) + 0.5) for a, h in zip(low, size, strict=True)]
    centres = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(size))
    return Cells(space.kind, space.frame, centres, size, (count,) * len(size))


def neighbours(flags: Flags) -> Flags:
    """Cells of a grid beside a marked one, diagonals included."""
    from scipy import ndimage

    return np.asarray(ndimage.binary_dilation(flags, np.ones((3,) * flags.ndim)))


def reached_cells(joints: JointSpace, cells: Cells, work: Workers) -> Flags:
    """Which centres of cells (N,) some posture reaches: samples, then Newton at the boundary."""
    shape = cells.shape
    q_of = np.full((len(cells.points), joints.model.n), np.nan)
    q = joints.samples(SAMPLES)
    (points,) = work.part(0.0, 0.5).rows(partial(_points, joints.model, cells), _CHUNK, q)
    at, inside = cells.numbers(points)
    q_of[at] = q[inside]
    hit = np.asarray(np.isfinite(q_of).all(axis=1))
    # a sample in a cell does not decide about its centre where the border passes
    inner = ~neighbours(~hit.reshape(shape)).ravel()
    reached, tried = inner.copy(), inner.copy()
    move = partial(_moved_to, _bounded(joints), cells)
    for k in range(_ROUNDS):
        rows = np.flatnonzero(neighbours((hit | reached).reshape(shape)).ravel() & ~tried)
        if not rows.size:
            break
        part = work.part(1.0 - 0.5 * 0.7**k, 1.0 - 0.5 * 0.7 ** (k + 1))
        found, good = part.rows(move, _CHUNK, cells.points[rows], _starts(q_of, rows, shape))
        tried[rows] = True
        reached[rows[good]] = True
        q_of[rows[good]] = found[good]
        hit[rows[~good]] = False
    work.done()
    return reached


def _points(model: RobotModel, space: Space, q: Array) -> tuple[Array]:
    return (space.of_world(dgm(model, q)[:, :3, 3]),)


def _starts(q_of: Array, rows: Ints, shape: tuple[int, ...]) -> Array:
    """A posture of the cell or of a neighbour for each row."""
    start = q_of[rows].copy()
    at = np.array(np.unravel_index(rows, shape))
    for step in np.ndindex(*(3,) * len(shape)):
        lacking = np.isnan(start).any(axis=1)
        if not lacking.any():
            break
        to = np.clip(at + np.array(step)[:, None] - 1, 0, np.array(shape)[:, None] - 1)
        start[lacking] = q_of[np.ravel_multi_index(tuple(to), shape)][lacking]
    return np.nan_to_num(start)


def _bounded(joints: JointSpace) -> JointSpace:
    """The joint space with the ranges that count as limits of its model."""
    ranges, circle = joints.ranges()
    low, high = np.where(circle, -np.inf, ranges[:, 0]), np.where(circle, np.inf, ranges[:, 1])
    table = replace(joints.model.table, lower=low, upper=high)
    return replace(joints, model=joints.model.with_table(table))


def _moved_to(joints: JointSpace, space: Space, goals: Array, q: Array) -> tuple[Array, Flags]:
    """Free postures (N, n) near q whose tool is at points of the space."""
    model, mask, goal = joints.model, "position", space.world(goals)
    if space.kind == "plane":
        mask = (1, 1, 0, 0, 0, 0)
    if space.kind == "half plane":  # the one through the tool
        local = (dgm(model, q)[:, :3, 3] - space.frame[:3, 3]) @ space.frame[:3, :3]
        away = np.maximum(np.hypot(local[:, 0], local[:, 2]), 1e-12)[:, None]
        turned = goals[:, :1] * local / away
        turned[:, 1] = goals[:, 1]
        goal = space.world(turned)
    T = np.tile(space.frame, (len(goals), 1, 1))
    T[:, :3, 3] = goal
    reach = max(float(np.abs(goals).max(initial=0.0)), 1e-9)
    found = igm_numeric(model, T, q, mask, "tool", 1e-7 * reach, limits=True, restarts=0)
    q, good = np.nan_to_num(found.q[:, 0]), found.valid[:, 0].copy()
    if joints.free is not None and good.any():
        good[good] = joints.is_free(q[good])
    return q, good
