"""Mass and Coriolis matrices, and joint accelerations.

Mass matrices by composite rigid bodies (M. Walker and D. Orin 1982). Coriolis matrices by
S. Echeandia and P. Wensing 2021, algorithm 1: each body has the factor
B = ((v x*) I + (I v) x* - I (v x)) / 2, [[0, -[p]x], [0, D]] with linear before angular; composite
bodies add up I and B, and for every joint i from j down to the base, with dS_j = v_j x S_j,
C_ij = S_i . (I dS_j + B S_j) and C_ji = dS_i . I S_j + S_i . B^T S_j.

Accelerations: M a = tau - h(q, v) by Cholesky. M need not be positive definite for parameters that
are not physical: it is then solved by elimination, and the sample is reported.
"""

from math import sqrt

import numpy as np

from . import Chain
from ._compile import CHAIN, INT, MATRIX, NOTHING, OUT2, OUT3, VECTOR, Floats, compiled
from ._inertia import Moments, inertia_of, inertia_times, join_antecedent
from ._motion import carry_velocity, link_pose
from ._vectors import (
    Matrix,
    Vector,
    add,
    cross,
    dot,
    matrix,
    product,
    product_transpose,
    put_matrix,
    put_vector,
    scale,
    subtract,
    times,
    vector,
)
from .linear_systems import factor, solve
from .torques import torque_room, torques_of_sample

__all__ = ["coriolis_matrices", "joint_accelerations", "mass_matrices"]

POSITIVE, INDEFINITE, SINGULAR = 0, 1, 2  # what a symmetric matrix is
EPSILON = float(np.finfo(np.float64).eps)


@compiled(inlined=True)
def mass_of_sample(
    chain: Chain, pi: Floats, R: Floats, P: Floats, composite: Floats, out: Floats, i: int
) -> None:
    """Mass matrix of the poses R, P of the links in their antecedents, without rotor inertia.

    Shapes: pi (f, 10), R (f + 1, 3, 3), P (f + 1, 3), composite (f, 10) -> out[i] (n, n).
    """
    f = chain.antecedent.shape[0]
    n = out.shape[1]
    for row in range(n):
        for column in range(n):
            out[i, row, column] = 0.0
    for k in range(f):
        for x in range(10):
            composite[k, x] = pi[k, x]
    for j in range(f, 0, -1):
        J, MS, M = inertia_of(composite, j - 1)
        b = chain.antecedent[j - 1]
        if b > 0:
            join_antecedent(composite, b - 1, matrix(R, j), vector(P, j), J, MS, M)
        if chain.sigma[j - 1] == 2:
            continue
        if chain.sigma[j - 1] == 0:
            force = (-MS[1], MS[0], 0.0)
            moment = (J[2], J[4], J[5])
        else:
            force = (0.0, 0.0, M)
            moment = (MS[1], -MS[0], 0.0)
        column = chain.joint[j - 1]
        inner = j
        while inner > 0:
            if chain.sigma[inner - 1] != 2:
                entry = moment[2] if chain.sigma[inner - 1] == 0 else force[2]
                out[i, chain.joint[inner - 1], column] = entry
                out[i, column, chain.joint[inner - 1]] = entry
            Rj = matrix(R, inner)
            force = times(Rj, force)
            moment = add(times(Rj, moment), cross(vector(P, inner), force))
            inner = chain.antecedent[inner - 1]


@compiled(NOTHING(MATRIX, CHAIN, MATRIX, OUT3))
def mass_matrices(q: Floats, chain: Chain, pi: Floats, out: Floats) -> None:
    """Mass matrices of the rigid links. Shapes: q (N, n), pi (f, 10) -> out (N, n, n)."""
    f = chain.antecedent.shape[0]
    R, P, composite = np.empty((f + 1, 3, 3)), np.empty((f + 1, 3)), np.empty((f, 10))
    for i in range(q.shape[0]):
        for k in range(f):
            Rj, Pj = link_pose(chain, k, q, i)
            put_matrix(R, k + 1, Rj)
            put_vector(P, k + 1, Pj)
        mass_of_sample(chain, pi, R, P, composite, out, i)


@compiled()
def body_factor(J: Moments, MS: Vector, M: float, w: Vector, v: Vector) -> tuple[Vector, Matrix]:
    """Momentum p and matrix D of one body's factor B.

    D = ([w]x J - J [w]x - [MS x v + J w]x - [v]x [MS]x - [MS]x [v]x) / 2.
    """
    p = add(scale(M, v), cross(w, MS))
    m = add(cross(MS, v), inertia_times(J, w))
    # J [w]x is minus the transpose of [w]x J, whose columns these are
    first = cross(w, (J[0], J[1], J[2]))
    second = cross(w, (J[1], J[3], J[4]))
    third = cross(w, (J[2], J[4], J[5]))
    vh = 2.0 * dot(v, MS)
    xx = first[0] - v[0] * MS[0] + 0.5 * vh
    yy = second[1] - v[1] * MS[1] + 0.5 * vh
    zz = third[2] - v[2] * MS[2] + 0.5 * vh
    xy = 0.5 * (first[1] + second[0] - v[0] * MS[1] - v[1] * MS[0])
    xz = 0.5 * (first[2] + third[0] - v[0] * MS[2] - v[2] * MS[0])
    yz = 0.5 * (second[2] + third[1] - v[1] * MS[2] - v[2] * MS[1])
    x, y, z = 0.5 * m[0], 0.5 * m[1], 0.5 * m[2]
    return p, (xx, xy + z, xz - y, xy - z, yy, yz + x, xz + y, yz - x, zz)


