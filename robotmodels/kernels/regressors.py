"""Regressors: rows that multiply the ten inertial parameters of each link.

A motion is given in link axes: t the velocity of the link's origin, z its angular velocity. All
columns are linear in it, so the unit motion of a joint gives that joint's row, and the link's own
velocity gives the power. Torques: book section 1.6.3 (C. Atkeson, C. An and J. Hollerbach
1986); energy: M. Gautier and W. Khalil 1988. Momentum p = A v, with the rate tau + C^T v - Q, needs
no acceleration: p_i is the product of the unit motion S_i with the momenta of the links outboard,
and (C^T v)_i that of V x S_i, V the twist of the joint's link.
"""

import numpy as np
from numpy.typing import NDArray

from . import Chain
from ._compile import CHAIN, INTS, MATRIX, NOTHING, OUT3, VECTOR, Floats, Ints, compiled
from ._motion import base_acceleration, carry_acceleration, carry_pose, carry_velocity, link_pose
from ._vectors import (
    Matrix,
    Vector,
    add,
    cross,
    dot,
    matrix,
    put_matrix,
    put_vector,
    subtract,
    times,
    transpose_times,
    vector,
    whole_matrix,
    whole_vector,
)

__all__ = ["energy_regressors", "momentum_regressors", "power_regressors", "torque_regressors"]

Bools = NDArray[np.bool_]

Ten = tuple[float, float, float, float, float, float, float, float, float, float]


@compiled()
def wrench_columns(t: Vector, z: Vector, w: Vector, dw: Vector, U: Matrix, u: Vector) -> Ten:
    """Power, on the motion [t; z], of the wrench that each unit parameter requires.

    In link axes, U of `rotation_acceleration`, u acceleration of the origin: M: [u; 0], MX MY MZ:
    [U_k; e_k x u], XX..ZZ: [0; column of J dw + w x J w], whose entries are those of U.
    """
    pull = transpose_times(U, t)
    turn = cross(u, z)
    xy, xz, yz = w[0] * w[1], w[0] * w[2], w[1] * w[2]
    return (
        z[0] * dw[0] + z[1] * xz - z[2] * xy,
        z[1] * U[7] - z[0] * U[6] + z[2] * (U[0] - U[4]),
        z[0] * U[3] + z[1] * (U[8] - U[0]) - z[2] * U[5],
        z[1] * dw[1] - z[0] * yz + z[2] * xy,
        z[0] * (U[4] - U[8]) - z[1] * U[1] + z[2] * U[2],
        z[2] * dw[2] + z[0] * yz - z[1] * xz,
        pull[0] + turn[0],
        pull[1] + turn[1],
        pull[2] + turn[2],
        dot(t, u),
    )


@compiled()
def needed_links(place: Ints, antecedent: Ints, wanted: Bools, needed: Bools) -> None:
    """Whether a link has requested parameters, and whether it or a descendant has any.

    ``place (10 f,)``: column of each parameter in ``out``, -1 if not requested.
    """
    for k in range(antecedent.shape[0] - 1, -1, -1):
        for c in range(10):
            wanted[k] |= place[10 * k + c] >= 0
        needed[k] |= wanted[k]
        if needed[k] and antecedent[k] > 0:
            needed[antecedent[k] - 1] = True


@compiled()
def momentum_columns(t: Vector, z: Vector, w: Vector, v: Vector) -> Ten:
    """Product of the motion [t; z] with the momentum of each unit parameter at twist [v; w].

    M: [v; 0], MX MY MZ: [w x e_k; e_k x v], XX..ZZ: [0; column of J w].
    """
    a = cross(t, w)
    b = cross(v, z)
    return (
        z[0] * w[0],
        z[0] * w[1] + z[1] * w[0],
        z[0] * w[2] + z[2] * w[0],
        z[1] * w[1],
        z[1] * w[2] + z[2] * w[1],
        z[2] * w[2],
        a[0] + b[0],
        a[1] + b[1],
        a[2] + b[2],
        dot(t, v),
    )


