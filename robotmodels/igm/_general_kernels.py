"""Compiled steps of the general six-joint inverse: from the pose to a 16x16 matrix, and back.

The loop. With the closing link ``G_5 = ... U^-1 ...`` the six joints and links close:
``M_0 G_0 M_1 G_1 M_2 G_2 M_3 G_3 M_4 G_4 M_5 G_5 = I``. Joint 5, revolute, moves neither the z axis
of its frame nor its origin, so that the line (p, l) = (origin, axis) can be reached two ways:

    M_2 G_2 M_3 G_3 M_4 G_4 (p, l) = G_1^-1 M_1^-1 G_0^-1 M_0^-1 G_5^-1 (p, l)

Fourteen functions of it (Raghavan and Roth 1993, eq. 3 to 8) are

    p (0-2), l (3-5), p x l (6-8), (p.p) l - 2 (p.l) p (9-11), p.p (12), p.l (13),

each linear in (1, cos, sin) of every revolute joint and in (1, r, r^2) of every prismatic one.
Their coefficients are found by sampling each joint at three values. Left, 14 x 27 in joints
2, 3, 4; right, 14 x 9 in joints 0, 1. Eight columns on the right are removed by Householder
reflections, six equations in joints 2, 3, 4 remain. Times two half-angle functions of joint "nu"
they are twelve equations in twelve products of "nu" and "mu" (the other of joints 3 and 4):
a 12 x 12 matrix A_0 + A_c cos + A_s sin of joint 2, which is singular at a posture.

With t the tangent of half that angle it is a quadratic eigenproblem of size 24 (Manocha and Canny
1994), of which 8 eigenvalues are t = +-i and belong to no posture. Their invariant subspace is
known: joint 2 turns only four planar vectors, X_k + i Y_k, k = 1..4 (of p, l, p x l and the last
vector), so that A_c + i A_s vanishes where the four functions X_k - i Y_k do. Projected onto the
orthogonal complement of that subspace the companion matrix has size 16 and the 16 roots.
"""

from math import atan2, cos, pi, sin, sqrt

import numpy as np
from numba import types

from ..kernels._compile import (
    INT,
    INTS,
    MATRIX,
    NOTHING,
    OUT1,
    OUT2,
    OUT3,
    STACK,
    VECTOR,
    compiled,
)

__all__ = [
    "assemble",
    "bring_home",
    "fall_into_valleys",
    "flat_singularities",
    "follow_valleys",
    "partners",
    "postures",
]

FLOAT = types.float64
COUNTS = types.Array(types.int64, 1, "C")
FLAGS = types.Array(types.boolean, 2, "C")
ORDERS = types.Array(types.int64, 2, "C")
COMPLEX = types.Array(types.complex128, 2, "C")

MERGE = 1e-6  # postures closer than this in every joint are one [rad, or lengths of the arm]
NEARLY_REAL = 2e-2  # imaginary part of an angle up to which its real part is tried [rad]
MERGED = 1e-3  # imaginary part up to which a pair counts as a double root that rounding split [rad]
TURNS = 12  # candidates for the angle at which the leading matrix is inverted
SMALL = 0.1  # smallest singular value of the Jacobian above which a posture is at no fold
SINGULAR = 1e-7  # and below which it is singular but for rounding
FLAT = 1e-6  # curvature along the null direction below which a posture is not at a fold
VALLEY = 1e-2  # smallest singular value of the Jacobian in a valley: nearly an infinite family
STRIDE = 0.02  # step along a valley [rad]
STRIDES = 1200  # steps one way
POINTS = 6000  # points of valleys remembered per pose
CLOSE = 0.3  # partners predicted farther away than this are left to the eigenvalues [rad]


@compiled()
def put_transform(A, i, B, k):
    """Copy ``A[i] (4, 4)`` to ``B[k]``."""
    for r in range(4):
        for c in range(4):
            B[k, r, c] = A[i, r, c]


# --- lines and their fourteen functions ----------------------------------------------------------


@compiled()
def move_line(G, x):
    """Apply the transform ``G (4, 4)`` to the line x = (p, l), in place."""
    for k in range(2):
        a, b, c = x[3 * k], x[3 * k + 1], x[3 * k + 2]
        for i in range(3):
            x[3 * k + i] = G[i, 0] * a + G[i, 1] * b + G[i, 2] * c
    for i in range(3):
        x[i] += G[i, 3]


@compiled()
def move_line_back(G, x):
    """Apply the inverse of the transform ``G (4, 4)`` to the line x = (p, l), in place."""
    for i in range(3):
        x[i] -= G[i, 3]
    for k in range(2):
        a, b, c = x[3 * k], x[3 * k + 1], x[3 * k + 2]
        for i in range(3):
            x[3 * k + i] = G[0, i] * a + G[1, i] * b + G[2, i] * c


