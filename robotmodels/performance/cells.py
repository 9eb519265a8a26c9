"""Grids of cells over a workspace: half a plane through the first axis, a plane, or space."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, tau

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, as_mask, read_only
from ..errors import InvalidValueError
from ..geometry import REVOLUTE
from ..igm.loop import joint_chain
from ..kinematics import dgm
from ..model import RobotModel
from .arms import (
    SectionArm,
    _axes,
    checked_resolution,
    joint_ranges,
    plane_normal,
    section_arm,
    sequence,
)

SECTIONS = ("auto", "plane", "space")
_SAMPLES = 20000
_GRID = 160
_MARGIN = 0.02


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


def space_of(
    model: RobotModel, section: str, limits: bool, turned: bool, mask: ArrayLike | str | None
) -> Space | None:
    """Coordinates of the workspace of an arm; None if it is a curve or a surface in space.

    ``turned``: whether a turn of the first joint leaves the question as it is.
    """
    rows = None if mask is None else as_mask(mask)
    chain = joint_chain(model)
    if chain.k < 2:
        return None
    if rows is not None and rows[:3].sum() == 2:
        normal = np.eye(3)[int(np.argmin(rows[:3]))]
    else:
        normal = plane_normal(model)
    if normal is not None:
        if section == "space":
            raise InvalidValueError(
                f"section: expected 'auto' or 'plane' for {model.name}, whose workspace lies in a "
                "plane, got 'space'."
            )
        frame = np.eye(4)
        frame[:3, :3] = _axes(normal)
        e3 = frame[:3, 2]
        frame[:3, 3] = e3 * (e3 @ dgm(model, np.zeros(model.n))[:3, 3])
        return Space("plane", read_only(frame))
    if chain.k < 3:
        return None
    first = int(chain.columns[0])
    circle = chain.sigma[0] == REVOLUTE and (
        not limits or not model.upper[first] - model.lower[first] < tau - 1e-9
    )
    if section == "plane" and not (circle and turned):
        raise InvalidValueError(
            f"section: {model.name} has no plane that stands for its workspace: its first joint "
            "does not turn freely, or obstacles or an orientation are not symmetric about its "
            "axis; use section='space'."
        )
    if circle and turned and section != "space":
        arm = section_arm(model)
        if arm is not None:
            return Space("half plane", arm.frame)
        base = model.base @ chain.D[0]
        R = _axes(base[:3, 2])
        frame = np.eye(4)
        frame[:3, :3] = np.column_stack((R[:, 0], R[:, 2], -R[:, 1]))
        frame[:3, 3] = base[:3, 3] - R[:, 2] * (R[:, 2] @ base[:3, 3])
        return Space("half plane", read_only(frame))
    return Space("space", read_only(np.eye(4)))


def samples(model: RobotModel, limits: bool, count: int) -> Array:
    """Configurations (count, n) that fill the joint ranges evenly; still joints at zero."""
    columns = joint_chain(model).columns
    ranges, _ = joint_ranges(model, limits)
    q = np.zeros((count, model.n))
    span = ranges[columns, 1] - ranges[columns, 0]
    q[:, columns] = ranges[columns, 0] + span * sequence(count, columns.size)
    return q


def grid_of(
    model: RobotModel, space: Space, limits: bool, resolution: int | None, default: int
) -> tuple[Array, Array, tuple[int, ...]]:
    """Centres (N, d) of cells over the reach of an arm, their sizes (d,), and the grid's shape."""
    cells = checked_resolution(resolution, default, space.dimensions)
    arm = section_arm(model)
    if arm is not None and is_section(space.frame, space.kind, arm):
        points = _of_section(model, arm, limits)
    else:
        points = space.of_world(dgm(model, samples(model, limits, _SAMPLES))[:, :3, 3])
    low, high = points.min(axis=0), points.max(axis=0)
    room = _MARGIN * max(float((high - low).max()), 1e-9)
    low, high = low - room, high + room
    if space.kind == "half plane":
        low[0] = max(low[0], 0.0)
    size = (high - low) / cells
    axes = [a + h * (np.arange(cells) + 0.5) for a, h in zip(low, size, strict=True)]
    mesh = np.meshgrid(*axes, indexing="ij")
    return np.stack(mesh, axis=-1).reshape(-1, space.dimensions), size, mesh[0].shape


def is_section(frame: Array, kind: str, arm: SectionArm | None) -> bool:
    """Whether coordinates are those of the section of an arm."""
    if arm is None or kind != ("half plane" if arm.radial else "plane"):
        return False
    return np.allclose(frame, arm.frame, rtol=0.0, atol=1e-9 * max(arm.size, 1.0))


def _of_section(model: RobotModel, arm: SectionArm, limits: bool) -> Array:
    """Points of the section on a grid of the last two joints, the ends included."""
    ranges, _ = joint_ranges(model, limits, arm.columns[1:])
    axes = [np.linspace(low, high, _GRID) for low, high in ranges[arm.columns[1:]]]
    x = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)
    return arm.values(x)[:, :2]


def measure_of_cells(space: Space, points: Array, size: Array) -> tuple[Array, Array]:
    """Area and volume of each cell; NaN for what is not defined."""
    cell, none = float(np.prod(size)), np.full(len(points), np.nan)
    if space.kind == "space":
        return none, np.full(len(points), cell)
    area = np.full(len(points), cell)
    return area, 2.0 * pi * points[:, 0] * cell if space.kind == "half plane" else none


def neighbours(flags: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Cells of a grid beside a marked one, diagonals included."""
    out = flags.copy()
    for axis in range(flags.ndim):
        grown = out.copy()
        for side in (slice(1, None), slice(None, -1)):
            to = [slice(None)] * flags.ndim
            of = [slice(None)] * flags.ndim
            to[axis] = side
            of[axis] = slice(None, -1) if side.start else slice(1, None)
            grown[tuple(to)] |= out[tuple(of)]
        out = grown
    return out


def outlines(
    reached: NDArray[np.bool_], points: Array, size: Array, shape: tuple[int, ...]
) -> list[Array]:
    """Outlines of the cells that are reached, which lie on their left."""
    flags = np.pad(reached.reshape(shape), 1)
    follows: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for i, j in zip(*np.nonzero(flags), strict=True):
        sides = (
            (flags[i, j - 1], (i, j), (i + 1, j)),
            (flags[i + 1, j], (i + 1, j), (i + 1, j + 1)),
            (flags[i, j + 1], (i + 1, j + 1), (i, j + 1)),
            (flags[i - 1, j], (i, j + 1), (i, j)),
        )
        for other, start, end in sides:
            if not other:
                follows.setdefault(start, []).append(end)
    origin = points[0] - 1.5 * size
    loops = []
    while follows:
        start = next(iter(follows))
        path = [start]
        while path[-1] in follows:
            ends = follows[path[-1]]
            step = ends.pop()
            if not ends:
                del follows[path[-1]]
            path.append(step)
        loops.append(origin + size * np.array(path))
    return loops
