"""Joint torques by the recursive Newton-Euler algorithm, and energies.

Book section 1.5.2 (J. Luh, M. Walker and R. Paul 1980, in link frames and linear in the
inertial parameters). Forward, velocities, accelerations and the wrench each link needs; backward,
the wrenches that links pass on to their antecedents: a joint's torque is the component on its axis.
Energies (section 1.5.1.2): E_j = (M v.v + 2 MS.(v x w) + w.J w) / 2 in link axes, and
U_j = -g.(M p + R MS) with the world pose (R, p) of the link: zero for masses at the world's
origin, as in Pinocchio.
"""

import numpy as np

from . import Chain
from ._compile import CHAIN, MATRIX, NOTHING, OUT2, VECTOR, Floats, compiled
from ._inertia import inertia_of, inertia_times
from ._motion import (
    base_acceleration,
    carry_acceleration,
    carry_pose,
    carry_velocity,
    link_pose,
    link_wrench,
)
from ._vectors import (
    add,
    cross,
    dot,
    matrix,
    put_matrix,
    put_vector,
    scale,
    times,
    vector,
    whole_matrix,
    whole_vector,
)

__all__ = ["energies", "joint_torques"]


@compiled()
def torque_room(chain: Chain, gravity: Floats) -> tuple[Floats, ...]:
    """Scratch of `torques_of_sample`: motions and wrenches of the base, in rows 0, and the links.

    Poses of the links in their antecedents come first: R (f + 1, 3, 3) and P (f + 1, 3).
    """
    f = chain.antecedent.shape[0] + 1
    R, U, P, u = np.zeros((f, 3, 3)), np.zeros((f, 3, 3)), np.zeros((f, 3)), np.zeros((f, 3))
    base_acceleration(chain, gravity, u)
    return R, P, U, u, np.zeros((f, 3)), np.zeros((f, 3)), np.zeros((f, 3)), np.zeros((f, 3))


@compiled(inlined=True)
def torques_of_sample(
    q: Floats,
    v: Floats,
    a: Floats,
    i: int,
    chain: Chain,
    pi: Floats,
    room: tuple[Floats, ...],
    out: Floats,
) -> None:
    """Torques of sample i into ``out (N, n)``, and the poses of its links into the scratch."""
    f = chain.antecedent.shape[0]
    R, P, U, u, w, dw, force, moment = room
    for k in range(f):
        Rj, Pj = link_pose(chain, k, q, i)
        wj, dwj, Uj, uj = carry_acceleration(chain, k, v, a, i, Rj, Pj, w, dw, U, u)
        F, N = link_wrench(pi, k, wj, dwj, Uj, uj)
        put_matrix(R, k + 1, Rj)
        put_vector(P, k + 1, Pj)
        put_vector(force, k + 1, F)
        put_vector(moment, k + 1, N)
    for j in range(f, 0, -1):
        F = vector(force, j)
        N = vector(moment, j)
        if chain.sigma[j - 1] == 0:
            out[i, chain.joint[j - 1]] = N[2]
        elif chain.sigma[j - 1] == 1:
            out[i, chain.joint[j - 1]] = F[2]
        b = chain.antecedent[j - 1]
        if b > 0:
            Rj = matrix(R, j)
            Fb = times(Rj, F)
            Nb = add(times(Rj, N), cross(vector(P, j), Fb))
            put_vector(force, b, add(vector(force, b), Fb))
            put_vector(moment, b, add(vector(moment, b), Nb))


@compiled(NOTHING(MATRIX, MATRIX, MATRIX, CHAIN, MATRIX, VECTOR, OUT2))
def joint_torques(
    q: Floats, v: Floats, a: Floats, chain: Chain, pi: Floats, gravity: Floats, out: Floats
) -> None:
    """Torques of the rigid links, without drive terms.

    Shapes: q, v, a (N, n); pi (f, 10); gravity (3,) -> out (N, n).
    """
    room = torque_room(chain, gravity)
    for i in range(q.shape[0]):
        torques_of_sample(q, v, a, i, chain, pi, room, out)


@compiled(NOTHING(MATRIX, MATRIX, CHAIN, MATRIX, VECTOR, OUT2))
def energies(q: Floats, v: Floats, chain: Chain, pi: Floats, gravity: Floats, out: Floats) -> None:
    """Kinetic energy of the rigid links, without rotors, and their energy in the field of gravity.

    Shapes: q, v (N, n); pi (f, 10); gravity (3,) -> out (N, 2).
    """
    f = chain.antecedent.shape[0]
    g = whole_vector(gravity)
    R = np.empty((f + 1, 3, 3))
    p = np.empty((f + 1, 3))
    omega = np.zeros((f + 1, 3))
    speed = np.zeros((f + 1, 3))
    put_matrix(R, 0, whole_matrix(chain.base_rotation))
    put_vector(p, 0, whole_vector(chain.base_position))
    for i in range(q.shape[0]):
        twice, energy = 0.0, 0.0
        for k in range(f):
            Rj, Pj = link_pose(chain, k, q, i)
            wj, vj = carry_velocity(chain, k, v, i, Rj, Pj, omega, speed)
            Rk, pk = carry_pose(chain, k, Rj, Pj, R, p)
            J, MS, M = inertia_of(pi, k)
            twice += M * dot(vj, vj) + 2.0 * dot(MS, cross(vj, wj)) + dot(wj, inertia_times(J, wj))
            energy -= dot(g, add(scale(M, pk), times(Rk, MS)))
        out[i, 0], out[i, 1] = 0.5 * twice, energy