@compiled()
def turn_line(kind, value, x):
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
def fourteen(x, f):
    """The fourteen functions of the line x = (p, l)."""
    px, py, pz, lx, ly, lz = x[0], x[1], x[2], x[3], x[4], x[5]
    pp = px * px + py * py + pz * pz
    pl = px * lx + py * ly + pz * lz
    f[0], f[1], f[2] = px, py, pz
    f[3], f[4], f[5] = lx, ly, lz
    f[6], f[7], f[8] = py * lz - pz * ly, pz * lx - px * lz, px * ly - py * lx
    f[9], f[10], f[11] = pp * lx - 2 * pl * px, pp * ly - 2 * pl * py, pp * lz - 2 * pl * pz
    f[12], f[13] = pp, pl


@compiled()
def sample(kind, k):
    """Value k = 0, 1, 2 at which a joint is sampled."""
    if kind == 1:
        return k - 1.0
    return 2.0 * pi / 3.0 * k


@compiled()
def to_coefficients(kind, a, b, c):
    """Coefficients of (1, cos, sin) or (1, r, r^2) from the three samples."""
    if kind == 1:
        return b, 0.5 * (c - a), 0.5 * (a + c) - b
    return (a + b + c) / 3.0, (2.0 * a - b - c) / 3.0, (b - c) / sqrt(3.0)


@compiled()
def basis(kind, value, b):
    """(1, cos, sin) or (1, r, r^2) of a joint into b (3,)."""
    b[0] = 1.0
    if kind == 1:
        b[1], b[2] = value, value * value
    else:
        b[1], b[2] = cos(value), sin(value)


@compiled()
def two_joints(kind_a, kind_b, F):
    """Samples ``F (14, 9)`` of two joints to coefficients, in place."""
    for i in range(14):
        for m in range(3):
            F[i, 3 * m], F[i, 3 * m + 1], F[i, 3 * m + 2] = to_coefficients(
                kind_b, F[i, 3 * m], F[i, 3 * m + 1], F[i, 3 * m + 2]
            )
        for m in range(3):
            F[i, m], F[i, 3 + m], F[i, 6 + m] = to_coefficients(
                kind_a, F[i, m], F[i, 3 + m], F[i, 6 + m]
            )


@compiled()
def left_side(kind, G, F, x, f):
    """Coefficients ``F (14, 9)`` in joints 3 and 4 of the functions of G_2 M_3 G_3 M_4 G_4."""
    for b in range(3):
        for c in range(3):
            x[0] = x[1] = x[2] = x[3] = x[4] = 0.0
            x[5] = 1.0
            move_line(G[4], x)
            turn_line(kind[4], sample(kind[4], c), x)
            move_line(G[3], x)
            turn_line(kind[3], sample(kind[3], b), x)
            move_line(G[2], x)
            fourteen(x, f)
            for i in range(14):
                F[i, 3 * b + c] = f[i]
    two_joints(kind[3], kind[4], F)


@compiled()
def right_side(kind, G, F, x, f):
    """Coefficients ``F (14, 9)`` in joints 0 and 1 of the other way to the line."""
    for d in range(3):
        for e in range(3):
            x[0] = x[1] = x[2] = x[3] = x[4] = 0.0
            x[5] = 1.0
            move_line_back(G[5], x)
            turn_line(kind[0], -sample(kind[0], d), x)
            move_line_back(G[0], x)
            turn_line(kind[1], -sample(kind[1], e), x)
            move_line_back(G[1], x)
            fourteen(x, f)
            for i in range(14):
                F[i, 3 * d + e] = f[i]
    two_joints(kind[0], kind[1], F)


# --- linear algebra ------------------------------------------------------------------------------


@compiled()
def eliminate(Q, P, order):
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
        for j in range(k + 1, n):
            total = first * Q[k, j]
            for i in range(k + 1, m):
                total += Q[i, k] * Q[i, j]
            total /= h
            Q[k, j] -= total * first
            for i in range(k + 1, m):
                Q[i, j] -= total * Q[i, k]
        for j in range(P.shape[1]):
            total = first * P[k, j]
            for i in range(k + 1, m):
                total += Q[i, k] * P[i, j]
            total /= h
            P[k, j] -= total * first
            for i in range(k + 1, m):
                P[i, j] -= total * Q[i, k]
        Q[k, k] = size
    return abs(Q[n - 1, n - 1]) / abs(Q[0, 0])


@compiled()
def factor(A, pivots):
    """LU factors of A with row exchanges, in place; smallest pivot over the largest."""
    n = A.shape[0]
    smallest, largest = np.inf, 0.0
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(A[i, k]) > abs(A[best, k]):
                best = i
        pivots[k] = best
        if best != k:
            for j in range(n):
                A[k, j], A[best, j] = A[best, j], A[k, j]
        size = abs(A[k, k])
        smallest = min(smallest, size)
        largest = max(largest, size)
        if size == 0.0:
            # a singular matrix is still usable for inverse iteration
            A[k, k] = 1e-300
        for i in range(k + 1, n):
            A[i, k] /= A[k, k]
            scale = A[i, k]
            if scale != 0.0:
                for j in range(k + 1, n):
                    A[i, j] -= scale * A[k, j]
    if largest == 0.0:
        return 0.0
    return smallest / largest


