"""Compiled: six revolute joints, three in a row about parallel axes: Universal Robots and kin.

The loop is written ``M_0 E_0 M_1 E_1 M_2 E_2 M_3 E_3 M_4 E_4 M_5 E_5 = 1`` with the axes of joints
1, 2, 3 parallel; one of the constants holds the pose. What the three leave alone (the direction of
their axes and the height along them) gives joints 0 and 4, then 5; a planar triangle the rest.
"""

from __future__ import annotations

from math import atan2, cos, hypot, pi, sin

import numpy as np
from numba import types

from ...kernels._compile import MATRIX, NOTHING, OUT3, Floats, Ints, compiled
from .equations import ANY, DOUBLE, NONE, type_2
from .pieper import COUNTS, LINKS, MARKS, SCRATCH, Scratch, advance, roots_of_linear, turning_pair

_ALIGNED = 1e-13  # sine between axis 5 and the three below which they count as parallel
_SQUARE = 1e-9  # cosine between axes that count as square


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


@compiled()
def pair_equations(E: Floats, size: float, work: Scratch) -> None:
    """``alpha(x_0) M_5^-1 = beta(x_4)``, the third row of the planar motion, for `turning_pair`."""
    row, b, f = work.row, work.b, work.f
    sense = E[1, 2, 2] * E[2, 2, 2]
    k = -(sense * E[3, 2, 3] + E[1, 2, 3] + E[1, 2, 2] * E[2, 2, 3])
    for i in range(3):
        row[0, i], row[1, i] = sense * E[4, i, 2], sense * E[4, i, 3] / size
        f[i, 0], f[i, 1], f[i, 2] = E[3, 2, i], 0.0, 0.0
        k -= E[0, i, 2] * E[0, i, 3]
    a0, a1, a2 = E[0, 0, 2], E[0, 1, 2], E[0, 2, 2]
    for i in range(2):
        w0, w1, w2 = E[5, 2, 0], E[5, 2, 1], E[5, 2, 2]
        if i == 1:
            w0 = w1 = w2 = 0.0
            for j in range(3):
                w0 -= E[5, j, 0] * E[5, j, 3] / size
                w1 -= E[5, j, 1] * E[5, j, 3] / size
                w2 -= E[5, j, 2] * E[5, j, 3] / size
        b[i, 0] = a2 * w2 - row[i, 2] * f[2, 0] + (k / size if i == 1 else 0.0)
        b[i, 1] = a0 * w0 + a1 * w1
        b[i, 2] = a0 * w1 - a1 * w0


@compiled()
def direction_seen(E: Floats, x0: float, alpha: Floats) -> float:
    """Direction of the parallel axes seen from behind joint 5; returns its part across axis 5."""
    c, s = cos(x0), sin(x0)
    u, v, w = c * E[0, 0, 2] - s * E[0, 1, 2], s * E[0, 0, 2] + c * E[0, 1, 2], E[0, 2, 2]
    for j in range(3):
        alpha[j] = u * E[5, j, 0] + v * E[5, j, 1] + w * E[5, j, 2]
    return hypot(alpha[0], alpha[1])


@compiled()
def square_pairs(E: Floats, work: Scratch, slack: float, reference: float, alpha: Floats) -> int:
    """Joints 0 and 4 where axis 4 is square to both neighbours and axes 4 and 5 meet.

    The angle of joint 4 comes from both parts of the direction: its cosine alone would lose half
    of the digits where axis 5 is nearly parallel to the three.
    """
    row, f, roots, found, marks = work.row, work.f, work.roots, work.found, work.marks
    outer, mark = roots_of_linear(work.b, 1, True, roots, slack, 1e-11), 0
    if outer < 0:
        roots[0], outer, mark = reference, 1, 4
    phase = atan2(
        row[0, 1] * f[0, 0] - row[0, 0] * f[1, 0], row[0, 0] * f[0, 0] + row[0, 1] * f[1, 0]
    )
    count = 0
    for i in range(outer):
        across = direction_seen(E, roots[i], alpha)
        half = atan2(across, alpha[2])
        for side in range(2 if across > _ALIGNED else 1):
            found[count, 0], marks[count] = roots[i], mark
            found[count, 1] = phase + half if side == 0 else phase - half
            count += 1
    return count


