"""Compiled: three joints that bring a point to a place, three that reach an orientation (Pieper).

The first: ``M_a E_1 M_b E_2 M_c w = p``. Joint a is eliminated by what it leaves alone (height and
distance if it turns, two coordinates if it slides); joint b by its sine and cosine, which leaves
an equation in joint c: of type 2 where the first two axes meet or are parallel, else a quartic.

D. L. Pieper, "The kinematics of manipulators under computer control", 1968.
"""

from __future__ import annotations

from math import atan2, cos, hypot, sin, sqrt
from typing import NamedTuple

import numpy as np
from numba import typeof, types

from ...kernels._compile import (
    INT,
    INTS,
    MATRIX,
    NOTHING,
    OUT2,
    OUT3,
    STACK,
    VECTOR,
    Floats,
    Ints,
    compiled,
)
from .chain import wrapped
from .equations import ANY, polynomial_roots, quadratic_roots, trigonometric_roots, type_2

LINKS = types.Array(types.float64, 4, "C", readonly=True)
COUNTS, MARKS = types.Array(types.int64, 1, "C"), types.Array(types.int64, 2, "C")
FLAGS, JOINT_FLAGS = (types.Array(types.boolean, ndim, "C") for ndim in (2, 3))
RANK = 1e-9  # coefficients of an unknown below which an equation is free of it
ALIGNED = 4e-13  # sine between axes below which any first angle is good to 1e-12
EXACT = 1e-13  # error of a point beside the length of the arm above which Newton steps follow
STEPS = 8  # at most
MERGE = 1e-6  # solutions closer than this in every joint are the same [rad, m]


class Scratch(NamedTuple):
    """Arrays that the solution of one pose works in, made once for all poses."""

    f: Floats  # (3, 3): coordinates of the point, functions of the last joint
    length: Floats  # (5,): their squared length
    row: Floats  # (2, 3): two equations free of the first joint
    b: Floats  # (2, 3): their right sides, functions of the last joint
    h: Floats  # (3, 4): other functions of the last joint
    g: Floats  # (5,): a product of two
    roots: Floats  # (8,)
    lengths: Floats  # (4,): roots for the joint in the middle
    work: Floats  # (3, 6): of the roots of a polynomial
    found: Floats  # (8, 2): values of the last joint and of the one in the middle
    x: Floats  # (8, 3): the three joints
    w: Floats  # (3,): the point behind the last joint
    p: Floats  # (3,): where it is to be
    marks: Ints  # (8,): 2 and 4 where the last joint and the one in the middle are free
    free: Ints  # (8,): bits 1, 2, 4 for joints that took their reference


def scratch() -> Scratch:
    """Room to work in, for `position_solutions` and its like."""
    shapes = (3, 3), 5, (2, 3), (2, 3), (3, 4), 5, 8, 4, (3, 6), (8, 2), (8, 3), 3, 3
    return Scratch(*map(np.zeros, shapes), *np.zeros((2, 8), np.int64))  # type: ignore[call-arg]


SCRATCH = typeof(scratch())
Limits = tuple[float, float]


@compiled(counted=False)
def advance(P: Floats, turning: bool, x: float, E: Floats, out: Floats) -> None:
    """``out = P M(x) E`` for poses as 3x4 arrays."""
    c, s = (cos(x), sin(x)) if turning else (1.0, 0.0)
    r = 0.0 if turning else x
    for i in range(3):
        a, b, d = c * P[i, 0] + s * P[i, 1], c * P[i, 1] - s * P[i, 0], P[i, 2]
        for j in range(4):
            out[i, j] = a * E[0, j] + b * E[1, j] + d * E[2, j]
        out[i, 3] += r * d + P[i, 3]


@compiled(counted=False)
def add_product(
    a: Floats, i: int, b: Floats, j: int, turning: bool, sign: float, out: Floats
) -> None:
    """Add the product of row i of a and row j of b, functions of the last joint, to ``out``.

    Over 1, cos, sin they give 1, cos, sin, cos 2, sin 2; over 1, r, r^2 the powers up to r^4.
    """
    if turning:
        a0, a1, a2, b0, b1, b2 = a[i, 0], a[i, 1], a[i, 2], b[j, 0], b[j, 1], b[j, 2]
        out[0] += sign * (a0 * b0 + 0.5 * (a1 * b1 + a2 * b2))
        out[1] += sign * (a0 * b1 + a1 * b0)
        out[2] += sign * (a0 * b2 + a2 * b0)
        out[3] += sign * 0.5 * (a1 * b1 - a2 * b2)
        out[4] += sign * 0.5 * (a1 * b2 + a2 * b1)
    else:
        for m in range(3):
            for n in range(3):
                out[m + n] += sign * a[i, m] * b[j, n]