@compiled()
def put_columns(out: Floats, i: int, row: int, place: Ints, k: int, columns: Ten) -> None:
    """Write the columns of link k into row ``out[i, row]`` where ``place`` wants them."""
    x = 10 * k
    for c in range(10):
        if place[x + c] >= 0:
            out[i, row, place[x + c]] = columns[c]


@compiled(NOTHING(MATRIX, MATRIX, MATRIX, CHAIN, VECTOR, INTS, OUT3))
def torque_regressors(
    q: Floats, v: Floats, a: Floats, chain: Chain, gravity: Floats, place: Ints, out: Floats
) -> None:
    """Regressors of the rigid links, without drive terms.

    Shapes: q, v, a (N, n); gravity (3,); place (10 f,) -> out (N, n, c).
    """
    f = chain.antecedent.shape[0]
    # Pose of the links in R_0, motion in their own axes
    R = np.empty((f + 1, 3, 3))
    p = np.empty((f + 1, 3))
    w = np.zeros((f + 1, 3))
    dw = np.zeros((f + 1, 3))
    U = np.zeros((f + 1, 3, 3))
    u = np.empty((f + 1, 3))
    put_matrix(R, 0, (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0))
    put_vector(p, 0, (0.0, 0.0, 0.0))
    base_acceleration(chain, gravity, u)
    nothing = (0.0, 0.0, 0.0)
    wanted, needed = np.zeros(f, dtype=np.bool_), np.zeros(f, dtype=np.bool_)
    needed_links(place, chain.antecedent, wanted, needed)
    for i in range(q.shape[0]):
        for row in range(out.shape[1]):
            for column in range(out.shape[2]):
                out[i, row, column] = 0.0
        for k in range(f):
            if not needed[k]:
                continue
            Rj, Pj = link_pose(chain, k, q, i)
            wj, dwj, Uj, uj = carry_acceleration(chain, k, v, a, i, Rj, Pj, w, dw, U, u)
            Rk, pk = carry_pose(chain, k, Rj, Pj, R, p)
            if not wanted[k]:
                continue
            inner = k + 1
            while inner > 0:
                row = chain.joint[inner - 1]
                z = transpose_times(Rk, (R[inner, 0, 2], R[inner, 1, 2], R[inner, 2, 2]))
                if chain.sigma[inner - 1] == 0:
                    # Unit motion of the link about the joint's axis
                    t = cross(z, transpose_times(Rk, subtract(pk, vector(p, inner))))
                    columns = wrench_columns(t, z, wj, dwj, Uj, uj)
                    put_columns(out, i, row, place, k, columns)
                elif chain.sigma[inner - 1] == 1:
                    columns = wrench_columns(z, nothing, wj, dwj, Uj, uj)
                    put_columns(out, i, row, place, k, columns)
                inner = chain.antecedent[inner - 1]


@compiled(NOTHING(MATRIX, MATRIX, MATRIX, CHAIN, VECTOR, INTS, OUT3))
def power_regressors(
    q: Floats, v: Floats, a: Floats, chain: Chain, gravity: Floats, place: Ints, out: Floats
) -> None:
    """Rows d with d @ pi = power of the torques of the rigid links.

    Shapes: q, v, a (N, n); gravity (3,); place (10 f,) -> out (N, 1, c).
    """
    f = chain.antecedent.shape[0]
    w = np.zeros((f + 1, 3))
    dw = np.zeros((f + 1, 3))
    U = np.zeros((f + 1, 3, 3))
    u = np.empty((f + 1, 3))
    speed = np.zeros((f + 1, 3))
    base_acceleration(chain, gravity, u)
    for i in range(q.shape[0]):
        for column in range(out.shape[2]):
            out[i, 0, column] = 0.0
        for k in range(f):
            Rj, Pj = link_pose(chain, k, q, i)
            _, t = carry_velocity(chain, k, v, i, Rj, Pj, w, speed)
            wj, dwj, Uj, uj = carry_acceleration(chain, k, v, a, i, Rj, Pj, w, dw, U, u)
            put_columns(out, i, 0, place, k, wrench_columns(t, wj, wj, dwj, Uj, uj))