@compiled(NOTHING(LINKS, types.float64, types.float64, MATRIX, SCRATCH, OUT3, MARKS, COUNTS))
def parallel_postures(
    links: Floats,
    size: float,
    slack: float,
    references: Floats,
    work: Scratch,
    q: Floats,
    free: Ints,
    counts: Ints,
) -> None:
    """Candidates ``q (N, 8, 6)`` of loops whose axes 1, 2, 3 are parallel; links (N, 6, 4, 4).

    Where axis 5 is parallel to the three, joint 5 takes its reference.
    """
    found, marks, unit = work.found, work.marks, np.eye(4)
    reference, x, planar_marks = np.zeros(3), np.zeros((2, 3)), np.zeros(2, np.int64)
    P, Q, T, alpha = np.zeros((3, 4)), np.zeros((3, 4)), np.zeros((3, 4)), np.zeros(3)
    beta = np.zeros(2)
    zero, reaching = 1e-11 * size, slack * size * size
    for n in range(links.shape[0]):
        E, count = links[n], 0
        pair_equations(E, size, work)
        row = work.row
        if (
            abs(E[3, 2, 2]) < _SQUARE and abs(row[0, 2]) < _SQUARE
            and hypot(row[1, 0], row[1, 1]) < _SQUARE
        ):  # fmt: skip
            pairs = square_pairs(E, work, slack, references[n, 0], alpha)
        else:
            reference[1], reference[2] = -references[n, 4], references[n, 0]
            pairs = turning_pair(True, (1.0, slack), reference, work)
        for i in range(pairs):
            x0, x4 = found[i, 0], -found[i, 1]
            # alpha Rz(-x_5) = beta
            x5, aligned = references[n, 5], direction_seen(E, x0, alpha) <= _ALIGNED
            if not aligned:
                c, s = cos(x4), sin(x4)
                u, v = c * E[3, 2, 0] + s * E[3, 2, 1], c * E[3, 2, 1] - s * E[3, 2, 0]
                for j in range(2):
                    beta[j] = u * E[4, 0, j] + v * E[4, 1, j] + E[3, 2, 2] * E[4, 2, j]
                sense = E[1, 2, 2] * E[2, 2, 2]
                x5 = atan2(sense * beta[1], sense * beta[0]) - atan2(alpha[1], alpha[0])
            # an aligned axis 5 takes its reference, or another angle at which the triangle closes
            for turn in range(8 if aligned else 1):
                last = x5 + 0.25 * pi * turn
                # E_3 M_4 E_4 M_5 E_5 M_0 E_0, whose inverse T is what joints 1 to 3 must do
                advance(unit, True, 0.0, E[3], P)
                advance(P, True, x4, E[4], Q)
                advance(Q, True, last, E[5], P)
                advance(P, True, x0, E[0], Q)
                for r in range(3):
                    T[r, 3] = 0.0
                    for s in range(3):
                        T[r, s] = Q[s, r]
                        T[r, 3] -= Q[s, r] * Q[s, 3]
                planar, kept = references[n, 1:4], aligned and turn == 0
                closed = triangle(T, E[1], E[2], reaching, zero, planar, x, planar_marks)
                for j in range(min(closed, 8 - count)):
                    q[n, count, 0], q[n, count, 4], q[n, count, 5] = x0, x4, last
                    for m in range(3):
                        q[n, count, 1 + m] = x[j, m]
                    free[n, count] = (marks[i] & 4) >> 2 | planar_marks[j] << 1 | kept << 5
                    free[n, count] |= (marks[i] & 2) << 3
                    count += 1
                if closed > 0:
                    break
        counts[n] = count
