"""Compiled: from poses of a six-joint arm to eigenproblems of size 16 (Raghavan and Roth 1993).

With the link that closes the loop through the pose, ``G_5 = ... U^-1 ...``, the joints and links
make ``M_0 G_0 M_1 G_1 M_2 G_2 M_3 G_3 M_4 G_4 M_5 G_5 = I``. Joint 5, revolute, moves neither the
z axis of its frame nor its origin, so the line (p, l) = (origin, axis) is reached in two ways:

    M_2 G_2 M_3 G_3 M_4 G_4 (p, l) = G_1^-1 M_1^-1 G_0^-1 M_0^-1 G_5^-1 (p, l)

Fourteen functions of it (eq. 3 to 8) are

    p (0-2), l (3-5), p x l (6-8), (p.p) l - 2 (p.l) p (9-11), p.p (12), p.l (13),

each linear in (1, cos, sin) of every revolute joint and in (1, r, r^2) of every prismatic one.
Eight columns on the right are removed by Householder reflections, six equations in joints 2, 3, 4
remain. Times two half-angle functions of joint "nu" they are twelve equations in twelve products
of "nu" and "mu" (the other of joints 3 and 4): A_0 + A_c cos + A_s sin of joint 2, singular at a
solution. With t the tangent of half that angle it is a quadratic eigenproblem of size 24 (Manocha
and Canny 1994), of which 8 eigenvalues are t = +-i and belong to no solution. Their invariant
subspace is known: joint 2 turns only four planar vectors, X_k + i Y_k, k = 1..4 (of p, l, p x l and
the last vector), so A_c + i A_s vanishes where the four functions X_k - i Y_k do. Projected onto
the orthogonal complement of that subspace the companion matrix has size 16 and the 16 roots.
"""

from __future__ import annotations

from math import cos, pi, sin, sqrt

import numpy as np
from numba import types

from ...kernels._compile import INT, INTS, NOTHING, OUT1, OUT3, Floats, Ints, compiled
from ...kernels.linear_systems import factor, solve

LINKS = types.Array(types.float64, 4, "C", readonly=True)
ORDERS = types.Array(types.int64, 2, "C")
PARTS = types.Tuple((OUT3, OUT3, ORDERS, OUT1, OUT1))
Parts = tuple[Floats, Floats, Ints, Floats, Floats]
ANGLES = 12  # candidates for the angle at which the leading matrix is inverted


@compiled()
def move_line(G: Floats, back: bool, x: Floats) -> None:
    """Apply a transform ``G (4, 4)``, or its inverse, to the line x = (p, l), in place."""
    for i in range(3):
        x[i] -= G[i, 3] if back else 0.0
    for k in range(2):
        a, b, c = x[3 * k], x[3 * k + 1], x[3 * k + 2]
        for i in range(3):
            if back:
                x[3 * k + i] = G[0, i] * a + G[1, i] * b + G[2, i] * c
            else:
                x[3 * k + i] = G[i, 0] * a + G[i, 1] * b + G[i, 2] * c
    for i in range(3):
        x[i] += 0.0 if back else G[i, 3]


@compiled()
def turn_line(kind: int, value: float, x: Floats) -> None:
    """Move the line x = (p, l) by a joint of the kind (0 revolute, 1 prismatic), in place."""
    if kind == 1:
        x[2] += value
        return
    c, s = cos(value), sin(value)
    for k in range(2):
        a, b = x[3 * k], x[3 * k + 1]
        x[3 * k] = c * a - s * b
        x[3 * k + 1] = s * a + c * b


@compiled()
def fourteen(x: Floats, F: Floats, column: int) -> None:
    """The fourteen functions of the line x = (p, l) into a column of F."""
    pp = x[0] * x[0] + x[1] * x[1] + x[2] * x[2]
    pl = x[0] * x[3] + x[1] * x[4] + x[2] * x[5]
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        F[i, column], F[3 + i, column] = x[i], x[3 + i]
        F[6 + i, column] = x[j] * x[3 + k] - x[k] * x[3 + j]
        F[9 + i, column] = pp * x[3 + i] - 2.0 * pl * x[i]
    F[12, column], F[13, column] = pp, pl


@compiled()
def sample(kind: int, k: int) -> float:
    """Value k = 0, 1, 2 at which a joint is sampled."""
    return k - 1.0 if kind == 1 else 2.0 * pi / 3.0 * k


