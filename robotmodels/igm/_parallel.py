"""Six turning joints, three in a row about parallel axes: the arms of Universal Robots and kin.

The loop is written ``M_0 E_0 M_1 E_1 M_2 E_2 M_3 E_3 M_4 E_4 M_5 E_5 = 1`` with the axes of joints
1, 2, 3 parallel; one of the constants holds the pose. What the three leave alone (the direction of
their axes and the height along them) gives joints 0 and 4, then 5; a planar triangle the rest.
"""

from __future__ import annotations

from math import atan2, cos, hypot, sin

import numpy as np
from numba import types

from ..kernels._compile import INT, MATRIX, OUT3, STACK, Floats, Ints, compiled
from .kernels.chain import wrapped
from .kernels.equations import ANY, DOUBLE, NONE, type_2
from .kernels.pieper import SCRATCH, Scratch, advance, roots_of_linear, turning_pair

_COUNTS = types.Array(types.int64, 1, "C")
_MARKS = types.Array(types.int64, 2, "C")
_ALIGNED = 1e-13  # sine between axis 5 and the three below which they count as parallel
_SQUARE = 1e-9  # cosine between axes that count as square


@compiled()
def close_loop(left: Floats, pose: Floats, inverted: int, right: Floats, out: Floats) -> None:
    """The constant that holds the pose: ``left pose right``, the pose inverted if asked."""
    middle = np.zeros((4, 4))
    middle[3, 3] = 1.0
    for i in range(3):
        for j in range(3):
            middle[i, j] = pose[j, i] if inverted else pose[i, j]
        if not inverted:
            middle[i, 3] = pose[i, 3]
    if inverted:
        for i in range(3):
            for j in range(3):
                middle[i, 3] -= pose[j, i] * pose[j, 3]
    for i in range(4):
        for j in range(4):
            total = 0.0
            for m in range(4):
                for k in range(4):
                    total += left[i, m] * middle[m, k] * right[k, j]
            out[i, j] = total


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
def reachable_first(T: Floats, E1: Floats, reach: Floats, reference: float, slack: float) -> float:
    """First angle nearest the reference at which the rest of a planar chain can close.

    The rest spans distances from ``reach[0]`` to ``reach[1]`` about the second axis.
    """
    best, gap = reference, -1.0
    c, s = cos(reference), sin(reference)
    # position of T seen from the second axis: E1^-1 M_1^-1 T
    p0, p1 = c * T[0, 3] + s * T[1, 3] - E1[0, 3], c * T[1, 3] - s * T[0, 3] - E1[1, 3]
    distance = hypot(p0, p1)
    if reach[0] <= distance <= reach[1]:
        return reference
    for i in range(2):
        # |Rot(-a) t - t_1|^2 = reach^2
        X = T[1, 3] * E1[0, 3] - T[0, 3] * E1[1, 3]
        Y = T[0, 3] * E1[0, 3] + T[1, 3] * E1[1, 3]
        total = T[0, 3] ** 2 + T[1, 3] ** 2 + E1[0, 3] ** 2 + E1[1, 3] ** 2
        kind, first, second = type_2(X, Y, 0.5 * (total - reach[i] ** 2), slack, 1e-300)
        if kind in (NONE, ANY):
            continue
        for angle in (first, second):
            away = abs(wrapped(angle - reference))
            if gap < 0.0 or away < gap:
                best, gap = reference + wrapped(angle - reference), away
    return best


@compiled()
def direction_seen(E: Floats, x0: float, alpha: Floats) -> float:
    """Direction of the parallel axes seen from behind joint 5; returns its part across axis 5."""
    c, s = cos(x0), sin(x0)
    a0, a1, a2 = E[0, 0, 2], E[0, 1, 2], E[0, 2, 2]
    a0, a1 = c * a0 - s * a1, s * a0 + c * a1
    for j in range(3):
        alpha[j] = a0 * E[5, j, 0] + a1 * E[5, j, 1] + a2 * E[5, j, 2]
    return hypot(alpha[0], alpha[1])


