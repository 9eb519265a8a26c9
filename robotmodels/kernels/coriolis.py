"""Coriolis matrices that are consistent with the Christoffel symbols.

S. Echeandia and P. Wensing 2021, "Numerical Methods to Compute the Coriolis Matrix and
Christoffel Symbols for Rigid-Body Systems", algorithm 1. Each body has the factor
B = ((v x*) I + (I v) x* - I (v x)) / 2; composite bodies add up I and B. With S_j the axis of
joint j and dS_j = v_j x S_j, for every joint i from j down to the base

    C_ij = S_i . (I dS_j + B S_j),    C_ji = dS_i . I S_j + S_i . B^T S_j.

With linear before angular, B is [[0, -[p]x], [0, D]]: p is the linear momentum M v + w x MS and
D a 3x3 matrix.
"""

import numpy as np

from ._compile import CHAIN, MATRIX, NOTHING, OUT3, Floats, Ints, compiled
from ._inertia import Moments, inertia_of, inertia_times, join_antecedent
from ._motion import coordinate, link_transform, link_velocity
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

__all__ = ["coriolis_matrices"]


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


@compiled(NOTHING(MATRIX, MATRIX, *CHAIN, MATRIX, OUT3))
def coriolis_matrices(
    q: Floats,
    v: Floats,
    antecedent: Ints,
    sigma: Ints,
    joint: Ints,
    rotation: Floats,
    position: Floats,
    base_rotation: Floats,
    base_position: Floats,
    pi: Floats,
    out: Floats,
) -> None:
    """Christoffel-consistent Coriolis matrices: dM/dt - 2 C is skew-symmetric.

    Shapes: q, v (N, n); pi (f, 10) -> out (N, n, n).
    """
    f = antecedent.shape[0]
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
            b = antecedent[k]
            c = joint[k]
            Rj, Pj = link_transform(
                sigma[k], coordinate(q, i, c), matrix(rotation, k), vector(position, k)
            )
            wj, vj = link_velocity(
                sigma[k], Rj, Pj, coordinate(v, i, c), vector(omega, b), vector(speed, b)
            )
            J, MS, M = inertia_of(pi, k)
            pj, Dj = body_factor(J, MS, M, wj, vj)
            put_matrix(R, k + 1, Rj)
            put_vector(P, k + 1, Pj)
            put_vector(omega, k + 1, wj)
            put_vector(speed, k + 1, vj)
            put_vector(momentum, k, pj)
            put_matrix(D, k, Dj)
            for x in range(10):
                composite[k, x] = pi[k, x]
        for j in range(f, 0, -1):
            Rj, Pj = matrix(R, j), vector(P, j)
            J, MS, M = inertia_of(composite, j - 1)
            pj, Dj = vector(momentum, j - 1), matrix(D, j - 1)
            b = antecedent[j - 1]
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
            if sigma[j - 1] == 2:
                continue
            wj, vj = vector(omega, j), vector(speed, j)
            # Wrenches I dS + B S, I S and B^T S, where I [a; b] = [M a + b x MS; MS x a + J b]
            if sigma[j - 1] == 0:
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
            outer = joint[j - 1]
            inner = j
            while inner > 0:
                if sigma[inner - 1] != 2:
                    w, u = vector(omega, inner), vector(speed, inner)
                    if sigma[inner - 1] == 0:
                        c_ij = m1[2]
                        c_ji = dot(cross(u, axis), f2) + dot(cross(w, axis), m2) + m3[2]
                    else:
                        # B^T S is a pure moment, so it does no work on a prismatic joint
                        c_ij = f1[2]
                        c_ji = dot(cross(w, axis), f2)
                    out[i, joint[inner - 1], outer] = c_ij
                    out[i, outer, joint[inner - 1]] = c_ji
                Ri, Pi = matrix(R, inner), vector(P, inner)
                f1 = times(Ri, f1)
                m1 = add(times(Ri, m1), cross(Pi, f1))
                f2 = times(Ri, f2)
                m2 = add(times(Ri, m2), cross(Pi, f2))
                m3 = times(Ri, m3)
                inner = antecedent[inner - 1]
