"""Aspects and components of the free joint space: sections 3.4.1 to 3.4.4 of the book.

Of an arm whose position three joints determine (or two in a plane) the position counts, of others
the pose. The joint space is cut by every factor of the determinant on a grid that closes in itself
where no limit cuts it. Joints that no factor shares are apart: aspects are products of parts.

Parameters
----------
arm, limits, free, executor, progress
    See `robotmodels.performance`; limits and obstacles cut the joint space.
resolution : int, optional
    Cells along each joint.

Returns
-------
Aspects
    The parts with ``volume`` (k,), rad^n (m for prismatic joints) of the joints that move the tool,
    largest first, and ``signs`` (k, factors) of the factors ``names`` of the determinant; none,
    with a status, for redundant arms. Of components of the free space ``signs`` is empty.

Examples
--------
>>> from robotmodels.robots import load
>>> found = aspects(load("planar_2r"), limits=False)
>>> found.count, found.signs.ravel(), found.of([[0.3, 1.0], [0.3, -1.0]])
(2, array([-1,  1], dtype=int8), array([1, 0]))
>>> free_components(load("planar_2r"), lambda q: abs(q[:, 1]) > 0.5, limits=False).count
1
"""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, Frozen, Value, as_vector
from .._arrays.tasks import Progress, Workers
from .._outcomes import Outcome, Result
from ..igm.loop import joint_chain
from ..model import RobotModel
from .arms import Flags, Ints, JointSpace, joint_space, wrapped
from .cells import checked_resolution
from .singularity import Factors, sign_factors

# cells along each of so many joints: at first, and when a grid does not separate all aspects
_CELLS = {1: (4096, 4096), 2: (400, 1200), 3: (96, 160), 4: (28, 36), 5: (14, 14), 6: (9, 9)}
_AT_A_TIME = 65536
_SPECKS = 1e-4  # of all cells: components without a core that belong to another


class AspectStatus(Outcome):
    """Outcome of a search for aspects."""

    FOUND = 0, "The joint space was divided."
    NOT_SEPARATED = 1, "The grid does not separate all parts: raise the resolution."
    NO_FREE_SPACE = 2, "No configuration is free."
    NOT_DEFINED = 3, "Not defined: the Jacobian of the task is not square, or never regular."


@dataclass(frozen=True, slots=True, eq=False)
class Group(Frozen, Value):
    """A grid over some joints (columns of q): lower ends, sides, which close, labels from 1."""

    joints: tuple[int, ...]
    low: Array
    side: Array
    closed: Flags
    factors: tuple[int, ...]
    labels: NDArray[np.int32]
    codes: Ints
    volumes: Array
    separates: bool

    def labels_of(self, q: Array, values: Array | None) -> Ints:
        """Label of the part for configurations (N, n); 0 where there is none."""
        cells = np.array(self.labels.shape)
        x = wrapped(q[:, self.joints], self.closed)
        at = np.clip(np.floor((x - self.low) / self.side).astype(int), 0, cells - 1)
        labels = self.labels[tuple(at.T)].astype(np.int64)
        if values is None or not self.factors:
            return labels
        wanted = (values[:, self.factors] > 0.0) @ (1 << np.array(self.factors))
        codes = np.append(-1, self.codes)
        # beside a singular position the cell may be of another aspect: look around
        for reach in (1, 2):
            wrong = np.flatnonzero(codes[labels] != wanted)
            for step in np.ndindex(*(2 * reach + 1,) * len(cells)) if wrong.size else ():
                to = at[wrong] + np.array(step) - reach
                good = np.all(self.closed | ((to >= 0) & (to < cells)), axis=1)
                other = self.labels[tuple((to % cells).T)]
                good &= codes[other] == wanted[wrong]
                labels[wrong[good]] = other[good]
                wrong = wrong[~good]
        return np.where(codes[labels] == wanted, labels, 0)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Aspects(Result):
    """Parts of the joint space, see the head of the file.

    ``groups`` are the grids, ``order`` (k, groups) the part of each that makes the aspect.
    """

    model: RobotModel
    limits: bool
    free: Any
    names: tuple[str, ...]
    signs: NDArray[np.int8]
    volume: Array
    groups: tuple[Group, ...]
    order: Ints
    status: AspectStatus

    @property
    def count(self) -> int:
        """Number of aspects."""
        return len(self.volume)

    @property
    def is_complete(self) -> bool:
        """Whether each aspect has a core away from singular positions, that is of one piece."""
        return self.status is AspectStatus.FOUND

    def of(self, q: ArrayLike) -> Ints:
        """Numbers (...), from 0, of the aspects of configurations (..., n), rad or m.

        -1 outside the limits, in collision, and so close to a singular position that the grid
        cannot tell; angles are turned inside the limits.
        """
        given = as_vector(q, self.model.n, "q")
        joints = JointSpace(self.model, self.limits, self.free)
        rows, inside = joints.within(given.reshape(-1, self.model.n))
        rows = np.where(inside[:, None], rows, 0.0)
        out = np.full(len(rows), -1)
        if self.count:
            if self.free is not None:
                inside &= joints.is_free(rows)
            factors = sign_factors(self.model) if self.names else None
            values = None if factors is None else factors.values(rows)
            place = np.stack([g.labels_of(rows, values) for g in self.groups], axis=-1)
            number = np.full([len(g.volumes) + 1 for g in self.groups], -1)
            number[tuple(self.order.T)] = np.arange(self.count)
            out = np.where(inside, number[tuple(place.T)], -1)
        return out.reshape(given.shape[:-1])

    def __repr__(self) -> str:
        kind = "aspects" if self.names else "components"
        shares = np.array2string(self.volume[:8], precision=4)
        return f"<Aspects of {self.model.name}: {self.count} {kind}, {shares}; {self.reason()}>"