@compiled()
def solve_columns(A, pivots, B):
    """Solve ``A X = B`` from the factors, B (n, m) overwritten by X."""
    n, m = B.shape
    for k in range(n):
        p = pivots[k]
        if p != k:
            for j in range(m):
                B[k, j], B[p, j] = B[p, j], B[k, j]
    for i in range(n):
        for k in range(i):
            scale = A[i, k]
            for j in range(m):
                B[i, j] -= scale * B[k, j]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            scale = A[i, k]
            for j in range(m):
                B[i, j] -= scale * B[k, j]
        scale = 1.0 / A[i, i]
        for j in range(m):
            B[i, j] *= scale


@compiled()
def solve_one(A, pivots, x):
    """Solve ``A y = x`` from the factors, x overwritten by y."""
    n = x.shape[0]
    for k in range(n):
        p = pivots[k]
        x[k], x[p] = x[p], x[k]
    for i in range(n):
        for k in range(i):
            x[i] -= A[i, k] * x[k]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            x[i] -= A[i, k] * x[k]
        x[i] /= A[i, i]


@compiled()
def solve_transposed(A, pivots, x):
    """Solve ``A^T y = x`` from the factors, x overwritten by y."""
    n = x.shape[0]
    for i in range(n):
        for k in range(i):
            x[i] -= A[k, i] * x[k]
        x[i] /= A[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            x[i] -= A[k, i] * x[k]
    for k in range(n - 1, -1, -1):
        p = pivots[k]
        x[k], x[p] = x[p], x[k]


@compiled()
def to_unit(x):
    """Scale x to length one; its length."""
    largest = 0.0
    for i in range(x.shape[0]):
        largest = max(largest, abs(x[i]))
    if largest == 0.0:
        return 0.0
    total = 0.0
    for i in range(x.shape[0]):
        x[i] /= largest
        total += x[i] * x[i]
    total = sqrt(total)
    for i in range(x.shape[0]):
        x[i] /= total
    return total * largest


@compiled()
def smallest_vectors(A, pivots, u, v):
    """Singular vectors ``A v = s u`` of the smallest singular value, from the factors; s."""
    n = v.shape[0]
    for i in range(n):
        v[i] = 1.0 + 0.1 * i
    s = 0.0
    for _ in range(3):
        for i in range(n):
            u[i] = v[i]
        solve_transposed(A, pivots, u)
        to_unit(u)
        for i in range(n):
            v[i] = u[i]
        solve_one(A, pivots, v)
        length = to_unit(v)
        s = 1.0 / length if length > 0.0 else 0.0
    return s


@compiled()
def orthonormal_rows(Z):
    """Gram and Schmidt's method, twice, on the rows of Z in place; least share that was left."""
    m, n = Z.shape
    least = 1.0
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
            return 0.0
        least = min(least, left / size)
        left = 1.0 / sqrt(left)
        for k in range(n):
            Z[i, k] *= left
    return sqrt(least)


# --- the matrix of size twelve -------------------------------------------------------------------


@compiled()
def widen(kind, E, row, at, swapped, m, out, line, start):
    """One of the twelve equations: one in joints 3, 4 times factor m = 0, 1 of joint nu.

    Revolute nu: times cos(h), sin(h) with h its half angle, in (cos h, sin h, cos 3h, sin 3h).
    Prismatic nu: times 1, r in (1, r, r^2, r^3). Joint nu is joint 3, or joint 4 if ``swapped``.
    The nine coefficients are read at ``E[row, at]``, the twelve written at ``out[line, start]``,
    over nu, then mu.
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
def at_angle(A, angle, out):
    """``A_0 + A_c cos + A_s sin`` for ``A (36, 12)`` into out."""
    c, s = cos(angle), sin(angle)
    for i in range(12):
        for j in range(12):
            out[i, j] = A[i, j] + c * A[12 + i, j] + s * A[24 + i, j]


@compiled(NOTHING(INTS, STACK, INT, STACK, INT, OUT3, OUT3, OUT3, ORDERS, OUT1, OUT1))
def assemble(kinds, links, closing, closings, swapped, M, P, Q, order, angle, quality):
    """Reduce poses to eigenproblems of size 16.

    Parameters
    ----------
    kinds : (6,)
        0 revolute, 1 prismatic, in the order of the loop; joints 2 and 5 are revolute.
    links : (6, 4, 4)
        Constants after each joint.
    closing : int
        Which of them is replaced by the pose's ``closings (N, 4, 4)``.
    swapped : int
        0: joint 3 is nu and joint 4 mu; 1: the other way round.
    M : (N, 16, 16), output
        Eigenvalues tan((angle of joint 2 - ``angle``) / 2). Zero where no matrix was found.
    P, Q, order : (N, 14, 27), (N, 8, 8), (N, 8), outputs
        The equations after the elimination, for the way back.
    angle, quality : (N,), outputs
        The reference angle; how far from dependent the eliminated columns were (0 to 1).
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


# --- from eigenvalues to postures ----------------------------------------------------------------


@compiled()
def wrapped(value):
    """Angle in (-pi, pi]."""
    value -= 2.0 * pi * np.round(value / (2.0 * pi))
    if value <= -pi:
        value += 2.0 * pi
    return value


@compiled()
def pose_of(sigma, D, q, T, z, o):
    """Pose ``T (3, 4)`` of the tool at ``q (6,)``, with axes z and origins o ``(6, 3)``."""
    for i in range(3):
        for j in range(4):
            T[i, j] = D[0, i, j]
    for k in range(6):
        for i in range(3):
            z[k, i], o[k, i] = T[i, 2], T[i, 3]
        if sigma[k] == 1:
            for i in range(3):
                T[i, 3] += q[k] * T[i, 2]
        else:
            c, s = cos(q[k]), sin(q[k])
            for i in range(3):
                a, b = T[i, 0], T[i, 1]
                T[i, 0] = c * a + s * b
                T[i, 1] = c * b - s * a
        L = D[k + 1]
        for i in range(3):
            a, b, c = T[i, 0], T[i, 1], T[i, 2]
            for j in range(3):
                T[i, j] = a * L[0, j] + b * L[1, j] + c * L[2, j]
            T[i, 3] += a * L[0, 3] + b * L[1, 3] + c * L[2, 3]


@compiled()
def jacobian_of(sigma, T, z, o, J):
    """Jacobian ``J (6, 6)`` of the tool from `pose_of`, rows [v; w] at the tool's origin."""
    for k in range(6):
        if sigma[k] == 1:
            for i in range(3):
                J[i, k], J[3 + i, k] = z[k, i], 0.0
            continue
        x, y, w = T[0, 3] - o[k, 0], T[1, 3] - o[k, 1], T[2, 3] - o[k, 2]
        J[0, k] = z[k, 1] * w - z[k, 2] * y
        J[1, k] = z[k, 2] * x - z[k, 0] * w
        J[2, k] = z[k, 0] * y - z[k, 1] * x
        for i in range(3):
            J[3 + i, k] = z[k, i]


@compiled()
def missing(U, T, e):
    """What is missing to the pose U, ``e (6,)`` = [p_d - p; log(R_d R^T)]; position and angle."""
    for i in range(3):
        e[i] = U[i, 3] - T[i, 3]
    # R_d R^T through its rows, whose antisymmetric part is the axis times the sine
    trace, x, y, w = 0.0, 0.0, 0.0, 0.0
    for j in range(3):
        a, b, c = U[0, j], U[1, j], U[2, j]
        r, s, t = T[0, j], T[1, j], T[2, j]
        trace += a * r + b * s + c * t
        x += c * s - b * t
        y += a * t - c * r
        w += b * r - a * s
    sine = 0.5 * sqrt(x * x + y * y + w * w)
    turn = atan2(sine, 0.5 * (trace - 1.0))
    scale = 0.5 if sine < 1e-9 else 0.5 * turn / sine
    e[3], e[4], e[5] = scale * x, scale * y, scale * w
    return sqrt(e[0] * e[0] + e[1] * e[1] + e[2] * e[2]), turn


@compiled()
def newton(sigma, D, U, tolerance, q, work):
    """Newton's method from q (6,), in place, until rounding stops it; whether the pose is met.

    ``tolerance`` is of the position in lengths of the arm and of the angle in radians. At double
    roots convergence is linear, so steps go on while the error keeps falling.
    """
    T, z, o, J, pivots, e, best = work
    least = np.inf
    met = False
    worse = 0
    for count in range(40):
        pose_of(sigma, D, q, T, z, o)
        position, turn = missing(U, T, e)
        error = max(position, turn)
        if error < least:
            if error > 0.7 * least:
                worse += 1
            least = error
            for k in range(6):
                best[k] = q[k]
            met = position <= tolerance[0] and turn <= tolerance[1]
        else:
            worse += 1
        if error < 1e-16 or worse >= (2 if met else 4) or (count >= 15 and least > 1e-5):
            break
        jacobian_of(sigma, T, z, o, J)
        factor(J, pivots)
        solve_one(J, pivots, e)
        largest = 0.0
        for k in range(6):
            largest = max(largest, abs(e[k]))
        if not largest < 1e100:
            break
        scale = min(1.0, 0.7 / largest)
        for k in range(6):
            q[k] += scale * e[k]
    for k in range(6):
        q[k] = best[k] if sigma[k] == 1 else wrapped(best[k])
    return met


@compiled()
def distance(sigma, a, b):
    """Largest difference of two postures over the joints."""
    largest = 0.0
    for k in range(6):
        d = a[k] - b[k]
        if sigma[k] == 0:
            d = wrapped(d)
        largest = max(largest, abs(d))
    return largest


@compiled()
def is_near(sigma, a, b, radius):
    """Whether two postures differ by at most the radius in every joint."""
    for k in range(6):
        d = a[k] - b[k]
        if abs(d) > radius and (sigma[k] == 1 or abs(wrapped(d)) > radius):
            return False
    return True


@compiled()
def keep(sigma, q, found, count):
    """Add q (6,) to ``found (16, 6)`` unless it is there; the new number."""
    for k in range(count):
        if is_near(sigma, q, found[k], MERGE):
            return count
    if count < found.shape[0]:
        for k in range(6):
            found[count, k] = q[k]
        count += 1
    return count


@compiled()
def two_factors(V, u, w):
    """Leading factors of ``V (12,)`` seen as 4 x 3: V is about u w^T."""
    best, largest = 0, -1.0
    for i in range(4):
        size = V[3 * i] ** 2 + V[3 * i + 1] ** 2 + V[3 * i + 2] ** 2
        if size > largest:
            best, largest = i, size
    for j in range(3):
        w[j] = V[3 * best + j]
    for _ in range(3):
        for i in range(4):
            u[i] = V[3 * i] * w[0] + V[3 * i + 1] * w[1] + V[3 * i + 2] * w[2]
        to_unit(u)
        for j in range(3):
            w[j] = V[j] * u[0] + V[3 + j] * u[1] + V[6 + j] * u[2] + V[9 + j] * u[3]


@compiled()
def back_substitute(kinds, G, angles, line, E, work):
    """Joints 0, 1 and 5 of the loop from joints 2, 3, 4 in ``angles (6,)``, in place."""
    P, Q, order = E
    b2, b3, b4, y, x = work
    basis(kinds[2], angles[2], b2)
    basis(kinds[3], angles[3], b3)
    basis(kinds[4], angles[4], b4)
    for i in range(8):
        y[i] = 0.0
        for a in range(3):
            for b in range(3):
                s = b2[a] * b3[b]
                k = 9 * a + 3 * b
                y[i] += s * (P[i, k] * b4[0] + P[i, k + 1] * b4[1] + P[i, k + 2] * b4[2])
    for i in range(7, -1, -1):
        for k in range(i + 1, 8):
            y[i] -= Q[i, k] * y[k]
        y[i] = y[i] / Q[i, i] if Q[i, i] != 0.0 else 0.0
    for i in range(8):
        x[order[i]] = y[i]
    # products in the order (0,1) (0,2) (1,0) (1,1) (1,2) (2,0) (2,1) (2,2) of joints 0 and 1
    angles[0] = x[2] if kinds[0] == 1 else atan2(x[5], x[2])
    angles[1] = x[0] if kinds[1] == 1 else atan2(x[1], x[0])
    # joint 5 closes the loop: the x axis of its frame seen after and before it
    line[0] = line[1] = line[2] = line[4] = line[5] = 0.0
    line[3] = 1.0
    move_line_back(G[5], line)
    for k in range(2):
        turn_line(kinds[k], -angles[k], line)
        move_line_back(G[k], line)
    for k in range(2, 5):
        turn_line(kinds[k], -angles[k], line)
        move_line_back(G[k], line)
    # M_5^-1 ... takes G_5^-1 x back to x: M_5 x is what the other five joints make of it
    angles[5] = atan2(line[4], line[3])


@compiled(
    NOTHING(
        INTS,
        STACK,
        STACK,
        VECTOR,
        INTS,
        INTS,
        FLOAT,
        STACK,
        INT,
        STACK,
        INT,
        COMPLEX,
        OUT3,
        OUT3,
        ORDERS,
        OUT1,
        OUT3,
        COUNTS,
        OUT2,
    )
)
def postures(
    sigma,
    D,
    goals,
    tolerance,
    kinds,
    joints,
    direction,
    links,
    closing,
    closings,
    swapped,
    eigenvalues,
    P,
    Q,
    order,
    angle,
    found,
    count,
    report,
):
    """Follow eigenvalues back to postures, polish them on the exact chain and keep new ones.

    ``report (N, 2)`` receives the number of real eigenvalues, pairs that are nearly real
    included, and the largest way that polishing moved a posture of a real one [rad].
    """
    kind_nu = kinds[4] if swapped else kinds[3]
    kind_mu = kinds[3] if swapped else kinds[4]
    G = np.empty((6, 4, 4))
    for k in range(6):
        put_transform(links, k, G, k)
    A = np.empty((12, 12))
    E = np.empty((1, 9))
    pivots = np.empty(12, np.int64)
    u12, v12, u, w = np.empty(12), np.empty(12), np.empty(4), np.empty(3)
    line, angles, q, start = np.empty(6), np.empty(6), np.empty(6), np.empty(6)
    back = (np.empty(3), np.empty(3), np.empty(3), np.empty(8), np.empty(8))
    polish = (
        np.empty((3, 4)),
        np.empty((6, 3)),
        np.empty((6, 3)),
        np.empty((6, 6)),
        np.empty(6, np.int64),
        np.empty(6),
        np.empty(6),
    )
    for n in range(goals.shape[0]):
        put_transform(closings, n, G, closing)
        real, moved = 0.0, 0.0
        for r in range(16):
            t = eigenvalues[n, r]
            imaginary = 2.0 * abs(t.imag) / (1.0 + t.real * t.real + t.imag * t.imag)
            # of a conjugate pair one is tried
            if t.imag < 0.0 or not imaginary <= NEARLY_REAL:
                continue
            if imaginary <= MERGED:
                real += 1.0 if t.imag == 0.0 else 2.0
            angles[2] = angle[n] + 2.0 * atan2(t.real, 1.0)
            c, s = cos(angles[2]), sin(angles[2])
            for e in range(6):
                for k in range(9):
                    E[0, k] = P[n, 8 + e, k] + c * P[n, 8 + e, 9 + k] + s * P[n, 8 + e, 18 + k]
                for m in range(2):
                    widen(kind_nu, E, 0, 0, swapped, m, A, 2 * e + m, 0)
            factor(A, pivots)
            smallest_vectors(A, pivots, u12, v12)
            two_factors(v12, u, w)
            if kind_nu == 1:
                nu = u[1] / u[0] if abs(u[0]) > abs(u[3]) else u[3] / u[2]
            else:
                nu = 2.0 * atan2(u[1], u[0])
            if kind_mu == 1:
                mu = w[1] / w[0] if abs(w[0]) > abs(w[2]) else w[2] / w[1]
            else:
                mu = atan2(w[2], w[1]) if w[0] > 0.0 else atan2(-w[2], -w[1])
            angles[3] = mu if swapped else nu
            angles[4] = nu if swapped else mu
            back_substitute(kinds, G, angles, line, (P[n], Q[n], order[n]), back)
            finite = True
            for k in range(6):
                value = direction * angles[k]
                finite = finite and abs(value) < 1e6
                start[joints[k]] = value
            if not finite:
                continue
            for k in range(6):
                q[k] = start[k]
            if newton(sigma, D, goals[n], tolerance, q, polish):
                if t.imag == 0.0:
                    moved = max(moved, distance(sigma, start, q))
                count[n] = keep(sigma, q, found[n], count[n])
            elif t.imag == 0.0:
                moved = np.inf
        report[n, 0], report[n, 1] = real, moved


@compiled(NOTHING(INTS, STACK, STACK, VECTOR, STACK, INTS, OUT3, COUNTS))
def bring_home(sigma, D, goals, tolerance, starts, starting, found, count):
    """Start from the postures ``starts (N, 16, 6)`` of poses nearby; keep what meets the goals."""
    q = np.empty(6)
    work = (
        np.empty((3, 4)),
        np.empty((6, 3)),
        np.empty((6, 3)),
        np.empty((6, 6)),
        np.empty(6, np.int64),
        np.empty(6),
        np.empty(6),
    )
    for n in range(goals.shape[0]):
        for k in range(starting[n]):
            for i in range(6):
                q[i] = starts[n, k, i]
            if newton(sigma, D, goals[n], tolerance, q, work):
                count[n] = keep(sigma, q, found[n], count[n])


@compiled()
def fold_at(sigma, D, root, q, u, v, work):
    """Smallest singular value of the Jacobian at a posture, and the curvature along its v.

    The curvature is ``h = u . d(J v) / ds`` on the line root + s v; ``u, v`` receive the vectors.
    """
    T, z, o, J, pivots, _, _ = work
    pose_of(sigma, D, root, T, z, o)
    jacobian_of(sigma, T, z, o, J)
    factor(J, pivots)
    small = smallest_vectors(J, pivots, u, v)
    h = 0.0
    if small > SMALL:
        return small, h
    for side in range(2):
        step = 1e-4 if side == 0 else -1e-4
        for i in range(6):
            q[i] = root[i] + step * v[i]
        pose_of(sigma, D, q, T, z, o)
        jacobian_of(sigma, T, z, o, J)
        for i in range(6):
            for j in range(6):
                h += u[i] * J[i, j] * v[j] / (2.0 * step)
    return small, h


@compiled(NOTHING(INTS, STACK, STACK, VECTOR, OUT3, COUNTS, FLAGS))
def partners(sigma, D, goals, tolerance, found, count, double):
    """Find the other root of pairs that nearly merged, and flag those that did.

    Near a fold the error along the null direction v of the Jacobian is ``s sigma + s^2 h / 2``
    with sigma the smallest singular value (left vector u) and h = u . d(J v)/ds. The partner of a
    posture is at ``s = -2 sigma / h``.
    """
    u, v, q, start = np.empty(6), np.empty(6), np.empty(6), np.empty(6)
    work = (
        np.empty((3, 4)),
        np.empty((6, 3)),
        np.empty((6, 3)),
        np.empty((6, 6)),
        np.empty(6, np.int64),
        np.empty(6),
        np.empty(6),
    )
    for n in range(goals.shape[0]):
        k = 0
        while k < count[n]:
            root = found[n, k]
            small, h = fold_at(sigma, D, root, q, u, v, work)
            double[n, k] = False
            k += 1
            # without curvature there is no fold: an infinite family, or a root of higher order
            if small > SMALL or abs(h) < FLAT or abs(h) * CLOSE < 2.0 * small:
                continue
            s = -2.0 * small / h
            for i in range(6):
                start[i] = root[i] + s * v[i]
            apart = distance(sigma, root, start)
            if apart <= MERGE:
                double[n, k - 1] = True
                continue
            known = False
            for j in range(count[n]):
                if j != k - 1 and distance(sigma, found[n, j], start) < 0.3 * apart:
                    known = True
            if known:
                continue
            for trial in range(2):
                for i in range(6):
                    q[i] = root[i] + s * (1.0 + 0.3 * trial) * v[i]
                before = count[n]
                if newton(sigma, D, goals[n], tolerance, q, work):
                    count[n] = keep(sigma, q, found[n], count[n])
                if count[n] > before:
                    break


@compiled(NOTHING(INTS, STACK, STACK, INTS, FLAGS))
def flat_singularities(sigma, D, found, count, flat):
    """Flag postures at which the Jacobian is singular and stays so along its null direction."""
    u, v, q, root = np.empty(6), np.empty(6), np.empty(6), np.empty(6)
    work = (
        np.empty((3, 4)),
        np.empty((6, 3)),
        np.empty((6, 3)),
        np.empty((6, 6)),
        np.empty(6, np.int64),
        np.empty(6),
        np.empty(6),
    )
    for n in range(found.shape[0]):
        for k in range(count[n]):
            for i in range(6):
                root[i] = found[n, k, i]
            small, h = fold_at(sigma, D, root, q, u, v, work)
            flat[n, k] = small < SINGULAR and abs(h) < FLAT


@compiled()
def slide_down(sigma, D, U, q, u, v, work):
    """Correct q (6,) in all but the null direction; what is missing along it, and the rest.

    ``u, v`` receive the singular vectors of the smallest singular value. The third result is that
    value.
    """
    T, z, o, J, pivots, e, _ = work
    along, rest, small = 0.0, np.inf, np.inf
    for step in range(3):
        pose_of(sigma, D, q, T, z, o)
        missing(U, T, e)
        jacobian_of(sigma, T, z, o, J)
        factor(J, pivots)
        small = smallest_vectors(J, pivots, u, v)
        along, size = 0.0, 0.0
        for i in range(6):
            along += u[i] * e[i]
            size += e[i] * e[i]
        rest = sqrt(max(size - along * along, 0.0))
        if step == 2 or rest > 0.3:
            break
        for i in range(6):
            e[i] -= along * u[i]
        solve_one(J, pivots, e)
        onto = 0.0
        for i in range(6):
            onto += e[i] * v[i]
        for i in range(6):
            q[i] += e[i] - onto * v[i]
    return along, rest, small


@compiled(NOTHING(INTS, STACK, STACK, MATRIX, OUT3, COUNTS))
def fall_into_valleys(sigma, D, goals, starts, valleys, count):
    """From ``starts (S, 6)`` fall to where the pose is met but for the flattest direction.

    Those that end in a valley go into ``valleys (N, S, 6)``. A family may have been so small that
    nothing is left of it at poses aside; Newton's method itself would leap along the valley.
    """
    T, z, o = np.empty((3, 4)), np.empty((6, 3)), np.empty((6, 3))
    J, pivots, e = np.empty((6, 6)), np.empty(6, np.int64), np.empty(6)
    u, v, q = np.empty(6), np.empty(6), np.empty(6)
    for n in range(goals.shape[0]):
        count[n] = 0
        for k in range(starts.shape[0]):
            for i in range(6):
                q[i] = starts[k, i]
            rest, small = np.inf, np.inf
            for _ in range(30):
                pose_of(sigma, D, q, T, z, o)
                missing(goals[n], T, e)
                jacobian_of(sigma, T, z, o, J)
                factor(J, pivots)
                small = smallest_vectors(J, pivots, u, v)
                along, size = 0.0, 0.0
                for i in range(6):
                    along += u[i] * e[i]
                    size += e[i] * e[i]
                rest = sqrt(max(size - along * along, 0.0))
                if rest < 1e-6:
                    break
                for i in range(6):
                    e[i] -= along * u[i]
                solve_one(J, pivots, e)
                onto, largest = 0.0, 0.0
                for i in range(6):
                    onto += e[i] * v[i]
                for i in range(6):
                    e[i] -= onto * v[i]
                    largest = max(largest, abs(e[i]))
                if not largest < 1e100:
                    break
                scale = min(1.0, 0.5 / largest)
                for i in range(6):
                    q[i] += scale * e[i]
            # a family leaves next to nothing missing along the valley
            if rest < 1e-6 and small < VALLEY and abs(along) < VALLEY:
                for i in range(6):
                    valleys[n, count[n], i] = q[i]
                count[n] += 1


@compiled(NOTHING(INTS, STACK, STACK, VECTOR, STACK, INTS, OUT3, COUNTS))
def follow_valleys(sigma, D, goals, tolerance, starts, starting, found, count):
    """Search along valleys for postures that Newton's method does not tell apart.

    Beside a pose with an infinite family of postures the Jacobian is nearly singular all along the
    former family, and the few postures that are left lie on it. From ``starts (N, S, 6)`` the
    valley is followed along the null direction; a posture is where what is missing along the
    left null vector changes sign.
    """
    T, z, o = np.empty((3, 4)), np.empty((6, 3)), np.empty((6, 3))
    J, pivots, e, best = np.empty((6, 6)), np.empty(6, np.int64), np.empty(6), np.empty(6)
    u, v, before, behind = np.empty(6), np.empty(6), np.empty(6), np.empty(6)
    q, origin, trial, aside = np.empty(6), np.empty(6), np.empty(6), np.empty(6)
    path = np.empty((POINTS, 6))
    work = (T, z, o, J, pivots, e, best)
    for n in range(goals.shape[0]):
        points = 0
        for k in range(starting[n]):
            # beside or on a family more is found than there is room for
            if count[n] == found.shape[1]:
                break
            for i in range(6):
                origin[i] = starts[n, k, i]
            along, rest, small = np.inf, np.inf, np.inf
            for _ in range(4):
                along, rest, small = slide_down(sigma, D, goals[n], origin, u, v, work)
            if rest > 1e-6 or small > VALLEY:
                continue
            # where nothing is missing along it either the valley is the family: a member is kept
            if max(abs(along), rest) < 5e-13:
                for i in range(6):
                    trial[i] = origin[i] if sigma[i] == 1 else wrapped(origin[i])
                count[n] = keep(sigma, trial, found[n], count[n])
            known = False
            for j in range(points):
                if is_near(sigma, path[j], origin, 2.0 * STRIDE):
                    known = True
                    break
            if known:
                continue
            closed = False
            for side in range(2):
                if closed:
                    break
                for i in range(6):
                    q[i] = origin[i]
                last, _, _ = slide_down(sigma, D, goals[n], q, u, v, work)
                for i in range(6):
                    before[i] = v[i] if side == 0 else -v[i]
                    behind[i] = u[i]
                for step in range(STRIDES):
                    for i in range(6):
                        trial[i] = q[i]
                        q[i] += STRIDE * before[i]
                    now, rest, small = slide_down(sigma, D, goals[n], q, u, v, work)
                    if rest > 1e-3 or small > VALLEY:
                        break
                    # singular vectors have no sign of their own: keep going, keep the side
                    ahead, same = 0.0, 0.0
                    for i in range(6):
                        ahead += v[i] * before[i]
                        same += u[i] * behind[i]
                    if same < 0.0:
                        now = -now
                    for i in range(6):
                        before[i] = v[i] if ahead > 0.0 else -v[i]
                        behind[i] = u[i] if same > 0.0 else -u[i]
                    # on the family itself nothing is missing anywhere, and rounding changes signs
                    if now * last < 0.0 and max(abs(now), abs(last)) > 1e-14:
                        share = last / (last - now)
                        for i in range(6):
                            trial[i] += share * (q[i] - trial[i])
                            aside[i] = trial[i]
                        met = newton(sigma, D, goals[n], tolerance, trial, work)
                        if not met:
                            # Newton's method leaps along the valley where it is as good as level
                            for i in range(6):
                                trial[i] = aside[i]
                            now_there, rest, _ = slide_down(sigma, D, goals[n], trial, u, v, work)
                            met = max(abs(now_there), rest) < 5e-13
                            for i in range(6):
                                trial[i] = trial[i] if sigma[i] == 1 else wrapped(trial[i])
                        if met:
                            count[n] = keep(sigma, trial, found[n], count[n])
                    last = now
                    if points < POINTS:
                        for i in range(6):
                            path[points, i] = q[i]
                        points += 1
                    if step > 10 and distance(sigma, q, origin) < STRIDE:
                        closed = True
                        break
