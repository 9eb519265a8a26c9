"""Kinetic and potential energies, linear in the inertial parameters.

Seed book section 1.5.1.2: E_j = (M v.v + 2 MS.(v x w) + w.J w) / 2 in link axes, and
U_j = -g.(M p + R MS) with the world pose (R, p) of the link: zero for masses at the world's
origin, as in Pinocchio.
"""

import numpy as np

from ._compile import CHAIN, MATRIX, NOTHING, OUT1, VECTOR, Floats, Ints, compiled
from ._inertia import inertia_of, inertia_times
from ._motion import coordinate, link_transform, link_velocity
from ._vectors import (
    add,
    cross,
    dot,
    matrix,
    product,
    put_matrix,
    put_vector,
    scale,
    times,
    vector,
    whole_matrix,
    whole_vector,
)

__all__ = ["kinetic_energies", "potential_energies"]


@compiled(NOTHING(MATRIX, MATRIX, *CHAIN, MATRIX, OUT1))
def kinetic_energies(
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
    """Kinetic energy of the rigid links, without rotors.

    Shapes: q, v (N, n); pi (f, 10) -> out (N,).
    """
    f = antecedent.shape[0]
    omega = np.zeros((f + 1, 3))
    speed = np.zeros((f + 1, 3))
    for i in range(q.shape[0]):
        twice = 0.0
        for k in range(f):
            b = antecedent[k]
            c = joint[k]
            Rj, Pj = link_transform(
                sigma[k], coordinate(q, i, c), matrix(rotation, k), vector(position, k)
            )
            wj, vj = link_velocity(
                sigma[k], Rj, Pj, coordinate(v, i, c), vector(omega, b), vector(speed, b)
            )
            put_vector(omega, k + 1, wj)
            put_vector(speed, k + 1, vj)
            J, MS, M = inertia_of(pi, k)
            twice += M * dot(vj, vj) + 2.0 * dot(MS, cross(vj, wj)) + dot(wj, inertia_times(J, wj))
        out[i] = 0.5 * twice


@compiled(NOTHING(MATRIX, *CHAIN, MATRIX, VECTOR, OUT1))
def potential_energies(
    q: Floats,
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
    """Energy of the links in the field of gravity.

    Shapes: q (N, n), pi (f, 10), gravity (3,) -> out (N,).
    """
    f = antecedent.shape[0]
    g = whole_vector(gravity)
    R = np.empty((f + 1, 3, 3))
    p = np.empty((f + 1, 3))
    put_matrix(R, 0, whole_matrix(base_rotation))
    put_vector(p, 0, whole_vector(base_position))
    for i in range(q.shape[0]):
        energy = 0.0
        for k in range(f):
            b = antecedent[k]
            qj = coordinate(q, i, joint[k])
            Rj, Pj = link_transform(sigma[k], qj, matrix(rotation, k), vector(position, k))
            Rb = matrix(R, b)
            Rk = product(Rb, Rj)
            pk = add(vector(p, b), times(Rb, Pj))
            put_matrix(R, k + 1, Rk)
            put_vector(p, k + 1, pk)
            _, MS, M = inertia_of(pi, k)
            energy -= dot(g, add(scale(M, pk), times(Rk, MS)))
        out[i] = energy
