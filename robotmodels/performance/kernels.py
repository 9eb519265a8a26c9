"""Compiled: the section of an arm of three joints, its singular curves, and products of Jacobians.

Joint variables of a section are those of the last two joints; the first is at zero, and the chain
starts in its frame, so that a turn or slide of it leaves the section as it is.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numba import types

from ..igm.kernels.pieper import advance
from ..kernels._compile import (
    INT,
    INTS,
    MATRIX,
    NOTHING,
    OUT1,
    OUT2,
    STACK,
    VECTOR,
    Floats,
    Ints,
    compiled,
)
from ..kernels.continuation import CLOSED, curve_of, curves_of, workspace

FLOAT = types.float64
VALUES = 9  # of a point of the section, see `section_values`


@compiled()
def triple(A: Floats, i: int, B: Floats, j: int, C: Floats, k: int) -> float:
    """Determinant of the columns i of A, j of B, k of C (each with three rows)."""
    return (
        A[0, i] * (B[1, j] * C[2, k] - B[2, j] * C[1, k])
        + A[1, i] * (B[2, j] * C[0, k] - B[0, j] * C[2, k])
        + A[2, i] * (B[0, j] * C[1, k] - B[1, j] * C[0, k])
    )


@compiled()
def section_point(
    kinds: Ints, D: Floats, a: float, b: float, T: Floats, J: Floats, H: Floats
) -> tuple[float, float, float]:
    """Jacobian of the point and its determinant, with the derivatives by the last two joints.

    Shapes: D (4, 4, 4) -> T (4, 3, 4), J, H (3, 3).
    """
    for i in range(3):
        for j in range(4):
            T[0, i, j] = D[0, i, j]
    for k in range(3):
        x = 0.0 if k == 0 else (a if k == 1 else b)
        advance(T[k], kinds[k] == 0, x, D[k + 1], T[k + 1])
    for k in range(3):
        for i in range(3):
            j, m = (i + 1) % 3, (i + 2) % 3
            J[i, k] = T[k, i, 2]
            if kinds[k] == 0:
                J[i, k] = T[k, j, 2] * (T[3, m, 3] - T[k, m, 3])
                J[i, k] -= T[k, m, 2] * (T[3, j, 3] - T[k, j, 3])
    slope_a, slope_b = 0.0, 0.0
    for by in range(1, 3):
        # the derivative of a column by a joint: the axis of the one nearer the base times the other
        for k in range(3):
            near, far = (by, k) if by < k else (k, by)
            for i in range(3):
                j, m = (i + 1) % 3, (i + 2) % 3
                H[i, k] = 0.0
                if kinds[near] == 0:
                    H[i, k] = T[near, j, 2] * J[m, far] - T[near, m, 2] * J[j, far]
        slope = triple(H, 0, J, 1, J, 2) + triple(J, 0, H, 1, J, 2) + triple(J, 0, J, 1, H, 2)
        if by == 1:
            slope_a = slope
        else:
            slope_b = slope
    return triple(J, 0, J, 1, J, 2), slope_a, slope_b


@compiled(NOTHING(INTS, STACK, MATRIX, OUT2))
def section_values(kinds: Ints, D: Floats, x: Floats, out: Floats) -> None:
    """Section coordinates, their derivatives, and the determinant. Shapes: x (N, 2) -> (N, 9).

    Columns: u, v; du/da, du/db, dv/da, dv/db; determinant and its derivatives by a and b.
    """
    T, J, H = np.empty((4, 3, 4)), np.empty((3, 3)), np.empty((3, 3))
    for n in range(x.shape[0]):
        det, slope_a, slope_b = section_point(kinds, D, x[n, 0], x[n, 1], T, J, H)
        px, py = T[3, 0, 3], T[3, 1, 3]
        if kinds[0] == 0:  # distance from the first axis, and height along it
            r = sqrt(px * px + py * py)
            out[n, 0], out[n, 1] = r, T[3, 2, 3]
            for k in range(2):
                out[n, 2 + k] = (px * J[0, k + 1] + py * J[1, k + 1]) / r if r > 0.0 else 0.0
                out[n, 4 + k] = J[2, k + 1]
        else:  # across the first axis
            out[n, 0], out[n, 1] = px, py
            for k in range(2):
                out[n, 2 + k], out[n, 4 + k] = J[0, k + 1], J[1, k + 1]
        out[n, 6], out[n, 7], out[n, 8] = det, slope_a, slope_b


@compiled()
def level_residual(x: Floats, data: tuple, F: Floats, J: Floats) -> None:
    """The determinant at a given level, in units of the arm."""
    kinds, D, level, unit, T, V, H = data
    det, slope_a, slope_b = section_point(kinds, D, x[0], x[1], T, V, H)
    F[0], F[1] = (det - level) / unit, 0.0
    J[0, 0], J[0, 1] = slope_a / unit, slope_b / unit
    J[1, 0] = J[1, 1] = 0.0


CURVES = curves_of(level_residual)
begin, trace = CURVES.begin, CURVES.trace


@compiled(INT(INTS, STACK, FLOAT, FLOAT, VECTOR, VECTOR, FLOAT, OUT2, OUT1))
def level_curve(
    kinds: Ints,
    D: Floats,
    level: float,
    unit: float,
    seed: Floats,
    periods: Floats,
    step: float,
    points: Floats,
    shut: Floats,
) -> int:
    """The curve of a level of the determinant through a seed; the number of its points.

    Shapes: seed, periods (2,) -> points (R, 2), shut (1,): whether the curve is closed.
    """
    rows = points.shape[0]
    data = (kinds, D, level, unit, np.empty((4, 3, 4)), np.empty((3, 3)), np.empty((3, 3)))
    curve, work = curve_of(rows, 2), workspace(2)
    limits = (1e-12, 1e-7, step, 1e9, 1e9)
    middle = rows // 2
    shut[0] = 0.0
    if not begin(data, seed, curve, middle, work, 1e-12) <= 1e-9:
        return 0
    last, why = trace(data, periods, curve, middle, 1, limits, work)
    first = middle
    if why == CLOSED:
        shut[0] = 1.0
    else:
        first, why = trace(data, periods, curve, middle, -1, limits, work)
    for k in range(first, last + 1):
        points[k - first, 0], points[k - first, 1] = curve[0][k, 0], curve[0][k, 1]
    return last - first + 1


@compiled(NOTHING(STACK, VECTOR, OUT2))
def gram_values(J: Floats, weights: Floats, out: Floats) -> None:
    """Determinant and trace of ``J J^T``, or of ``J^T J`` if smaller. Shapes: J (N, m, n), (N, 2).

    ``weights (m,)`` multiply the rows of J. By Cholesky factors.
    """
    N, m, n = J.shape
    k = min(m, n)
    G = np.empty((k, k))
    for s in range(N):
        det, trace_of = 1.0, 0.0
        for i in range(k):
            for j in range(i + 1):
                total = 0.0
                if m <= n:
                    for c in range(n):
                        total += J[s, i, c] * J[s, j, c]
                    total *= weights[i] * weights[j]
                else:
                    for c in range(m):
                        total += J[s, c, i] * J[s, c, j] * weights[c] * weights[c]
                if i == j:
                    trace_of += total
                for c in range(j):
                    total -= G[i, c] * G[j, c]
                if i == j:
                    G[i, i] = sqrt(max(total, 0.0))
                    det *= max(total, 0.0)
                else:
                    G[i, j] = total / G[j, j] if G[j, j] > 0.0 else 0.0
        out[s, 0], out[s, 1] = det, trace_of
