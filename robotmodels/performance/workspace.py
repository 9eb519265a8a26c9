"""Workspaces: sections 3.3.1 to 3.3.6 of the book."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, as_exact, as_mask, as_reals, read_only
from .._outcomes import Outcome
from ..errors import InvalidValueError, ShapeError
from ..igm.request import poses_of
from ..kinematics import dgm
from ..model import RobotModel, check_model
from .accessibility import in_every_orientation, posture_counts
from .arms import (
    Result,
    checked_flag,
    checked_word,
    free_predicate,
    kept_free,
    leaves_a_family,
    section_arm,
)
from .arrangement import boundary, measures
from .cells import SECTIONS, Space, grid_of, is_section, measure_of_cells, outlines, space_of
from .reach import reached_cells

KINDS = ("positions", "primary", "secondary", "orientation", "free")
_RESOLUTION = {"counted": 400, "reached": 150, "oriented": 60, "space": 28}


class WorkspaceStatus(Outcome):
    """Meaning of the counts of a workspace."""

    COUNTED = 0, "The postures of every cell were counted."
    REACHED_ONLY = (
        1, "Infinitely many postures reach a cell: the count is 1 where one was found.",
    )  # fmt: skip
    SAMPLED = 2, "Of every orientation samples were tried; the count is the least of them."
    EMPTY = 3, "No cell is reached."
    NOT_DEFINED = (
        4,
        "The tool is still, or moves on a curve or a surface in space: there is nothing to fill.",
    )


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Workspace(Result):
    """Workspace of an arm on a grid of cells, with numbers of postures.

    Parameters
    ----------
    model : RobotModel
        The robot.
    kind : str
        Positions, primary, secondary, orientation or free.
    limits : bool
        Whether the joint limits count.
    free : object
        Predicate or obstacles, or None.
    mask : ndarray of bool, shape (6,), or None
        Components that were asked for.
    rotation : ndarray, shape (3, 3), or None
        The orientation of kind ``orientation``.
    points : ndarray, shape (N, 2) or (N, 3)
        Centres of all cells, m: distance from the first axis and height, x and y in a plane, or
        world positions.
    count : ndarray of int64, shape (N,)
        Postures at the centre of each cell, 0 outside.
    size : ndarray, shape (2,) or (3,)
        Sides of a cell, m.
    shape : tuple of int
        Cells along each coordinate; ``points`` run over the last one first.
    coordinates : str
        ``"half plane"``, ``"plane"`` or ``"space"``.
    frame : ndarray, shape (4, 4)
        Maps the coordinates, completed by zero, to the world.
    status : WorkspaceStatus
        What the counts mean.
    """

    model: RobotModel
    kind: str
    limits: bool
    free: Any
    mask: NDArray[np.bool_] | None
    rotation: Array | None
    points: Array
    count: NDArray[np.int64]
    size: Array
    shape: tuple[int, ...]
    coordinates: str
    frame: Array
    status: WorkspaceStatus

    def reason(self) -> str:
        """The status as a sentence."""
        return self.status.sentence

    @property
    def poses(self) -> Array:
        """World poses (N, 4, 4) of the cells, in the orientation asked or that of zero joints."""
        T = np.tile(np.eye(4), (len(self.points), 1, 1))
        home = dgm(self.model, np.zeros(self.model.n))[:3, :3]
        T[:, :3, :3] = home if self.rotation is None else self.rotation
        T[:, :3, 3] = self._space.world(self.points)
        return T

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
        return float(self._cells[0][self.count > 0].sum())

    @property
    def grid_error(self) -> float:
        """Bound of the relative error of sums of cells: half of each cell along the border."""
        flags = (self.count > 0).reshape(self.shape)
        if not flags.any():
            return 0.0
        padded = np.pad(flags, 1)  # the border of the grid is one too
        edges = sum(int(np.diff(padded, axis=k).sum()) for k in range(flags.ndim))
        return float(0.5 * edges / flags.sum())

    def contains(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Whether points are reached.

        Parameters
        ----------
        points : array_like, shape (..., 2) or (..., 3)
            In the coordinates of ``points``, or world positions.

        Returns
        -------
        ndarray of bool, shape (...)
            Solved exactly where the postures of an arm are counted; else that of the cell.
        """
        given = as_reals(points, "points")
        if given.ndim == 0 or given.shape[-1] not in (2, 3):
            raise ShapeError(
                f"points: expected shape (..., 2) in the section or (..., 3) in the world, got "
                f"{given.shape}."
            )
        rows = given.reshape(-1, given.shape[-1])
        inside = np.asarray(np.isfinite(rows).all(axis=1))
        safe = np.where(inside[:, None], rows, 0.0)
        local = safe if safe.shape[1] == len(self.size) else self._space.of_world(safe)
        if safe.shape[1] == 2 and len(self.size) == 3:
            raise ShapeError("points: expected world positions (..., 3) of this workspace.")
        if self._counted:
            world = self._space.world(local)
            if safe.shape[1] == 3 and self.coordinates == "plane":
                world = safe
            exact = _count_positions(self.model, world, self.limits, self.free)
            return np.asarray((exact > 0) & inside).reshape(given.shape[:-1])
        low = self.points[0] - 0.5 * self.size if len(self.points) else np.zeros(len(self.size))
        cell = np.floor((local - low) / self.size).astype(int)
        inside &= np.all((cell >= 0) & (cell < self.shape), axis=1)
        flags = (self.count > 0).reshape(self.shape)
        inside[inside] = flags[tuple(cell[inside].T)]
        return inside.reshape(given.shape[:-1])

    def boundary(self) -> list[Array]:
        """Closed polylines (K, 2) around what is reached, which lies on their left.

        From the singular curves and those of the limits where they bound it (see `area_of`), else
        the outlines of the cells.
        """
        if self._by_curves:
            return [line.copy() for line in boundary(self.model, self.limits)]
        if self.coordinates == "space":
            raise InvalidValueError("boundary: expected a workspace in a plane, got one in space.")
        return outlines(self.count > 0, self.points, self.size, self.shape)

    @property
    def _space(self) -> Space:
        return Space(self.coordinates, self.frame)

    @property
    def _cells(self) -> tuple[Array, Array]:
        return measure_of_cells(self._space, self.points, self.size)

    @property
    def _counted(self) -> bool:
        """Whether the count of a point is that of the postures of its position."""
        return self.kind in ("positions", "free") and _is_counted(self._space, self.model)

    @property
    def _by_curves(self) -> bool:
        """Whether singular curves and limits bound what is reached."""
        planar = self.coordinates != "space" and self.free is None and self.kind == "positions"
        section = is_section(self.frame, self.coordinates, section_arm(self.model))
        return planar and self.status <= 1 and section

    def _total(self, which: int, count: int | None) -> float:
        whole = isinstance(count, (int, np.integer)) and not isinstance(count, bool)
        if count is not None and not whole:
            raise InvalidValueError(f"count: expected a number of postures, got {count!r:.60}.")
        if self.coordinates == ("space", "plane")[which]:
            return float("nan")
        if self._by_curves:
            values = measures(self.model, self.limits)[which]
            if count is None:
                return float(values.sum())
            return float(values[count]) if 0 <= count < len(values) else 0.0
        chosen = self.count > 0 if count is None else self.count == count
        if count == 0:
            return 0.0
        return float(self._cells[which][chosen].sum())

    def __repr__(self) -> str:
        unit, value = ("m^3", self.volume) if self.coordinates != "plane" else ("m^2", self.area)
        most = int(self.count.max(initial=0))
        grid = " x ".join(map(str, self.shape))
        return (
            f"<Workspace of {self.model.name}: {self.kind}, {self.coordinates}, {grid} cells\n"
            f"  {value:.6g} {unit}, at most {most} postures\n  {self.reason()}>"
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
) -> Workspace:
    """Workspace of an arm: which positions it reaches, and in how many postures.

    Parameters
    ----------
    arm : RobotModel
        The robot.
    kind : {"positions", "primary", "secondary", "orientation", "free"}
        Positions in any orientation; those in every orientation; those in some but not every
        one; those in the given orientation; those free of collisions with ``free``.
    section : {"auto", "plane", "space"}
        Half a plane through the first axis where that joint turns freely, the plane of a planar
        arm, which has no other, or space.
    limits : bool
        Whether the joint limits count.
    free : callable or obstacles, optional
        Function of q (N, n) that returns bool (N,), or obstacles.
    resolution : int, optional
        Cells along each coordinate.
    orientation : array_like, shape (3, 3), optional
        Rotation of the tool, for kind ``orientation``.
    mask : array_like, shape (6,), optional
        Components that are asked; two positions make a planar workspace.

    Returns
    -------
    Workspace
        Cells with numbers of postures; areas and volumes.

    Raises
    ------
    InvalidValueError, ShapeError
        An unknown word, no obstacles for kind ``free``, no orientation for kind ``orientation``,
        a slide without limits, a resolution that is no number of cells or needs more than 1 GB.

    Notes
    -----
    Three joints are solved by the quartic of Pieper, cell by cell. The positions of other arms
    are found by samples of the joints, and by Newton steps in the cells at the border.

    References
    ----------
    Seed book sections 3.3.1 to 3.3.6.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> w = workspace(load("planar_2r"), limits=False, resolution=100)
    >>> round(w.area, 6), w.count.max(), w.contains([[1.0, 0.5], [2.0, 0.5]])
    (12.566371, np.int64(2), array([ True, False]))
    """
    check_model(arm)
    checked_word(kind, KINDS, "kind")
    checked_word(section, SECTIONS, "section")
    bounded, is_free = checked_flag(limits, "limits"), free_predicate(arm, free)
    free = kept_free(free)
    rows = None if mask is None else read_only(as_mask(mask), np.bool_)
    rotation = _rotation(kind, orientation, free)
    turned = free is None and kind != "orientation"
    space = space_of(arm, section, bounded, turned, mask)
    if space is None:
        return _nothing(arm, kind, bounded, free, rows, rotation)
    # a planar question to an arm in space leaves a coordinate open
    counted = kind in ("positions", "free") and _is_counted(space, arm)
    default = _RESOLUTION["reached"]
    if kind not in ("positions", "free"):
        default = _RESOLUTION["oriented"]
    elif counted:
        default = _RESOLUTION["counted"]
    if space.kind == "space":
        default = _RESOLUTION["space"]
    points, size, shape = grid_of(arm, space, bounded, resolution, default)
    world = space.world(points)
    status = WorkspaceStatus.COUNTED
    if counted:
        count = _count_positions(arm, world, bounded, free)
    elif kind in ("positions", "free"):
        reached, _ = reached_cells(arm, space, points, size, shape, bounded, is_free)
        count, status = reached.astype(np.int64), WorkspaceStatus.REACHED_ONLY
    elif kind == "orientation":
        T = np.tile(np.eye(4), (len(points), 1, 1))
        T[:, :3, :3], T[:, :3, 3] = rotation, world
        asked = None if space.kind == "plane" else rows
        count = posture_counts(arm, T, asked, bounded, is_free)[1]
        if leaves_a_family(arm, asked):
            count, status = np.minimum(count, 1), WorkspaceStatus.REACHED_ONLY
    else:
        reached, _ = _positions(arm, space, points, size, shape, bounded, free)
        inner = np.flatnonzero(reached)
        failed, least = in_every_orientation(arm, world[inner], bounded, is_free, rows)
        count = np.zeros(len(points), np.int64)
        count[inner] = np.where(failed == 0, least, 0)
        if kind == "secondary":
            count = (reached & (count == 0)).astype(np.int64)
        status = WorkspaceStatus.SAMPLED
    if not count.any():
        status = WorkspaceStatus.EMPTY
    return Workspace(
        arm, kind, bounded, free, rows, rotation, read_only(points), read_only(count, np.int64),
        read_only(size), shape, space.kind, space.frame, status,
    )  # fmt: skip


