"""Compiled: from the pose to the eigenproblem of size 16 whose roots are the postures.

Of the fourteen equations of `_lines` eight columns on the right are removed by Householder
reflections, six equations in joints 2, 3, 4 remain. Times two half-angle functions of joint "nu"
they are twelve equations in twelve products of "nu" and "mu" (the other of joints 3 and 4):
a 12 x 12 matrix A_0 + A_c cos + A_s sin of joint 2, which is singular at a posture.

With t the tangent of half that angle it is a quadratic eigenproblem of size 24 (Manocha and Canny
1994), of which 8 eigenvalues are t = +-i and belong to no posture. Their invariant subspace is
known: joint 2 turns only four planar vectors, X_k + i Y_k, k = 1..4 (of p, l, p x l and the last
vector), so that A_c + i A_s vanishes where the four functions X_k - i Y_k do. Projected onto the
orthogonal complement of that subspace the companion matrix has size 16 and the 16 roots.
"""

from __future__ import annotations

from math import cos, pi, sin

import numpy as np
from numba import types

from ...kernels._compile import (
    INT,
    INTS,
    NOTHING,
    OUT1,
    OUT3,
    STACK,
    Floats,
    Ints,
    compiled,
)
from ._linear import eliminate, factor, orthonormal_rows, solve_columns
from ._lines import left_side, put_transform, right_side

ORDERS = types.Array(types.int64, 2, "C")
TURNS = 12  # candidates for the angle at which the leading matrix is inverted


@compiled()
def widen(
    kind: int,
    E: Floats,
    row: int,
    at: int,
    swapped: int,
    m: int,
    out: Floats,
    line: int,
    start: int,
) -> None:
    """One of the twelve equations: one in joints 3, 4 times factor m = 0, 1 of joint nu.

    Factors: cos(h), sin(h) of the half angle if revolute, 1, r if prismatic. nu is joint 3, or 4 if
    ``swapped``. Reads nine coefficients at ``E[row, at]``, writes twelve at ``out[line, start]``.
    """
    step_nu, step_mu = (1, 3) if swapped else (3, 1)
    for mu in range(3):
        k = at + step_mu * mu
        one, two, three = E[row, k], E[row, k + step_nu], E[row, k + 2 * step_nu]
        j = start + mu
        if kind == 1:
            for nu in range(4):
                out[line, j + 3 * nu] = 0.0
            out[line, j + 3 * m] = one
            out[line, j + 3 * m + 3] = two
            out[line, j + 3 * m + 6] = three
        elif m == 0:
            out[line, j] = one + 0.5 * two
            out[line, j + 3] = 0.5 * three
            out[line, j + 6] = 0.5 * two
            out[line, j + 9] = 0.5 * three
        else:
            out[line, j] = 0.5 * three
            out[line, j + 3] = one - 0.5 * two
            out[line, j + 6] = -0.5 * three
            out[line, j + 9] = 0.5 * two


@compiled()
def at_angle(A: Floats, angle: float, out: Floats) -> None:
    """``A_0 + A_c cos + A_s sin`` for ``A (36, 12)`` into out."""
    c, s = cos(angle), sin(angle)
    for i in range(12):
        for j in range(12):
            out[i, j] = A[i, j] + c * A[12 + i, j] + s * A[24 + i, j]