@compiled(NOTHING(MATRIX, MATRIX, CHAIN, MATRIX, OUT3))
def coriolis_matrices(q: Floats, v: Floats, chain: Chain, pi: Floats, out: Floats) -> None:
    """Christoffel-consistent Coriolis matrices: dM/dt - 2 C is skew-symmetric.

    Shapes: q, v (N, n); pi (f, 10) -> out (N, n, n).
    """
    f = chain.antecedent.shape[0]
    n = out.shape[1]
    axis = (0.0, 0.0, 1.0)
    R = np.empty((f + 1, 3, 3))
    P = np.empty((f + 1, 3))
    omega = np.zeros((f + 1, 3))
    speed = np.zeros((f + 1, 3))
    composite = np.empty((f, 10))
    momentum = np.empty((f, 3))
    D = np.empty((f, 3, 3))
    for i in range(q.shape[0]):
        for row in range(n):
            for column in range(n):
                out[i, row, column] = 0.0
        for k in range(f):
            Rj, Pj = link_pose(chain, k, q, i)
            wj, vj = carry_velocity(chain, k, v, i, Rj, Pj, omega, speed)
            J, MS, M = inertia_of(pi, k)
            pj, Dj = body_factor(J, MS, M, wj, vj)
            put_matrix(R, k + 1, Rj)
            put_vector(P, k + 1, Pj)
            put_vector(momentum, k, pj)
            put_matrix(D, k, Dj)
            for x in range(10):
                composite[k, x] = pi[k, x]
        for j in range(f, 0, -1):
            Rj, Pj = matrix(R, j), vector(P, j)
            J, MS, M = inertia_of(composite, j - 1)
            pj, Dj = vector(momentum, j - 1), matrix(D, j - 1)
            b = chain.antecedent[j - 1]
            if b > 0:
                join_antecedent(composite, b - 1, Rj, Pj, J, MS, M)
                # D_b = R D R^T - [P]x [R p]x, and [P]x [h]x = h P^T - (P.h) 1
                h = times(Rj, pj)
                Db = product_transpose(product(Rj, Dj), Rj)
                Ph = dot(Pj, h)
                put_vector(momentum, b - 1, add(vector(momentum, b - 1), h))
                for row in range(3):
                    for column in range(3):
                        D[b - 1, row, column] += Db[3 * row + column] - h[row] * Pj[column]
                    D[b - 1, row, row] += Ph
            if chain.sigma[j - 1] == 2:
                continue
            wj, vj = vector(omega, j), vector(speed, j)
            # Wrenches I dS + B S, I S and B^T S, where I [a; b] = [M a + b x MS; MS x a + J b]
            if chain.sigma[j - 1] == 0:
                da, db = cross(vj, axis), cross(wj, axis)
                f1 = subtract(add(scale(M, da), cross(db, MS)), cross(pj, axis))
                m1 = add(add(cross(MS, da), inertia_times(J, db)), (Dj[2], Dj[5], Dj[8]))
                f2 = (-MS[1], MS[0], 0.0)
                m2 = (J[2], J[4], J[5])
                m3 = (Dj[6], Dj[7], Dj[8])
            else:
                da = cross(wj, axis)
                f1 = scale(M, da)
                m1 = cross(MS, da)
                f2 = (0.0, 0.0, M)
                m2 = (MS[1], -MS[0], 0.0)
                m3 = cross(pj, axis)
            outer = chain.joint[j - 1]
            inner = j
            while inner > 0:
                if chain.sigma[inner - 1] != 2:
                    w, u = vector(omega, inner), vector(speed, inner)
                    if chain.sigma[inner - 1] == 0:
                        c_ij = m1[2]
                        c_ji = dot(cross(u, axis), f2) + dot(cross(w, axis), m2) + m3[2]
                    else:
                        # B^T S is a pure moment, so it does no work on a prismatic joint
                        c_ij = f1[2]
                        c_ji = dot(cross(w, axis), f2)
                    out[i, chain.joint[inner - 1], outer] = c_ij
                    out[i, outer, chain.joint[inner - 1]] = c_ji
                Ri, Pi = matrix(R, inner), vector(P, inner)
                f1 = times(Ri, f1)
                m1 = add(times(Ri, m1), cross(Pi, f1))
                f2 = times(Ri, f2)
                m2 = add(times(Ri, m2), cross(Pi, f2))
                m3 = times(Ri, m3)
                inner = chain.antecedent[inner - 1]


