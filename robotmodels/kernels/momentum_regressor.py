"""Generalised momentum and what changes it besides the torques, linear in the inertial parameters.

p = A v, and its rate is tau + C^T v - Q (Lagrange): no acceleration is needed. Joint i has the
unit motion S_i, so p_i is the product of S_i with the momenta of the links outboard, and
(C^T v)_i that of the rate of S_i, V x S_i in spatial notation (R. Featherstone, "Rigid Body
Dynamics Algorithms", 2008, section 2.9, for V the twist of the joint's link).
"""

import numpy as np

from ._compile import CHAIN, INTS, MATRIX, NOTHING, OUT3, VECTOR, Floats, Ints, compiled
from ._motion import coordinate, link_transform, link_velocity
from ._regressor import momentum_columns, put_columns
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

__all__ = ["momentum_regressors"]


@compiled(NOTHING(MATRIX, MATRIX, *CHAIN, VECTOR, INTS, OUT3, OUT3))
def momentum_regressors(
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
    momentum: Floats,
    force: Floats,
) -> None:
    """Regressors of p = A v and of C^T v - Q, without drive terms.

    Shapes: q, v (N, n); gravity (3,); place (10 f,) -> momentum, force (N, n, c).
    """
    f = antecedent.shape[0]
    # Pose of the links in R_0, velocities in their own axes
    R = np.empty((f + 1, 3, 3))
    p = np.empty((f + 1, 3))
    omega = np.zeros((f + 1, 3))
    speed = np.zeros((f + 1, 3))
    put_matrix(R, 0, (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0))
    put_vector(p, 0, (0.0, 0.0, 0.0))
    g = transpose_times(whole_matrix(base_rotation), whole_vector(gravity))
    nothing = (0.0, 0.0, 0.0)
    axis = (0.0, 0.0, 1.0)
    for i in range(q.shape[0]):
        for row in range(momentum.shape[1]):
            for column in range(momentum.shape[2]):
                momentum[i, row, column] = 0.0
                force[i, row, column] = 0.0
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
            pk = add(vector(p, b), times(Rb, Pj))
            Rk = product(Rb, Rj)
            put_matrix(R, k + 1, Rk)
            put_vector(p, k + 1, pk)
            put_vector(omega, k + 1, w)
            put_vector(speed, k + 1, u)
            weight = transpose_times(Rk, g)
            inner = k + 1
            while inner > 0:
                if sigma[inner - 1] != 2:
                    row = joint[inner - 1]
                    # Unit motion [t; z] of the link, and its rate [dt; dz], in link axes
                    Ri = matrix(R, inner)
                    z = transpose_times(Rk, (Ri[2], Ri[5], Ri[8]))
                    wi, vi = vector(omega, inner), vector(speed, inner)
                    turn = transpose_times(Rk, times(Ri, cross(wi, axis)))
                    if sigma[inner - 1] == 0:
                        r = transpose_times(Rk, subtract(pk, vector(p, inner)))
                        t = cross(z, r)
                        dz = turn
                        slide = transpose_times(Rk, times(Ri, cross(vi, axis)))
                        dt = add(slide, cross(turn, r))
                    else:
                        t = z
                        z = nothing
                        dz = nothing
                        dt = turn
                    put_columns(momentum, i, row, place, k, momentum_columns(t, z, w, u))
                    rate = momentum_columns(dt, dz, w, u)
                    fall = cross(weight, z)
                    pull = dot(weight, t)
                    put_columns(
                        force,
                        i,
                        row,
                        place,
                        k,
                        (
                            rate[0],
                            rate[1],
                            rate[2],
                            rate[3],
                            rate[4],
                            rate[5],
                            rate[6] + fall[0],
                            rate[7] + fall[1],
                            rate[8] + fall[2],
                            rate[9] + pull,
                        ),
                    )
                inner = antecedent[inner - 1]
