"""Poses of a robot whose parameters are off, and their derivatives by every parameter.

Each row of the table is seven elementary motions (book eq. [1.3], with gamma and b for
branches and Hayati's beta), ``Rot(z, gamma) Trans(z, b) Rot(y, beta) Rot(x, alpha) Trans(x, d)
Rot(z, theta) Trans(z, r)``. A change of one is a screw along its axis (section 1.4.3):
``[axis x (p - origin); axis]`` for a rotation and ``[axis; 0]`` for a translation, times a factor
that depends on the configuration: 1, or the reading of the joint for a gain.
"""

from math import cos, sin

import numpy as np

from ._compile import INTS, MATRIX, NOTHING, OUT3, VECTOR, Floats, Ints, compiled
from ._vectors import (
    Matrix,
    Vector,
    add,
    cross,
    product,
    put_vector,
    scale,
    subtract,
    times,
    vector,
    whole_matrix,
    whole_vector,
)
from .poses import put_pose

__all__ = ["erroneous_poses"]

_ELEMENTS = 7


@compiled()
def _turned_x(R: Matrix, angle: float) -> Matrix:
    """R Rot(x, angle)."""
    c = cos(angle)
    s = sin(angle)
    return (
        R[0], R[1] * c + R[2] * s, R[2] * c - R[1] * s,
        R[3], R[4] * c + R[5] * s, R[5] * c - R[4] * s,
        R[6], R[7] * c + R[8] * s, R[8] * c - R[7] * s,
    )  # fmt: skip


@compiled()
def _turned_y(R: Matrix, angle: float) -> Matrix:
    """R Rot(y, angle)."""
    c = cos(angle)
    s = sin(angle)
    return (
        R[0] * c - R[2] * s, R[1], R[2] * c + R[0] * s,
        R[3] * c - R[5] * s, R[4], R[5] * c + R[3] * s,
        R[6] * c - R[8] * s, R[7], R[8] * c + R[6] * s,
    )  # fmt: skip


@compiled()
def _turned_z(R: Matrix, angle: float) -> Matrix:
    """R Rot(z, angle)."""
    c = cos(angle)
    s = sin(angle)
    return (
        R[0] * c + R[1] * s, R[1] * c - R[0] * s, R[2],
        R[3] * c + R[4] * s, R[4] * c - R[3] * s, R[5],
        R[6] * c + R[7] * s, R[7] * c - R[6] * s, R[8],
    )  # fmt: skip


@compiled()
def _x_axis(R: Matrix) -> Vector:
    return (R[0], R[3], R[6])


@compiled()
def _y_axis(R: Matrix) -> Vector:
    return (R[1], R[4], R[7])


@compiled()
def _z_axis(R: Matrix) -> Vector:
    return (R[2], R[5], R[8])


@compiled()
def _screws_of_row(
    element: Floats, R: Matrix, p: Vector, axes: Floats, origins: Floats, first: int
) -> tuple[Matrix, Vector]:
    """Pass one row: its frame in the world, and the axis and origin of its seven motions."""
    put_vector(axes, first, _z_axis(R))  # gamma
    put_vector(origins, first, p)
    R = _turned_z(R, element[0])
    put_vector(axes, first + 1, _z_axis(R))  # b
    p = add(p, scale(element[1], _z_axis(R)))
    put_vector(axes, first + 2, _y_axis(R))  # beta
    put_vector(origins, first + 2, p)
    R = _turned_y(R, element[2])
    put_vector(axes, first + 3, _x_axis(R))  # alpha
    put_vector(origins, first + 3, p)
    R = _turned_x(R, element[3])
    put_vector(axes, first + 4, _x_axis(R))  # d
    p = add(p, scale(element[4], _x_axis(R)))
    put_vector(axes, first + 5, _z_axis(R))  # theta
    put_vector(origins, first + 5, p)
    R = _turned_z(R, element[5])
    put_vector(axes, first + 6, _z_axis(R))  # r
    return R, add(p, scale(element[6], _z_axis(R)))


@compiled(
    NOTHING(
        MATRIX, MATRIX, INTS, INTS, INTS, MATRIX, VECTOR, MATRIX, VECTOR,
        VECTOR, INTS, INTS, INTS, MATRIX, OUT3, OUT3,
    )
)  # fmt: skip
def erroneous_poses(
    q: Floats,
    nominal: Floats,
    sigma: Ints,
    joint: Ints,
    path: Ints,
    before_rotation: Floats,
    before_position: Floats,
    after_rotation: Floats,
    after_position: Floats,
    deviation: Floats,
    owner: Ints,
    row: Ints,
    element: Ints,
    factor: Floats,
    out_pose: Floats,
    out_psi: Floats,
) -> None:
    """Poses of one end of a robot and the generalised differential model.

    Shapes: q (N, n); nominal (R, 7); sigma, joint (R,); path (k,); deviation (P,); owner, row,
    element (A,); factor (N, A) -> out_pose (N, 4, 4), out_psi (N, 6, P).
    """
    k = path.shape[0]
    count = owner.shape[0]
    place = np.full(nominal.shape[0], -1)
    for m in range(k):
        place[path[m]] = m
    elements = np.empty((k, _ELEMENTS))
    axes = np.empty((k * _ELEMENTS, 3))
    origins = np.empty((k * _ELEMENTS, 3))
    start = whole_matrix(before_rotation)
    start_position = whole_vector(before_position)
    last = whole_matrix(after_rotation)
    last_position = whole_vector(after_position)
    for i in range(q.shape[0]):
        for m in range(k):
            j = path[m]
            for e in range(_ELEMENTS):
                elements[m, e] = nominal[j, e]
            if sigma[j] == 0:
                elements[m, 5] += q[i, joint[j]]
            elif sigma[j] == 1:
                elements[m, 6] += q[i, joint[j]]
        for c in range(count):
            m = place[row[c]]
            if m >= 0:
                elements[m, element[c]] += factor[i, c] * deviation[owner[c]]
        R = start
        p = start_position
        for m in range(k):
            R, p = _screws_of_row(elements[m], R, p, axes, origins, m * _ELEMENTS)
        p = add(p, times(R, last_position))
        R = product(R, last)
        put_pose(out_pose[i], R, p)
        if out_psi.shape[2] == 0:
            continue
        for s in range(6):
            for c in range(out_psi.shape[2]):
                out_psi[i, s, c] = 0.0
        for c in range(count):
            m = place[row[c]]
            f = factor[i, c]
            if m < 0 or f == 0.0:
                continue
            e = element[c]
            axis = vector(axes, m * _ELEMENTS + e)
            if e == 1 or e == 4 or e == 6:
                v = axis
                w = (0.0, 0.0, 0.0)
            else:
                v = cross(axis, subtract(p, vector(origins, m * _ELEMENTS + e)))
                w = axis
            for s in range(3):
                out_psi[i, s, owner[c]] += f * v[s]
                out_psi[i, 3 + s, owner[c]] += f * w[s]
