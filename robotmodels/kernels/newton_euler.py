"""Joint torques by the recursive Newton-Euler algorithm.

Seed book section 1.5.2 (J. Luh, M. Walker and R. Paul 1980, in link frames and linear in the
inertial parameters). Forward, velocities, accelerations and the wrench each link needs:
F_j = M u_j + U_j MS_j and N_j = J dw_j + w_j x J w_j + MS_j x u_j. Backward, the wrenches that
links pass on to their antecedents; a joint's torque is the component on its axis.
"""

import numpy as np

from ._compile import CHAIN, MATRIX, NOTHING, OUT2, VECTOR, Floats, Ints, compiled
from ._inertia import inertia_of, inertia_times
from ._motion import coordinate, link_acceleration, link_transform, rotation_acceleration
from ._vectors import (
    add,
    cross,
    matrix,
    put_matrix,
    put_vector,
    scale,
    times,
    transpose_times,
    vector,
    whole_matrix,
    whole_vector,
)

__all__ = ["joint_torques"]


@compiled(NOTHING(MATRIX, MATRIX, MATRIX, *CHAIN, MATRIX, VECTOR, OUT2))
def joint_torques(
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
    pi: Floats,
    gravity: Floats,
    out: Floats,
) -> None:
    """Torques of the rigid links, without drive terms.

    Shapes: q, v, a (N, n); pi (f, 10); gravity (3,) -> out (N, n).
    """
    f = antecedent.shape[0]
    R = np.empty((f + 1, 3, 3))
    P = np.empty((f + 1, 3))
    w = np.zeros((f + 1, 3))
    dw = np.zeros((f + 1, 3))
    U = np.zeros((f + 1, 3, 3))
    u = np.empty((f + 1, 3))
    force = np.empty((f + 1, 3))
    moment = np.empty((f + 1, 3))
    # A base that accelerates against gravity loads the links as gravity does
    g = transpose_times(whole_matrix(base_rotation), whole_vector(gravity))
    put_vector(u, 0, (-g[0], -g[1], -g[2]))
    for i in range(q.shape[0]):
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
            J, MS, M = inertia_of(pi, k)
            F = add(scale(M, uj), times(Uj, MS))
            N = add(add(inertia_times(J, dwj), cross(wj, inertia_times(J, wj))), cross(MS, uj))
            put_matrix(R, k + 1, Rj)
            put_vector(P, k + 1, Pj)
            put_vector(w, k + 1, wj)
            put_vector(dw, k + 1, dwj)
            put_matrix(U, k + 1, Uj)
            put_vector(u, k + 1, uj)
            put_vector(force, k + 1, F)
            put_vector(moment, k + 1, N)
        for j in range(f, 0, -1):
            F = vector(force, j)
            N = vector(moment, j)
            if sigma[j - 1] == 0:
                out[i, joint[j - 1]] = N[2]
            elif sigma[j - 1] == 1:
                out[i, joint[j - 1]] = F[2]
            b = antecedent[j - 1]
            if b > 0:
                Rj = matrix(R, j)
                Fb = times(Rj, F)
                Nb = add(times(Rj, N), cross(vector(P, j), Fb))
                put_vector(force, b, add(vector(force, b), Fb))
                put_vector(moment, b, add(vector(moment, b), Nb))
