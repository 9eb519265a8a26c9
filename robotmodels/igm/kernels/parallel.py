"""Compiled: six turning joints, three in a row about parallel axes: candidates.

The loop is ``M_0 E_0 M_1 E_1 ... M_5 E_5 = 1`` with the axes of joints 1, 2, 3 parallel; one of the
constants holds the pose. The direction of the three axes and the height along them, which the three
joints leave alone, give joints 0 and 4, then 5; a planar triangle gives the rest.
"""

from __future__ import annotations

from math import atan2, cos, hypot, sin

import numpy as np
from numba import types

from ...kernels._compile import MATRIX, NOTHING, OUT3, Floats, Ints, compiled
from .equations import ANY, DOUBLE, NONE, type_2
from .pieper import COUNTS, LINKS, MARKS, advance, turning_pair

ALIGNED = 1e-13  # sine between axis 5 and the three below which they count as parallel


@compiled()
def triangle(
    T: Floats,
    E1: Floats,
    E2: Floats,
    slack: float,
    zero: float,
    reference: Floats,
    x: Floats,
    marks: Ints,
) -> int:
    """``M_1 E_1 M_2 E_2 M_3 = T`` for parallel axes: the (at most two) ``x (2, 3)``.

    Returns how many; a bit (1, 2, 4) in ``marks`` for a joint that took its reference.
    """
    g0 = E1[0, 0] * E1[0, 3] + E1[1, 0] * E1[1, 3]
    g1 = E1[0, 1] * E1[0, 3] + E1[1, 1] * E1[1, 3]
    u0, u1 = E2[0, 3], E2[1, 3]
    t2 = T[0, 3] * T[0, 3] + T[1, 3] * T[1, 3]
    Z = 0.5 * (t2 - E1[0, 3] ** 2 - E1[1, 3] ** 2 - u0 * u0 - u1 * u1)
    kind, first, second = type_2(g1 * u0 - g0 * u1, g0 * u0 + g1 * u1, Z, slack, zero * zero)
    if kind == NONE:
        return 0
    count = 1 if kind in (ANY, DOUBLE) else 2
    for i in range(count):
        b = reference[1] if kind == ANY else (first if i == 0 else second)
        marks[i] = 2 if kind == ANY else 0
        c, s = cos(b), sin(b)
        v0, v1 = c * u0 - s * u1, s * u0 + c * u1
        f0 = E1[0, 0] * v0 + E1[0, 1] * v1 + E1[0, 3]
        f1 = E1[1, 0] * v0 + E1[1, 1] * v1 + E1[1, 3]
        if hypot(T[0, 3], T[1, 3]) <= zero:
            a = reference[0]
            marks[i] |= 1
        else:
            a = atan2(T[1, 3], T[0, 3]) - atan2(f1, f0)
        x[i, 0], x[i, 1] = a, b
        # the x axis of T seen from behind the second constant
        c, s = cos(a), sin(a)
        p0, p1 = c * T[0, 0] + s * T[1, 0], c * T[1, 0] - s * T[0, 0]
        r0, r1 = E1[0, 0] * p0 + E1[1, 0] * p1, E1[0, 1] * p0 + E1[1, 1] * p1
        c, s = cos(b), sin(b)
        p0, p1 = c * r0 + s * r1, c * r1 - s * r0
        r0, r1 = E2[0, 0] * p0 + E2[1, 0] * p1, E2[0, 1] * p0 + E2[1, 1] * p1
        x[i, 2] = atan2(r1, r0)
    return count


