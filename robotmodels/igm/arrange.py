"""Solutions of a chain as rows of a result: limits, order, status, in the model's columns."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array, read_only
from .by_plan import ByPlan
from .families import KnownArm
from .paul.layout import AT_LIMIT, GIVEN, WITHIN_LIMITS
from .postures import Postures

Flags = NDArray[np.bool_]

_UNLIMITED = 1e9


class Rows(NamedTuple):
    """Fields of an `IGMSolutions` for N poses, in its order, S rows a pose."""

    q: Array
    valid: Flags
    residual: Array
    inside: Flags
    code: NDArray[np.int16]
    labels: tuple[str, ...]
    status: NDArray[np.int8]
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
        """The same rows as of other methods; none is double, free or in a family."""
        S, most = self.q.shape[1], self.most
        code = self.marks[:, 2 : 2 + most]
        free, family = np.zeros((2, len(code), most, self.q.shape[2]), np.bool_)
        inside, double = self.marks[:, 2 + S : 2 + S + most] > 0, np.zeros(code.shape, np.bool_)
        return Rows(
            self.q[:, :most], code >= 0, self.residual[:, :most], inside, code.astype(np.int16),
            self.plan.labels, self.marks[:, 1].astype(np.int8), double, free, family,
        )  # fmt: skip

    def fields(self) -> tuple[Any, ...]:
        """Fields of an `IGMSolutions`."""
        arm = self.arm
        periodic = arm.never if self.mode & WITHIN_LIMITS else arm.turns
        return result_fields(self.batch, self.rows(), self.plan.method, periodic, (True,) * 6)


def result_fields(
    batch: tuple[int, ...], rows: Rows, method: str, periodic: Flags, mask: tuple[bool, ...]
) -> tuple[Any, ...]:
    """Fields of an `IGMSolutions` in their order, read-only."""

    def shaped(values: Any) -> Any:
        if not isinstance(values, np.ndarray):
            return values
        array = np.ascontiguousarray(values).reshape((*batch, *values.shape[1:]))
        array.setflags(write=False)
        return array

    *fields, closest, missing = map(shaped, rows)
    return (*fields, method, periodic, read_only(mask, np.bool_), None, closest, missing)


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

    Solutions of one branch get codes of their own, in the order of their joints. Shapes: code
    (N, S), columns (k,), references (N, n); joints (3, n): lower and upper limits, 1 for revolute.
    """
    from .kernels.order import arranged_rows

    (N, S, _), n = found.q.shape, joints.shape[1]
    arrays = found.q, found.residual, found.double, found.free, found.moving
    q, residual = np.full((N, S, n), np.nan), np.full((N, S), np.nan)
    inside, double = np.zeros((2, N, S), np.bool_)
    free, family = np.zeros((2, N, S, n), np.bool_)
    codes, status = np.where(found.valid, code, -1).astype(np.int64), np.zeros(N, np.int64)
    out = q, residual, inside, double, free, family
    most = arranged_rows(
        tuple(map(np.ascontiguousarray, arrays)), columns, references, joints.ravel(), len(labels),
        GIVEN * given | WITHIN_LIMITS * limits, codes, status, out,
    )  # fmt: skip
    q, residual = (array[:, :most] for array in out[:2])
    inside, double, free, family = (array[:, :most] for array in out[2:])
    codes = codes[:, :most].astype(np.int16)
    last = int(codes.max(initial=0)) // len(labels)
    if labels == ("",):
        labels = tuple(str(rank + 1) for rank in range(last + 1))
    else:
        labels += tuple(f"{name} ({r + 1})" for r in range(1, last + 1) for name in labels)
    status = status.astype(np.int8)
    return Rows(q, codes >= 0, residual, inside, codes, labels, status, double, free, family)


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
    names = set(Rows._fields[:10]) - {"labels", "status"}
    fields = {n: merged(getattr(rows, n), getattr(part, n), nothing.get(n, False)) for n in names}
    rows.status[at] = part.status
    found = rows._replace(labels=max(rows.labels, part.labels, key=len), **fields)
    if part.closest is None or part.missing is None:
        return found
    closest, missing = (np.full((len(rows.q), size), np.nan) for size in (rows.q.shape[2], 6))
    closest[at], missing[at] = part.closest, part.missing
    return found._replace(closest=closest, missing=missing)
