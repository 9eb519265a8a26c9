"""Six joints, three of them prismatic: the others give the orientation, these the position."""

from __future__ import annotations

from math import cos, sin

import numpy as np
from numba import types

from ..kernels._compile import INTS, MATRIX, OUT3, STACK, compiled
from .kernels.pieper import wrist_postures

_DEPENDENT = 1e-11  # what elimination leaves of a direction that depends on the others
_COUNTS = types.Array(types.int64, 1, "C")


@compiled()
def three_lengths(Z, g, reference, r):
    """``Z r = g`` for directions in the columns of ``Z (3, 3)``, both overwritten.

    Where directions depend on each other the first of them take their references. Whether a
    solution exists is left to the check on the chain.
    """
    used = np.zeros(3, dtype=np.int64)
    order = np.zeros(3, dtype=np.int64)
    rank = 0
    # the later joints follow the earlier ones, so that they are pivots first
    for column in (2, 1, 0):
        best = -1
        for i in range(3):
            if used[i] == 0 and (best < 0 or abs(Z[i, column]) > abs(Z[best, column])):
                best = i
        r[column] = reference[column]
        if abs(Z[best, column]) <= _DEPENDENT:
            continue
        used[best], order[rank] = column + 1, best
        rank += 1
        for i in range(3):
            if i != best:
                share = Z[i, column] / Z[best, column]
                for j in range(3):
                    Z[i, j] -= share * Z[best, j]
                g[i] -= share * g[best]
        if rank == 3:
            break
    for m in range(rank):
        row = order[m]
        column = used[row] - 1
        value = g[row]
        for j in range(3):
            known = True
            for i in range(3):
                known = known and used[i] != j + 1
            if known:
                value -= Z[row, j] * reference[j]
        r[column] = value / Z[row, column]


@compiled(
    types.void(STACK, INTS, INTS, STACK, STACK, types.float64, MATRIX, OUT3, _COUNTS)
)  # fmt: skip
def three_prismatic(poses, turning, sliding, D, rotations, slack, references, q, counts):
    """Candidate postures ``q (N, 2, 6)`` of arms with three prismatic joints.

    ``rotations (4, 3, 3)`` are the constant rotations before, between and after the revolute
    joints, whose numbers are in ``turning (3,)``; ``sliding (3,)`` has those of the others.
    """
    M, A, B = np.empty((3, 3)), rotations[1], rotations[2]
    x, free, reference = np.zeros((2, 3)), np.zeros(2, dtype=np.int64), np.zeros(3)
    Z, g, r, lengths = np.empty((3, 3)), np.empty(3), np.empty(3), np.zeros(3)
    P, T = np.empty((3, 4)), np.empty((3, 4))
    for n in range(poses.shape[0]):
        for i in range(3):
            reference[i] = references[n, turning[i]]
            lengths[i] = references[n, sliding[i]]
            for j in range(3):
                M[i, j] = 0.0
                for a in range(3):
                    for b in range(3):
                        M[i, j] += rotations[0, a, i] * poses[n, a, b] * rotations[3, j, b]
        counts[n] = wrist_postures(A, B, M, slack, reference, x, free)
        for way in range(counts[n]):
            for i in range(3):
                q[n, way, turning[i]] = x[way, i]
                q[n, way, sliding[i]] = 0.0
                for j in range(4):
                    P[i, j] = D[0, i, j]
            slides = 0
            for k in range(6):
                if slides < 3 and sliding[slides] == k:
                    for i in range(3):
                        Z[i, slides] = P[i, 2]
                    slides += 1
                c, s = cos(q[n, way, k]), sin(q[n, way, k])
                for i in range(3):
                    a, b, d = c * P[i, 0] + s * P[i, 1], c * P[i, 1] - s * P[i, 0], P[i, 2]
                    for j in range(4):
                        T[i, j] = a * D[k + 1, 0, j] + b * D[k + 1, 1, j] + d * D[k + 1, 2, j]
                    T[i, 3] += P[i, 3]
                for i in range(3):
                    for j in range(4):
                        P[i, j] = T[i, j]
            for i in range(3):
                g[i] = poses[n, i, 3] - P[i, 3]
            three_lengths(Z, g, lengths, r)
            for i in range(3):
                q[n, way, sliding[i]] = r[i]
