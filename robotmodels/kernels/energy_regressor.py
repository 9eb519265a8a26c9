"""Total energy, kinetic plus potential, as a row that multiplies the inertial parameters.

M. Gautier and W. Khalil 1988; seed book section 1.5.1.2: the energy of link j is h_j pi_j, with
h_j made of products of w_j and v_j (kinetic) and of the link's world pose and gravity (potential).
"""

import numpy as np

from ._compile import CHAIN, INTS, MATRIX, NOTHING, OUT3, VECTOR, Floats, Ints, compiled
from ._motion import coordinate, link_transform, link_velocity
from ._regressor import put_columns
from ._vectors import (
    add,
    cross,
    dot,
    matrix,
    product,
    put_matrix,
    put_vector,
    times,
    transpose_times,
    vector,
    whole_matrix,
    whole_vector,
)

__all__ = ["energy_regressors"]


@compiled(NOTHING(MATRIX, MATRIX, *CHAIN, VECTOR, INTS, OUT3))
def energy_regressors(
    q: Floats,
    v: Floats,
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
    """Rows h with h @ pi = kinetic + potential energy.

    Shapes: q, v (N, n); gravity (3,); place (10 f,) -> out (N, 1, c).
    """
    f = antecedent.shape[0]
    g = whole_vector(gravity)
    R = np.empty((f + 1, 3, 3))
    p = np.empty((f + 1, 3))
    omega = np.zeros((f + 1, 3))
    speed = np.zeros((f + 1, 3))
    put_matrix(R, 0, whole_matrix(base_rotation))
    put_vector(p, 0, whole_vector(base_position))
    for i in range(q.shape[0]):
        for column in range(out.shape[2]):
            out[i, 0, column] = 0.0
        for k in range(f):
            b = antecedent[k]
            c = joint[k]
            Rj, Pj = link_transform(
                sigma[k], coordinate(q, i, c), matrix(rotation, k), vector(position, k)
            )
            w, u = link_velocity(
                sigma[k], Rj, Pj, coordinate(v, i, c), vector(omega, b), vector(speed, b)
            )
            Rb = matrix(R, b)
            Rk = product(Rb, Rj)
            pk = add(vector(p, b), times(Rb, Pj))
            put_matrix(R, k + 1, Rk)
            put_vector(p, k + 1, pk)
            put_vector(omega, k + 1, w)
            put_vector(speed, k + 1, u)
            first = cross(u, w)
            fall = transpose_times(Rk, g)
            columns = (
                0.5 * w[0] * w[0],
                w[0] * w[1],
                w[0] * w[2],
                0.5 * w[1] * w[1],
                w[1] * w[2],
                0.5 * w[2] * w[2],
                first[0] - fall[0],
                first[1] - fall[1],
                first[2] - fall[2],
                0.5 * dot(u, u) - dot(g, pk),
            )
            put_columns(out, i, 0, place, k, columns)
