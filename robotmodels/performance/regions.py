"""Connectivity of workspaces: sections 3.5.2 and 3.5.3 of the book.

n-connected: images of the components of the free joint space. t-connected: postures of neighbouring
cells are joined by Newton steps; where a cuspidal arm has several postures of a cell in one aspect,
sheets are put together so that each cell has one. The cells at the border are left out, as a
singular position may pass through them.

Parameters
----------
arm, limits, free, executor, progress
    See `robotmodels.performance`; limits and obstacles of ``over`` count where it is given.
connectivity : {"n", "t"}
    Whether any two points of a region are joined by some motion, or every path in it can be
    followed without a change of posture at a singular position.
over : Workspace, optional
    Positions or an orientation, of the same arm; its limits and obstacles count.

Returns
-------
Regions
    ``cells`` (k, N) of each region, which may overlap, the largest first, and ``measure`` (k,),
    area (in a plane) or volume, m^2 or m^3.

References
----------
P. Wenger and P. Chedmail, IJRR 10(3), 1991.

Examples
--------
>>> from robotmodels.robots import load
>>> arm = load("planar_2r")
>>> w = workspace(arm, limits=False, resolution=30)
>>> regions(arm, "n", w).count, regions(arm, "t", w).count
(1, 1)
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from itertools import product
from typing import Any

import numpy as np

from .._arrays import Array
from .._arrays.tasks import Progress, Workers
from .._choices import one_of
from .._outcomes import Outcome, Result
from ..errors import InvalidValueError
from ..model import RobotModel
from .accessibility import allowed_postures
from .arms import Flags, Ints, JointSpace, joint_space, section_arm, task_rows
from .aspects import Aspects, free_components, linked
from .cells import neighbours
from .dexterity import workspace_of
from .paths import Continuation
from .workspace import Workspace, WorkspaceStatus, postures_in, workspace

_AT_A_TIME = 4096
_LEAST = 4  # cells of a region
_MOST_SHEETS = 64


class RegionStatus(Outcome):
    """Outcome of `regions`."""

    FOUND = 0, "The workspace was divided."
    EMPTY = 1, "No cell is reached."
    NOT_DEFINED = 2, "Infinitely many postures reach a point: regions do not determine paths."


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Regions(Result):
    """Connected regions of the workspace ``over``, see the head of the file."""

    connectivity: str
    over: Workspace
    cells: Flags
    measure: Array
    status: RegionStatus

    @property
    def count(self) -> int:
        """Number of regions."""
        return len(self.cells)


def regions(
    arm: RobotModel,
    connectivity: str = "t",
    over: Workspace | None = None,
    limits: bool = True,
    free: Any = None,
    executor: Executor | None = None,
    progress: Progress = None,
) -> Regions:
    """Regions of a workspace in which points are joined, or in which every path can be followed."""
    joints, work = joint_space(arm, limits, free), Workers(executor, progress)
    one_of(connectivity, ("n", "t"), "connectivity")
    if over is None:
        requested: Any = {"kind": "positions" if free is None else "free", "limits": limits}
        w = workspace(arm, free=free, resolution=20, **requested)
        if w.size.size == 2:
            w = workspace(arm, free=free, resolution=100, **requested)
    else:
        w = workspace_of(arm, over)
        if free is not None or (w.limits and not joints.limits):
            raise InvalidValueError(
                "over: its limits and obstacles count; expected no `free` and no limits=False "
                "beside it, make the workspace with them."
            )
    counted = section_arm(arm) is not None or w.kind == "orientation"
    status, found = RegionStatus.FOUND, []
    if w.status is WorkspaceStatus.EMPTY:
        status = RegionStatus.EMPTY
    elif w.status is WorkspaceStatus.NOT_DEFINED or (connectivity == "t" and not counted):
        status = RegionStatus.NOT_DEFINED
    elif connectivity == "n":
        parts = free_components(arm, w.free, w.limits, None, executor, work.part(0.0, 0.5).done)
        found = _images(w, parts, work.part(0.5, 1.0))
    else:
        found = _followed(w, work)
    work.done()
    weights = w.cells.measures()[w.coordinates != "plane"]
    kept: list[Flags] = []
    for cells in sorted(found, key=lambda cells: -float(weights[cells].sum())):
        if not any((cells <= other).all() for other in kept):
            kept.append(cells)  # the largest first, without those inside another
    measure = np.array([weights[c].sum() for c in kept])
    cells = np.array(kept, np.bool_).reshape(len(kept), len(w.points))
    return Regions(connectivity, w, cells, measure, status)


def _images(w: Workspace, parts: Aspects, work: Workers) -> list[Flags]:
    """Cells that each component of the free joint space reaches."""
    if parts.count == 1:
        return [np.asarray(w.count > 0)]
    rows, q = postures_in(w, work)
    label, found = parts.of(q), []
    for k in range(parts.count):
        cells = np.zeros(len(w.points), np.bool_)
        cells[rows[label == k]] = True
        if cells.sum() >= _LEAST:
            found.append(cells)
    return found


def _followed(w: Workspace, work: Workers) -> list[Flags]:
    """Cells of regions in which every path can be followed."""
    q, valid = allowed_postures(w.joints, w.poses, w.place)
    valid &= (w.count > 0)[:, None]
    (N, S), T = valid.shape, w.poses
    rows = task_rows(w.model, None if w.kind != "orientation" else w.mask)
    follow = partial(_linked, w.joints, Continuation(w.model, rows))
    links, number = [np.zeros((2, 0), np.int64)], np.arange(N).reshape(w.shape)
    for axis in range(len(w.shape)):
        i = np.take(number, range(w.shape[axis] - 1), axis).ravel()
        j = np.take(number, range(1, w.shape[axis]), axis).ravel()
        both = valid[i].any(axis=1) & valid[j].any(axis=1)
        i, j = i[both], j[both]
        part = work.part(0.25 * axis, 0.25 * (axis + 1))
        (to,) = part.rows(follow, _AT_A_TIME, T[i], T[j], q[i], valid[i], q[j], valid[j])
        m, s = np.nonzero(to >= 0)
        links.append(np.stack((i[m] * S + s, j[m] * S + to[m, s])))
    a, b = np.concatenate(links, axis=1)
    # sheets: parts of equal numbers of postures
    level = w.count[a // S] == w.count[b // S]
    part, sheet = linked(a, b, N * S), linked(a[level], b[level], N * S)
    nodes, sections = np.flatnonzero(valid.ravel()), []
    sizes = np.bincount(part[nodes], minlength=1)
    for k in np.flatnonzero(sizes >= _LEAST):
        members = nodes[part[nodes] == k]
        single = np.unique(members // S).size == members.size
        sections += [members] if single else _sections(members, sheet, S, a, b)
    found, corners = [], partial(_to_corners, w, follow)
    for k, own in enumerate(sections):
        last = work.part(0.75 + 0.25 * k / len(sections), 0.75 + 0.25 * (k + 1) / len(sections))
        (good,) = last.rows(corners, _AT_A_TIME, own // S, q.reshape(N * S, -1)[own])
        found += _inner(w, own[good], S, a, b)
    return found


def _linked(
    joints: JointSpace, continuation: Continuation, T: Array, goal: Array, q: Array, valid: Flags,
    r: Array, valid_next: Flags,
) -> tuple[Ints]:  # fmt: skip
    """Postures of goals that continue those of poses, -1 for none: as `Continuation.successors`.

    A motion that ends a whole turn from a posture ends at another one where limits count.
    """
    to, way = continuation.successors(T, goal, q, valid, r, valid_next)
    bounded = joints.limits & np.isfinite(joints.model.lower) & np.isfinite(joints.model.upper)
    gap = np.take_along_axis(r, np.maximum(to, 0)[..., None], 1) - q - way if r.size else way
    jumps = np.abs(np.nan_to_num(gap, nan=np.inf))[..., bounded].max(axis=2, initial=0.0) > 1e-3
    return (np.where(jumps, -1, to),)


def _to_corners(
    w: Workspace, follow: Callable[..., tuple[Ints]], cells: Ints, q: Array
) -> tuple[Flags]:
    """Which postures (m, n) of cells go on to all corners of their cell."""
    T, frame = w.poses[cells], w.frame[:3, : w.size.size]
    good, one = np.ones(len(cells), np.bool_), np.ones((len(cells), 1), np.bool_)
    for corner in product((-0.5, 0.5), repeat=w.size.size):
        shift = w.size * np.array(corner)
        if w.coordinates == "half plane":
            shift = np.maximum(w.points[cells] + shift, [1e-6 * w.size[0], -np.inf])
            shift = shift - w.points[cells]
        goal = T.copy()
        goal[:, :3, 3] += shift @ frame.T
        r, valid = allowed_postures(w.joints, goal, w.place)
        good &= follow(T, goal, q[:, None], one, r, valid)[0][:, 0] >= 0
    return (good,)


def _sections(members: Ints, sheet: Ints, S: int, a: Ints, b: Ints) -> list[Ints]:
    """Unions of sheets of one part in which each cell has one node, grown from every sheet."""
    numbers, sizes = np.unique(sheet[members], return_counts=True)
    order = numbers[np.argsort(-sizes)][: min(int((sizes >= _LEAST).sum()), _MOST_SHEETS)].tolist()
    cells = {k: set((members[sheet[members] == k] // S).tolist()) for k in order}
    pairs = np.unique(np.sort(np.stack((sheet[a], sheet[b]), axis=1)), axis=0)
    beside: dict[int, set[int]] = {k: set() for k in order}
    for x, y in pairs[np.isin(pairs, order).all(axis=1)].tolist():
        beside[x].add(y)
        beside[y].add(x)
    found: set[frozenset[int]] = set()
    for first in order:
        chosen, covered, edge = {first}, set(cells[first]), beside[first] - {first}
        while edge:
            k = max(edge, key=lambda k: (len(cells[k]), -k))
            edge.discard(k)
            if not covered & cells[k]:
                chosen.add(k)
                covered |= cells[k]
                edge |= beside[k] - chosen
        found.add(frozenset(chosen))
    return [members[np.isin(sheet[members], list(chosen))] for chosen in found]


def _inner(w: Workspace, own: Ints, S: int, a: Ints, b: Ints) -> list[Flags]:
    """Cells of a section without its boundary and without neighbours that are not joined."""
    from scipy import ndimage

    node = np.full(len(w.points), -1)
    node[own // S] = own
    mine = (node[a // S] == a) & (node[b // S] == b)
    joined = np.bincount(np.concatenate((a[mine], b[mine])) // S, minlength=len(node))
    beside = sum(
        2 - (k == 0) - (k == n - 1) for k, n in zip(np.indices(w.shape), w.shape, strict=True)
    )
    good = (joined.reshape(w.shape) == beside) & ~neighbours(node.reshape(w.shape) < 0)
    labels, count = ndimage.label(good)
    parts = [(labels == k + 1).ravel() for k in range(count)]
    return [cells for cells in parts if cells.sum() >= _LEAST]
