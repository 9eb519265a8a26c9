"""Derivatives of the direct geometric model: of the product of factors, joint by joint.

Seed book section 1.3.1.1 ("calculation of the Jacobian matrix by derivation of the DGM"). The pose
is a product in which each joint moves one factor, so its derivative is the same product with that
factor differentiated: dT/dq_j = (factors before j) dT_j/dq_j (factors behind j). No screw is used.
"""

from math import cos, sin

import numpy as np

from ._compile import CHAIN, INTS, MATRIX, NOTHING, OUT3, OUT4, VECTOR, Floats, Ints, compiled
from ._motion import coordinate, link_transform
from ._vectors import (
    Matrix,
    Vector,
    add,
    matrix,
    product,
    put_matrix,
    scale,
    times,
    vector,
    whole_matrix,
    whole_vector,
)
from .poses import put_pose

__all__ = ["differentiated_pose_rates", "differentiated_poses"]

NO_ROTATION = (0.0,) * 9


@compiled()
def plus(m: Matrix, k: Matrix) -> Matrix:
    """Sum of two matrices."""
    return (
        m[0] + k[0],
        m[1] + k[1],
        m[2] + k[2],
        m[3] + k[3],
        m[4] + k[4],
        m[5] + k[5],
        m[6] + k[6],
        m[7] + k[7],
        m[8] + k[8],
    )


@compiled()
def times_turn(m: Matrix, c: float, s: float) -> Matrix:
    """Matrix m times [[c, -s, 0], [s, c, 0], [0, 0, 0]]."""
    return (
        m[0] * c + m[1] * s,
        m[1] * c - m[0] * s,
        0.0,
        m[3] * c + m[4] * s,
        m[4] * c - m[3] * s,
        0.0,
        m[6] * c + m[7] * s,
        m[7] * c - m[6] * s,
        0.0,
    )


@compiled()
def put_block(out: Floats, i: int, column: int, R: Matrix, p: Vector) -> None:
    """Write the 3x4 matrix (R, p) into ``out[i, column]``, ``out (N, n, 3, 4)``."""
    for row in range(3):
        out[i, column, row, 0] = R[3 * row]
        out[i, column, row, 1] = R[3 * row + 1]
        out[i, column, row, 2] = R[3 * row + 2]
        out[i, column, row, 3] = p[row]


@compiled(NOTHING(MATRIX, *CHAIN, INTS, MATRIX, VECTOR, OUT3, OUT4))
def differentiated_poses(
    q: Floats,
    antecedent: Ints,
    sigma: Ints,
    joint: Ints,
    rotation: Floats,
    position: Floats,
    base_rotation: Floats,
    base_position: Floats,
    path: Ints,
    tool_rotation: Floats,
    tool_position: Floats,
    poses: Floats,
    out: Floats,
) -> None:
    """World poses of a tool, and their derivatives with respect to every joint.

    Shapes: q (N, n), path (k,), tool_rotation (3, 3), tool_position (3,) -> poses (N, 4, 4), out
    (N, n, 3, 4).
    """
    base, origin = whole_matrix(base_rotation), whole_vector(base_position)
    E, e = whole_matrix(tool_rotation), whole_vector(tool_position)
    zero = (0.0, 0.0, 0.0)
    before = np.empty((path.shape[0], 3, 3))
    for i in range(q.shape[0]):
        for column in range(out.shape[1]):
            put_block(out, i, column, NO_ROTATION, zero)
        R, p = base, origin
        for s in range(path.shape[0]):
            k = path[s] - 1
            qj = coordinate(q, i, joint[k])
            Rj, Pj = link_transform(sigma[k], qj, matrix(rotation, k), vector(position, k))
            put_matrix(before, s, R)
            p = add(p, times(R, Pj))
            R = product(R, Rj)
        put_pose(poses[i], product(R, E), add(p, times(R, e)))
        # from the tool inwards: (B, b) is the product of the factors behind the joint
        B, b = E, e
        for s in range(path.shape[0] - 1, -1, -1):
            k = path[s] - 1
            qj = coordinate(q, i, joint[k])
            C = matrix(rotation, k)
            if sigma[k] == 0:
                D = product(matrix(before, s), times_turn(C, -sin(qj), cos(qj)))
                put_block(out, i, joint[k], product(D, B), times(D, b))
            elif sigma[k] == 1:
                z = times(matrix(before, s), (C[2], C[5], C[8]))
                put_block(out, i, joint[k], NO_ROTATION, z)
            Rj, Pj = link_transform(sigma[k], qj, C, vector(position, k))
            b = add(Pj, times(Rj, b))
            B = product(Rj, B)


