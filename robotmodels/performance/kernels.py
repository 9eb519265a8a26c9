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
COUNTS = types.Array(types.int64, 1, "C")
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


@compiled()
def turned_order(
    P: Floats, members: Ints, count: int, normal: Floats, half: bool, angles: Floats
) -> None:
    """Sort members (rows of P) by their angle about a normal, of lines by the half turn."""
    for i in range(count):
        a, b, along, across = members[0], members[i], 0.0, 0.0
        for c in range(3):
            e, f = (c + 1) % 3, (c + 2) % 3
            along += P[a, c] * P[b, c]
            across += normal[c] * (P[a, e] * P[b, f] - P[a, f] * P[b, e])
        angle = np.arctan2(across, along)
        if half and (angle < -1e-12 or angle > np.pi - 1e-12):
            angle += np.pi if angle < 0.0 else -np.pi
        angles[i] = angle
    for i in range(1, count):
        j = i
        while j > 0 and angles[j - 1] > angles[j]:
            angles[j - 1], angles[j] = angles[j], angles[j - 1]
            members[j - 1], members[j] = members[j], members[j - 1]
            j -= 1


@compiled(FLOAT(MATRIX, FLOAT, OUT2, COUNTS, COUNTS, COUNTS))
def zonotope_faces(
    G: Floats, zero: float, vertices: Floats, corners: Ints, sizes: Ints, counts: Ints
) -> float:
    """Vertices and faces of the sums of rows of G (k, 3) times factors in [-1, 1]; the radius.

    ``corners`` holds the numbers of the vertices of all faces in turn, ``sizes`` how many each has,
    ``counts`` the numbers of vertices, faces and corners.
    """
    k = G.shape[0]
    number = np.full(1 << k, -1)
    sign, members, n = np.zeros(k), np.zeros(k, np.int64), np.zeros(3)
    angles, flip = np.zeros(k), np.zeros(k)
    radius, found, faces, used = np.inf, 0, 0, 0
    for i in range(k):
        for j in range(i + 1, k):
            length = 0.0
            for c in range(3):
                e, f = (c + 1) % 3, (c + 2) % 3
                n[c] = G[i, e] * G[j, f] - G[i, f] * G[j, e]
                length += n[c] * n[c]
            length, inside, height, first = sqrt(length), 0, 0.0, True
            for m in range(k):
                dot = (n[0] * G[m, 0] + n[1] * G[m, 1] + n[2] * G[m, 2]) / length
                height += abs(dot)
                sign[m] = 1.0 if dot > 0.0 else -1.0
                if m in (i, j) or abs(dot) <= zero:
                    if m < j and m != i:
                        first = False  # an earlier pair spans the same plane
                    members[inside] = m
                    inside += 1
            if not first:
                continue
            radius = min(radius, height)
            for c in range(3):
                n[c] /= length
            turned_order(G, members, inside, n, True, angles)
            base = members[0]
            for m in range(inside):
                # a column runs with or against its place in the half turn
                b, across, along = members[m], 0.0, 0.0
                for c in range(3):
                    e, f = (c + 1) % 3, (c + 2) % 3
                    along += G[base, c] * G[b, c]
                    across += n[c] * (G[base, e] * G[b, f] - G[base, f] * G[b, e])
                flip[m] = 1.0 if across > 0.0 or (abs(across) <= 1e-300 and along > 0.0) else -1.0
            for side in range(2):
                turn = 1.0 if side == 0 else -1.0
                for step in range(2 * inside):
                    for m in range(inside):
                        up = (m <= step) if step < inside else (m > step - inside)
                        sign[members[m]] = flip[m] if up else -flip[m]
                    code = 0
                    for m in range(k):
                        code |= (1 if sign[m] * turn > 0.0 else 0) << m
                    if number[code] < 0:
                        number[code] = found
                        for c in range(3):
                            vertices[found, c] = 0.0
                            for m in range(k):
                                vertices[found, c] += sign[m] * turn * G[m, c]
                        found += 1
                    corners[used] = number[code]
                    used += 1
                sizes[faces] = 2 * inside
                faces += 1
    counts[0], counts[1], counts[2] = found, faces, used
    return radius


@compiled(FLOAT(MATRIX, FLOAT, OUT2, COUNTS, COUNTS, COUNTS))
def strip_faces(
    A: Floats, zero: float, vertices: Floats, corners: Ints, sizes: Ints, counts: Ints
) -> float:
    """Vertices and faces of ``|A x| <= 1`` in space, A (n, 3); the radius. As `zonotope_faces`."""
    n = A.shape[0]
    x, angles, middle = np.zeros(3), np.zeros(vertices.shape[0]), np.zeros(3)
    members, P = np.zeros(vertices.shape[0], np.int64), np.zeros(vertices.shape)
    found, faces, used, longest = 0, 0, 0, 0.0
    for i in range(n):
        longest = max(longest, A[i, 0] ** 2 + A[i, 1] ** 2 + A[i, 2] ** 2)
        for j in range(i + 1, n):
            for m in range(j + 1, n):
                det = 0.0
                for c in range(3):
                    e, f = (c + 1) % 3, (c + 2) % 3
                    det += A[i, c] * (A[j, e] * A[m, f] - A[j, f] * A[m, e])
                if abs(det) <= zero:
                    continue
                for side in range(4):
                    # corners come in opposite pairs
                    s, t = 1.0 if side & 1 else -1.0, 1.0 if side & 2 else -1.0
                    for c in range(3):
                        e, f = (c + 1) % 3, (c + 2) % 3
                        x[c] = A[j, e] * A[m, f] - A[j, f] * A[m, e]
                        x[c] += s * (A[m, e] * A[i, f] - A[m, f] * A[i, e])
                        x[c] = (x[c] + t * (A[i, e] * A[j, f] - A[i, f] * A[j, e])) / det
                    inside = True
                    for r in range(n):
                        height = A[r, 0] * x[0] + A[r, 1] * x[1] + A[r, 2] * x[2]
                        inside &= abs(height) <= 1.0 + 1e-9
                    for v in range(found if inside else 0):
                        away, size = 0.0, 0.0
                        for c in range(3):
                            away = max(away, abs(vertices[v, c] - x[c]))
                            size = max(size, abs(x[c]))
                        inside &= away > 1e-8 * size
                    if inside:
                        for c in range(3):
                            vertices[found, c], vertices[found + 1, c] = x[c], -x[c]
                        found += 2
    for r in range(n):
        for side in range(2):
            sign, count = 1.0 if side == 0 else -1.0, 0
            for c in range(3):
                middle[c] = 0.0
            for v in range(found):
                height = A[r, 0] * vertices[v, 0] + A[r, 1] * vertices[v, 1]
                if abs(sign * (height + A[r, 2] * vertices[v, 2]) - 1.0) <= 1e-8:
                    members[count] = v
                    count += 1
                    for c in range(3):
                        middle[c] += vertices[v, c]
            if count < 3:
                continue
            for i in range(count):
                for c in range(3):
                    P[members[i], c] = vertices[members[i], c] - middle[c] / count
            turned_order(P, members, count, A[r], False, angles)
            for i in range(count):
                corners[used] = members[i]
                used += 1
            sizes[faces] = count
            faces += 1
    counts[0], counts[1], counts[2] = found, faces, used
    return 1.0 / sqrt(longest)