@compiled(counted=False)
def basis(turning: bool, x: float) -> tuple[float, float]:
    """What the coefficients of a function of the last joint stand over, but for 1."""
    return (cos(x), sin(x)) if turning else (x, x * x)


@compiled(counted=False)
def value(a: Floats, i: int, u: float, v: float) -> float:
    """Value of row i, a function of the last joint, where its basis is u, v."""
    return a[i, 0] + u * a[i, 1] + v * a[i, 2]


@compiled(counted=False, inlined=True)
def roots_of_product(work: Scratch, turning: bool, slack: float) -> int:
    """Roots of ``work.g``, a product of two functions of the last joint."""
    if turning:
        return trigonometric_roots(work.g, work.roots, work.work, slack)
    return polynomial_roots(work.g, work.roots, work.work)


@compiled(counted=False)
def roots_of_linear(
    a: Floats, i: int, turning: bool, roots: Floats, slack: float, zero: float
) -> int:
    """Roots of row i, a function of the last joint itself; -1 if every value is one."""
    if turning:
        kind, roots[0], roots[1] = type_2(a[i, 2], a[i, 1], -a[i, 0], slack, zero)
        return -1 if kind == ANY else kind
    if abs(a[i, 2]) > zero:
        return quadratic_roots(a[i, 2], a[i, 1], a[i, 0], roots)
    if abs(a[i, 1]) > zero:
        roots[0] = -a[i, 0] / a[i, 1]
        return 1
    return -1 if abs(a[i, 0]) <= slack else 0


@compiled(counted=False, inlined=True)
def point_solutions(
    kinds: Ints, E1: Floats, E2: Floats, limits: Limits, reference: Floats, work: Scratch
) -> int:
    """All ``x (m, 3)`` with ``M_a E_1 M_b E_2 M_c w = p``, all in ``work``. Returns how many.

    ``limits``: length of the arm, and relative overshoot of a double root.
    """
    # free[i] gets a bit (1, 2, 4) for each joint whose value was taken from the reference
    last, middle, first = kinds[2] == 0, kinds[1] == 0, kinds[0] == 0
    size, zero = limits[0], 1e-11 * limits[0]
    f, length, row, b, x, w, p = work.f, work.length, work.row, work.b, work.x, work.w, work.p
    # f = E_2 M_c w and its squared length, functions of the last joint
    for i in range(5):
        length[i] = 0.0
    for i in range(3):
        f[i, 0] = E2[i, 2] * w[2] + E2[i, 3]
        if last:
            f[i, 1] = E2[i, 0] * w[0] + E2[i, 1] * w[1]
            f[i, 2] = E2[i, 1] * w[0] - E2[i, 0] * w[1]
        else:
            f[i, 0] += E2[i, 0] * w[0] + E2[i, 1] * w[1]
            f[i, 1], f[i, 2] = E2[i, 2], 0.0
        add_product(f, i, f, i, last, 1.0, length)
    # two equations row.y + lam |y|^2 = k in y = M_b f, free of the first joint
    lam = 1.0 / (2.0 * size) if first else 0.0
    k0, k1 = p[2] - E1[2, 3] if first else p[0] - E1[0, 3], 0.0 if first else p[1] - E1[1, 3]
    for i in range(3):
        row[0, i], row[1, i] = E1[2, i] if first else E1[0, i], 0.0 if first else E1[1, i]
        if first:
            k1 += (p[i] * p[i] - E1[i, 3] * E1[i, 3]) * lam
            for j in range(3):
                row[1, i] += E1[j, i] * E1[j, 3] / size
    # b: what is left of k without the parts that the middle joint does not change
    for m in range(3):
        b[0, m], b[1, m] = (k0, k1) if m == 0 else (0.0, 0.0)
        b[1, m] -= lam * length[m]
        for i in range(2):
            b[i, m] -= row[i, 2] * f[2, m]
            if not middle:
                b[i, m] -= row[i, 0] * f[0, m] + row[i, 1] * f[1, m]
    if middle:
        count = turning_pair(last, limits, reference, work)
    else:
        count = sliding_pair(lam, last, limits, reference, work)
    on_axis = first and hypot(p[0], p[1]) <= zero
    for i in range(count):
        xc, xb = work.found[i, 0], work.found[i, 1]
        u, v = basis(last, xc)
        y0, y1, y2 = value(f, 0, u, v), value(f, 1, u, v), value(f, 2, u, v)
        if middle:
            c, s = cos(xb), sin(xb)
            y0, y1 = c * y0 - s * y1, s * y0 + c * y1
        else:
            y2 += xb
        x[i, 1], x[i, 2], work.free[i] = xb, xc, work.marks[i]
        if not first:
            x[i, 0] = p[2] - (E1[2, 0] * y0 + E1[2, 1] * y1 + E1[2, 2] * y2 + E1[2, 3])
        elif on_axis:
            # asked of the goal: there two solutions merge, and joints are good to half the digits
            x[i, 0] = reference[0]
            work.free[i] |= 1
        else:
            h0 = E1[0, 0] * y0 + E1[0, 1] * y1 + E1[0, 2] * y2 + E1[0, 3]
            h1 = E1[1, 0] * y0 + E1[1, 1] * y1 + E1[1, 2] * y2 + E1[1, 3]
            x[i, 0] = angle_between(h0, h1, p[0], p[1])
    return count


