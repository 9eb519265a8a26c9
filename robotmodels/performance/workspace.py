"""Workspaces: sections 3.3.1 to 3.3.6 of the book.

Three joints are solved by the quartic of Pieper, cell by cell. The positions of other arms are
found by samples of the joints, and by Newton steps in the cells at the border.

Parameters
----------
arm, limits, free, executor, progress
    See `robotmodels.performance`.
kind : {"positions", "primary", "secondary", "orientation", "free"}
    Positions in any orientation; those in every orientation; those in some but not every
    one; those in the given orientation; those free of collisions with ``free``.
section : {"auto", "plane", "space"}
    Half a plane through the first axis where that joint turns freely, the plane of a planar
    arm, which has no other, or space.
resolution : int, optional
    Cells along each coordinate.
orientation : array_like, shape (3, 3), optional
    Rotation of the tool, for kind ``orientation``.
mask : array_like, shape (6,), optional
    Requested components; two positions make a planar workspace.

Returns
-------
Workspace
    Cells with numbers of postures; areas and volumes.

Examples
--------
>>> from robotmodels.robots import load
>>> w = workspace(load("planar_2r"), limits=False, resolution=100)
>>> round(w.area, 6), w.count.max(), w.contains([[1.0, 0.5], [2.0, 0.5]])
(12.566371, np.int64(2), array([ True, False]))
"""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array, as_exact, as_floats, as_mask
from .._arrays.tasks import Progress, Workers
from .._choices import one_of
from .._outcomes import Outcome, Result
from ..errors import InvalidValueError, ShapeError
from ..igm.request import poses_of
from ..kinematics import dgm
from ..model import RobotModel
from . import arms
from .accessibility import allowed_postures, in_every_orientation, posture_counts
from .arms import Flags, Ints, JointSpace
from .arrangement import boundary, measures
from .cells import SAMPLES, SECTIONS, Cells, Space, cells_of, reached_cells, space_of

_AT_A_TIME = 16384
KINDS = ("positions", "primary", "secondary", "orientation", "free")
_RESOLUTION = {"counted": 400, "reached": 150, "oriented": 60, "turned": 240, "space": 28}


