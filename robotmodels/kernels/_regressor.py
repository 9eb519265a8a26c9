"""The ten columns of one link on the motion of one joint, and where they go.

A motion is given in link axes: t the velocity of the link's origin, z its angular velocity. All
columns are linear in it, so the unit motion of a joint gives that joint's row, and the link's own
velocity gives the power.
"""

import numpy as np
from numpy.typing import NDArray

from ._compile import Floats, Ints, compiled
from ._vectors import Matrix, Vector, cross, dot, transpose_times

Bools = NDArray[np.bool_]

INERTIA, MOMENTS, MASS = 1, 2, 4  # bits: which of XX to ZZ, MX MY MZ, and M is wanted

Ten = tuple[float, float, float, float, float, float, float, float, float, float]


@compiled()
def wrench_columns(t: Vector, z: Vector, w: Vector, dw: Vector, U: Matrix, u: Vector) -> Ten:
    """Power on the motion of the wrenches that unit parameters need to accelerate.

    In link axes, U of `rotation_acceleration`, u acceleration of the origin: M: [u; 0], MX MY MZ:
    [U_k; e_k x u], XX..ZZ: [0; column of J dw + w x J w], whose entries are found again in U.
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
def wanted_wrench_columns(
    t: Vector, z: Vector, w: Vector, dw: Vector, U: Matrix, u: Vector, wanted: int
) -> Ten:
    """Those of `wrench_columns` that the bits of ``wanted`` ask for, and zero in others' place."""
    if wanted & INERTIA:
        if wanted & (MOMENTS | MASS):
            return wrench_columns(t, z, w, dw, U, u)
        nothing = (0.0, 0.0, 0.0)
        return wrench_columns(nothing, z, w, dw, U, nothing)
    a, b, c = 0.0, 0.0, 0.0
    if wanted & MOMENTS:
        pull = transpose_times(U, t)
        turn = cross(u, z)
        a, b, c = pull[0] + turn[0], pull[1] + turn[1], pull[2] + turn[2]
    return (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, a, b, c, dot(t, u))


@compiled()
def wanted_of_links(place: Ints, antecedent: Ints, wanted: Ints, needed: Bools) -> None:
    """What is wanted of each link, and whether it or a link outboard of it matters at all.

    ``place (10 f,)`` as in the kernels; ``wanted (f,)`` bits and ``needed (f,)`` are written.
    """
    for k in range(antecedent.shape[0] - 1, -1, -1):
        bits = 0
        for c in range(10):
            if place[10 * k + c] >= 0:
                bits |= INERTIA if c < 6 else (MOMENTS if c < 9 else MASS)
        wanted[k] = bits
        needed[k] |= bits != 0
        if needed[k] and antecedent[k] > 0:
            needed[antecedent[k] - 1] = True


@compiled()
def momentum_columns(t: Vector, z: Vector, w: Vector, v: Vector) -> Ten:
    """Product of the motion with the momenta that unit parameters give a link of twist [v; w].

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