@compiled(counted=False)
def angle_between(a0: float, a1: float, b0: float, b1: float) -> float:
    """The turn that brings the direction a to b, in (-pi, pi]."""
    return atan2(a0 * b1 - a1 * b0, a0 * b0 + a1 * b1)


@compiled(counted=False)
def turning_pair(last: bool, limits: Limits, reference: Floats, work: Scratch) -> int:
    """Two equations in two joints, ``row_i . Rot(x_b) (f_x, f_y) = b_i``: eliminate the turn x_b.

    ``b`` and ``f`` are functions of the other joint x_c. Writes pairs (x_c, x_b) to ``found``,
    bits 4 and 2 to ``marks`` where they are free; returns how many.
    """
    f, row, b, h, g = work.f, work.row, work.b, work.h, work.g
    roots, found, marks = work.roots, work.found, work.marks
    (size, slack), zero = limits, 1e-11 * limits[0]
    n0, n1 = hypot(row[0, 0], row[0, 1]), hypot(row[1, 0], row[1, 1])
    det = row[0, 0] * row[1, 1] - row[0, 1] * row[1, 0]
    count, mark = 0, 0
    if abs(det) > RANK * max(n0, n1):
        # |B b|^2 = f_x^2 + f_y^2 with B the inverse of the two rows: Pieper's quartic
        for m in range(3):
            h[0, m] = (row[1, 1] * b[0, m] - row[0, 1] * b[1, m]) / det
            h[1, m] = (row[0, 0] * b[1, m] - row[1, 0] * b[0, m]) / det
        for m in range(5):
            g[m] = 0.0
        for i in range(2):
            add_product(h, i, h, i, last, 1.0, g)
            add_product(f, i, f, i, last, -1.0, g)
        count = roots_of_product(work, last, slack * size * size)
        for i in range(count):
            u, v = basis(last, roots[i])
            fx, fy = value(f, 0, u, v), value(f, 1, u, v)
            found[i, 0], found[i, 1], marks[i] = roots[i], reference[1], 2
            if hypot(fx, fy) > zero:
                found[i, 1] = angle_between(fx, fy, value(h, 0, u, v), value(h, 1, u, v))
                marks[i] = 0
        return count
    # the rows are parallel (axes that meet, or are parallel): one combination of the equations
    # is free of the second joint
    main = 0 if n0 >= n1 else 1
    other = 1 - main
    amplitude = max(n0, n1)
    if amplitude <= RANK:
        return 0  # the first two axes coincide: the arm is redundant here
    ratio = (row[other, 0] * row[main, 0] + row[other, 1] * row[main, 1]) / amplitude**2
    for m in range(3):
        h[0, m] = b[other, m] - ratio * b[main, m]
    outer = roots_of_linear(h, 0, last, roots, slack * size, zero)
    if outer < 0:
        roots[0], outer, mark = reference[2], 1, 4
    for i in range(outer):
        u, v = basis(last, roots[i])
        fx, fy = value(f, 0, u, v), value(f, 1, u, v)
        # row . (c f_x - s f_y, s f_x + c f_y) = b
        X = row[main, 1] * fx - row[main, 0] * fy
        Y = row[main, 0] * fx + row[main, 1] * fy
        kind, t0, t1 = type_2(X, Y, value(b, main, u, v), slack * size, zero)
        for j in range(1 if kind == ANY else kind):
            found[count, 0], found[count, 1], marks[count] = roots[i], t0 if j == 0 else t1, mark
            if kind == ANY:
                found[count, 1], marks[count] = reference[1], mark | 2
            count += 1
    return count