def aspects(
    arm: RobotModel,
    limits: bool = True,
    free: Any = None,
    resolution: int | None = None,
    executor: Executor | None = None,
    progress: Progress = None,
) -> Aspects:
    """Aspects: the largest connected parts of the joint space without singular positions."""
    joints, work = joint_space(arm, limits, free), Workers(executor, progress)
    factors = sign_factors(arm)
    if factors is None:
        return _none(joints, AspectStatus.NOT_DEFINED)
    return _divided(joints, factors, resolution, work)


def free_components(
    arm: RobotModel,
    free: Any = None,
    limits: bool = True,
    resolution: int | None = None,
    executor: Executor | None = None,
    progress: Progress = None,
) -> Aspects:
    """Connected components of the free joint space, singular positions included."""
    joints, work = joint_space(arm, limits, free), Workers(executor, progress)
    return _divided(joints, Factors(arm, (), (), (), np.zeros(6, np.bool_)), resolution, work)


def _divided(
    joints: JointSpace, factors: Factors, resolution: int | None, work: Workers
) -> Aspects:
    """The parts of all groups of joints that share factors, and their products."""
    columns = tuple(int(c) for c in joint_chain(joints.model).columns)
    if not columns:
        return _none(joints, AspectStatus.NOT_DEFINED)
    parts = _apart(columns, factors, joints.free is not None)
    cut = [bool(members) or joints.free is not None for _, members in parts]
    needed = [j for (own, _), is_cut in zip(parts, cut, strict=True) if is_cut for j in own]
    ranges, circle = joints.ranges(needed)
    groups = []
    for k, (own, members) in enumerate(parts):
        first, last = _CELLS.get(len(own), (6, 6)) if cut[k] else (1, 1)
        cells = checked_resolution(resolution, first, len(own)) if cut[k] else 1
        part = work.part(k / len(parts), (k + 1) / len(parts))
        while True:
            group = _group(joints, own, members, factors, ranges, circle, cells, part)
            if group.separates or resolution is not None or cells >= last:
                break
            cells = min(2 * cells, last)
        groups.append(group)
    return _products(joints, factors.names, tuple(groups))


def _apart(
    columns: tuple[int, ...], factors: Factors, together: bool
) -> list[tuple[tuple[int, ...], tuple[int, ...]]]:
    """Groups of joints that share no factor, with the factors of each."""
    shared = [*factors.joints, columns] if together else factors.joints
    pairs = [pair for own in shared for pair in pairwise(own)]
    a, b = np.reshape(np.array(pairs, np.int64), (-1, 2)).T
    part = linked(a, b, 1 + max(columns))
    groups: dict[int, list[int]] = {}
    for column in columns:
        groups.setdefault(int(part[column]), []).append(column)
    of = [int(part[own[0]]) for own in factors.joints]
    return [
        (tuple(sorted(own)), tuple(i for i, k in enumerate(of) if k == g))
        for g, own in groups.items()
    ]


def _group(
    joints: JointSpace, own: tuple[int, ...], members: tuple[int, ...], factors: Factors,
    ranges: Array, circle: Flags, cells: int, work: Workers,
) -> Group:  # fmt: skip
    """The parts of the space of some joints, by connected cells of equal signs."""
    low, high = ranges[list(own)].T
    width = high - low
    low = np.where(np.isfinite(width), low, 0.0)  # a slide without limits, in one cell
    side, shape = np.where(np.isfinite(width), width, 1.0) / cells, (cells,) * len(own)
    closed = circle[list(own)]
    q = np.zeros((cells ** len(own), joints.model.n))
    q[:, own] = low + side * (np.indices(shape).reshape(len(own), -1).T + 0.5)
    values, flags = work.rows(partial(_at, joints, factors, members), _AT_A_TIME, q)
    certain = flags.reshape(shape).copy()
    code = np.where(flags, (values > 0.0) @ (1 << np.array(members, np.int64)), -1).reshape(shape)
    for value in values.T:
        certain &= _core(value.reshape(shape), closed)
    labels, separates = _connected(code, certain, closed)
    count = int(labels.max())
    sizes = np.bincount(labels.ravel(), minlength=count + 1)[1:]
    codes = np.zeros(count, np.int64)
    codes[labels[labels > 0] - 1] = code[labels > 0]
    volumes = np.asarray(sizes * np.prod(width / cells), float)
    return Group(own, low, side, closed, members, labels, codes, volumes, separates)