@compiled(NOTHING(MATRIX, MATRIX, CHAIN, VECTOR, INTS, OUT3))
def energy_regressors(
    q: Floats, v: Floats, chain: Chain, gravity: Floats, place: Ints, out: Floats
) -> None:
    """Rows h with h @ pi = kinetic + potential energy.

    Shapes: q, v (N, n); gravity (3,); place (10 f,) -> out (N, 1, c).
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
        for column in range(out.shape[2]):
            out[i, 0, column] = 0.0
        for k in range(f):
            Rj, Pj = link_pose(chain, k, q, i)
            w, u = carry_velocity(chain, k, v, i, Rj, Pj, omega, speed)
            Rk, pk = carry_pose(chain, k, Rj, Pj, R, p)
            first = cross(u, w)
            weight = transpose_times(Rk, g)
            columns = (
                0.5 * w[0] * w[0],
                w[0] * w[1],
                w[0] * w[2],
                0.5 * w[1] * w[1],
                w[1] * w[2],
                0.5 * w[2] * w[2],
                first[0] - weight[0],
                first[1] - weight[1],
                first[2] - weight[2],
                0.5 * dot(u, u) - dot(g, pk),
            )
            put_columns(out, i, 0, place, k, columns)


@compiled(NOTHING(MATRIX, MATRIX, CHAIN, VECTOR, INTS, OUT3, OUT3))
def momentum_regressors(
    q: Floats,
    v: Floats,
    chain: Chain,
    gravity: Floats,
    place: Ints,
    momentum: Floats,
    force: Floats,
) -> None:
    """Regressors of p = A v and of C^T v - Q, without drive terms.

    Shapes: q, v (N, n); gravity (3,); place (10 f,) -> momentum, force (N, n, c).
    """
    f = chain.antecedent.shape[0]
    # Pose of the links in R_0, velocities in their own axes
    R = np.empty((f + 1, 3, 3))
    p = np.empty((f + 1, 3))
    omega = np.zeros((f + 1, 3))
    speed = np.zeros((f + 1, 3))
    put_matrix(R, 0, (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0))
    put_vector(p, 0, (0.0, 0.0, 0.0))
    g = transpose_times(whole_matrix(chain.base_rotation), whole_vector(gravity))
    nothing = (0.0, 0.0, 0.0)
    axis = (0.0, 0.0, 1.0)
    for i in range(q.shape[0]):
        for row in range(momentum.shape[1]):
            for column in range(momentum.shape[2]):
                momentum[i, row, column] = 0.0
                force[i, row, column] = 0.0
        for k in range(f):
            Rj, Pj = link_pose(chain, k, q, i)
            w, u = carry_velocity(chain, k, v, i, Rj, Pj, omega, speed)
            Rk, pk = carry_pose(chain, k, Rj, Pj, R, p)
            weight = transpose_times(Rk, g)
            inner = k + 1
            while inner > 0:
                if chain.sigma[inner - 1] != 2:
                    row = chain.joint[inner - 1]
                    # Unit motion [t; z] of the link, and its rate [dt; dz], in link axes
                    Ri = matrix(R, inner)
                    z = transpose_times(Rk, (Ri[2], Ri[5], Ri[8]))
                    wi, vi = vector(omega, inner), vector(speed, inner)
                    turn = transpose_times(Rk, times(Ri, cross(wi, axis)))
                    if chain.sigma[inner - 1] == 0:
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
                    put_columns(force, i, row, place, k, rate)
                    moment, lift = cross(weight, z), dot(weight, t)
                    for c in range(4):
                        if place[10 * k + 6 + c] >= 0:
                            force[i, row, place[10 * k + 6 + c]] += moment[c] if c < 3 else lift
                inner = chain.antecedent[inner - 1]