@compiled(counted=False)
def sliding_pair(lam: float, last: bool, limits: Limits, reference: Floats, work: Scratch) -> int:
    """The same with a sliding joint x_b: ``row_i z x_b + lam_i (2 f_z x_b + x_b^2) = b_i``.

    Only the second equation has the quadratic term, and only if the first joint turns.
    """
    f, row, b, h, g = work.f, work.row, work.b, work.h, work.g
    roots, lengths, found, marks = work.roots, work.lengths, work.found, work.marks
    (size, slack), zero = limits, 1e-11 * limits[0]
    count, mark = 0, 0
    main = 0 if lam > 0.0 or abs(row[0, 2]) >= abs(row[1, 2]) else 1
    other = 1 - main
    if abs(row[main, 2]) > RANK:
        # the slide (row 0 of h) from the main equation into the other one
        for m in range(3):
            h[0, m] = b[main, m] / row[main, 2]
            if lam > 0.0:
                h[1, m] = lam * (2.0 * f[2, m] + h[0, m]) + (row[other, 2] if m == 0 else 0.0)
            else:
                h[1, m] = b[other, m] - row[other, 2] * h[0, m]
        if lam > 0.0:
            for m in range(5):
                g[m] = -b[other, m] if m < 3 else 0.0
            add_product(h, 1, h, 0, last, 1.0, g)
            outer = roots_of_product(work, last, slack * size)
        else:
            outer = roots_of_linear(h, 1, last, roots, slack * size, zero)
        if outer < 0:
            roots[0], outer, mark = reference[2], 1, 4
        for i in range(outer):
            u, v = basis(last, roots[i])
            found[i, 0], found[i, 1], marks[i] = roots[i], value(h, 0, u, v), mark
        return outer
    if lam == 0.0:
        return 0  # both joints slide along the same line: redundant
    # the first equation is free of the slide: it gives the last joint, the second the slide
    outer = roots_of_linear(b, main, last, roots, slack * size, zero)
    if outer < 0:
        roots[0], outer, mark = reference[2], 1, 4
    for i in range(outer):
        u, v = basis(last, roots[i])
        linear = row[other, 2] + 2.0 * lam * value(f, 2, u, v)
        for j in range(quadratic_roots(lam, linear, -value(b, other, u, v), lengths)):
            found[count, 0], found[count, 1], marks[count] = roots[i], lengths[j], mark
            count += 1
    return count


@compiled(counted=False)
def wrist_postures(
    A: Floats, B: Floats, M: Floats, slack: float, first: float, x: Floats, free: Ints, R: Floats
) -> int:
    """The (at most two) ``x (m, 3)`` with ``Rz(x_0) A Rz(x_1) B Rz(x_2) = M``. Returns how many.

    Where first and last axis are aligned, the first angle is free (``free[i] = 1``) and ``first``.
    Shapes: M, R (3, 3); R is room to work in.
    """
    m0, m1, m2 = M[0, 2], M[1, 2], M[2, 2]
    n0, n1, n2 = B[0, 2], B[1, 2], B[2, 2]
    X = A[0, 2] * m1 - A[1, 2] * m0
    Y = A[0, 2] * m0 + A[1, 2] * m1
    kind, one, two = type_2(X, Y, n2 - A[2, 2] * m2, max(slack, 1e-9), ALIGNED)
    count = 1 if kind == ANY else kind
    for i in range(count):
        a = first if kind == ANY else (one if i == 0 else two)
        free[i] = 1 if kind == ANY else 0
        c, s = cos(a), sin(a)
        # R = A^T Rz(-a) M, whose last column is Rz(b) n
        for j in range(3):
            u, v = c * M[0, j] + s * M[1, j], c * M[1, j] - s * M[0, j]
            for r in range(3):
                R[r, j] = A[0, r] * u + A[1, r] * v + A[2, r] * M[2, j]
        b = atan2(R[1, 2], R[0, 2]) - atan2(n1, n0)
        c, s = cos(b), sin(b)
        # the first column of B^T Rz(-b) R = Rz(c) is enough
        u, v = c * R[0, 0] + s * R[1, 0], c * R[1, 0] - s * R[0, 0]
        x[i, 0], x[i, 1] = a, b
        x[i, 2] = atan2(
            B[0, 1] * u + B[1, 1] * v + B[2, 1] * R[2, 0],
            B[0, 0] * u + B[1, 0] * v + B[2, 0] * R[2, 0],
        )
    return count


