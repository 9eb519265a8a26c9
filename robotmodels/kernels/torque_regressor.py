"""Torque regressors: the matrix Y with Y pi = joint torques.

Seed book section 1.6.3; C. Atkeson, C. An and J. Hollerbach 1986. Each of a link's ten parameters,
set to one, asks for a wrench; its power on the unit motion that a joint inboard gives to the link
is the entry of that joint's row.
"""

import numpy as np

from ._compile import CHAIN, INTS, MATRIX, NOTHING, OUT3, VECTOR, Floats, Ints, compiled
from ._motion import coordinate, link_acceleration, link_transform, rotation_acceleration
from ._regressor import put_columns, wanted_of_links, wanted_wrench_columns
from ._vectors import (
    add,
    cross,
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


@compiled(NOTHING(MATRIX, MATRIX, MATRIX, *CHAIN, VECTOR, INTS, OUT3))
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
    place: Ints,
    out: Floats,
) -> None:
    """Regressors of the rigid links, without drive terms.

    Shapes: q, v, a (N, n); gravity (3,); place (10 f,) -> out (N, n, c).
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
    nothing = (0.0, 0.0, 0.0)
    wanted = np.zeros(f, dtype=np.int64)
    needed = np.zeros(f, dtype=np.bool_)
    wanted_of_links(place, antecedent, wanted, needed)
    for i in range(q.shape[0]):
        for row in range(out.shape[1]):
            for column in range(out.shape[2]):
                out[i, row, column] = 0.0
        for k in range(f):
            if not needed[k]:
                continue
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
            bits = wanted[k]
            if bits == 0:
                continue
            inner = k + 1
            while inner > 0:
                row = joint[inner - 1]
                z = transpose_times(Rk, (R[inner, 0, 2], R[inner, 1, 2], R[inner, 2, 2]))
                if sigma[inner - 1] == 0:
                    # Unit motion of the link about the joint's axis
                    t = cross(z, transpose_times(Rk, subtract(pk, vector(p, inner))))
                    columns = wanted_wrench_columns(t, z, wj, dwj, Uj, uj, bits)
                    put_columns(out, i, row, place, k, columns)
                elif sigma[inner - 1] == 1:
                    columns = wanted_wrench_columns(z, nothing, wj, dwj, Uj, uj, bits)
                    put_columns(out, i, row, place, k, columns)
                inner = antecedent[inner - 1]