def _at(
    joints: JointSpace, factors: Factors, members: tuple[int, ...], q: Array
) -> tuple[Array, Flags]:
    """Values (N, k) of some factors, and which configurations are free (N,)."""
    values = factors.values(q)[:, members] if members else np.zeros((len(q), 0))
    return values, joints.is_free(q) if joints.free is not None else np.ones(len(q), np.bool_)


def _core(value: Array, closed: Flags) -> Flags:
    """Cells in which a factor cannot vanish, judged by its differences to the next cells."""
    change = np.zeros_like(value)
    for axis in range(value.ndim):
        step = np.abs(np.roll(value, -1, axis) - value)
        if not closed[axis]:
            np.moveaxis(step, axis, 0)[-1] = 0.0
        change += np.maximum(step, np.roll(step, 1, axis))
    return np.abs(value) > change


def _connected(code: Ints, certain: Flags, closed: Flags) -> tuple[NDArray[np.int32], bool]:
    """Labels, from 1, of connected cells with equal codes; whether the grid separates them all."""
    from scipy import ndimage

    whole, cores = (_components(c, closed) for c in (code, np.where(certain, code, -1)))
    code_of = np.zeros(int(whole.max()) + 1, np.int64)
    code_of[whole] = code.ravel()
    sizes, sure = np.bincount(whole), certain.ravel()
    owner = np.full(int(cores.max()) + 1, -1)  # every core lies in one part
    owner[cores[sure]] = whole[sure]
    number = np.bincount(owner[owner >= 0], minlength=len(sizes))
    kept = (code_of >= 0) & ((number > 0) | (sizes > _SPECKS * code.size))
    for value in np.setdiff1d(code_of[code_of >= 0], code_of[kept]):
        kept[np.argmax(np.where(code_of == value, sizes, 0))] = True
    labels = np.where(kept, np.cumsum(kept), 0)[whole].reshape(code.shape)
    for value in np.unique(code[(labels == 0) & (code >= 0)]):
        # the cut-off tips of a part belong to it
        lost, other = (labels == 0) & (code == value), (labels == 0) | (code != value)
        near = ndimage.distance_transform_edt(other, return_distances=False, return_indices=True)
        labels[lost] = labels[tuple(axis[lost] for axis in near)]
    return labels.astype(np.int32), bool((number[kept] == 1).all())


def _components(code: Ints, closed: Flags) -> Ints:
    """Numbers (N,) of the connected parts of equal codes of a grid that closes along some axes."""
    from scipy import ndimage

    labels, count = np.zeros(code.shape, np.int64), 0
    for value in np.flatnonzero(np.bincount(code[code >= 0])):
        part, more = ndimage.label(code == value)
        labels, count = labels + np.where(part > 0, part + count, 0), count + more
    ends = [np.zeros((2, 0), np.int64)]
    for axis in np.flatnonzero(closed):
        values, numbers = (np.moveaxis(x, axis, 0)[[-1, 0]].reshape(2, -1) for x in (code, labels))
        ends.append(numbers[:, (values[0] == values[1]) & (values[0] >= 0)])
    a, b = np.concatenate(ends, axis=1)
    return linked(a, b, count + 1)[labels.ravel()]


def linked(a: Ints, b: Ints, count: int) -> Ints:
    """Numbers (count,) of the connected parts of a graph with edges from a to b."""
    from scipy import sparse

    graph = sparse.coo_matrix((np.ones(a.size), (a, b)), (count, count))
    return np.asarray(sparse.csgraph.connected_components(graph, directed=False)[1], np.int64)


def _products(joints: JointSpace, names: tuple[str, ...], groups: tuple[Group, ...]) -> Aspects:
    """Aspects as products of the parts of all groups, largest first."""
    if any(len(g.volumes) == 0 for g in groups):
        return _none(joints, AspectStatus.NO_FREE_SPACE)
    order = np.indices([len(g.volumes) for g in groups]).reshape(len(groups), -1).T
    volume = np.prod([g.volumes[order[:, k]] for k, g in enumerate(groups)], axis=0)
    code = np.bitwise_or.reduce([g.codes[order[:, k]] for k, g in enumerate(groups)])
    signs = np.where((code[:, None] >> np.arange(len(names))) & 1, 1, -1).astype(np.int8)
    rank = np.lexsort((code, -volume.round(9)))
    found = all(g.separates for g in groups)
    status = AspectStatus.FOUND if found else AspectStatus.NOT_SEPARATED
    parts = signs[rank], volume[rank], groups, order[rank] + 1
    return Aspects(joints.model, joints.limits, joints.free, names, *parts, status)


def _none(joints: JointSpace, status: AspectStatus) -> Aspects:
    parts = (), np.zeros((0, 0), np.int8), np.zeros(0), (), np.zeros((0, 0), np.int64)
    return Aspects(joints.model, joints.limits, joints.free, *parts, status)