FLOAT = types.float64


@compiled(
    NOTHING(LINKS, STACK, INT, INTS, VECTOR, FLOAT, FLOAT, MATRIX, SCRATCH, OUT3, MARKS, COUNTS)
)
def concurrent_postures(
    links: Floats,
    pair: Floats,
    backwards: int,
    kinds: Ints,
    meeting: Floats,
    size: float,
    slack: float,
    references: Floats,
    work: Scratch,
    q: Floats,
    free: Ints,
    counts: Ints,
) -> None:
    """Candidates ``q (N, 8, 6)`` of loops ``M_0 E_0 ... M_5 E_5 = 1`` whose axes 3, 4, 5 meet.

    Shapes: links (N, 6, 4, 4); ``meeting`` holds the height of the point on axis 3 and on axis 5.
    ``backwards`` solves the first three joints from the other end, with the links ``pair``.
    """
    x, marks = work.x, work.free
    start, end = (work.p, work.w) if backwards else (work.w, work.p)
    y, wrist_marks = np.zeros((2, 3)), np.zeros(2, np.int64)
    order, reference = np.zeros(3, np.int64), np.zeros(3)
    unit, limits = np.zeros((3, 4)), (size, slack)
    P, Q, M = np.zeros((3, 4)), np.zeros((3, 4)), np.zeros((3, 3))
    for i in range(3):
        unit[i, i] = 1.0
    for n in range(links.shape[0]):
        E = links[n]
        for i in range(3):
            start[i] = E[2, i, 2] * meeting[0] + E[2, i, 3]
            end[i] = E[5, 2, i] * meeting[1]
            for j in range(3):
                end[i] -= E[5, j, i] * E[5, j, 3]
        for i in range(3):
            order[i] = kinds[2 - i if backwards else i]
            reference[i] = -references[n, 2 - i] if backwards else references[n, i]
        three = pair if backwards else E
        m = point_solutions(order, three[0], three[1], limits, reference, work)
        count = 0
        for i in range(m):
            if backwards:
                x[i, 0], x[i, 1], x[i, 2] = -x[i, 2], -x[i, 1], -x[i, 0]
                marks[i] = ((marks[i] & 1) << 2) | (marks[i] & 2) | (marks[i] >> 2)
            advance(unit, kinds[0] == 0, x[i, 0], E[0], P)
            advance(P, kinds[1] == 0, x[i, 1], E[1], Q)
            advance(Q, kinds[2] == 0, x[i, 2], E[2], P)
            for r in range(3):
                for s in range(3):
                    M[r, s] = P[0, r] * E[5, s, 0] + P[1, r] * E[5, s, 1] + P[2, r] * E[5, s, 2]
            first = references[n, 3]
            for j in range(wrist_postures(E[3], E[4], M, slack, first, y, wrist_marks, work.h)):
                if count == 8:
                    break
                for r in range(3):
                    q[n, count, r], q[n, count, 3 + r] = x[i, r], y[j, r]
                free[n, count] = marks[i] | (wrist_marks[j] << 3)
                count += 1
        counts[n] = count