@compiled()
def to_coefficients(kind: int, F: Floats, i: int, at: int, step: int) -> None:
    """Three samples of a function to its coefficients of (1, cos, sin) or (1, r, r^2), in place."""
    a, b, c = F[i, at], F[i, at + step], F[i, at + 2 * step]
    if kind == 1:
        F[i, at], F[i, at + step], F[i, at + 2 * step] = b, 0.5 * (c - a), 0.5 * (a + c) - b
    else:
        F[i, at], F[i, at + step] = (a + b + c) / 3.0, (2.0 * a - b - c) / 3.0
        F[i, at + 2 * step] = (b - c) / sqrt(3.0)


@compiled()
def side(kinds: Ints, G: Floats, far: bool, F: Floats) -> None:
    """Coefficients ``F (14, 9)`` of the left side in joints 3, 4, or of the far one in 0, 1."""
    x = np.empty(6)
    outer, inner = (0, 1) if far else (3, 4)
    for b in range(3):
        for c in range(3):
            for i in range(6):
                x[i] = 1.0 if i == 5 else 0.0
            if far:
                move_line(G[5], True, x)
                turn_line(kinds[0], -sample(kinds[0], b), x)
                move_line(G[0], True, x)
                turn_line(kinds[1], -sample(kinds[1], c), x)
                move_line(G[1], True, x)
            else:
                move_line(G[4], False, x)
                turn_line(kinds[4], sample(kinds[4], c), x)
                move_line(G[3], False, x)
                turn_line(kinds[3], sample(kinds[3], b), x)
                move_line(G[2], False, x)
            fourteen(x, F, 3 * b + c)
    for i in range(14):
        for m in range(3):
            to_coefficients(kinds[inner], F, i, 3 * m, 1)
        for m in range(3):
            to_coefficients(kinds[outer], F, i, m, 3)


@compiled()
def reflect(Q: Floats, P: Floats, order: Ints) -> float:
    """Householder reflections that make ``Q (14, 8)`` triangular, also applied to ``P (14, 27)``.

    Columns are taken in order of size; ``order (8,)`` receives them. Returns the ratio of the
    last diagonal entry to the first, 0 where the columns are dependent.
    """
    m, n = Q.shape
    for k in range(n):
        order[k] = k
    for k in range(n):
        best, largest = k, -1.0
        for j in range(k, n):
            total = 0.0
            for i in range(k, m):
                total += Q[i, j] * Q[i, j]
            if total > largest:
                best, largest = j, total
        if best != k:
            order[k], order[best] = order[best], order[k]
            for i in range(m):
                Q[i, k], Q[i, best] = Q[i, best], Q[i, k]
        size = sqrt(largest)
        if size == 0.0:
            return 0.0
        if Q[k, k] > 0.0:
            size = -size
        # v = column - size e_k, kept below the diagonal; H = I - v v^T / h
        first = Q[k, k] - size
        h = -size * first
        for j in range(k + 1, n + P.shape[1]):
            B, c = (Q, j) if j < n else (P, j - n)
            total = first * B[k, c]
            for i in range(k + 1, m):
                total += Q[i, k] * B[i, c]
            total /= h
            B[k, c] -= total * first
            for i in range(k + 1, m):
                B[i, c] -= total * Q[i, k]
        Q[k, k] = size
    return abs(Q[n - 1, n - 1]) / abs(Q[0, 0])


@compiled()
def orthonormal_rows(Z: Floats) -> bool:
    """Gram and Schmidt's method, twice, on the rows of Z in place; False if they are dependent."""
    m, n = Z.shape
    for i in range(m):
        size = 0.0
        for k in range(n):
            size += Z[i, k] * Z[i, k]
        for _ in range(2):
            for j in range(i):
                total = 0.0
                for k in range(n):
                    total += Z[j, k] * Z[i, k]
                for k in range(n):
                    Z[i, k] -= total * Z[j, k]
        left = 0.0
        for k in range(n):
            left += Z[i, k] * Z[i, k]
        if left <= 1e-28 * size:
            return False
        left = 1.0 / sqrt(left)
        for k in range(n):
            Z[i, k] *= left
    return True


@compiled()
def widen(kind: int, E: Floats, row: int, swapped: int, m: int, A: Floats, line: int) -> None:
    """One of the twelve equations: one in joints 3, 4 times factor m = 0, 1 of joint nu.

    Factors: cos(h), sin(h) of the half angle if revolute, 1, r if prismatic. nu is joint 3, or 4 if
    ``swapped``. Reads nine coefficients of ``E[row]``, writes the first twelve of ``A[line]``.
    """
    step_nu, step_mu = (1, 3) if swapped else (3, 1)
    for mu in range(3):
        k = step_mu * mu
        one, two, three = E[row, k], E[row, k + step_nu], E[row, k + 2 * step_nu]
        if kind == 1:
            A[line, mu + 9 - 9 * m] = 0.0
            A[line, mu + 3 * m] = one
            A[line, mu + 3 * m + 3] = two
            A[line, mu + 3 * m + 6] = three
        elif m == 0:
            A[line, mu], A[line, mu + 3] = one + 0.5 * two, 0.5 * three
            A[line, mu + 6], A[line, mu + 9] = 0.5 * two, 0.5 * three
        else:
            A[line, mu], A[line, mu + 3] = 0.5 * three, one - 0.5 * two
            A[line, mu + 6], A[line, mu + 9] = -0.5 * three, 0.5 * two


