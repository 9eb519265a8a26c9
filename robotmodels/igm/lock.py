"""Joints that are locked: constants of a shorter chain, which another family solves."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import se3
from .._arrays import Array, read_only
from ..errors import InvalidValueError
from .check import checked
from .loop import JointChain
from .solver import Found, Prepare, Solver, Tolerances, nothing_found, postures

__all__ = [
    "Locked",
    "at_ends",
    "locked_chain",
    "motion",
    "prepare_locked",
    "stacked",
    "whole_postures",
]


def motion(sigma: int, value: ArrayLike) -> Array:
    """Motion of a joint along or about z."""
    value = np.asarray(value, dtype=np.float64)
    M = np.zeros((*value.shape, 4, 4))
    M[..., range(4), range(4)] = 1.0
    if sigma == 1:
        M[..., 2, 3] = value
    else:
        c, s = np.cos(value), np.sin(value)
        M[..., 0, 0], M[..., 0, 1], M[..., 1, 0], M[..., 1, 1] = c, -s, s, c
    return M


def locked_chain(chain: JointChain, locks: Mapping[int, float]) -> JointChain:
    """Chain with some joints replaced by constants."""
    for position, value in locks.items():
        if not 0 <= position < chain.k:
            raise InvalidValueError(
                f"locks: joints of this chain are 0 to {chain.k - 1}, got {position}."
            )
        if not np.isfinite(value):
            raise InvalidValueError(
                f"locks: expected a finite value for joint {position}, got {value}."
            )
    kept = [j for j in range(chain.k) if j not in locks]
    constant, D = chain.D[0], []
    for j in range(chain.k):
        if j in locks:
            constant = constant @ motion(int(chain.sigma[j]), locks[j]) @ chain.D[j + 1]
        else:
            D.append(constant)
            constant = chain.D[j + 1]
    D.append(constant)
    return JointChain(
        columns=read_only(chain.columns[kept], np.int64),
        sigma=read_only(chain.sigma[kept], np.int64),
        D=read_only(np.array(D)),
        base=chain.base,
    )


@dataclass(frozen=True, slots=True, eq=False)
class Locked:
    """Arm with locked joints. Shapes: positions (m,), values (V, m), which (N,)."""

    chain: JointChain
    positions: NDArray[np.int64]
    values: Array
    solvers: tuple[Solver, ...]
    which: NDArray[np.int64] | None

    @property
    def method(self) -> str:
        """The family in words."""
        one = self.positions.size == 1
        numbers = ", ".join(str(j + 1) for j in self.positions)
        return f"joint{'' if one else 's'} {numbers} locked; {self.solvers[0].method}"


def prepare_locked(
    chain: JointChain, locks: Mapping[int, ArrayLike], prepare: Prepare
) -> Locked | None:
    """Lock joints and prepare a solver of the others."""
    if not locks:
        raise InvalidValueError("locks: expected at least one joint, got none.")
    positions = read_only(sorted(locks), np.int64)
    columns = [np.asarray(locks[int(j)], dtype=np.float64) for j in positions]
    sizes = {column.shape for column in columns if column.ndim}
    if len(sizes) > 1 or any(len(size) > 1 for size in sizes):
        raise InvalidValueError(
            f"locks: expected a number or one for each pose (N,), got shapes {sorted(sizes)}."
        )
    table = np.stack(np.broadcast_arrays(*columns), axis=-1)
    which = None
    if sizes:
        table, which = np.unique(table, axis=0, return_inverse=True)
        which = read_only(which.reshape(-1), np.int64)
    values = read_only(np.atleast_2d(table))
    solvers = []
    for row in values:
        solver = prepare(
            locked_chain(chain, dict(zip(positions.tolist(), row.tolist(), strict=True)))
        )
        if solver is None:
            return None
        solvers.append(solver)
    if not solvers:  # no pose: any chain tells the method
        return None
    return Locked(chain, positions, values, tuple(solvers), which)


@postures.register
def _(solver: Locked, U: Array, references: Array, tolerances: Tolerances) -> Found:
    N = U.shape[0]
    rest = np.setdiff1d(np.arange(solver.chain.k), solver.positions)
    which = np.zeros(N, np.int64) if solver.which is None else solver.which
    parts = [
        postures(inner, U[which == v], references[which == v][:, rest], tolerances)
        for v, inner in enumerate(solver.solvers)
    ]
    found = stacked(parts, [np.flatnonzero(which == v) for v in range(len(parts))], N)
    return whole_postures(
        solver.chain, U, solver.positions, solver.values[which], found, tolerances
    )


def stacked(parts: list[Found], rows: list[NDArray[np.int64]], N: int) -> Found:
    """Combine the postures of different poses."""
    S = max(part.q.shape[1] for part in parts)
    out = nothing_found(N, S, parts[0].q.shape[2])
    for part, at in zip(parts, rows, strict=True):
        s = part.q.shape[1]
        for name in ("q", "valid", "residual", "double", "free", "family"):
            getattr(out, name)[at, :s] = getattr(part, name)
    return out


def whole_postures(
    chain: JointChain,
    U: Array,
    positions: NDArray[np.int64],
    values: Array,
    found: Found,
    tolerances: Tolerances,
) -> Found:
    """Postures of the whole chain from those of its other joints, checked on the whole chain.

    Shapes: U (N, 4, 4), positions (m,), values (N, m).
    """
    N, S = found.valid.shape
    rest = np.setdiff1d(np.arange(chain.k), positions)
    q = np.full((N, S, chain.k), np.nan)
    q[..., rest] = found.q
    q[..., positions] = np.where(found.valid[..., None], values[:, None], np.nan)
    held = np.zeros(q.shape, np.bool_)
    held[..., rest] = found.free
    held[..., positions] = found.valid[..., None]
    out = checked(chain, U, q, found.valid, tolerances, free=held, double=found.double)
    out.free[..., positions] = False
    # rows are packed in the order they came; a row that fell away moves the others up
    kept = _survivors(found.valid, out.valid, q, out.q, chain.sigma)
    out.family[...] = np.take_along_axis(found.family, kept, axis=1) & out.valid
    return out


def _survivors(
    before: NDArray[np.bool_],
    after: NDArray[np.bool_],
    q: Array,
    kept: Array,
    sigma: NDArray[np.int64],
) -> NDArray[np.int64]:
    """Row among the candidates that each posture came from, shape (N, S)."""
    if np.array_equal(before, after):
        return np.broadcast_to(np.arange(before.shape[1]), before.shape)
    way = np.abs(kept[:, :, None] - q[:, None])
    way = np.where(sigma == 0, np.abs(way - 2 * np.pi * np.round(way / (2 * np.pi))), way)
    return np.where(before[:, None], way.max(axis=-1), np.inf).argmin(axis=-1)


def at_ends(chain: JointChain, U: Array, first: Array, last: Array) -> tuple[JointChain, Array]:
    """Lock joints at the ends of a chain by moving the poses.

    Shapes: U (N, 4, 4), first (N, a), last (N, b) -> U (N, 4, 4).
    """
    a, b = first.shape[1], last.shape[1]
    middle = slice(a, chain.k - b)
    left = np.broadcast_to(np.eye(4), U.shape)
    right = np.broadcast_to(np.eye(4), U.shape)
    for j in range(a):
        left = left @ chain.D[j] @ motion(int(chain.sigma[j]), first[:, j])
    for i in range(b):
        j = chain.k - b + i
        right = right @ motion(int(chain.sigma[j]), last[:, i]) @ chain.D[j + 1]
    inner = JointChain(
        columns=read_only(chain.columns[middle], np.int64),
        sigma=read_only(chain.sigma[middle], np.int64),
        D=read_only(chain.D[a : chain.k - b + 1]),
        base=chain.base,
    )
    return inner, np.ascontiguousarray(se3.inverse(left) @ U @ se3.inverse(right))
