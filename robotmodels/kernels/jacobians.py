"""Jacobians of a frame and their time derivatives, rows linear then angular velocity.

Seed book section 1.3.1.2: a revolute joint with axis z through o moves the point p by z x (p - o)
and turns it by z; a prismatic joint moves it by z. The three references are Pinocchio's:
0 LOCAL_WORLD_ALIGNED, 1 LOCAL, 2 WORLD (the point is the one at the world's origin).
"""

import numpy as np

from ._compile import CHAIN, INT, INTS, MATRIX, NOTHING, OUT3, VECTOR, Floats, Ints, compiled
from ._motion import coordinate, link_transform
from ._vectors import (
    Vector,
    add,
    cross,
    matrix,
    product,
    put_vector,
    scale,
    subtract,
    times,
    transpose_times,
    vector,
    whole_matrix,
    whole_vector,
)

__all__ = ["jacobian_rates", "jacobians"]


@compiled()
def put_column(out: Floats, i: int, column: int, linear: Vector, angular: Vector) -> None:
    """Write one column of matrix i of ``out (N, 6, n)``."""
    for row in range(3):
        out[i, row, column] = linear[row]
        out[i, row + 3, column] = angular[row]


@compiled(NOTHING(MATRIX, *CHAIN, INTS, MATRIX, VECTOR, INT, OUT3))
def jacobians(
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
    reference: int,
    out: Floats,
) -> None:
    """Jacobians of a tool carried by the last frame of a path.

    Shapes: q (N, n), path (k,), tool_rotation (3, 3), tool_position (3,) -> out (N, 6, n).
    """
    base = whole_matrix(base_rotation)
    origin = whole_vector(base_position)
    E = whole_matrix(tool_rotation)
    e = whole_vector(tool_position)
    zero = (0.0, 0.0, 0.0)
    z = np.empty((path.shape[0], 3))
    o = np.empty((path.shape[0], 3))
    for i in range(q.shape[0]):
        R, p = base, origin
        for s in range(path.shape[0]):
            k = path[s] - 1
            qj = coordinate(q, i, joint[k])
            Rj, Pj = link_transform(sigma[k], qj, matrix(rotation, k), vector(position, k))
            p = add(p, times(R, Pj))
            R = product(R, Rj)
            put_vector(z, s, (R[2], R[5], R[8]))
            put_vector(o, s, p)
        point = zero if reference == 2 else add(p, times(R, e))
        R = product(R, E)
        for column in range(out.shape[2]):
            put_column(out, i, column, zero, zero)
        for s in range(path.shape[0]):
            k = path[s] - 1
            if sigma[k] == 2:
                continue
            angular = vector(z, s)
            linear = cross(angular, subtract(point, vector(o, s)))
            if sigma[k] == 1:
                linear, angular = angular, zero
            if reference == 1:
                linear = transpose_times(R, linear)
                angular = transpose_times(R, angular)
            put_column(out, i, joint[k], linear, angular)


@compiled(NOTHING(MATRIX, MATRIX, *CHAIN, INTS, MATRIX, VECTOR, INT, OUT3))
def jacobian_rates(
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
    reference: int,
    out: Floats,
) -> None:
    """Time derivatives of the entries of `jacobians`. Shapes: q, v (N, n) -> out (N, 6, n)."""
    base = whole_matrix(base_rotation)
    origin = whole_vector(base_position)
    E = whole_matrix(tool_rotation)
    e = whole_vector(tool_position)
    zero = (0.0, 0.0, 0.0)
    z = np.empty((path.shape[0], 3))
    dz = np.empty((path.shape[0], 3))
    o = np.empty((path.shape[0], 3))
    do = np.empty((path.shape[0], 3))
    for i in range(q.shape[0]):
        R, p = base, origin
        w, dp = zero, zero
        for s in range(path.shape[0]):
            k = path[s] - 1
            qj = coordinate(q, i, joint[k])
            Rj, Pj = link_transform(sigma[k], qj, matrix(rotation, k), vector(position, k))
            arm = times(R, Pj)
            p = add(p, arm)
            dp = add(dp, cross(w, arm))
            R = product(R, Rj)
            zj = (R[2], R[5], R[8])
            put_vector(z, s, zj)
            put_vector(dz, s, cross(w, zj))
            motion = scale(coordinate(v, i, joint[k]), zj)
            if sigma[k] == 0:
                w = add(w, motion)
            else:
                dp = add(dp, motion)
            put_vector(o, s, p)
            put_vector(do, s, dp)
        arm = times(R, e)
        point, dpoint = add(p, arm), add(dp, cross(w, arm))
        if reference == 2:
            point, dpoint = zero, zero
        R = product(R, E)
        for column in range(out.shape[2]):
            put_column(out, i, column, zero, zero)
        for s in range(path.shape[0]):
            k = path[s] - 1
            if sigma[k] == 2:
                continue
            angular, dangular = vector(z, s), vector(dz, s)
            lever = subtract(point, vector(o, s))
            linear = cross(angular, lever)
            dlinear = add(cross(dangular, lever), cross(angular, subtract(dpoint, vector(do, s))))
            if sigma[k] == 1:
                linear, dlinear = angular, dangular
                angular, dangular = zero, zero
            if reference == 1:
                dlinear = transpose_times(R, subtract(dlinear, cross(w, linear)))
                dangular = transpose_times(R, subtract(dangular, cross(w, angular)))
            put_column(out, i, joint[k], dlinear, dangular)