@compiled()
def at_angle(P: Floats, kind: int, swapped: int, angle: float, A: Floats) -> None:
    """The twelve equations ``A (12, 12)`` at an angle of joint 2, from ``P (14, 27)``."""
    E = np.empty((1, 9))
    c, s = cos(angle), sin(angle)
    for e in range(6):
        for k in range(9):
            E[0, k] = P[8 + e, k] + c * P[8 + e, 9 + k] + s * P[8 + e, 18 + k]
        for m in range(2):
            widen(kind, E, 0, swapped, m, A, 2 * e + m)


@compiled(NOTHING(INTS, LINKS, INT, OUT3, PARTS))
def eigenproblems(kinds: Ints, links: Floats, swapped: int, M: Floats, parts: Parts) -> None:
    """Reduce poses to eigenproblems of size 16 for tan((q_2 - angle) / 2).

    Shapes: kinds (6,); links (N, 6, 4, 4) -> M (N, 16, 16), zeros before; parts: P (N, 14, 27),
    Q (N, 14, 8), order (N, 8), angle and quality (N,).
    """
    P, Q, order, angle, quality = parts
    kind_nu = kinds[4] if swapped else kinds[3]
    F, X = np.empty((14, 9)), np.empty((14, 9))
    K0, K1, K2 = np.empty((12, 12)), np.empty((12, 12)), np.empty((12, 12))
    pivots = np.empty(12, np.int64)
    Z, b = np.empty((16, 24)), np.empty(12)
    for n in range(links.shape[0]):
        side(kinds, links[n], False, X)
        side(kinds, links[n], True, F)
        Pn = P[n]
        # joint 2 turns the planar parts of the four vectors and leaves the rest
        for i in range(14):
            planar = i < 12 and i % 3 < 2
            for k in range(9):
                Pn[i, k] = 0.0 if planar else X[i, k]
                Pn[i, 9 + k] = X[i, k] if planar else 0.0
                Pn[i, 18 + k] = 0.0
                if planar:
                    Pn[i, 18 + k] = -X[i + 1, k] if i % 3 == 0 else X[i - 1, k]
            Pn[i, 0] -= F[i, 0]
            for k in range(8):
                Q[n, i, k] = F[i, k + 1]
        quality[n] = reflect(Q[n], Pn, order[n])
        # the angle at which the leading matrix is best conditioned
        best, lead = -1.0, 0.0
        for k in range(ANGLES):
            at_angle(Pn, kind_nu, swapped, 2.0 * pi * k / ANGLES, K2)
            size, largest = factor(K2, pivots), 0.0
            for i in range(12):
                largest = max(largest, abs(K2[i, i]))
            size /= largest
            if size > best:
                best, lead = size, 2.0 * pi * k / ANGLES
        angle[n] = lead - pi
        # the subspace of t = +-i
        for i in range(4):
            for m in range(2):
                r = 2 * i + m
                widen(kind_nu, X, 3 * i, swapped, m, Z, r)
                widen(kind_nu, X, 3 * i + 1, swapped, m, Z, 8 + r)
                for j in range(12):
                    Z[r, 12 + j] = -Z[8 + r, j]
                    Z[8 + r, 12 + j] = Z[r, j]
        if best < 1e-14 or not orthonormal_rows(Z):
            quality[n] = 0.0
            continue
        # K0 + K1 t + K2 t^2 in the tangent t about that angle
        at_angle(Pn, kind_nu, swapped, angle[n], K0)
        at_angle(Pn, kind_nu, swapped, angle[n] + 0.5 * pi, K1)
        at_angle(Pn, kind_nu, swapped, angle[n] - 0.5 * pi, K2)
        for i in range(12):
            for j in range(12):
                K1[i, j] -= K2[i, j]
        at_angle(Pn, kind_nu, swapped, lead, K2)
        factor(K2, pivots)
        for k in range(16):
            for i in range(12):
                b[i] = 0.0
                for j in range(12):
                    b[i] -= K0[i, j] * Z[k, j] + K1[i, j] * Z[k, 12 + j]
            solve(K2, pivots, b)
            for i in range(16):
                for j in range(12):
                    M[n, i, k] += Z[i, j] * Z[k, 12 + j] + Z[i, 12 + j] * b[j]