@compiled(NOTHING(LINKS, types.float64, types.float64, MATRIX, OUT3, MARKS, COUNTS))
def parallel_postures(
    links: Floats,
    size: float,
    slack: float,
    references: Floats,
    q: Floats,
    free: Ints,
    counts: Ints,
) -> None:
    """Candidates ``q (N, 8, 6)`` of loops with links (N, 6, 4, 4), in the order of the loop."""
    E, planar, x, marks_3 = (
        np.empty((6, 4, 4)),
        np.empty(3),
        np.empty((2, 3)),
        np.empty(2, np.int64),
    )
    row, b, f = np.zeros((2, 3)), np.zeros((2, 3)), np.zeros((3, 3))
    found, marks, reference = np.zeros((8, 2)), np.zeros(8, np.int64), np.zeros(3)
    P, Q, S, T = np.empty((3, 4)), np.empty((3, 4)), np.empty((3, 4)), np.empty((3, 4))
    alpha, beta, w = np.empty(3), np.empty(2), np.empty((2, 4))
    for n in range(links.shape[0]):
        for i in range(96):
            E[i // 16, i // 4 % 4, i % 4] = links[n, i // 16, i // 4 % 4, i % 4]
        # alpha(x_0) M_5^-1 = beta(x_4): the third row of the planar motion, from both ends
        sense = E[1, 2, 2] * E[2, 2, 2]
        height = E[1, 2, 3] + E[1, 2, 2] * E[2, 2, 3]
        w[0, 3], w[1, 3] = 0.0, -(sense * E[3, 2, 3] + height)
        for j in range(3):
            row[0, j], row[1, j], f[j, 0] = (
                sense * E[4, j, 2],
                sense * E[4, j, 3] / size,
                E[3, 2, j],
            )
            w[0, j], w[1, j] = E[5, 2, j], 0.0
            w[1, 3] -= E[0, j, 2] * E[0, j, 3]
            for m in range(3):
                w[1, j] -= E[5, m, j] * E[5, m, 3] / size
        w[1, 3] /= size
        for i in range(2):
            b[i, 0] = w[i, 3] + E[0, 2, 2] * w[i, 2] - row[i, 2] * f[2, 0]
            b[i, 1] = E[0, 0, 2] * w[i, 0] + E[0, 1, 2] * w[i, 1]
            b[i, 2] = E[0, 0, 2] * w[i, 1] - E[0, 1, 2] * w[i, 0]
        reference[1], reference[2] = -references[n, 4], references[n, 0]
        count = 0
        for i in range(turning_pair(row, b, f, True, 1.0, slack, 1e-11, reference, found, marks)):
            x0, x4 = found[i, 0], -found[i, 1]
            # the direction of the three axes behind joint 5 and before it
            c, s = cos(x0), sin(x0)
            a0, a1 = c * E[0, 0, 2] - s * E[0, 1, 2], s * E[0, 0, 2] + c * E[0, 1, 2]
            c, s = cos(x4), sin(x4)
            v0, v1 = c * E[3, 2, 0] + s * E[3, 2, 1], c * E[3, 2, 1] - s * E[3, 2, 0]
            for j in range(3):
                alpha[j] = a0 * E[5, j, 0] + a1 * E[5, j, 1] + E[0, 2, 2] * E[5, j, 2]
            for j in range(2):
                beta[j] = sense * (v0 * E[4, 0, j] + v1 * E[4, 1, j] + E[3, 2, 2] * E[4, 2, j])
            aligned = max(hypot(alpha[0], alpha[1]), hypot(beta[0], beta[1])) <= ALIGNED
            x5 = references[n, 5]
            if not aligned:
                x5 = atan2(beta[1], beta[0]) - atan2(alpha[1], alpha[0])
            # M_1 E_1 M_2 E_2 M_3 = T = (E_3 M_4 E_4 M_5 E_5 M_0 E_0)^-1
            advance(E[5], True, x0, E[0], P)
            advance(E[3], True, x4, E[4], Q)
            advance(Q, True, x5, P, S)
            for j in range(3):
                T[j, 3], planar[j] = 0.0, references[n, 1 + j]
                for m in range(3):
                    T[j, m] = S[m, j]
                    T[j, 3] -= S[m, j] * S[m, 3]
            solved = triangle(T, E[1], E[2], slack * size * size, 1e-11 * size, planar, x, marks_3)
            for j in range(min(solved, 8 - count)):
                q[n, count, 0], q[n, count, 4], q[n, count, 5] = x0, x4, x5
                for m in range(3):
                    q[n, count, 1 + m] = x[j, m]
                free[n, count] = (marks[i] & 4) >> 2 | marks_3[j] << 1 | (marks[i] & 2) << 3
                free[n, count] |= 32 if aligned else 0
                count += 1
        counts[n] = count
