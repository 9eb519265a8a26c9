"""Torque regressors: the matrix Y with Y pi = joint torques.

Seed book section 1.6.3; C. Atkeson, C. An and J. Hollerbach 1986. Each of a link's ten parameters,
set to one, asks for a wrench; its power on the unit motion that a joint inboard gives to the link
is the entry of that joint's row. In link axes, with U the matrix of `rotation_acceleration` and u
the acceleration of the origin, the wrenches are

    M: [u; 0],    MX MY MZ: [U_k; e_k x u],    XX..ZZ: [0; column of J dw + w x J w].
"""

import numpy as np

from ._compile import CHAIN, MATRIX, NOTHING, OUT3, VECTOR, Floats, Ints, compiled
from ._motion import coordinate, link_acceleration, link_transform, rotation_acceleration
from ._vectors import (
    add,
    cross,
    dot,
    matrix,
    product,
    put_matrix,
    put_vector,
    subtract,
    times,
    transpose_times,
    vector,
    whole_matrix,
    whole_vector,
)

__all__ = ["torque_regressors"]


@compiled(NOTHING(MATRIX, MATRIX, MATRIX, *CHAIN, VECTOR, OUT3))
def torque_regressors(
    q: Floats,
    v: Floats,
    a: Floats,
    antecedent: Ints,
    sigma: Ints,
    joint: Ints,
    rotation: Floats,
    position: Floats,
    base_rotation: Floats,
    base_position: Floats,
    gravity: Floats,
    out: Floats,
) -> None:
    """Regressors of the rigid links, without drive terms.

    Parameters
    ----------
    q, v, a : (N, n)
        Joint positions, velocities, accelerations [rad or m, and per s, s^2].
    antecedent, ..., base_position
        The `Chain`.
    gravity : (3,)
        Acceleration of gravity in the world [m/s^2].
    out : (N, n, 10 f)
        Written: by link XX XY XZ YY YZ ZZ MX MY MZ M; zero where a link does not load a joint.
    """
    f = antecedent.shape[0]
    # Pose of the links in R_0, motion in their own axes
    R = np.empty((f + 1, 3, 3))
    p = np.empty((f + 1, 3))
    w = np.zeros((f + 1, 3))
    dw = np.zeros((f + 1, 3))
    U = np.zeros((f + 1, 3, 3))
    u = np.empty((f + 1, 3))
    put_matrix(R, 0, (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0))
    put_vector(p, 0, (0.0, 0.0, 0.0))
    g = transpose_times(whole_matrix(base_rotation), whole_vector(gravity))
    put_vector(u, 0, (-g[0], -g[1], -g[2]))
    for i in range(q.shape[0]):
        for row in range(out.shape[1]):
            for column in range(out.shape[2]):
                out[i, row, column] = 0.0
        for k in range(f):
            b = antecedent[k]
            c = joint[k]
            Rj, Pj = link_transform(
                sigma[k], coordinate(q, i, c), matrix(rotation, k), vector(position, k)
            )
            wj, dwj, uj = link_acceleration(
                sigma[k],
                Rj,
                Pj,
                coordinate(v, i, c),
                coordinate(a, i, c),
                vector(w, b),
                vector(dw, b),
                matrix(U, b),
                vector(u, b),
            )
            Uj = rotation_acceleration(wj, dwj)
            Rb = matrix(R, b)
            pk = add(vector(p, b), times(Rb, Pj))
            Rk = product(Rb, Rj)
            put_matrix(R, k + 1, Rk)
            put_vector(p, k + 1, pk)
            put_vector(w, k + 1, wj)
            put_vector(dw, k + 1, dwj)
            put_matrix(U, k + 1, Uj)
            put_vector(u, k + 1, uj)
            # Moments of unit second moments: the entries of J dw + w x J w, found again in U
            XX = (dwj[0], wj[0] * wj[2], -wj[0] * wj[1])
            XY = (-Uj[6], Uj[7], Uj[0] - Uj[4])
            XZ = (Uj[3], Uj[8] - Uj[0], -Uj[5])
            YY = (-wj[1] * wj[2], dwj[1], wj[0] * wj[1])
            YZ = (Uj[4] - Uj[8], -Uj[1], Uj[2])
            ZZ = (wj[1] * wj[2], -wj[0] * wj[2], dwj[2])
            x = 10 * k
            inner = k + 1
            while inner > 0:
                row = joint[inner - 1]
                z = transpose_times(Rk, (R[inner, 0, 2], R[inner, 1, 2], R[inner, 2, 2]))
                if sigma[inner - 1] == 0:
                    # Unit motion of the link about the joint's axis: [t; z]
                    t = cross(z, transpose_times(Rk, subtract(pk, vector(p, inner))))
                    pull = transpose_times(Uj, t)
                    turn = cross(uj, z)
                    out[i, row, x] = dot(z, XX)
                    out[i, row, x + 1] = dot(z, XY)
                    out[i, row, x + 2] = dot(z, XZ)
                    out[i, row, x + 3] = dot(z, YY)
                    out[i, row, x + 4] = dot(z, YZ)
                    out[i, row, x + 5] = dot(z, ZZ)
                    out[i, row, x + 6] = pull[0] + turn[0]
                    out[i, row, x + 7] = pull[1] + turn[1]
                    out[i, row, x + 8] = pull[2] + turn[2]
                    out[i, row, x + 9] = dot(t, uj)
                elif sigma[inner - 1] == 1:
                    pull = transpose_times(Uj, z)
                    out[i, row, x + 6] = pull[0]
                    out[i, row, x + 7] = pull[1]
                    out[i, row, x + 8] = pull[2]
                    out[i, row, x + 9] = dot(z, uj)
                inner = antecedent[inner - 1]
