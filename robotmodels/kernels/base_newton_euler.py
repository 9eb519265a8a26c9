"""Joint torques from base parameters: Newton-Euler without what the zero parameters multiply.

Seed book section 1.5.3 (W. Khalil and J.-F. Kleinfinger 1987): most parameters of a base set are
zero, above all the masses, and so is much of a table. A link is told by bits what of it counts,
and what its outboard links need; work for nothing is left out.

Counted on an RX-90 (36 base parameters without drives): 461 multiplications and 352 additions, 717
and 600 for the whole recursion. Of the 461, 302 are by zeros and ones of the table and of the
axes: formulas written out for this one robot would have 159 and 112. They would save less time
than that, for a third of what is left is the sines and cosines.
"""

from math import cos, sin

import numpy as np

from ._compile import CHAIN, INTS, MATRIX, NOTHING, OUT2, VECTOR, Floats, Ints, compiled
from ._inertia import inertia_of, inertia_times
from ._motion import coordinate, link_transform, rotation_acceleration
from ._vectors import (
    Vector,
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

__all__ = ["INERTIA", "LOADED", "MASS", "MOMENTS", "OFFSET", "ROTATES", "TWISTED", "base_torques"]

MASS, MOMENTS, INERTIA = 1, 2, 4  # of the link itself: M, MX MY MZ, XX to ZZ
LOADED = 8  # it or a link outboard of it has any parameter
ROTATES = 16  # U is needed: for its own first moments, or for the origins of links outboard
OFFSET = 32  # its origin is not that of its antecedent
TWISTED = 64  # revolute, and the constant rotation is about x (alpha), as in most tables


@compiled()
def inward(ca: float, sa: float, c: float, s: float, x: Vector) -> Vector:
    """Turn a vector about x by -alpha, then about z by -theta: from the antecedent's axes."""
    y = ca * x[1] + sa * x[2]
    return (c * x[0] + s * y, c * y - s * x[0], ca * x[2] - sa * x[1])


@compiled()
def outward(ca: float, sa: float, c: float, s: float, x: Vector) -> Vector:
    """The inverse of `inward`: to the antecedent's axes."""
    y = s * x[0] + c * x[1]
    return (c * x[0] - s * x[1], ca * y - sa * x[2], sa * y + ca * x[2])


@compiled(NOTHING(MATRIX, MATRIX, MATRIX, *CHAIN, MATRIX, VECTOR, INTS, OUT2))
def base_torques(
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
    parts: Ints,
    out: Floats,
) -> None:
    """Torques of the rigid links, without drive terms.

    Shapes: q, v, a (N, n); pi (f, 10); gravity (3,); parts (f,) -> out (N, n).
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
    turn = np.empty((f, 2))
    g = transpose_times(whole_matrix(base_rotation), whole_vector(gravity))
    put_vector(u, 0, (-g[0], -g[1], -g[2]))
    nothing = (0.0, 0.0, 0.0)
    for i in range(q.shape[0]):
        for k in range(f):
            bits = parts[k]
            if not bits & LOADED:
                continue
            b = antecedent[k]
            c = joint[k]
            dq = coordinate(v, i, c)
            ddq = coordinate(a, i, c)
            ub = vector(u, b)
            if bits & TWISTED:
                Pj = vector(position, k)
                ca, sa = rotation[k, 1, 1], rotation[k, 2, 1]
                cq, sq = cos(q[i, c]), sin(q[i, c])
                turn[k, 0], turn[k, 1] = cq, sq
                if bits & OFFSET:
                    ub = add(ub, times(matrix(U, b), Pj))
                wj = inward(ca, sa, cq, sq, vector(w, b))
                dwj = inward(ca, sa, cq, sq, vector(dw, b))
                uj = inward(ca, sa, cq, sq, ub)
            else:
                Rj, Pj = link_transform(
                    sigma[k], coordinate(q, i, c), matrix(rotation, k), vector(position, k)
                )
                put_matrix(R, k + 1, Rj)
                if bits & OFFSET:
                    ub = add(ub, times(matrix(U, b), Pj))
                wj = transpose_times(Rj, vector(w, b))
                dwj = transpose_times(Rj, vector(dw, b))
                uj = transpose_times(Rj, ub)
            if sigma[k] == 0:
                dwj = (dwj[0] + wj[1] * dq, dwj[1] - wj[0] * dq, dwj[2] + ddq)
                wj = (wj[0], wj[1], wj[2] + dq)
            else:
                uj = (uj[0] + 2.0 * wj[1] * dq, uj[1] - 2.0 * wj[0] * dq, uj[2] + ddq)
            J, MS, M = inertia_of(pi, k)
            F = nothing
            N = nothing
            if bits & INERTIA:
                N = add(inertia_times(J, dwj), cross(wj, inertia_times(J, wj)))
            if bits & ROTATES:
                Uj = rotation_acceleration(wj, dwj)
                put_matrix(U, k + 1, Uj)
                if bits & MOMENTS:
                    F = times(Uj, MS)
                    N = add(N, cross(MS, uj))
            if bits & MASS:
                F = add(F, scale(M, uj))
            put_vector(P, k + 1, Pj)
            put_vector(w, k + 1, wj)
            put_vector(dw, k + 1, dwj)
            put_vector(u, k + 1, uj)
            put_vector(force, k + 1, F)
            put_vector(moment, k + 1, N)
        for j in range(f, 0, -1):
            if not parts[j - 1] & LOADED:
                if sigma[j - 1] != 2:
                    out[i, joint[j - 1]] = 0.0
                continue
            F = vector(force, j)
            N = vector(moment, j)
            if sigma[j - 1] == 0:
                out[i, joint[j - 1]] = N[2]
            elif sigma[j - 1] == 1:
                out[i, joint[j - 1]] = F[2]
            b = antecedent[j - 1]
            if b > 0:
                if parts[j - 1] & TWISTED:
                    ca, sa = rotation[j - 1, 1, 1], rotation[j - 1, 2, 1]
                    cq, sq = turn[j - 1, 0], turn[j - 1, 1]
                    Fb = outward(ca, sa, cq, sq, F)
                    Nb = outward(ca, sa, cq, sq, N)
                else:
                    Rj = matrix(R, j)
                    Fb = times(Rj, F)
                    Nb = times(Rj, N)
                if parts[j - 1] & OFFSET:
                    Nb = add(Nb, cross(vector(P, j), Fb))
                put_vector(force, b, add(vector(force, b), Fb))
                put_vector(moment, b, add(vector(moment, b), Nb))
