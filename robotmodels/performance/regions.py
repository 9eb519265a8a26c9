"""Connectivity of workspaces: sections 3.5.2 and 3.5.3 of the book."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array, read_only
from .._outcomes import Outcome
from ..errors import InvalidValueError
from ..kinematics import dgm
from ..kinematics.lengths import characteristic_length
from ..model import RobotModel, check_model
from .accessibility import postures_of, with_free
from .arms import (
    Result,
    checked_flag,
    checked_word,
    free_predicate,
    section_arm,
    task_rows,
    turned_inside,
)
from .aspects import Aspects, free_components
from .cells import Space, measure_of_cells, neighbours, samples
from .continuation import successors
from .dexterity import _over, place_of
from .workspace import Workspace, WorkspaceStatus, workspace

_SAMPLES = 400000
_RESOLUTION = {2: 100, 3: 20}
_AT_A_TIME = 4096
_LEAST = 4  # cells of a region
_MOST_SHEETS = 64


class RegionStatus(Outcome):
    """Outcome of `regions`."""

    FOUND = 0, "The workspace was divided."
    EMPTY = 1, "No cell is reached."
    NOT_DEFINED = (
        2, "Infinitely many postures reach a point: which path can be followed is not a question "
        "of regions.",
    )  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Regions(Result):
    """Connected regions of a workspace, which may overlap.

    Parameters
    ----------
    connectivity : str
        ``"n"``: any two points of a region are joined by some motion; ``"t"``: every path inside
        can be followed.
    over : Workspace
        The cells.
    cells : ndarray of bool, shape (k, N)
        Which cells belong to each region, the largest first.
    measure : ndarray, shape (k,)
        Area (in a plane) or volume of each, m^2 or m^3.
    status : RegionStatus
        Outcome.
    """

    connectivity: str
    over: Workspace
    cells: NDArray[np.bool_]
    measure: Array
    status: RegionStatus

    @property
    def count(self) -> int:
        """Number of regions."""
        return len(self.cells)

    def reason(self) -> str:
        """The status as a sentence."""
        return self.status.sentence

    def __repr__(self) -> str:
        unit = "m^2" if self.over.coordinates == "plane" else "m^3"
        sizes = ", ".join(f"{v:.4g}" for v in self.measure[:6]) or "none"
        return f"<Regions ({self.connectivity}): {self.count}, {sizes} {unit}; {self.reason()}>"


def regions(
    arm: RobotModel,
    connectivity: str = "t",
    over: Workspace | None = None,
    limits: bool = True,
    free: Any = None,
) -> Regions:
    """Regions of a workspace in which points are joined, or in which every path can be followed.

    Parameters
    ----------
    arm : RobotModel
        The robot.
    connectivity : {"n", "t"}
        Whether any two points of a region are joined by some motion, or every path in it can be
        followed without a change of posture at a singular position.
    over : Workspace, optional
        Positions or an orientation, of the same arm; its limits and obstacles count.
    limits, free
        As for `workspace`, without ``over``.

    Returns
    -------
    Regions
        Cells of each region. Of t-connected ones the cells at the border are left out, as a
        singular position may pass through them.

    Raises
    ------
    InvalidValueError, ShapeError
        An unknown connectivity, a workspace of another arm, obstacles of the wrong kind.

    Notes
    -----
    n: images of the components of the free joint space. t: postures of neighbouring cells are
    joined by Newton steps; where a cuspidal arm has several postures of a cell in one aspect,
    sheets are put together so that each cell has one.

    References
    ----------
    Seed book sections 3.5.2 and 3.5.3; P. Wenger and P. Chedmail, "Ability of a robot to travel
    through its free work space in an environment with obstacles", IJRR 10(3), 1991.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> arm = load("planar_2r")
    >>> w = workspace(arm, limits=False, resolution=30)
    >>> regions(arm, "n", w).count, regions(arm, "t", w).count
    (1, 1)
    """
    check_model(arm)
    checked_word(connectivity, ("n", "t"), "connectivity")
    if over is None:
        first = workspace(arm, limits=checked_flag(limits, "limits"), free=free, resolution=8,
                          kind="positions" if free is None else "free")  # fmt: skip
        w = workspace(arm, kind=first.kind, limits=limits, free=free,
                      resolution=_RESOLUTION[max(first.size.size, 2)])  # fmt: skip
    else:
        w = _over(arm, over)
        if free is not None or (w.limits and not checked_flag(limits, "limits")):
            raise InvalidValueError(
                "over: its limits and obstacles count; expected no `free` and no limits=False "
                "beside it, make the workspace with them."
            )
    if w.status is WorkspaceStatus.EMPTY:
        return _result(connectivity, w, [], RegionStatus.EMPTY)
    counted = section_arm(arm) is not None or w.kind == "orientation"
    if w.status is WorkspaceStatus.NOT_DEFINED or (connectivity == "t" and not counted):
        return _result(connectivity, w, [], RegionStatus.NOT_DEFINED)
    if connectivity == "n":
        parts = free_components(arm, w.free, w.limits)
        return _result("n", w, _images(arm, w, parts, counted), RegionStatus.FOUND)
    return _result("t", w, _followed(arm, w), RegionStatus.FOUND)


def _result(
    connectivity: str, w: Workspace, found: list[NDArray[np.bool_]], status: RegionStatus
) -> Regions:
    """Regions, largest first, without those inside another."""
    area, volume = measure_of_cells(Space(w.coordinates, w.frame), w.points, w.size)
    weights = area if w.coordinates == "plane" else volume
    found = sorted(found, key=lambda cells: -float(weights[cells].sum()))
    kept: list[NDArray[np.bool_]] = []
    for cells in found:
        if not any((cells <= other).all() for other in kept):
            kept.append(cells)
    cells = np.array(kept, np.bool_).reshape(len(kept), len(w.points))
    measure = np.array([weights[c].sum() for c in kept])
    return Regions(connectivity, w, read_only(cells, np.bool_), read_only(measure), status)


def _cell_postures(arm: RobotModel, w: Workspace) -> tuple[Array, NDArray[np.bool_]]:
    """Postures of all cells within the limits and free: q (N, S, n), valid (N, S)."""
    q, valid, _ = postures_of(arm, w.poses, place_of(w))
    q, inside = turned_inside(arm, q, w.limits)
    valid &= inside & (w.count > 0)[:, None]
    is_free = free_predicate(arm, w.free)
    if is_free is not None:
        valid = with_free(valid, q, is_free)
    return q, valid


def _images(
    arm: RobotModel, w: Workspace, parts: Aspects, counted: bool
) -> list[NDArray[np.bool_]]:
    """Cells that each component of the free joint space reaches."""
    if parts.count == 1:
        return [np.asarray(w.count > 0)]
    if counted:
        q, valid = _cell_postures(arm, w)
        rows = np.nonzero(valid)[0]
        label = parts.of(q[valid])
    else:
        q = samples(arm, w.limits, _SAMPLES)
        p = Space(w.coordinates, w.frame).of_world(dgm(arm, q)[:, :3, 3])
        at = np.floor((p - w.points[0]) / w.size + 0.5).astype(int)
        good = np.all((at >= 0) & (at < w.shape), axis=1)
        rows = np.asarray(np.ravel_multi_index(tuple(at[good].T), w.shape))
        label = parts.of(q[good])
    found = []
    for k in range(parts.count):
        cells = np.zeros(len(w.points), np.bool_)
        cells[rows[label == k]] = True
        cells &= w.count > 0
        if cells.sum() >= _LEAST:
            found.append(cells)
    return found


def _followed(arm: RobotModel, w: Workspace) -> list[NDArray[np.bool_]]:
    """Cells of regions in which every path can be followed."""
    from scipy import sparse

    q, valid = _cell_postures(arm, w)
    N, S = valid.shape
    rows = task_rows(arm, None if w.kind != "orientation" else w.mask)
    links = [_links(arm, w, q, valid, rows, axis) for axis in range(len(w.shape))]
    a, b = np.concatenate(links, axis=1)
    joined = np.ones(a.size, np.bool_)
    total, part = sparse.csgraph.connected_components(
        sparse.coo_matrix((joined, (a, b)), (N * S, N * S)), directed=False
    )
    # sheets: parts of equal numbers of postures
    level = w.count[a // S] == w.count[b // S]
    _, sheet = sparse.csgraph.connected_components(
        sparse.coo_matrix((joined[level], (a[level], b[level])), (N * S, N * S)), directed=False
    )
    nodes = np.flatnonzero(valid.ravel())
    found = []
    sizes = np.bincount(part[nodes], minlength=total)
    for number in np.flatnonzero(sizes >= _LEAST):
        members = nodes[part[nodes] == number]
        cells = members // S
        if np.unique(cells).size == cells.size:
            chosen = [members]
        else:
            chosen = _sections(members, sheet, S, a, b)
        for own in chosen:
            whole = own[_to_corners(arm, w, own // S, q.reshape(N * S, -1)[own], rows)]
            found += _inner(w, whole, S, a, b)
    return found


def _to_corners(
    arm: RobotModel, w: Workspace, cells: NDArray[np.int64], q: Array, rows: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Which postures (m, n) of cells go on to all corners of their cell."""
    T, length, place = w.poses[cells], characteristic_length(arm), place_of(w)
    frame, is_free = w.frame[:3, : w.size.size], free_predicate(arm, w.free)
    good = np.ones(len(cells), np.bool_)
    one = np.ones((len(cells), 1), np.bool_)
    for corner in product((-0.5, 0.5), repeat=w.size.size):
        shift = w.size * np.array(corner)
        if w.coordinates == "half plane":
            shift = np.maximum(w.points[cells] + shift, [1e-6 * w.size[0], -np.inf])
            shift = shift - w.points[cells]
        goal = T.copy()
        goal[:, :3, 3] += shift @ frame.T
        r, valid, _ = postures_of(arm, goal, place)
        r, inside = turned_inside(arm, r, w.limits)
        valid &= inside
        if is_free is not None:
            valid = with_free(valid, r, is_free)
        to, way = successors(arm, T, goal, q[:, None], one, r, valid, rows, length)
        end = r[np.arange(len(cells)), to[:, 0]]
        good &= (to[:, 0] >= 0) & ~_jumps(arm, w, end - q - way[:, 0])
    return good