def _rotation(kind: str, orientation: ArrayLike | None, free: Any) -> Array | None:
    """The orientation that was asked for, checked."""
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
    return read_only(poses_of(T)[:3, :3])


def _is_counted(space: Space, arm: RobotModel) -> bool:
    """Whether a point of the space is a position that three joints determine."""
    three = section_arm(arm)
    if three is None:
        return False
    return space.kind != "plane" or is_section(space.frame, space.kind, three)


def _count_positions(model: RobotModel, world: Array, limits: bool, free: Any) -> NDArray[np.int64]:
    """Postures of world positions by the quartic."""
    T = np.tile(np.eye(4), (len(world), 1, 1))
    T[:, :3, 3] = world
    place = np.repeat((True, False), 3)
    return posture_counts(model, T, place, limits, free_predicate(model, free))[1]


def _positions(
    model: RobotModel, space: Space, points: Array, size: Array, shape: tuple[int, ...],
    limits: bool, free: Any,
) -> tuple[NDArray[np.bool_], Array | None]:  # fmt: skip
    """Which cells are reached in any orientation."""
    if _is_counted(space, model):
        return _count_positions(model, space.world(points), limits, free) > 0, None
    return reached_cells(model, space, points, size, shape, limits, free_predicate(model, free))


def _nothing(
    arm: RobotModel, kind: str, limits: bool, free: Any, mask: Any, rotation: Any
) -> Workspace:
    """A workspace without cells."""
    return Workspace(
        arm, kind, limits, free, mask, rotation, read_only(np.zeros((0, 3))),
        read_only(np.zeros(0), np.int64), read_only(np.ones(3)), (0, 0, 0), "space",
        read_only(np.eye(4)), WorkspaceStatus.NOT_DEFINED,
    )  # fmt: skip
