"""Mass matrices by composite rigid bodies.

M. Walker and D. Orin 1982; R. Featherstone, *Rigid Body Dynamics Algorithms*, section 6.2: with
everything outboard of joint j frozen into one body, a unit acceleration of j asks for a wrench,
which the joints inboard feel along their own axes.
"""

import numpy as np

from ._compile import CHAIN, MATRIX, NOTHING, OUT3, Floats, Ints, compiled
from ._inertia import inertia_of, join_antecedent
from ._motion import coordinate, link_transform
from ._vectors import add, cross, matrix, put_matrix, put_vector, times, vector

__all__ = ["mass_matrices"]


@compiled(NOTHING(MATRIX, *CHAIN, MATRIX, OUT3))
def mass_matrices(
    q: Floats,
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
    """Mass matrices of the rigid links, without rotor inertia.

    Shapes: q (N, n), pi (f, 10) -> out (N, n, n).
    """
    f = antecedent.shape[0]
    n = out.shape[1]
    R = np.empty((f + 1, 3, 3))
    P = np.empty((f + 1, 3))
    composite = np.empty((f, 10))
    for i in range(q.shape[0]):
        for row in range(n):
            for column in range(n):
                out[i, row, column] = 0.0
        for k in range(f):
            qj = coordinate(q, i, joint[k])
            Rj, Pj = link_transform(sigma[k], qj, matrix(rotation, k), vector(position, k))
            put_matrix(R, k + 1, Rj)
            put_vector(P, k + 1, Pj)
            for x in range(10):
                composite[k, x] = pi[k, x]
        for j in range(f, 0, -1):
            J, MS, M = inertia_of(composite, j - 1)
            b = antecedent[j - 1]
            if b > 0:
                join_antecedent(composite, b - 1, matrix(R, j), vector(P, j), J, MS, M)
            if sigma[j - 1] == 2:
                continue
            if sigma[j - 1] == 0:
                force = (-MS[1], MS[0], 0.0)
                moment = (J[2], J[4], J[5])
            else:
                force = (0.0, 0.0, M)
                moment = (MS[1], -MS[0], 0.0)
            column = joint[j - 1]
            inner = j
            while inner > 0:
                if sigma[inner - 1] != 2:
                    entry = moment[2] if sigma[inner - 1] == 0 else force[2]
                    out[i, joint[inner - 1], column] = entry
                    out[i, column, joint[inner - 1]] = entry
                Rj = matrix(R, inner)
                force = times(Rj, force)
                moment = add(times(Rj, moment), cross(vector(P, inner), force))
                inner = antecedent[inner - 1]