class WorkspaceStatus(Outcome):
    """Meaning of the counts of a workspace."""

    COUNTED = 0, "The postures of every cell were counted."
    REACHED_ONLY = 1, "Infinitely many postures reach a cell: 1 counts where one was found."
    SAMPLED = 2, "Orientations were sampled; the count is the least over the samples."
    EMPTY = 3, "No cell is reached."
    NOT_DEFINED = 4, "The tool does not move, or only on a curve or a surface in space."


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Workspace(Result):
    """Workspace of an arm on a grid of cells, with numbers of postures.

    ``points`` (N, 2 or 3) are the centres of all cells, m: distance from the first axis and height
    (``coordinates`` "half plane"), x and y in a "plane", or world positions in "space", the last
    coordinate the fastest; ``count`` (N,) the postures there, 0 outside; ``size`` (2 or 3,) the
    sides of a cell, ``shape`` the cells along each coordinate; ``frame`` (4, 4) maps coordinates,
    completed by zero, to the world. ``rotation`` (3, 3) is that of kind ``orientation``.
    """

    model: RobotModel
    kind: str
    limits: bool
    free: Any
    mask: Flags | None
    rotation: Array | None
    points: Array
    count: Ints
    size: Array
    shape: tuple[int, ...]
    coordinates: str
    frame: Array
    status: WorkspaceStatus

    @property
    def joints(self) -> JointSpace:
        """The joint space that counts."""
        return JointSpace(self.model, self.limits, self.free)

    @property
    def cells(self) -> Cells:
        """The grid."""
        return Cells(self.coordinates, self.frame, self.points, self.size, self.shape)

    @property
    def poses(self) -> Array:
        """World poses (N, 4, 4) of the cells, in the requested orientation or that of q = 0."""
        if self.rotation is None:
            return self.cells.poses(dgm(self.model, np.zeros(self.model.n))[:3, :3])
        return self.cells.poses(self.rotation)

    @property
    def place(self) -> Flags | None:
        """The mask with which the postures of the cells are solved."""
        if self.kind != "orientation":
            return arms.PLACE
        return None if self.coordinates == "plane" else self.mask

    @property
    def area(self) -> float:
        """Area of the section that is reached, m^2; NaN in space. See `area_of`."""
        return self._total(0, None)

    @property
    def volume(self) -> float:
        """Volume that is reached, m^3: of a half plane the volume it sweeps; NaN in a plane."""
        return self._total(1, None)

    def area_of(self, count: int) -> float:
        """Area with exactly so many postures, m^2.

        By the boundary method, to 1e-6 or better, where the curves of the section bound it (three
        joints, or two in a plane, no obstacles); else the sum of the cells.
        """
        return self._total(0, count)

    def volume_of(self, count: int) -> float:
        """Volume with exactly so many postures, m^3; see `area_of`."""
        return self._total(1, count)

    @property
    def grid_area(self) -> float:
        """Area of the cells that are reached, m^2."""
        return float(self.cells.measures()[0][self.count > 0].sum())

    @property
    def grid_error(self) -> float:
        """Bound of the relative error of sums of cells: half of each cell along the boundary."""
        flags = (self.count > 0).reshape(self.shape)
        if not flags.any():
            return 0.0
        padded = np.pad(flags, 1)  # the border of the grid is one too
        edges = sum(int(np.diff(padded, axis=k).sum()) for k in range(flags.ndim))
        return float(0.5 * edges / flags.sum())

    def contains(self, points: ArrayLike) -> Flags:
        """Whether points (..., 2 or 3), in coordinates of ``points`` or the world, are reached.

        Solved exactly where the postures of an arm are counted; else that of the cell. World points
        off the plane in which an arm moves are not.
        """
        given = as_floats(points, "points")
        if given.ndim == 0 or given.shape[-1] not in (2, 3) or given.shape[-1] < len(self.size):
            wanted = "(..., 3) in the world"
            wanted = wanted if len(self.size) == 3 else f"(..., 2) in the section or {wanted}"
            raise ShapeError(f"points: expected shape {wanted}, got {given.shape}.")
        rows, cells = given.reshape(-1, given.shape[-1]), self.cells
        local = rows if rows.shape[1] == len(self.size) else cells.of_world(rows)
        if self.kind in ("positions", "free") and _is_counted(cells, self.model):
            inside = _count_positions(self.joints, cells.world(local), Workers()) > 0
        else:
            number, inside = cells.numbers(local)
            inside[inside] = self.count[number] > 0
        if (
            local is not rows
            and self.coordinates == "plane"
            and arms.plane_normal(self.model) is not None
        ):
            height = (rows - self.frame[:3, 3]) @ self.frame[:3, 2]
            inside &= np.abs(height) <= 1e-9 * (1.0 + np.abs(rows).max(axis=1))
        return inside.reshape(given.shape[:-1])

    def boundary(self) -> list[Array]:
        """Closed polylines (K, 2) around what is reached, which lies on their left.

        From the singular curves and those of the limits; where these do not bound what is reached
        (see `area_of`) InvalidValueError is raised.
        """
        if not self._by_curves:
            raise InvalidValueError(
                "boundary: expected positions of three joints in a section, or of two in a plane, "
                "without obstacles; other workspaces have cells only, see `count`."
            )
        return boundary(self.model, self.limits)

    @property
    def _by_curves(self) -> bool:
        """Whether singular curves and limits bound what is reached."""
        planar = self.coordinates != "space" and self.free is None and self.kind == "positions"
        return planar and self.status <= 1 and self.cells.is_section(arms.section_arm(self.model))

    def _total(self, which: int, count: int | None) -> float:
        whole = isinstance(count, (int, np.integer)) and not isinstance(count, bool)
        if count is not None and not whole:
            raise InvalidValueError(f"count: expected a number of postures, got {count!r:.60}.")
        if self.coordinates == ("space", "plane")[which]:
            return float("nan")
        if self._by_curves:
            values, of = measures(self.model, self.limits)[which], np.arange(5)
        else:
            values, of = self.cells.measures()[which], self.count
        return float(values[of > 0 if count is None else (of == count) & (of > 0)].sum())

    def __repr__(self) -> str:
        unit, value = ("m^2", self.area) if self.coordinates == "plane" else ("m^3", self.volume)
        grid, of = " x ".join(map(str, self.shape)), getattr(self.model, "name", self.model)
        return (
            f"<Workspace of {of}: {self.kind}, {self.coordinates}, {grid} cells, {value:.6g} "
            f"{unit}, at most {self.count.max(initial=0)} postures. {self.reason()}>"
        )


