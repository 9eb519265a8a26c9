"""Forward recursion along the chain (poses, velocities, accelerations), and wrenches of links.

All is in link axes (book section 1.5.2.2; for
trees, W. Khalil and J.-F. Kleinfinger 1987). R, P are the rotation and position of frame j in its
antecedent a; names that end in a belong to the antecedent.
"""

from math import cos, sin

from . import Chain
from ._compile import Floats, compiled
from ._inertia import inertia_of, inertia_times
from ._vectors import (
    Matrix,
    Vector,
    add,
    cross,
    matrix,
    product,
    put_matrix,
    put_vector,
    scale,
    times,
    transpose_times,
    vector,
    whole_matrix,
    whole_vector,
)


@compiled()
def coordinate(q: Floats, i: int, column: int) -> float:
    """Sample i of a joint's coordinate; a fixed frame (column -1) does not move."""
    if column < 0:
        return 0.0
    return q[i, column]


@compiled()
def link_transform(sigma: int, q: float, C: Matrix, c: Vector) -> tuple[Matrix, Vector]:
    """Rotation R and position P of frame j: the constant (C, c) times the motion along z."""
    if sigma == 0:
        cq = cos(q)
        sq = sin(q)
        R = (
            C[0] * cq + C[1] * sq,
            C[1] * cq - C[0] * sq,
            C[2],
            C[3] * cq + C[4] * sq,
            C[4] * cq - C[3] * sq,
            C[5],
            C[6] * cq + C[7] * sq,
            C[7] * cq - C[6] * sq,
            C[8],
        )
        return R, c
    # q is 0 for a fixed frame
    return C, (c[0] + C[2] * q, c[1] + C[5] * q, c[2] + C[8] * q)


@compiled()
def link_velocity(
    sigma: int, R: Matrix, P: Vector, dq: float, wa: Vector, va: Vector
) -> tuple[Vector, Vector]:
    """Angular velocity w and velocity v of the origin of frame j, in its axes.

    w_j = R^T w_a + (revolute) dq z,  v_j = R^T (v_a + w_a x P) + (prismatic) dq z.
    """
    w = transpose_times(R, wa)
    v = transpose_times(R, add(va, cross(wa, P)))
    if sigma == 0:
        return (w[0], w[1], w[2] + dq), v
    return w, (v[0], v[1], v[2] + dq)


@compiled()
def rotation_acceleration(w: Vector, dw: Vector) -> Matrix:
    """Khalil's matrix U = [dw]x + [w]x[w]x: U r is the acceleration of point r over the origin."""
    xx, yy, zz = w[0] * w[0], w[1] * w[1], w[2] * w[2]
    xy, xz, yz = w[0] * w[1], w[0] * w[2], w[1] * w[2]
    return (
        -yy - zz,
        xy - dw[2],
        xz + dw[1],
        xy + dw[2],
        -xx - zz,
        yz - dw[0],
        xz - dw[1],
        yz + dw[0],
        -xx - yy,
    )


@compiled()
def link_acceleration(
    sigma: int,
    R: Matrix,
    P: Vector,
    dq: float,
    ddq: float,
    wa: Vector,
    dwa: Vector,
    Ua: Matrix,
    ua: Vector,
) -> tuple[Vector, Vector, Vector]:
    """Angular velocity w, its derivative dw and the acceleration u of the origin of frame j.

    dw_j = R^T dw_a + (revolute) (ddq z + (R^T w_a) x dq z)
    u_j = R^T (u_a + U_a P) + (prismatic) (ddq z + 2 (R^T w_a) x dq z)
    """
    w = transpose_times(R, wa)
    dw = transpose_times(R, dwa)
    u = transpose_times(R, add(ua, times(Ua, P)))
    if sigma == 0:
        dw = (dw[0] + w[1] * dq, dw[1] - w[0] * dq, dw[2] + ddq)
        w = (w[0], w[1], w[2] + dq)
    else:
        u = (u[0] + 2.0 * w[1] * dq, u[1] - 2.0 * w[0] * dq, u[2] + ddq)
    return w, dw, u


@compiled()
def link_pose(chain: Chain, k: int, q: Floats, i: int) -> tuple[Matrix, Vector]:
    """Rotation and position of link k in its antecedent, of sample i."""
    return link_transform(
        chain.sigma[k],
        coordinate(q, i, chain.joint[k]),
        matrix(chain.rotation, k),
        vector(chain.position, k),
    )


@compiled()
def carry_pose(
    chain: Chain, k: int, Rj: Matrix, Pj: Vector, R: Floats, p: Floats
) -> tuple[Matrix, Vector]:
    """Place of link k in the frame of row 0, from that of its antecedent; kept in row k + 1."""
    b = chain.antecedent[k]
    Rb = matrix(R, b)
    Rk = product(Rb, Rj)
    pk = add(vector(p, b), times(Rb, Pj))
    put_matrix(R, k + 1, Rk)
    put_vector(p, k + 1, pk)
    return Rk, pk


@compiled()
def carry_velocity(
    chain: Chain, k: int, v: Floats, i: int, R: Matrix, P: Vector, omega: Floats, speed: Floats
) -> tuple[Vector, Vector]:
    """`link_velocity` of link k from that of its antecedent; kept in row k + 1."""
    b = chain.antecedent[k]
    rate = coordinate(v, i, chain.joint[k])
    w, u = link_velocity(chain.sigma[k], R, P, rate, vector(omega, b), vector(speed, b))
    put_vector(omega, k + 1, w)
    put_vector(speed, k + 1, u)
    return w, u


@compiled(inlined=True)
def carry_acceleration(
    chain: Chain,
    k: int,
    v: Floats,
    a: Floats,
    i: int,
    Rj: Matrix,
    Pj: Vector,
    w: Floats,
    dw: Floats,
    U: Floats,
    u: Floats,
) -> tuple[Vector, Vector, Matrix, Vector]:
    """`link_acceleration` and U of link k from those of its antecedent; kept in row k + 1."""
    b, c = chain.antecedent[k], chain.joint[k]
    wj, dwj, uj = link_acceleration(
        chain.sigma[k],
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
    put_vector(w, k + 1, wj)
    put_vector(dw, k + 1, dwj)
    put_matrix(U, k + 1, Uj)
    put_vector(u, k + 1, uj)
    return wj, dwj, Uj, uj


@compiled()
def base_acceleration(chain: Chain, gravity: Floats, u: Floats) -> None:
    """Acceleration -g of the base, in row 0, which replaces gravity."""
    g = transpose_times(whole_matrix(chain.base_rotation), whole_vector(gravity))
    put_vector(u, 0, (-g[0], -g[1], -g[2]))


@compiled(inlined=True)
def link_wrench(
    pi: Floats, k: int, w: Vector, dw: Vector, U: Matrix, u: Vector
) -> tuple[Vector, Vector]:
    """Force and moment that accelerate link k: M u + U MS and J dw + w x J w + MS x u."""
    J, MS, M = inertia_of(pi, k)
    F = add(scale(M, u), times(U, MS))
    return F, add(add(inertia_times(J, dw), cross(w, inertia_times(J, w))), cross(MS, u))
