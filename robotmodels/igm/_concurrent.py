"""Six joints, three of them turning about axes that meet in a point: Pieper's method.

The loop is written ``M_0 E_0 M_1 E_1 M_2 E_2 M_3 E_3 M_4 E_4 M_5 E_5 = 1`` with the axes of joints
3, 4, 5 meeting; one of the constants holds the pose. The meeting point gives the first three
joints (`point_postures`), the orientation the others (`wrist_postures`).
"""

from __future__ import annotations

from math import cos, sin

import numpy as np
from numba import types

from ..kernels._compile import INT, INTS, MATRIX, OUT3, STACK, VECTOR, Floats, Ints, compiled
from ._point import point_postures
from ._wrist import wrist_postures

_COUNTS = types.Array(types.int64, 1, "C")
_MARKS = types.Array(types.int64, 2, "C")


@compiled()
def advance(P: Floats, turning: bool, x: float, E: Floats, out: Floats) -> None:
    """``out = P M(x) E`` for poses as 3x4 arrays."""
    c, s = (cos(x), sin(x)) if turning else (1.0, 0.0)
    r = 0.0 if turning else x
    for i in range(3):
        a, b, d = c * P[i, 0] + s * P[i, 1], c * P[i, 1] - s * P[i, 0], P[i, 2]
        for j in range(4):
            out[i, j] = a * E[0, j] + b * E[1, j] + d * E[2, j]
        out[i, 3] += r * d + P[i, 3]


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


@compiled(
    types.void(
        STACK,
        STACK,
        INT,
        MATRIX,
        MATRIX,
        INT,
        INTS,
        INT,
        VECTOR,
        types.float64,
        types.float64,
        MATRIX,
        OUT3,
        _MARKS,
        _COUNTS,
    )
)
def concurrent_postures(
    poses: Floats,
    constants: Floats,
    slot: int,
    left: Floats,
    right: Floats,
    inverted: int,
    sigma: Ints,
    backwards: int,
    meeting: Floats,
    size: float,
    slack: float,
    references: Floats,
    q: Floats,
    free: Ints,
    counts: Ints,
) -> None:
    """Candidate postures ``q (N, 8, 6)`` of each pose, in the order of the loop.

    ``meeting`` holds the height of the meeting point on axis 3 and on axis 5; ``backwards`` solves
    the first three joints from the other end, where their last two axes are the simple pair.
    """
    E = constants.copy()
    x, marks = np.zeros((8, 3)), np.zeros(8, dtype=np.int64)
    y, wrist_marks = np.zeros((2, 3)), np.zeros(2, dtype=np.int64)
    kinds = np.zeros(3, dtype=np.int64)
    reference, wrist_reference = np.zeros(3), np.zeros(3)
    w, p = np.zeros(3), np.zeros(3)
    identity = np.eye(4)
    P, Q, M = np.zeros((3, 4)), np.zeros((3, 4)), np.zeros((3, 3))
    back_1, back_2 = np.eye(4), np.eye(4)
    for n in range(poses.shape[0]):
        close_loop(left, poses[n], inverted, right, E[slot])
        for i in range(3):
            w[i] = E[2, i, 2] * meeting[0] + E[2, i, 3]
            p[i] = E[5, 2, i] * meeting[1]
            for j in range(3):
                p[i] -= E[5, j, i] * E[5, j, 3]
            wrist_reference[i] = references[n, 3 + i]
        if backwards:
            close_loop(identity, E[1], 1, identity, back_1)
            close_loop(identity, E[0], 1, identity, back_2)
            for i in range(3):
                kinds[i] = sigma[2 - i]
                reference[i] = -references[n, 2 - i]
            found = point_postures(kinds, back_1, back_2, p, w, size, slack, reference, x, marks)
        else:
            for i in range(3):
                kinds[i] = sigma[i]
                reference[i] = references[n, i]
            found = point_postures(kinds, E[0], E[1], w, p, size, slack, reference, x, marks)
        count = 0
        for i in range(found):
            if backwards:
                x[i, 0], x[i, 1], x[i, 2] = -x[i, 2], -x[i, 1], -x[i, 0]
                mark = ((marks[i] & 1) << 2) | (marks[i] & 2) | ((marks[i] & 4) >> 2)
            else:
                mark = marks[i]
            advance(identity, sigma[0] == 0, x[i, 0], E[0], P)
            advance(P, sigma[1] == 0, x[i, 1], E[1], Q)
            advance(Q, sigma[2] == 0, x[i, 2], E[2], P)
            for r in range(3):
                for s in range(3):
                    M[r, s] = P[0, r] * E[5, s, 0] + P[1, r] * E[5, s, 1] + P[2, r] * E[5, s, 2]
            for j in range(wrist_postures(E[3], E[4], M, slack, wrist_reference, y, wrist_marks)):
                if count == 8:
                    break
                for m in range(3):
                    q[n, count, m] = x[i, m]
                    q[n, count, 3 + m] = y[j, m]
                free[n, count] = mark | (wrist_marks[j] << 3)
                count += 1
        counts[n] = count