@compiled(NOTHING(INTS, STACK, INT, STACK, INT, OUT3, OUT3, OUT3, ORDERS, OUT1, OUT1))
def assemble(
    kinds: Ints,
    links: Floats,
    closing: int,
    closings: Floats,
    swapped: int,
    M: Floats,
    P: Floats,
    Q: Floats,
    order: Ints,
    angle: Floats,
    quality: Floats,
) -> None:
    """Reduce poses to eigenproblems of size 16.

    Shapes: kinds (6,); links (6, 4, 4); M (N, 16, 16); P (N, 14, 27); Q (N, 8, 8); order (N, 8);
    angle, quality (N,).
    """
    kind_nu = kinds[4] if swapped else kinds[3]
    G = np.empty((6, 4, 4))
    for k in range(6):
        put_transform(links, k, G, k)
    F = np.empty((14, 9))
    X = np.empty((14, 9))
    Qk = np.empty((14, 8))
    line = np.empty(6)
    f = np.empty(14)
    A = np.empty((36, 12))
    K0, K1, K2, trial = (
        np.empty((12, 12)),
        np.empty((12, 12)),
        np.empty((12, 12)),
        np.empty((12, 12)),
    )
    pivots = np.empty(12, np.int64)
    Z = np.empty((16, 24))
    ZT = np.empty((24, 16))
    B = np.empty((12, 16))
    for n in range(closings.shape[0]):
        put_transform(closings, n, G, closing)
        left_side(kinds, G, X, line, f)
        right_side(kinds, G, F, line, f)
        Pn = P[n]
        # joint 2 turns the planar parts of the four vectors and leaves the rest
        for i in range(14):
            for k in range(9):
                if i >= 12 or i % 3 == 2:
                    Pn[i, k], Pn[i, 9 + k], Pn[i, 18 + k] = X[i, k], 0.0, 0.0
                elif i % 3 == 0:
                    Pn[i, k], Pn[i, 9 + k], Pn[i, 18 + k] = 0.0, X[i, k], -X[i + 1, k]
                else:
                    Pn[i, k], Pn[i, 9 + k], Pn[i, 18 + k] = 0.0, X[i, k], X[i - 1, k]
            Pn[i, 0] -= F[i, 0]
            for k in range(8):
                Qk[i, k] = F[i, k + 1]
        quality[n] = eliminate(Qk, Pn, order[n])
        for i in range(8):
            for j in range(8):
                Q[n, i, j] = Qk[i, j] if j >= i else 0.0
        for a in range(3):
            for e in range(6):
                for m in range(2):
                    widen(kind_nu, Pn, 8 + e, 9 * a, swapped, m, A, 12 * a + 2 * e + m, 0)

        best, turn = -1.0, 0
        for k in range(TURNS):
            at_angle(A, 2.0 * pi * k / TURNS, trial)
            size = factor(trial, pivots)
            if size > best:
                best, turn = size, k
        lead = 2.0 * pi * turn / TURNS
        angle[n] = lead - pi
        for i in range(16):
            for j in range(16):
                M[n, i, j] = 0.0
        # the subspace of t = +-i
        for i in range(4):
            for m in range(2):
                r = 2 * i + m
                widen(kind_nu, X, 3 * i, 0, swapped, m, Z, r, 0)
                widen(kind_nu, X, 3 * i + 1, 0, swapped, m, Z, 8 + r, 0)
                for j in range(12):
                    Z[r, 12 + j] = -Z[8 + r, j]
                    Z[8 + r, 12 + j] = Z[r, j]
        if best < 1e-14 or orthonormal_rows(Z) == 0.0:
            quality[n] = 0.0
            continue
        c, s = cos(angle[n]), sin(angle[n])
        for i in range(12):
            for j in range(12):
                even = c * A[12 + i, j] + s * A[24 + i, j]
                K0[i, j] = A[i, j] + even
                K1[i, j] = 2.0 * (c * A[24 + i, j] - s * A[12 + i, j])
                K2[i, j] = A[i, j] - even
        factor(K2, pivots)
        for i in range(24):
            for j in range(16):
                ZT[i, j] = Z[j, i]
        for i in range(12):
            for k in range(16):
                B[i, k] = 0.0
            for j in range(12):
                for k in range(16):
                    B[i, k] -= K0[i, j] * ZT[j, k] + K1[i, j] * ZT[12 + j, k]
        solve_columns(K2, pivots, B)
        for i in range(16):
            for j in range(12):
                for k in range(16):
                    M[n, i, k] += Z[i, j] * ZT[12 + j, k] + Z[i, 12 + j] * B[j, k]
