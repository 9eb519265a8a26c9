"""Arms with some joints locked: prepared once, asked for postures of the whole arm."""

from __future__ import annotations

from collections import OrderedDict
from threading import Lock

import numpy as np

from ..._arrays import Array
from ..lock import at_ends, locked_chain, stacked, whole_postures
from ..loop import JointChain
from ..solver import Found, Prepare, Solver, Tolerances, nothing_found, postures

KEPT = 128
"""Chains with locked joints that an arm remembers."""


class LockedArms:
    """Chains with locked joints that were prepared: the most recent ones of one arm."""

    def __init__(self, chain: JointChain, prepare: Prepare) -> None:
        self.chain, self.prepare = chain, prepare
        self._known: OrderedDict[tuple[int | float, ...], Solver | None] = OrderedDict()
        self._lock = Lock()

    def solver(self, positions: tuple[int, ...], values: tuple[float, ...]) -> Solver | None:
        """Solver of the chain with these joints locked; None if there is none."""
        key = (*positions, *values)
        with self._lock:
            if key in self._known:
                self._known.move_to_end(key)
                return self._known[key]
        if values:
            rest = locked_chain(self.chain, dict(zip(positions, values, strict=True)))
        else:
            first, last = values_at_ends(positions, np.zeros((1, len(positions))))
            rest, _ = at_ends(self.chain, np.eye(4)[None], first, last)
        solver = self.prepare(rest)
        with self._lock:
            self._known[key] = solver
            while len(self._known) > KEPT:
                self._known.popitem(last=False)
        return solver

    def __reduce__(self) -> tuple[type, tuple[JointChain, Prepare]]:
        return type(self), (self.chain, self.prepare)


def locked_postures(
    arms: LockedArms,
    positions: tuple[int, ...],
    values: Array,
    U: Array,
    references: Array,
    tolerances: Tolerances,
) -> Found:
    """Postures of the whole arm with joints locked at values that differ from pose to pose.

    Shapes: values (N, m), U (N, 4, 4), references (N, k).
    """
    N, chain = U.shape[0], arms.chain
    rest = np.setdiff1d(np.arange(chain.k), positions)
    parts, rows = [nothing_found(0, 1, rest.size)], [np.zeros(0, np.int64)]
    if at_an_end(positions, chain.k):
        inner = arms.solver(positions, ())
        if inner is not None:
            _, moved = at_ends(chain, U, *values_at_ends(positions, values))
            parts.append(postures(inner, moved, references[:, rest], tolerances))
            rows.append(np.arange(N))
    else:
        distinct, group = np.unique(values, axis=0, return_inverse=True)
        for v, row in enumerate(distinct):
            inner = arms.solver(positions, tuple(row.tolist()))
            at = np.flatnonzero(group.reshape(-1) == v)
            if inner is not None:
                parts.append(postures(inner, U[at], references[at][:, rest], tolerances))
                rows.append(at)
    found = stacked(parts, rows, N)
    return whole_postures(chain, U, np.array(positions), values, found, tolerances)


def at_an_end(positions: tuple[int, ...], k: int) -> bool:
    """Whether joints are the first or the last of a chain."""
    m = len(positions)
    return positions in (tuple(range(m)), tuple(range(k - m, k)))


def values_at_ends(positions: tuple[int, ...], values: Array) -> tuple[Array, Array]:
    """Values of joints at the first and at the last end of a chain."""
    none = values[:, :0]
    return (values, none) if positions[0] == 0 else (none, values)