@compiled(NOTHING(MATRIX, MATRIX, *CHAIN, INTS, MATRIX, VECTOR, OUT3, OUT4, OUT4))
def differentiated_pose_rates(
    q: Floats,
    v: Floats,
    antecedent: Ints,
    sigma: Ints,
    joint: Ints,
    rotation: Floats,
    position: Floats,
    base_rotation: Floats,
    base_position: Floats,
    path: Ints,
    tool_rotation: Floats,
    tool_position: Floats,
    poses: Floats,
    out: Floats,
    rates: Floats,
) -> None:
    """`differentiated_poses`, and the time derivatives of the derivatives along a motion.

    Shapes: q, v (N, n) -> rates (N, n, 3, 4).
    """
    base, origin = whole_matrix(base_rotation), whole_vector(base_position)
    E, e = whole_matrix(tool_rotation), whole_vector(tool_position)
    zero = (0.0, 0.0, 0.0)
    before = np.empty((path.shape[0], 3, 3))
    dbefore = np.empty((path.shape[0], 3, 3))
    for i in range(q.shape[0]):
        for column in range(out.shape[1]):
            put_block(out, i, column, NO_ROTATION, zero)
            put_block(rates, i, column, NO_ROTATION, zero)
        R, p, dR = base, origin, NO_ROTATION
        for s in range(path.shape[0]):
            k = path[s] - 1
            qj, vj = coordinate(q, i, joint[k]), coordinate(v, i, joint[k])
            C = matrix(rotation, k)
            Rj, Pj = link_transform(sigma[k], qj, C, vector(position, k))
            put_matrix(before, s, R)
            put_matrix(dbefore, s, dR)
            p = add(p, times(R, Pj))
            dR = product(dR, Rj)
            if sigma[k] == 0:
                dR = plus(dR, product(R, times_turn(C, -sin(qj) * vj, cos(qj) * vj)))
            R = product(R, Rj)
        put_pose(poses[i], product(R, E), add(p, times(R, e)))
        B, b, dB, db = E, e, NO_ROTATION, zero
        for s in range(path.shape[0] - 1, -1, -1):
            k = path[s] - 1
            qj, vj = coordinate(q, i, joint[k]), coordinate(v, i, joint[k])
            C = matrix(rotation, k)
            A, dA = matrix(before, s), matrix(dbefore, s)
            Rj, Pj = link_transform(sigma[k], qj, C, vector(position, k))
            if sigma[k] == 0:
                cq, sq = cos(qj), sin(qj)
                turn = times_turn(C, -sq, cq)
                D = product(A, turn)
                dD = plus(product(dA, turn), product(A, times_turn(C, -cq * vj, -sq * vj)))
                put_block(out, i, joint[k], product(D, B), times(D, b))
                put_block(
                    rates,
                    i,
                    joint[k],
                    plus(product(dD, B), product(D, dB)),
                    add(times(dD, b), times(D, db)),
                )
                db = add(times(Rj, db), scale(vj, times(turn, b)))
                dB = plus(product(Rj, dB), product(times_turn(C, -sq * vj, cq * vj), B))
            else:
                z = (C[2], C[5], C[8])
                if sigma[k] == 1:
                    put_block(out, i, joint[k], NO_ROTATION, times(A, z))
                    put_block(rates, i, joint[k], NO_ROTATION, times(dA, z))
                db = add(times(Rj, db), scale(vj, z))
                dB = product(Rj, dB)
            b = add(Pj, times(Rj, b))
            B = product(Rj, B)
