"""Poses of frames: the product of the table's factors from the base outwards.

Seed book section 1.2.2: T(0, j) = T(0, a(j)) T(a(j), j), here with the base's place in the world
in front and the tool behind.
"""

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
    put_vector,
    times,
    vector,
    whole_matrix,
    whole_vector,
)

__all__ = ["link_poses", "tip_poses"]


@compiled()
def put_pose(pose: Floats, R: Matrix, p: Vector) -> None:
    """Write the 4x4 matrix of (R, p) into ``pose (4, 4)``."""
    for row in range(3):
        pose[row, 0] = R[3 * row]
        pose[row, 1] = R[3 * row + 1]
        pose[row, 2] = R[3 * row + 2]
        pose[row, 3] = p[row]
        pose[3, row] = 0.0
    pose[3, 3] = 1.0


@compiled(NOTHING(MATRIX, *CHAIN, INTS, MATRIX, VECTOR, OUT3))
def tip_poses(
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
    out: Floats,
) -> None:
    """World poses of a tool carried by the last frame of a path.

    Shapes: q (N, n), path (k,), tool_rotation (3, 3), tool_position (3,) -> out (N, 4, 4).
    """
    base = whole_matrix(base_rotation)
    origin = whole_vector(base_position)
    E = whole_matrix(tool_rotation)
    e = whole_vector(tool_position)
    if path.shape[0] == 0:
        for i in range(q.shape[0]):
            put_pose(out[i], product(base, E), add(origin, times(base, e)))
        return
    # what comes before the first motion is the same for every sample; after that each frame is
    # the constant of its row, then the motion of its joint
    first = path[0] - 1
    origin = add(origin, times(base, vector(position, first)))
    base = product(base, matrix(rotation, first))
    for i in range(q.shape[0]):
        R, p = link_transform(sigma[first], coordinate(q, i, joint[first]), base, origin)
        for j in path[1:]:
            k = j - 1
            p = add(p, times(R, vector(position, k)))
            R = product(R, matrix(rotation, k))
            R, p = link_transform(sigma[k], coordinate(q, i, joint[k]), R, p)
        put_pose(out[i], product(R, E), add(p, times(R, e)))


@compiled(NOTHING(MATRIX, *CHAIN, OUT4))
def link_poses(
    q: Floats,
    antecedent: Ints,
    sigma: Ints,
    joint: Ints,
    rotation: Floats,
    position: Floats,
    base_rotation: Floats,
    base_position: Floats,
    out: Floats,
) -> None:
    """World poses of all frames of the table. Shapes: q (N, n) -> out (N, f, 4, 4)."""
    f = antecedent.shape[0]
    R = np.empty((f + 1, 3, 3))
    p = np.empty((f + 1, 3))
    put_matrix(R, 0, whole_matrix(base_rotation))
    put_vector(p, 0, whole_vector(base_position))
    for i in range(q.shape[0]):
        for k in range(f):
            a = antecedent[k]
            qj = coordinate(q, i, joint[k])
            Rj, Pj = link_transform(sigma[k], qj, matrix(rotation, k), vector(position, k))
            Ra = matrix(R, a)
            Rk = product(Ra, Rj)
            pk = add(vector(p, a), times(Ra, Pj))
            put_matrix(R, k + 1, Rk)
            put_vector(p, k + 1, pk)
            put_pose(out[i, k], Rk, pk)
