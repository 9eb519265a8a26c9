"""Solutions of a chain as rows of a result: limits, order, status, in the model's columns."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array, read_only
from .by_plan import ByPlan
from .known import KnownArm
from .paul.layout import WITHIN_LIMITS
from .postures import Postures
from .solutions import posture_distance
from .status import IGMStatus

Flags = NDArray[np.bool_]

AT_LIMIT = 1e-9
"""What rounding may carry a solution over its limits [rad, m]."""
_UNLIMITED = 1e9


class Rows(NamedTuple):
    """Fields of an `IGMSolutions` for N poses, S rows a pose."""

    q: Array
    valid: Flags
    residual: Array
    inside: Flags
    code: NDArray[np.int16]
    status: NDArray[np.int8]
    labels: tuple[str, ...]
    double: Flags
    free: Flags
    family: Flags
    closest: Array | None = None
    missing: Array | None = None


class PlanRows(NamedTuple):
    """Result of the kernel of plans for N poses; ``most`` rows of each are in use.

    Shapes: q (N, S, n), residual (N, S), marks (N, 2 + 2 S).
    """

    arm: KnownArm
    batch: tuple[int, ...]
    q: Array
    residual: Array
    marks: NDArray[np.int64]
    most: int
    mode: int

    @property
    def plan(self) -> ByPlan:
        """Solver of the arm."""
        assert self.arm.plan is not None
        return self.arm.plan

    def rows(self) -> Rows:
        """The same as any other method has it: nothing is double, free or in a family."""
        S, most = self.q.shape[1], self.most
        code = self.marks[:, 2 : 2 + most]
        free, family = np.zeros((2, len(code), most, self.q.shape[2]), np.bool_)
        return Rows(
            q=self.q[:, :most],
            valid=code >= 0,
            residual=self.residual[:, :most],
            inside=self.marks[:, 2 + S : 2 + S + most] > 0,
            code=code.astype(np.int16),
            status=self.marks[:, 1].astype(np.int8),
            labels=self.plan.labels,
            double=np.zeros(code.shape, np.bool_),
            free=free,
            family=family,
        )

    def fields(self) -> tuple[Any, ...]:
        """Fields of an `IGMSolutions`."""
        arm = self.arm
        periodic = arm.never if self.mode & WITHIN_LIMITS else arm.turns
        return result_fields(self.batch, self.rows(), self.plan.method, periodic, (True,) * 6)


def result_fields(
    batch: tuple[int, ...], rows: Rows, method: str, periodic: Flags, mask: tuple[bool, ...]
) -> tuple[Any, ...]:
    """Fields of an `IGMSolutions` in their order, read-only."""

    def shaped(values: NDArray[Any] | None) -> NDArray[Any] | None:
        if values is None:
            return None
        array = np.ascontiguousarray(values).reshape((*batch, *values.shape[1:]))
        array.setflags(write=False)
        return array

    q, valid, residual, inside, code = map(shaped, rows[:5])
    double, free, family, closest, missing = map(shaped, rows[7:])
    return (
        q, valid, residual, inside, code, rows.labels, shaped(rows.status), double, free, family,
        method, periodic, read_only(mask, np.bool_), None, closest, missing,
    )  # fmt: skip


def arranged(
    found: Postures,
    code: NDArray[np.int16],
    labels: tuple[str, ...],
    columns: NDArray[np.int64],
    references: Array,
    given: bool,
    joints: Array,
    limits: bool,
) -> Rows:
    """Rows of a result; joints without a column do not move the tool and keep their reference.

    Shapes: code (N, S), columns (k,), references (N, n); joints (3, n): lower and upper limits,
    1 for revolute.
    """
    goal = references[:, None]
    lower, upper, revolute = joints[0], joints[1], joints[2] != 0.0
    q = np.repeat(goal, found.q.shape[1], axis=1)
    q[..., columns] = found.q
    if limits:
        both = (lower > -_UNLIMITED) & (upper < _UNLIMITED)
        middle = 0.5 * (np.where(both, lower, 0.0) + np.where(both, upper, 0.0))
        turned = turned_inside(q, lower, upper, goal if given else middle)
        q = np.where(revolute, turned, q)
    inside = found.valid & np.all((lower - AT_LIMIT <= q) & (q <= upper + AT_LIMIT), axis=-1)
    kept = inside if limits else found.valid
    distance = np.zeros(kept.shape)
    if given:
        distance = posture_distance(q, goal, revolute & (not limits))
    order = np.lexsort((code, np.where(kept, distance, np.inf)), axis=-1)
    count = kept.sum(axis=1)
    order = order[:, : count.max(initial=0)]
    valid = np.arange(order.shape[1]) < count[:, None]

    def sorted_rows(values: NDArray[Any], nothing: float) -> NDArray[Any]:
        """Values in the new order."""
        at = order.reshape(*order.shape, *(1,) * (values.ndim - 2))
        there = valid.reshape(at.shape)
        return np.where(there, np.take_along_axis(values, at, axis=1), values.dtype.type(nothing))

    free, family = np.zeros(q.shape, np.bool_), np.zeros(q.shape, np.bool_)
    free[..., columns] = found.free
    family[..., columns] = found.moving & ~found.free
    moving = np.any(found.moving | found.free, axis=-1)
    status = np.where(np.any(kept & moving, axis=1), IGMStatus.REACHED_FAMILY, IGMStatus.REACHED)
    # another member of a family may lie within the limits: left to a search
    dropped = np.any(found.valid, axis=1) & ~np.any(found.valid & moving, axis=1)
    nothing = np.where(dropped, IGMStatus.OUTSIDE_LIMITS, IGMStatus.NOT_CONVERGED)
    return Rows(
        q=sorted_rows(q, np.nan),
        valid=valid,
        residual=sorted_rows(found.residual, np.nan),
        inside=sorted_rows(inside, False),
        code=sorted_rows(code, -1),
        status=np.where(count > 0, status, nothing).astype(np.int8),
        labels=labels,
        double=sorted_rows(found.double, False),
        free=sorted_rows(free, False),
        family=sorted_rows(family, False),
    )


def turned_inside(x: Array, lower: Array, upper: Array, goal: Array) -> Array:
    """``x`` plus whole turns, inside the limits and nearest to ``goal`` there; NaN if none is."""
    turn = 2.0 * np.pi
    lowest = x - turn * np.floor((x - lower + AT_LIMIT) / turn)
    highest = x + turn * np.floor((upper + AT_LIMIT - x) / turn)
    lowest = np.where(lower > -_UNLIMITED, lowest, -np.inf)
    highest = np.where(upper < _UNLIMITED, highest, np.inf)
    nearest = np.clip(x + turn * np.round((goal - x) / turn), lowest, highest)
    return np.where(lowest <= highest, nearest, np.nan)


def put(rows: Rows, at: NDArray[np.int64], part: Rows) -> Rows:
    """Rows of a plan with those of some poses replaced by another solver's, of the same labels."""
    S, new_S = rows.q.shape[1], part.q.shape[1]

    def merged(old: NDArray[Any], new: NDArray[Any], nothing: float) -> NDArray[Any]:
        values = np.full((len(old), max(S, new_S), *old.shape[2:]), nothing, old.dtype)
        values[:, :S] = old
        values[at] = nothing
        values[at, :new_S] = new
        return values

    nothing = {"q": np.nan, "residual": np.nan, "code": -1}
    names = ("q", "valid", "residual", "inside", "code", "double", "free", "family")
    fields = {n: merged(getattr(rows, n), getattr(part, n), nothing.get(n, False)) for n in names}
    rows.status[at] = part.status
    found = rows._replace(labels=max(rows.labels, part.labels, key=len), **fields)
    if part.closest is None or part.missing is None:
        return found
    closest, missing = (np.full((len(rows.q), size), np.nan) for size in (rows.q.shape[2], 6))
    closest[at], missing[at] = part.closest, part.missing
    return found._replace(closest=closest, missing=missing)
