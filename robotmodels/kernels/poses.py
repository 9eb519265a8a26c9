"""Poses of frames, their Jacobians, and velocities differentiated once more.

Book section 1.2.2: T(0, j) = T(0, a(j)) T(a(j), j), here with the base's place in the world
in front and the tool behind. Section 1.3.1.2: a revolute joint with axis z through o moves the
point p by z x (p - o) and turns it by z; a prismatic joint moves it by z. The three references of
Jacobians are Pinocchio's: 0 LOCAL_WORLD_ALIGNED, 1 LOCAL, 2 WORLD (the point is the one at the
world's origin). Accelerations come from the same recursion and need no Jacobian.
"""

import numpy as np

from . import Chain
from ._compile import (
    CHAIN,
    INT,
    INTS,
    MATRIX,
    NOTHING,
    OUT2,
    OUT3,
    OUT4,
    STACK,
    VECTOR,
    Floats,
    Ints,
    compiled,
)
from ._motion import carry_pose, coordinate, link_pose, link_transform
from ._vectors import (
    Matrix,
    Vector,
    add,
    cross,
    dot,
    matrix,
    product,
    put_matrix,
    put_vector,
    scale,
    subtract,
    times,
    transpose_times,
    vector,
    whole_matrix,
    whole_vector,
)

__all__ = [
    "accelerations",
    "improper_pose",
    "jacobian_rates",
    "jacobians",
    "link_poses",
    "tip_poses",
]


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


@compiled(NOTHING(MATRIX, CHAIN, INTS, MATRIX, VECTOR, OUT3))
def tip_poses(
    q: Floats, chain: Chain, path: Ints, tool_rotation: Floats, tool_position: Floats, out: Floats
) -> None:
    """World poses of a tool carried by the last frame of a path.

    Shapes: q (N, n), path (k,), tool_rotation (3, 3), tool_position (3,) -> out (N, 4, 4).
    """
    base = whole_matrix(chain.base_rotation)
    origin = whole_vector(chain.base_position)
    E = whole_matrix(tool_rotation)
    e = whole_vector(tool_position)
    for i in range(q.shape[0]):
        R, p = base, origin
        for j in path:
            # the constant of a row, then the motion of its joint
            k = j - 1
            p = add(p, times(R, vector(chain.position, k)))
            R = product(R, matrix(chain.rotation, k))
            R, p = link_transform(chain.sigma[k], coordinate(q, i, chain.joint[k]), R, p)
        put_pose(out[i], product(R, E), add(p, times(R, e)))


@compiled(NOTHING(MATRIX, CHAIN, OUT4))
def link_poses(q: Floats, chain: Chain, out: Floats) -> None:
    """World poses of all frames of the table. Shapes: q (N, n) -> out (N, f, 4, 4)."""
    f = chain.antecedent.shape[0]
    R = np.empty((f + 1, 3, 3))
    p = np.empty((f + 1, 3))
    put_matrix(R, 0, whole_matrix(chain.base_rotation))
    put_vector(p, 0, whole_vector(chain.base_position))
    for i in range(q.shape[0]):
        for k in range(f):
            Rj, Pj = link_pose(chain, k, q, i)
            Rk, pk = carry_pose(chain, k, Rj, Pj, R, p)
            put_pose(out[i, k], Rk, pk)


@compiled()
def put_column(out: Floats, i: int, column: int, linear: Vector, angular: Vector) -> None:
    """Write one column of matrix i of ``out (N, 6, n)``."""
    for row in range(3):
        out[i, row, column] = linear[row]
        out[i, row + 3, column] = angular[row]


@compiled(NOTHING(MATRIX, CHAIN, INTS, MATRIX, VECTOR, INT, OUT3))
def jacobians(
    q: Floats,
    chain: Chain,
    path: Ints,
    tool_rotation: Floats,
    tool_position: Floats,
    reference: int,
    out: Floats,
) -> None:
    """Jacobians of a tool carried by the last frame of a path.

    Shapes: q (N, n), path (k,), tool_rotation (3, 3), tool_position (3,) -> out (N, 6, n).
    """
    base = whole_matrix(chain.base_rotation)
    origin = whole_vector(chain.base_position)
    E = whole_matrix(tool_rotation)
    e = whole_vector(tool_position)
    zero = (0.0, 0.0, 0.0)
    z = np.empty((path.shape[0], 3))
    o = np.empty((path.shape[0], 3))
    for i in range(q.shape[0]):
        R, p = base, origin
        for s in range(path.shape[0]):
            k = path[s] - 1
            Rj, Pj = link_pose(chain, k, q, i)
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
            if chain.sigma[k] == 2:
                continue
            angular = vector(z, s)
            linear = cross(angular, subtract(point, vector(o, s)))
            if chain.sigma[k] == 1:
                linear, angular = angular, zero
            if reference == 1:
                linear = transpose_times(R, linear)
                angular = transpose_times(R, angular)
            put_column(out, i, chain.joint[k], linear, angular)