@compiled()
def solve_definite(A: Floats, b: Floats, diagonal: Floats) -> int:
    """Solve ``A x = b`` into b by Cholesky: POSITIVE; else SINGULAR or INDEFINITE.

    A has unit diagonal, kept in ``diagonal`` (n,); its lower half is overwritten. A zero pivot
    with a non-zero rest of its column means INDEFINITE.
    """
    n = A.shape[0]
    least = 4.0 * n * EPSILON
    for k in range(n):
        diagonal[k] = A[k, k]
    kind = POSITIVE
    for k in range(n):
        pivot = A[k, k]
        for column in range(k):
            pivot -= A[k, column] * A[k, column]
        for row in range(k + 1, n):
            rest = A[k, row]
            for column in range(k):
                rest -= A[row, column] * A[k, column]
            A[row, k] = rest
        if not pivot > least:
            kind = INDEFINITE if pivot < -least else SINGULAR
            for row in range(k + 1, n):
                if A[row, k] * A[row, k] > 4.0 * least:
                    kind = INDEFINITE
            break
        A[k, k] = sqrt(pivot)
        for row in range(k + 1, n):
            A[row, k] /= A[k, k]
    if kind != POSITIVE:
        for row in range(n):
            A[row, row] = diagonal[row]
            for column in range(row):
                A[row, column] = A[column, row]
        return kind
    for row in range(n):
        rest = b[row]
        for column in range(row):
            rest -= A[row, column] * b[column]
        b[row] = rest / A[row, row]
    for row in range(n - 1, -1, -1):
        rest = b[row]
        for column in range(row + 1, n):
            rest -= A[column, row] * b[column]
        b[row] = rest / A[row, row]
    return POSITIVE


@compiled()
def solve_in_place(A: Floats, b: Floats, sizes: Floats, diagonal: Floats) -> int:
    """Solve ``A x = b`` into b, spoiling A, which is POSITIVE or INDEFINITE.

    Not if it is SINGULAR to rounding. ``sizes`` and ``diagonal`` (n,) are scratch.
    """
    n = A.shape[0]
    # Coordinates of unit diagonal (of the row's size where that is zero), so that the units and
    # sizes of the bodies do not decide what is singular
    for row in range(n):
        sizes[row] = abs(A[row, row])
        if not sizes[row] > 0.0:
            for column in range(n):
                sizes[row] = max(sizes[row], abs(A[row, column]))
        if not sizes[row] > 0.0:
            return SINGULAR
        sizes[row] = sqrt(sizes[row])
    for row in range(n):
        for column in range(n):
            A[row, column] /= sizes[row] * sizes[column]
        b[row] /= sizes[row]
    kind = solve_definite(A, b, diagonal)
    if kind == SINGULAR:
        return SINGULAR
    if kind == INDEFINITE and not eliminate(A, b):
        return SINGULAR
    for row in range(n):
        b[row] /= sizes[row]
    return kind


@compiled()
def eliminate(A: Floats, b: Floats) -> bool:
    """Solve ``A x = b`` into b by pivoting rows; False if A is singular to rounding."""
    n = A.shape[0]
    for row in range(n):
        scale = 0.0
        for column in range(n):
            scale = max(scale, abs(A[row, column]))
        if not scale > 0.0:
            return False
        # Rows of unit size, so that rows of different units compare
        for column in range(n):
            A[row, column] /= scale
        b[row] /= scale
    pivots = np.empty(n, dtype=np.int64)
    if not factor(A, pivots) > 4.0 * n * EPSILON:
        return False
    solve(A, pivots, b)
    return True


@compiled(INT(MATRIX, MATRIX, MATRIX, CHAIN, MATRIX, VECTOR, MATRIX, OUT2))
def joint_accelerations(
    q: Floats,
    v: Floats,
    tau: Floats,
    chain: Chain,
    pi: Floats,
    gravity: Floats,
    rotor: Floats,
    out: Floats,
) -> int:
    """Accelerations of the joints under given torques.

    Shapes: q, v, tau (N, n); pi (f, 10); gravity (3,); rotor (n, n) -> out (N, n).
    """
    samples, n = q.shape
    f = chain.antecedent.shape[0]
    room = torque_room(chain, gravity)
    composite, M, still = np.empty((f, 10)), np.empty((1, n, n)), np.zeros((1, n))
    sizes, diagonal = np.empty(n), np.empty(n)
    singular, indefinite = -1, -1
    for i in range(samples):
        h = out[i : i + 1]
        torques_of_sample(q[i : i + 1], v[i : i + 1], still, 0, chain, pi, room, h)
        mass_of_sample(chain, pi, room[0], room[1], composite, M, 0)
        for row in range(n):
            h[0, row] = tau[i, row] - h[0, row]
            for column in range(n):
                M[0, row, column] += rotor[row, column]
        kind = solve_in_place(M[0], h[0], sizes, diagonal)
        if kind == SINGULAR and singular < 0:
            singular = i
        if kind == INDEFINITE and indefinite < 0:
            indefinite = i
        if kind == SINGULAR:
            for row in range(n):
                h[0, row] = np.nan
    if singular < 0 and indefinite >= 0:
        return -2 - indefinite
    return singular
