"""Joints of a redundant arm that move while the tool stands still."""

from __future__ import annotations

import numpy as np
from numba import types
from numpy.typing import NDArray

from ..kernels._compile import INTS, STACK, Floats, Ints, compiled
from ._check import forward, jacobian

DEPENDENT = 1e-9  # pivots beside the largest that count as zero
STILL = 1e-9  # speeds beside the largest that count as zero


@compiled(
    types.void(
        INTS, STACK, types.float64, STACK, types.Array(types.boolean, 2, "C", readonly=True),
        types.Array(types.boolean, 3, "C"),
    )
)  # fmt: skip
def moving_joints(
    sigma: Ints,
    D: Floats,
    length: float,
    q: Floats,
    wanted: NDArray[np.bool_],
    moving: NDArray[np.bool_],
) -> None:
    """Joints with a part in the null space of ``J (6, k)``, by elimination with full pivoting."""
    k = sigma.size
    P, axes, J = np.zeros((3, 4)), np.zeros((k, 6)), np.zeros((6, k))
    column = np.zeros(k, dtype=np.int64)
    null = np.zeros(k)
    for p in range(q.shape[0]):
        for s in range(q.shape[1]):
            if not wanted[p, s]:
                continue
            forward(sigma, D, q[p, s], P, axes)
            jacobian(sigma, P, axes, J)
            for i in range(3):
                for m in range(k):
                    J[i, m] /= length
            for m in range(k):
                column[m] = m
            rank, largest = 0, 0.0
            while rank < min(6, k):
                row, at, best = rank, rank, 0.0
                for i in range(rank, 6):
                    for m in range(rank, k):
                        if abs(J[i, column[m]]) > best:
                            best, row, at = abs(J[i, column[m]]), i, m
                largest = max(largest, best)
                if best <= DEPENDENT * largest:
                    break
                column[rank], column[at] = column[at], column[rank]
                for m in range(k):
                    J[rank, m], J[row, m] = J[row, m], J[rank, m]
                pivot = J[rank, column[rank]]
                for i in range(6):
                    if i != rank:
                        share = J[i, column[rank]] / pivot
                        for m in range(k):
                            J[i, m] -= share * J[rank, m]
                rank += 1
            for f in range(rank, k):
                fastest = 1.0
                for i in range(rank):
                    null[i] = -J[i, column[f]] / J[i, column[i]]
                    fastest = max(fastest, abs(null[i]))
                moving[p, s, column[f]] = True
                for i in range(rank):
                    if abs(null[i]) > STILL * fastest:
                        moving[p, s, column[i]] = True
