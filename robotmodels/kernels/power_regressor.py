"""Power of the joint torques as a row that multiplies the inertial parameters.

Seed book section 1.6.3 (power model): the wrench that a unit parameter of a link asks for, on the
link's own velocity. It is the rate of the energy's row, and needs no sum over the joints.
"""

import numpy as np

from ._compile import CHAIN, INTS, MATRIX, NOTHING, OUT3, VECTOR, Floats, Ints, compiled
from ._motion import coordinate, link_acceleration, link_transform, rotation_acceleration
from ._regressor import put_columns, wrench_columns
from ._vectors import (
    add,
    cross,
    matrix,
    put_matrix,
    put_vector,
    transpose_times,
    vector,
    whole_matrix,
    whole_vector,
)

__all__ = ["power_regressors"]


@compiled(NOTHING(MATRIX, MATRIX, MATRIX, *CHAIN, VECTOR, INTS, OUT3))
def power_regressors(
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
    """Rows d with d @ pi = power of the torques of the rigid links.

    Shapes: q, v, a (N, n); gravity (3,); place (10 f,) -> out (N, 1, c).
    """
    f = antecedent.shape[0]
    w = np.zeros((f + 1, 3))
    dw = np.zeros((f + 1, 3))
    U = np.zeros((f + 1, 3, 3))
    u = np.empty((f + 1, 3))
    speed = np.zeros((f + 1, 3))
    g = transpose_times(whole_matrix(base_rotation), whole_vector(gravity))
    put_vector(u, 0, (-g[0], -g[1], -g[2]))
    for i in range(q.shape[0]):
        for column in range(out.shape[2]):
            out[i, 0, column] = 0.0
        for k in range(f):
            b = antecedent[k]
            c = joint[k]
            rate = coordinate(v, i, c)
            Rj, Pj = link_transform(
                sigma[k], coordinate(q, i, c), matrix(rotation, k), vector(position, k)
            )
            t = transpose_times(Rj, add(vector(speed, b), cross(vector(w, b), Pj)))
            if sigma[k] == 1:
                t = (t[0], t[1], t[2] + rate)
            wj, dwj, uj = link_acceleration(
                sigma[k],
                Rj,
                Pj,
                rate,
                coordinate(a, i, c),
                vector(w, b),
                vector(dw, b),
                matrix(U, b),
                vector(u, b),
            )
            Uj = rotation_acceleration(wj, dwj)
            put_vector(speed, k + 1, t)
            put_vector(w, k + 1, wj)
            put_vector(dw, k + 1, dwj)
            put_matrix(U, k + 1, Uj)
            put_vector(u, k + 1, uj)
            put_columns(out, i, 0, place, k, wrench_columns(t, wj, wj, dwj, Uj, uj))
