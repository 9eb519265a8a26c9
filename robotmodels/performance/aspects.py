"""Aspects and components of the free joint space: sections 3.4.1 to 3.4.3 of the book.

Parameters
----------
arm : RobotModel
    The robot.
limits : bool
    Whether the joint limits cut the joint space.
free : callable or obstacles, optional
    Function of q (N, n) that returns bool (N,), or obstacles: parts of the free space.
resolution : int, optional
    Cells along each joint.

Raises
------
InvalidValueError
    A slide without limits that obstacles or a factor of the determinant depend on (the volume is
    infinite if they do not), a resolution that is no number of cells or needs more than 1 GB.

References
----------
Seed book sections 3.4.1 to 3.4.4.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, as_vector, read_only
from .._outcomes import Outcome
from ..igm.loop import joint_chain
from ..model import RobotModel, check_model
from .arms import (
    Free,
    Result,
    checked_flag,
    checked_resolution,
    free_predicate,
    joint_ranges,
    kept_free,
    turned_inside,
)
from .components import Group, connected, core_cells, labels_of
from .factors import Factors, sign_factors

# cells along each of so many joints: at first, and when a grid does not separate all aspects
_CELLS = {1: (4096, 4096), 2: (400, 1200), 3: (96, 160), 4: (28, 36), 5: (14, 14), 6: (9, 9)}
_FEW = 7


class AspectStatus(Outcome):
    """Outcome of a search for aspects."""

    FOUND = 0, "The joint space was divided."
    NOT_SEPARATED = 1, "The grid does not separate all parts: raise the resolution."
    NO_FREE_SPACE = 2, "No configuration is free."
    NOT_DEFINED = (
        3, "Aspects are not defined: the Jacobian of the task is not square, or never regular.",
    )  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Aspects(Result):
    """Parts of the joint space: aspects, or components of the free space.

    Parameters
    ----------
    model : RobotModel
        The robot.
    limits : bool
        Whether the joint limits count.
    free : object
        Predicate or obstacles, or None.
    names : tuple of str
        The factors of the determinant; none for components of the free space.
    signs : ndarray of int8, shape (k, factors)
        Signs of the factors in each aspect.
    volume : ndarray, shape (k,)
        Volume of each, rad^n (and m for slides), largest first. Joints that do not move the tool
        are left out.
    groups : tuple
        The grids: joints that no factor shares are apart, and aspects are products of parts.
    order : ndarray of int64, shape (k, groups)
        The part of each group that makes the aspect.
    status : AspectStatus
        Whether all were found.
    """

    model: RobotModel
    limits: bool
    free: Any
    names: tuple[str, ...]
    signs: NDArray[np.int8]
    volume: Array
    groups: tuple[Group, ...]
    order: NDArray[np.int64]
    status: AspectStatus

    @property
    def count(self) -> int:
        """Number of aspects."""
        return len(self.volume)

    @property
    def is_complete(self) -> bool:
        """Whether each aspect has a core away from singular positions, that is of one piece."""
        return self.status is AspectStatus.FOUND

    def reason(self) -> str:
        """The status as a sentence."""
        return self.status.sentence

    def of(self, q: ArrayLike) -> NDArray[np.int64]:
        """Aspect of configurations.

        Parameters
        ----------
        q : array_like, shape (..., n)
            Joint variables, rad or m; angles are turned inside the limits.

        Returns
        -------
        ndarray of int64, shape (...)
            Number of the aspect, from 0; -1 outside the limits, in collision, and so close to a
            singular position that the grid cannot tell.
        """
        given = as_vector(q, self.model.n, "q")
        rows, inside = turned_inside(self.model, given.reshape(-1, self.model.n), self.limits)
        rows = np.where(inside[:, None], rows, 0.0)
        out = np.full(len(rows), -1)
        if self.count:
            is_free = free_predicate(self.model, self.free)
            if is_free is not None:
                inside &= is_free(rows)
            factors = sign_factors(self.model) if self.names else None
            values = None if factors is None else factors.values(rows)
            place = np.stack([labels_of(g, rows, values) for g in self.groups], axis=-1)
            sizes = [len(g.volumes) + 1 for g in self.groups]
            number = np.full(sizes, -1)
            number[tuple(self.order.T)] = np.arange(self.count)
            out = np.where(inside, number[tuple(place.T)], -1)
        return out.reshape(given.shape[:-1])

    def __repr__(self) -> str:
        shares = ", ".join(f"{v:.4g}" for v in self.volume[:_FEW])
        more = ", ..." if self.count > _FEW else ""
        kind = "aspects" if self.names else "components"
        return (
            f"<Aspects of {self.model.name}: {self.count} {kind}, volumes {shares or 'none'}{more};"
            f"\n  {self.reason()}>"
        )


def aspects(
    arm: RobotModel, limits: bool = True, free: Any = None, resolution: int | None = None
) -> Aspects:
    """Aspects: the largest connected parts of the joint space without singular positions.

    Of an arm whose position three joints determine (or two in a plane) the position counts, of
    others the pose. The joint space is cut by every factor of the determinant on a grid that
    closes in itself where no limit cuts it.

    Returns
    -------
    Aspects
        The parts with their volumes and signs; none, with a status, for redundant arms.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> found = aspects(load("planar_2r"), limits=False)
    >>> found.count, found.signs.ravel(), found.of([[0.3, 1.0], [0.3, -1.0]])
    (2, array([-1,  1], dtype=int8), array([1, 0]))
    """
    check_model(arm)
    return _divided(arm, sign_factors(arm), True, limits, free, resolution)


def free_components(
    arm: RobotModel, free: Any = None, limits: bool = True, resolution: int | None = None
) -> Aspects:
    """Connected components of the free joint space, singular positions included.

    Returns
    -------
    Aspects
        The components with their volumes; ``signs`` is empty.

    Examples
    --------
    >>> from robotmodels.robots import load
    >>> free_components(load("planar_2r"), lambda q: abs(q[:, 1]) > 0.5, limits=False).count
    1
    """
    check_model(arm)
    return _divided(arm, None, False, limits, free, resolution)


def _divided(
    arm: RobotModel, factors: Factors | None, signed: bool, limits: bool, free: Any,
    resolution: int | None,
) -> Aspects:  # fmt: skip
    bounded, is_free = checked_flag(limits, "limits"), free_predicate(arm, free)
    columns = tuple(int(c) for c in joint_chain(arm).columns)
    free = kept_free(free)
    names = () if factors is None else factors.names
    if not columns or (signed and factors is None):
        return _none(arm, bounded, free, AspectStatus.NOT_DEFINED)
    parts = _apart(columns, factors, is_free is not None)
    needed = [j for joints, members in parts for j in joints if members or is_free is not None]
    ranges, circle = joint_ranges(arm, bounded, needed)
    groups = []
    for joints, members in parts:
        first, last = _CELLS.get(len(joints), (6, 6))
        if not members and is_free is None:
            first = last = 1  # no factor depends on these joints
        cells = first
        if resolution is not None or first > 1:
            cells = checked_resolution(resolution, first, len(joints))
        while True:
            group = _group(arm, joints, members, factors, is_free, ranges, circle, cells)
            if group.separates or resolution is not None or cells >= last:
                break
            cells = min(2 * cells, last)
        groups.append(group)
    return _products(arm, bounded, free, names, tuple(groups))


def _apart(
    columns: tuple[int, ...], factors: Factors | None, together: bool
) -> list[tuple[tuple[int, ...], tuple[int, ...]]]:
    """Groups of joints that share no factor, with the factors of each."""
    groups: list[tuple[set[int], set[int]]] = []
    if together:
        groups = [(set(columns), set())]
    for k, joints in enumerate(factors.joints if factors is not None else ()):
        own, members = set(joints), {k}
        for group in [g for g in groups if g[0] & own]:
            groups.remove(group)
            own |= group[0]
            members |= group[1]
        groups.append((own, members))
    for column in columns:
        if not any(column in joints for joints, _ in groups):
            groups.append(({column}, set()))
    return [(tuple(sorted(j)), tuple(sorted(m))) for j, m in groups]


def _group(
    arm: RobotModel, joints: tuple[int, ...], members: tuple[int, ...], factors: Factors | None,
    is_free: Free | None, ranges: Array, circle: NDArray[np.bool_], cells: int,
) -> Group:  # fmt: skip
    """The parts of the space of some joints, by connected cells of equal signs."""
    d = len(joints)
    low, high = ranges[list(joints)].T
    width = high - low
    low = np.where(np.isfinite(width), low, 0.0)  # a slide without limits, in one cell
    side = np.where(np.isfinite(width), width, 1.0) / cells
    closed = tuple(bool(circle[j]) for j in joints)
    axes = [a + h * (np.arange(cells) + 0.5) for a, h in zip(low, side, strict=True)]
    q = np.zeros((cells**d, arm.n))
    for j, mesh in zip(joints, np.meshgrid(*axes, indexing="ij"), strict=True):
        q[:, j] = mesh.ravel()
    shape = (cells,) * d
    code = np.zeros(shape, np.int64)
    certain = np.ones(shape, np.bool_)
    if members:
        assert factors is not None
        values = factors.values(q)[:, list(members)].T.reshape(-1, *shape)
        for k, value in zip(members, values, strict=True):
            code |= (value > 0.0).astype(np.int64) << k
            certain &= core_cells(value, closed)
    if is_free is not None:
        flags = is_free(q).reshape(shape)
        code = np.where(flags, code, -1)
    labels, separates = connected(code, certain & (code >= 0), closed)
    count = int(labels.max())
    sizes = np.bincount(labels.ravel(), minlength=count + 1)[1:]
    codes = np.zeros(count, np.int64)
    codes[labels[labels > 0] - 1] = code[labels > 0]
    return Group(
        joints, read_only(low), read_only(side), closed, members, read_only(labels, np.int32),
        read_only(codes, np.int64), read_only(sizes * float(np.prod(width / cells))), separates,
    )  # fmt: skip


def _products(
    arm: RobotModel, limits: bool, free: Any, names: tuple[str, ...], groups: tuple[Group, ...]
) -> Aspects:
    """Aspects as products of the parts of all groups, largest first."""
    if any(len(g.volumes) == 0 for g in groups):
        return _none(arm, limits, free, AspectStatus.NO_FREE_SPACE)
    mesh = np.meshgrid(*(np.arange(len(g.volumes)) for g in groups), indexing="ij")
    order = np.stack([m.ravel() for m in mesh], axis=-1)
    volume = np.prod([g.volumes[order[:, k]] for k, g in enumerate(groups)], axis=0)
    code = np.zeros(len(order), np.int64)
    for k, group in enumerate(groups):
        code |= group.codes[order[:, k]]
    signs = np.where((code[:, None] >> np.arange(len(names))) & 1, 1, -1)
    rank = np.lexsort((code, -volume.round(9)))
    status = AspectStatus.FOUND
    if not all(g.separates for g in groups):
        status = AspectStatus.NOT_SEPARATED
    return Aspects(
        arm, limits, free, names, read_only(signs[rank], np.int8), read_only(volume[rank]), groups,
        read_only(order[rank] + 1, np.int64), status,
    )  # fmt: skip


def _none(arm: RobotModel, limits: bool, free: Any, status: AspectStatus) -> Aspects:
    return Aspects(
        arm, limits, free, (), read_only(np.zeros((0, 0)), np.int8), read_only(np.zeros(0)), (),
        read_only(np.zeros((0, 0)), np.int64), status,
    )  # fmt: skip