def _jumps(arm: RobotModel, w: Workspace, gap: Array) -> NDArray[np.bool_]:
    """Whether motions (m,) end a whole turn from a posture, where limits make that another one."""
    bounded = w.limits & np.isfinite(arm.lower) & np.isfinite(arm.upper)
    away = np.abs(np.nan_to_num(gap, nan=np.inf))[:, bounded]
    return np.asarray(away.max(axis=1, initial=0.0) > 1e-3)


def _links(
    arm: RobotModel, w: Workspace, q: Array, valid: NDArray[np.bool_], rows: NDArray[np.bool_],
    axis: int,
) -> NDArray[np.int64]:  # fmt: skip
    """Pairs (2, m) of nodes (cell, posture) that are joined along an axis of the grid."""
    N, S = valid.shape
    number = np.arange(N).reshape(w.shape)
    low = np.take(number, range(w.shape[axis] - 1), axis).ravel()
    high = np.take(number, range(1, w.shape[axis]), axis).ravel()
    both = valid[low].any(axis=1) & valid[high].any(axis=1)
    low, high = low[both], high[both]
    T, length = w.poses, characteristic_length(arm)
    pairs = [np.zeros((2, 0), np.int64)]
    for k in range(0, len(low), _AT_A_TIME):
        i, j = low[k : k + _AT_A_TIME], high[k : k + _AT_A_TIME]
        to, way = successors(arm, T[i], T[j], q[i], valid[i], q[j], valid[j], rows, length)
        m, s = np.nonzero(to >= 0)
        r = to[m, s]
        good = ~_jumps(arm, w, q[j[m], r] - q[i[m], s] - way[m, s])
        pairs.append(np.stack((i[m] * S + s, j[m] * S + r))[:, good])
    return np.concatenate(pairs, axis=1)


