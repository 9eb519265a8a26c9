"""Motion of one link from that of its antecedent: position, velocity, acceleration.

The forward half of every recursion in this package, in link axes (seed book section 1.5.2.2; for
trees, W. Khalil and J.-F. Kleinfinger 1987). R, P are the rotation and position of frame j in its
antecedent a; names that end in a belong to the antecedent.
"""

from math import cos, sin

from ._compile import Floats, compiled
from ._vectors import Matrix, Vector, add, cross, times, transpose_times


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