@compiled(NOTHING(MATRIX, MATRIX, CHAIN, INTS, MATRIX, VECTOR, INT, OUT3))
def jacobian_rates(
    q: Floats,
    v: Floats,
    chain: Chain,
    path: Ints,
    tool_rotation: Floats,
    tool_position: Floats,
    reference: int,
    out: Floats,
) -> None:
    """Time derivatives of the entries of `jacobians`. Shapes: q, v (N, n) -> out (N, 6, n)."""
    base = whole_matrix(chain.base_rotation)
    origin = whole_vector(chain.base_position)
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
            Rj, Pj = link_pose(chain, k, q, i)
            arm = times(R, Pj)
            p = add(p, arm)
            dp = add(dp, cross(w, arm))
            R = product(R, Rj)
            zj = (R[2], R[5], R[8])
            put_vector(z, s, zj)
            put_vector(dz, s, cross(w, zj))
            motion = scale(coordinate(v, i, chain.joint[k]), zj)
            if chain.sigma[k] == 0:
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
            if chain.sigma[k] == 2:
                continue
            angular, dangular = vector(z, s), vector(dz, s)
            lever = subtract(point, vector(o, s))
            linear = cross(angular, lever)
            dlinear = add(cross(dangular, lever), cross(angular, subtract(dpoint, vector(do, s))))
            if chain.sigma[k] == 1:
                linear, dlinear = angular, dangular
                angular, dangular = zero, zero
            if reference == 1:
                dlinear = transpose_times(R, subtract(dlinear, cross(w, linear)))
                dangular = transpose_times(R, subtract(dangular, cross(w, angular)))
            put_column(out, i, chain.joint[k], dlinear, dangular)


@compiled(NOTHING(MATRIX, MATRIX, MATRIX, CHAIN, INTS, MATRIX, VECTOR, INT, OUT2))
def accelerations(
    q: Floats,
    v: Floats,
    a: Floats,
    chain: Chain,
    path: Ints,
    tool_rotation: Floats,
    tool_position: Floats,
    reference: int,
    out: Floats,
) -> None:
    """Time derivatives of the twists of a tool, ``J a + dJ/dt v``.

    Shapes: q, v, a (N, n) -> out (N, 6).
    """
    base = whole_matrix(chain.base_rotation)
    origin = whole_vector(chain.base_position)
    E = whole_matrix(tool_rotation)
    e = whole_vector(tool_position)
    zero = (0.0, 0.0, 0.0)
    for i in range(q.shape[0]):
        R, p = base, origin
        w, dw, u, du = zero, zero, zero, zero
        for s in range(path.shape[0] + 1):
            if s == path.shape[0]:
                # the tool does not move in the last frame
                arm = times(R, e)
                du = add(du, add(cross(dw, arm), cross(w, cross(w, arm))))
                u = add(u, cross(w, arm))
                p = add(p, arm)
                R = product(R, E)
                break
            k = path[s] - 1
            Rj, Pj = link_pose(chain, k, q, i)
            arm = times(R, Pj)
            du = add(du, add(cross(dw, arm), cross(w, cross(w, arm))))
            u = add(u, cross(w, arm))
            p = add(p, arm)
            R = product(R, Rj)
            zj = (R[2], R[5], R[8])
            motion = scale(coordinate(v, i, chain.joint[k]), zj)
            change = scale(coordinate(a, i, chain.joint[k]), zj)
            if chain.sigma[k] == 0:
                dw = add(dw, add(change, cross(w, motion)))
                w = add(w, motion)
            else:
                du = add(du, add(change, scale(2.0, cross(w, motion))))
                u = add(u, motion)
        if reference == 1:
            du = transpose_times(R, subtract(du, cross(w, u)))
            dw = transpose_times(R, dw)
        elif reference == 2:
            du = subtract(du, add(cross(dw, p), cross(w, u)))
        for row in range(3):
            out[i, row] = du[row]
            out[i, row + 3] = dw[row]


@compiled(INT(STACK))
def improper_pose(T: Floats) -> int:
    """Index of the first pose that is not a rotation and a translation to rounding; -1 if none.

    ``T`` has shape (N, 4, 4). Rounding is 4e-15 on every element of ``R R^T - 1``.
    """
    for n in range(T.shape[0]):
        if T[n, 3, 0] != 0.0 or T[n, 3, 1] != 0.0 or T[n, 3, 2] != 0.0 or T[n, 3, 3] != 1.0:
            return n
        for i in range(3):
            if not np.isfinite(T[n, i, 3]):
                return n
            for j in range(i, 3):
                off = dot(vector(T[n], i), vector(T[n], j)) - (1.0 if i == j else 0.0)
                if not abs(off) <= 4e-15:  # also for NaN
                    return n
        det = dot(vector(T[n], 0), cross(vector(T[n], 1), vector(T[n], 2)))
        if det < 0.0:
            return n
    return -1