def _sections(
    members: NDArray[np.int64], sheet: NDArray[np.int64], S: int, a: NDArray[np.int64],
    b: NDArray[np.int64],
) -> list[NDArray[np.int64]]:  # fmt: skip
    """Unions of sheets of one part in which each cell has one node, grown from every sheet."""
    numbers, own, sizes = np.unique(sheet[members], return_inverse=True, return_counts=True)
    order = [k for k in np.argsort(-sizes) if sizes[k] >= _LEAST][:_MOST_SHEETS]
    nodes = {k: members[own == k] for k in order}
    cells = {k: set((nodes[k] // S).tolist()) for k in order}
    place = {int(numbers[k]): k for k in order}
    beside: dict[int, set[int]] = {int(k): set() for k in order}
    pairs = np.unique(np.stack((sheet[a], sheet[b])), axis=1)
    for x, y in pairs.T:
        p, r = place.get(int(x)), place.get(int(y))
        if p is not None and r is not None and p != r:
            beside[int(p)].add(int(r))
            beside[int(r)].add(int(p))
    found, seen = [], set()
    for first in order:
        chosen, covered = {int(first)}, set(cells[first])
        grew = True
        while grew:
            grew = False
            edge = set().union(*(beside[k] for k in chosen)) - chosen
            for k in sorted(edge, key=lambda k: -len(cells[k])):
                if not covered & cells[k]:
                    chosen.add(k)
                    covered |= cells[k]
                    grew = True
        if frozenset(chosen) not in seen:
            seen.add(frozenset(chosen))
            found.append(np.concatenate([nodes[k] for k in sorted(chosen)]))
    return found


def _inner(
    w: Workspace, own: NDArray[np.int64], S: int, a: NDArray[np.int64], b: NDArray[np.int64]
) -> list[NDArray[np.bool_]]:
    """Cells of a section without its border and without neighbours that are not joined."""
    from scipy import ndimage

    N = len(w.points)
    node = np.full(N, -1)
    node[own // S] = own
    inside = node >= 0
    good = inside.reshape(w.shape).copy()
    joined = np.zeros((len(w.shape), N), np.bool_)
    mine = (node[a // S] == a) & (node[b // S] == b)
    step = b[mine] // S - a[mine] // S
    strides = [int(np.prod(w.shape[k + 1 :])) for k in range(len(w.shape))]
    for axis, stride in enumerate(strides):
        joined[axis, (a[mine] // S)[step == stride]] = True
        pair = joined[axis].reshape(w.shape)
        low = [slice(None)] * len(w.shape)
        high = [slice(None)] * len(w.shape)
        low[axis], high[axis] = slice(None, -1), slice(1, None)
        grid = inside.reshape(w.shape)
        torn = grid[tuple(low)] & grid[tuple(high)] & ~pair[tuple(low)]
        good[tuple(low)] &= ~torn
        good[tuple(high)] &= ~torn
    good &= ~neighbours(~inside.reshape(w.shape))
    labels, count = ndimage.label(good)
    parts = [(labels == k + 1).ravel() for k in range(count)]
    return [cells for cells in parts if cells.sum() >= _LEAST]