def workspace(
    arm: RobotModel,
    kind: str = "positions",
    section: str = "auto",
    limits: bool = True,
    free: Any = None,
    resolution: int | None = None,
    orientation: ArrayLike | None = None,
    mask: ArrayLike | str | None = None,
    executor: Executor | None = None,
    progress: Progress = None,
) -> Workspace:
    """Workspace of an arm: which positions it reaches, and in how many postures."""
    joints, work = arms.joint_space(arm, limits, free), Workers(executor, progress)
    one_of(kind, KINDS, "kind")
    one_of(section, SECTIONS, "section")
    rows = None if mask is None else as_mask(mask)
    if rows is not None and rows[3:].any() and kind in ("positions", "free"):
        raise InvalidValueError(
            f"mask: kind={kind!r} counts positions in any orientation; leave it out, or "
            "take kind='orientation' or 'primary'."
        )
    rotation = _rotation(kind, orientation, free)
    space = space_of(joints, section, free is None and kind != "orientation", mask)
    requested = arm, kind, joints.limits, joints.free, rows, rotation
    if space is None:
        empty = Cells("space", np.eye(4), np.zeros((0, 3)), np.ones(3), (0, 0, 0))
        return _workspace(requested, empty, np.zeros(0), WorkspaceStatus.NOT_DEFINED)
    # a planar question to an arm in space leaves a coordinate open
    counted = _is_counted(space, arm)
    default = "space" if space.kind == "space" else "counted" if counted else "reached"
    if kind not in ("positions", "free") and default != "space":
        default = "oriented" if space.turning_axis(joints) is None else "turned"
    cells = cells_of(joints, space, resolution, _RESOLUTION[default])
    status = WorkspaceStatus.COUNTED
    if rotation is not None:
        seen = None if space.kind == "plane" else rows
        count = posture_counts(joints, cells.poses(rotation), seen, work)[1]
        if arms.leaves_a_family(arm, seen):
            count, status = np.minimum(count, 1), WorkspaceStatus.REACHED_ONLY
        return _workspace(requested, cells, count, status)
    first = work if kind in ("positions", "free") else work.part(0.0, 0.1)
    if counted:
        count = _count_positions(joints, cells.world(cells.points), first)
    else:
        count, status = reached_cells(joints, cells, first), WorkspaceStatus.REACHED_ONLY
    if kind in ("primary", "secondary"):
        reached, status = np.flatnonzero(count), WorkspaceStatus.SAMPLED
        axis, own = cells.turning_axis(joints), np.arange(reached.size)
        first = own
        if axis is not None:  # cells at one distance from the axis have one answer
            away = np.linalg.norm(cells.points[reached] - axis, axis=1).round(9)
            _, first, own = np.unique(away, return_index=True, return_inverse=True)
        positions = cells.world(cells.points[reached[first]])
        failed, least = in_every_orientation(joints, positions, rows, work.part(0.1, 1.0))
        every = np.where(failed == 0, least, 0)[own]
        count = np.zeros(len(count), np.int64)
        count[reached] = every if kind == "primary" else every == 0
    return _workspace(requested, cells, count, status)


def _workspace(requested: Any, cells: Cells, count: Any, status: WorkspaceStatus) -> Workspace:
    """The result; empty without a cell that is reached."""
    if status is not WorkspaceStatus.NOT_DEFINED and not count.any():
        status = WorkspaceStatus.EMPTY
    grid: Any = (
        cells.points,
        count.astype(np.int64),
        cells.size,
        cells.shape,
        cells.kind,
        cells.frame,
    )
    return Workspace(*requested, *grid, status)  # type: ignore[reportCallIssue]


def _rotation(kind: str, orientation: ArrayLike | None, free: Any) -> Array | None:
    """The requested orientation, checked."""
    if kind == "free" and free is None:
        raise InvalidValueError("free: expected obstacles or a function for kind='free', got None.")
    if (orientation is None) != (kind != "orientation"):
        raise InvalidValueError(
            f"orientation: expected a rotation (3, 3) for kind='orientation' and none for others, "
            f"got {'none' if orientation is None else 'one'} for kind={kind!r}."
        )
    if orientation is None:
        return None
    T = np.eye(4)
    T[:3, :3] = as_exact(orientation, (3, 3), "orientation")
    return poses_of(T)[:3, :3]


def _is_counted(space: Space, arm: RobotModel) -> bool:
    """Whether a point of the space is a position that three joints determine."""
    three = arms.section_arm(arm)
    if three is None:
        return False
    return space.kind != "plane" or space.is_section(three)


def _count_positions(joints: JointSpace, world: Array, work: Workers) -> Ints:
    """Postures of world positions (N, 3) by the quartic."""
    T = np.tile(np.eye(4), (len(world), 1, 1))
    T[:, :3, 3] = world
    return posture_counts(joints, T, arms.PLACE, work)[1]


def postures_in(w: Workspace, work: Workers) -> tuple[Ints, Array]:
    """Cells (M,) and configurations (M, n): all postures of the cells, or samples of them."""
    inner = np.flatnonzero(w.count > 0)
    if w.kind == "orientation" or arms.section_arm(w.model) is not None:
        solve = partial(_solved, w.joints, w.place)
        cells, q = work.rows(solve, _AT_A_TIME, inner, w.poses[inner])
        return cells, q
    q = w.joints.samples(SAMPLES)
    cells, inside = w.cells.numbers(w.cells.of_world(dgm(w.model, q)[:, :3, 3]))
    known = w.count[cells] > 0
    return cells[known], q[inside][known]


def _solved(joints: JointSpace, place: Flags | None, cells: Ints, T: Array) -> tuple[Ints, Array]:
    q, valid = allowed_postures(joints, T, place)
    return cells[np.nonzero(valid)[0]], q[valid]