@compiled(counted=False)
def improved_point(
    kinds: Ints, E1: Floats, size: float, n: int, work: Scratch
) -> tuple[float, float]:
    """Newton steps on solution n, in place: error, and determinant of the Jacobian."""
    f, J, x, p = work.f, work.h, work.x[n], work.p
    a, b, c = x[0], x[1], x[2]
    least, least_det = np.inf, 0.0
    for _ in range(STEPS):
        u, v = basis(kinds[2] == 0, c)
        du, dv = (-v, u) if kinds[2] == 0 else (1.0, 0.0)
        # f, its derivative by the last joint, and the one of M_b f by the joint in the middle
        y0, y1, y2 = value(f, 0, u, v), value(f, 1, u, v), value(f, 2, u, v)
        d0, d1 = du * f[0, 1] + dv * f[0, 2], du * f[1, 1] + dv * f[1, 2]
        d2 = du * f[2, 1] + dv * f[2, 2]
        t0, t1, t2 = 0.0, 0.0, 1.0
        if kinds[1] == 0:
            cb, sb = cos(b), sin(b)
            y0, y1 = cb * y0 - sb * y1, sb * y0 + cb * y1
            d0, d1 = cb * d0 - sb * d1, sb * d0 + cb * d1
            t0, t1, t2 = -y1, y0, 0.0
        else:
            y2 += b
        # the Jacobian and what is missing, seen from the first joint after its motion
        for i in range(3):
            J[i, 0] = 0.0
            J[i, 1] = E1[i, 0] * t0 + E1[i, 1] * t1 + E1[i, 2] * t2
            J[i, 2] = E1[i, 0] * d0 + E1[i, 1] * d1 + E1[i, 2] * d2
            J[i, 3] = E1[i, 0] * y0 + E1[i, 1] * y1 + E1[i, 2] * y2 + E1[i, 3]
        if kinds[0] == 0:
            ca, sa = cos(a), sin(a)
            J[0, 0], J[1, 0] = -J[1, 3], J[0, 3]
            J[0, 3], J[1, 3] = ca * p[0] + sa * p[1] - J[0, 3], ca * p[1] - sa * p[0] - J[1, 3]
            J[2, 3] = p[2] - J[2, 3]
        else:
            J[2, 0] = 1.0
            J[0, 3], J[1, 3], J[2, 3] = p[0] - J[0, 3], p[1] - J[1, 3], p[2] - a - J[2, 3]
        error, det = sqrt(J[0, 3] ** 2 + J[1, 3] ** 2 + J[2, 3] ** 2), triple(J, 0, J, 1, J, 2)
        if not error < least:
            break
        x[0], x[1], x[2], least, least_det = a, b, c, error, det
        if error <= EXACT * size or abs(det) <= 1e-12:
            break
        a += triple(J, 3, J, 1, J, 2) / det
        b += triple(J, 0, J, 3, J, 2) / det
        c += triple(J, 0, J, 1, J, 3) / det
    return least, least_det


@compiled(counted=False)
def triple(A: Floats, i: int, B: Floats, j: int, C: Floats, k: int) -> float:
    """Determinant of the columns i of A, j of B, k of C (each with three rows)."""
    return (
        A[0, i] * (B[1, j] * C[2, k] - B[2, j] * C[1, k])
        + A[1, i] * (B[2, j] * C[0, k] - B[0, j] * C[2, k])
        + A[2, i] * (B[0, j] * C[1, k] - B[1, j] * C[0, k])
    )


@compiled(NOTHING(INTS, STACK, MATRIX, MATRIX, VECTOR, SCRATCH, types.Tuple((OUT3, OUT2, MARKS))))
def position_solutions(
    kinds: Ints,
    D: Floats,
    points: Floats,
    references: Floats,
    limits: Floats,
    work: Scratch,
    out: tuple[Floats, Floats, Ints],
) -> None:
    """Configurations of three joints that bring the tool's origin to points of R_0.

    Shapes: D (4, 4, 4); points, references (N, 3) -> q (N, 4, 3); residual, marks (N, 4).
    """
    # limits: length of the arm, relative overshoot of a double root, largest error. marks stay
    # negative in rows without a solution; bits 1, 2, 4: joints at their reference, 8: double root
    x, free, p, turning = work.x, work.free, work.p, 0
    (q, residual, marks), size, pair = out, limits[0], (limits[0], limits[1])
    for i in range(3):
        work.w[i] = D[3, i, 3]
        turning += 1 - kinds[i]
    for n in range(points.shape[0]):
        for i in range(3):
            p[i] = 0.0
            for j in range(3):
                p[i] += D[0, j, i] * (points[n, j] - D[0, j, 3])
        count = 0
        for i in range(point_solutions(kinds, D[1], D[2], pair, references[n], work)):
            error, det = improved_point(kinds, D[1], size, i, work)
            if not error <= limits[2]:
                continue
            same = -1
            for k in range(3):
                x[i, k] = wrapped(x[i, k]) if kinds[k] == 0 else x[i, k]
            for r in range(count):
                gap = 0.0
                for k in range(3):
                    d = x[i, k] - q[n, r, k]
                    gap = max(gap, abs(wrapped(d) if kinds[k] == 0 else d))
                if gap < MERGE:
                    same = r
            if same >= 0:
                marks[n, same] |= 8
            elif count < 4:
                for k in range(3):
                    q[n, count, k] = x[i, k]
                # two solutions in one: an isolated singular configuration
                double = free[i] == 0 and abs(det) <= MERGE * size**turning
                residual[n, count], marks[n, count] = error, 8 if double else free[i]
                count += 1