@compiled()
def _square_pairs(E: Floats, work: Scratch, slack: float, reference: float, alpha: Floats) -> int:
    """Joints 0 and 4 where axis 4 is square to both neighbours and axes 4 and 5 meet.

    Joint 0 is of type 2; the angle of joint 4 comes from both parts of the direction, because its
    cosine alone would lose half of the digits where axis 5 is nearly parallel to the three.
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
        found[count, 0], found[count, 1], marks[count] = roots[i], phase + half, mark
        count += 1
        if across > _ALIGNED:
            found[count, 0], found[count, 1], marks[count] = roots[i], phase - half, mark
            count += 1
    return count


@compiled()
def _planar_target(P: Floats, E: Floats, x4: float, x5: float, Q: Floats, T: Floats) -> None:
    """``T = P^-1 (E_3 M_4 E_4 M_5)^-1`` with ``P = E_5 M_0 E_0``: what joints 1 to 3 must do."""
    unit = np.eye(4)
    advance(unit, True, 0.0, E[3], Q)
    R = np.zeros((3, 4))
    advance(Q, True, x4, E[4], R)
    advance(R, True, x5, unit, Q)
    # T = (Q P)^-1
    for i in range(3):
        for j in range(3):
            R[i, j] = Q[i, 0] * P[0, j] + Q[i, 1] * P[1, j] + Q[i, 2] * P[2, j]
        R[i, 3] = Q[i, 0] * P[0, 3] + Q[i, 1] * P[1, 3] + Q[i, 2] * P[2, 3] + Q[i, 3]
    for i in range(3):
        T[i, 3] = 0.0
        for j in range(3):
            T[i, j] = R[j, i]
            T[i, 3] -= R[j, i] * R[j, 3]


@compiled()
def _planar_end(P: Floats, T: Floats) -> None:
    """``T = P^-1``: where the planar chain of four must end."""
    for i in range(3):
        T[i, 3] = 0.0
        for j in range(3):
            T[i, j] = P[j, i]
            T[i, 3] -= P[j, i] * P[j, 3]


@compiled()
def _undo(T: Floats, c: float, s: float, E: Floats, out: Floats) -> None:
    """``out = E^-1 Rz^-1 T``."""
    for j in range(4):
        u, v = c * T[0, j] + s * T[1, j], c * T[1, j] - s * T[0, j]
        w = T[2, j]
        if j == 3:
            u, v, w = u - E[0, 3], v - E[1, 3], w - E[2, 3]
        for i in range(3):
            out[i, j] = E[0, i] * u + E[1, i] * v + E[2, i] * w


@compiled(
    types.void(
        STACK,
        STACK,
        INT,
        MATRIX,
        MATRIX,
        INT,
        types.float64,
        types.float64,
        MATRIX,
        SCRATCH,
        OUT3,
        _MARKS,
        _COUNTS,
    )
)
def parallel_postures(
    poses: Floats,
    constants: Floats,
    slot: int,
    left: Floats,
    right: Floats,
    inverted: int,
    size: float,
    slack: float,
    references: Floats,
    work: Scratch,
    q: Floats,
    free: Ints,
    counts: Ints,
) -> None:
    """Candidate postures ``q (N, 8, 6)`` of each pose, in the order of the loop."""
    E = constants.copy()
    identity = np.eye(4)
    row, b, f, found, marks = work.row, work.b, work.f, work.found, work.marks
    f[:] = 0.0
    reference, planar = np.zeros(3), np.zeros(3)
    x, planar_marks = np.zeros((2, 3)), np.zeros(2, dtype=np.int64)
    P, Q, T, S = np.zeros((3, 4)), np.zeros((3, 4)), np.eye(4), np.eye(4)
    alpha, beta, reach = np.zeros(4), np.zeros(4), np.zeros(2)
    sense = constants[1, 2, 2] * constants[2, 2, 2]
    height = constants[1, 2, 3] + constants[1, 2, 2] * constants[2, 2, 3]
    zero, reaching = 1e-11 * size, slack * size * size
    for n in range(poses.shape[0]):
        close_loop(left, poses[n], inverted, right, E[slot])
        # alpha(x_0) M_5^-1 = beta(x_4): the third row of the planar motion, from both ends
        for i in range(3):
            row[0, i] = sense * E[4, i, 2]
            row[1, i] = sense * E[4, i, 3] / size
            f[i, 0] = E[3, 2, i]
        for i in range(2):
            if i == 0:
                k, w0, w1, w2 = 0.0, E[5, 2, 0], E[5, 2, 1], E[5, 2, 2]
            else:
                k = -(sense * E[3, 2, 3] + height)
                w0 = w1 = w2 = 0.0
                for j in range(3):
                    k -= E[0, j, 2] * E[0, j, 3]
                    w0 -= E[5, j, 0] * E[5, j, 3]
                    w1 -= E[5, j, 1] * E[5, j, 3]
                    w2 -= E[5, j, 2] * E[5, j, 3]
                k, w0, w1, w2 = k / size, w0 / size, w1 / size, w2 / size
            a0, a1, a2 = E[0, 0, 2], E[0, 1, 2], E[0, 2, 2]
            b[i, 0] = k + a2 * w2 - row[i, 2] * f[2, 0]
            b[i, 1] = a0 * w0 + a1 * w1
            b[i, 2] = a0 * w1 - a1 * w0
        square = (
            abs(f[2, 0]) < _SQUARE and abs(row[0, 2]) < _SQUARE
            and hypot(row[1, 0], row[1, 1]) < _SQUARE
        )  # fmt: skip
        if square:
            pairs = _square_pairs(E, work, slack, references[n, 0], alpha)
        else:
            reference[1], reference[2] = -references[n, 4], references[n, 0]
            pairs = turning_pair(True, 1.0, slack, 1e-11, reference, work)
        count = 0
        for i in range(pairs):
            x0, x4 = found[i, 0], -found[i, 1]
            amplitude = direction_seen(E, x0, alpha)
            c, s = cos(x4), sin(x4)
            v0, v1, v2 = E[3, 2, 0], E[3, 2, 1], E[3, 2, 2]
            v0, v1 = c * v0 + s * v1, c * v1 - s * v0
            for j in range(2):
                beta[j] = sense * (v0 * E[4, 0, j] + v1 * E[4, 1, j] + v2 * E[4, 2, j])
            # P = E_5 M_0 E_0, whose inverse ends the planar motion
            close_loop(identity, E[5], 0, identity, S)
            advance(S, True, x0, E[0], P)
            aligned = max(amplitude, hypot(beta[0], beta[1])) <= _ALIGNED
            if not aligned:
                # alpha Rz(-x_5) = beta
                x5 = atan2(beta[1], beta[0]) - atan2(alpha[1], alpha[0])
                _planar_target(P, E, x4, x5, Q, T)
                for j in range(3):
                    planar[j] = references[n, 1 + j]
                solved = triangle(T, E[1], E[2], reaching, zero, planar, x, planar_marks)
                for j in range(solved):
                    if count < 8:
                        q[n, count, 0], q[n, count, 4], q[n, count, 5] = x0, x4, x5
                        for m in range(3):
                            q[n, count, 1 + m] = x[j, m]
                        free[n, count] = (
                            (marks[i] & 4) >> 2 | (planar_marks[j] << 1) | (marks[i] & 2) << 3
                        )
                        count += 1
                continue
            # axis 5 is parallel to the three: a planar chain of four. Joint 1 takes its
            # reference, or the nearest angle at which joints 2, 3 and 5 can close the chain
            advance(identity, True, 0.0, E[3], Q)
            advance(Q, True, x4, E[4], S[:3])
            # M_1 E_1 M_2 E_2 M_3 S M_5 = P^-1 with S = E_3 M_4 E_4
            _planar_end(P, T)
            inner, outer = hypot(E[2, 0, 3], E[2, 1, 3]), hypot(S[0, 3], S[1, 3])
            reach[0], reach[1] = abs(inner - outer), inner + outer
            x1 = reachable_first(T, E[1], reach, references[n, 1], reaching)
            c, s = cos(x1), sin(x1)
            R = np.eye(4)
            _undo(T, c, s, E[1], R)
            for j in range(3):
                planar[j] = references[n, 2 + j]
            planar[2] = references[n, 5]
            solved = triangle(R, E[2], S, reaching, zero, planar, x, planar_marks)
            for j in range(solved):
                if count < 8:
                    q[n, count, 0], q[n, count, 1], q[n, count, 4] = x0, x1, x4
                    q[n, count, 2], q[n, count, 3], q[n, count, 5] = x[j, 0], x[j, 1], x[j, 2]
                    free[n, count] = 2 | (marks[i] & 4) >> 2
                    count += 1
        counts[n] = count
