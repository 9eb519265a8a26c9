"""Compiled: spherical shoulder, revolute elbow, spherical wrist: candidates at an arm angle.

``D_0 M_1 D_1 ... M_7 D_7 = U`` with the axes of joints 1, 2, 3 meeting in S and those of 5, 6, 7
in W. The distance from S to W gives joint 4, the arm angle the orientation of the upper arm; its
frame is that of joint 4 before the joint turns. Shoulder and wrist are then three revolute joints
each that reach an orientation.
"""

from __future__ import annotations

from math import atan2, cos, hypot, pi, sin, sqrt

import numpy as np
from numba import types
from numpy.typing import NDArray

from ...kernels._compile import MATRIX, OUT1, OUT3, STACK, VECTOR, Floats, compiled
from .chain import wrapped
from .equations import DOUBLE, NONE, TWO, type_2
from .pieper import advance, wrist_postures

ALONG = 1e-6  # sine between the line and base z below which base x takes its place
STRAIGHT = 4e-7  # bend below which the elbow counts as stretched or folded: 1e-14 m or so
NO_LINE = 1e-9  # distance from shoulder to wrist below which there is no line [m]
FLAGS, JOINT_FLAGS = (types.Array(types.boolean, ndim, "C") for ndim in (2, 3))


@compiled()
def cross_into(M: Floats) -> None:
    """The third column of ``M (3, 3)``: the cross product of the first two."""
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        M[i, 2] = M[j, 0] * M[k, 1] - M[k, 0] * M[j, 1]


@compiled()
def upper_arm(points: Floats, flat: bool, angle: float, F: Floats) -> float:
    """Line, elbow and their normal as columns of ``F (3, 3)``, in the frame of joint 4.

    ``points`` are S before joint 4 and W behind it; returns their distance. The elbow is the foot
    of S on axis 4; where it lies on the line, its side is that of ``axis 4 x line``.
    """
    s, w = points[0], points[1]
    c, n = cos(angle), sin(angle)
    x = c * w[0] - n * w[1] - s[0]
    y = n * w[0] + c * w[1] - s[1]
    z = 0.0 if flat else w[2] - s[2]
    distance = sqrt(x * x + y * y + z * z)
    if distance < NO_LINE:
        return distance
    F[0, 0], F[1, 0], F[2, 0] = x / distance, y / distance, z / distance
    if flat:
        # the elbow seen from S is (-s_x, -s_y, 0)
        side = s[0] * F[1, 0] - s[1] * F[0, 0]
        sign = -1.0 if side < -STRAIGHT * hypot(s[0], s[1]) else 1.0
        F[0, 1], F[1, 1], F[2, 1] = -sign * F[1, 0], sign * F[0, 0], 0.0
    else:
        along = -s[0] * F[0, 0] - s[1] * F[1, 0]
        ex, ey, ez = -s[0] - along * F[0, 0], -s[1] - along * F[1, 0], -along * F[2, 0]
        length = sqrt(ex * ex + ey * ey + ez * ez)
        F[0, 1], F[1, 1], F[2, 1] = ex / length, ey / length, ez / length
    cross_into(F)
    return distance


@compiled()
def reference_axes(x: float, y: float, z: float, B: Floats) -> None:
    """The line (a unit vector), the direction of arm angle 0 and their normal as columns of B."""
    B[0, 0], B[1, 0], B[2, 0] = x, y, z
    if hypot(x, y) > ALONG:
        a, b, c = -z * x, -z * y, x * x + y * y
    else:
        a, b, c = y * y + z * z, -x * y, -x * z
    length = sqrt(a * a + b * b + c * c)
    B[0, 1], B[1, 1], B[2, 1] = a / length, b / length, c / length
    cross_into(B)


@compiled()
def times_transposed(A: Floats, B: Floats, out: Floats) -> None:
    """``out = A B^T`` of rotations."""
    for i in range(3):
        for j in range(3):
            out[i, j] = A[i, 0] * B[j, 0] + A[i, 1] * B[j, 1] + A[i, 2] * B[j, 2]


@compiled()
def transposed_times(A: Floats, B: Floats, out: Floats) -> None:
    """``out = A^T B`` of rotations."""
    for i in range(3):
        for j in range(3):
            out[i, j] = A[0, i] * B[0, j] + A[1, i] * B[1, j] + A[2, i] * B[2, j]


@compiled()
def upper_arm_pose(D: Floats, q: Floats, P: Floats, Q: Floats) -> None:
    """Pose P of the frame of joint 4, before the joint turns; Q is scratch."""
    for i in range(3):
        for j in range(4):
            Q[i, j] = D[0, i, j]
    advance(Q, True, q[0], D[1], P)
    advance(P, True, q[1], D[2], Q)
    advance(Q, True, q[2], D[3], P)


@compiled(types.void(MATRIX, STACK, VECTOR, MATRIX, types.boolean, OUT1))
def arm_angles(
    q: Floats, D: Floats, shoulder: Floats, points: Floats, flat: bool, psi: Floats
) -> None:
    """Arm angles ``psi (N,)`` of postures ``q (N, 7)``."""
    F, B = np.zeros((3, 3)), np.zeros((3, 3))
    P, Q, line, elbow = np.empty((3, 4)), np.empty((3, 4)), np.empty(3), np.empty(3)
    for n in range(q.shape[0]):
        psi[n] = 0.0
        if upper_arm(points, flat, q[n, 3], F) < NO_LINE:
            continue
        upper_arm_pose(D, q[n], P, Q)
        for i in range(3):
            line[i], elbow[i] = 0.0, 0.0
            for j in range(3):
                line[i] += P[i, j] * F[j, 0]
                elbow[i] += P[i, j] * F[j, 1]
        reference_axes(line[0], line[1], line[2], B)
        c = elbow[0] * B[0, 1] + elbow[1] * B[1, 1] + elbow[2] * B[2, 1]
        s = elbow[0] * B[0, 2] + elbow[1] * B[1, 2] + elbow[2] * B[2, 2]
        psi[n] = wrapped(atan2(s, c))


@compiled()
def turned_arm(B: Floats, F: Floats, psi: float, G: Floats, R: Floats) -> None:
    """Rotation R of the frame of joint 4, before it turns, with the elbow at the arm angle."""
    c, s = cos(psi), sin(psi)
    for i in range(3):
        G[i, 0] = B[i, 0]
        G[i, 1] = c * B[i, 1] + s * B[i, 2]
        G[i, 2] = c * B[i, 2] - s * B[i, 1]
    times_transposed(G, F, R)


@compiled()
def wrist_target(R: Floats, q4: float, D: Floats, U: Floats, G: Floats, M: Floats) -> None:
    """``M = (R Rz(q_4) D_4)^T U D_7^T``: what joints 5 to 7 must do, ``M_5 D_5 M_6 D_6 M_7``."""
    c, s = cos(q4), sin(q4)
    for i in range(3):
        x, y = c * R[i, 0] + s * R[i, 1], c * R[i, 1] - s * R[i, 0]
        for j in range(3):
            M[i, j] = x * D[4, 0, j] + y * D[4, 1, j] + R[i, 2] * D[4, 2, j]
    transposed_times(M, U, G)
    times_transposed(G, D[7], M)


@compiled(
    types.void(
        STACK,
        VECTOR,
        MATRIX,
        STACK,
        VECTOR,
        VECTOR,
        MATRIX,
        types.boolean,
        VECTOR,
        OUT3,
        FLAGS,
        JOINT_FLAGS,
    )
)
def arm_angle_candidates(
    poses: Floats,
    psi: Floats,
    references: Floats,
    D: Floats,
    shoulder: Floats,
    wrist: Floats,
    points: Floats,
    flat: bool,
    tolerances: Floats,
    q: Floats,
    present: NDArray[np.bool_],
    free: NDArray[np.bool_],
) -> None:
    """Candidates ``q (N, 8, 7)`` of poses ``(N, 4, 4)`` at arm angles ``psi (N,)``.

    ``shoulder`` is S in R_0, ``wrist`` is W in the frame of the tool.
    """
    s, w = points[0], points[1]
    X, Y = s[1] * w[0] - s[0] * w[1], s[0] * w[0] + s[1] * w[1]
    offset = 0.0 if flat else w[2] - s[2]
    known = s[0] * s[0] + s[1] * s[1] + w[0] * w[0] + w[1] * w[1] + offset * offset
    F, B, M = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    R, G = np.empty((3, 3)), np.empty((3, 3))
    P, Q = np.empty((3, 4)), np.empty((3, 4))
    x_shoulder, x_wrist, line = np.empty((2, 3)), np.empty((2, 3)), np.empty(3)
    free_shoulder, free_wrist = np.zeros(2, np.int64), np.zeros(2, np.int64)
    slack_angle = max(1e-9, tolerances[1])
    for n in range(poses.shape[0]):
        U, reference = poses[n], references[n]
        for i in range(3):
            line[i] = U[i, 3] - shoulder[i]
            for j in range(3):
                line[i] += U[i, j] * wrist[j]
        length = sqrt(line[0] * line[0] + line[1] * line[1] + line[2] * line[2])
        # an overshoot by a length moves Z by that times the distance
        slack = (length + 1e-9) * max(tolerances[0], 1e-9)
        Z = 0.5 * (known - length * length)
        kind, first, second = type_2(X, Y, Z, slack, 0.0)
        if kind == NONE or not length >= 0.0:
            continue
        if kind == TWO and abs(sin(first - second)) < 2.0 * STRAIGHT:
            # rounding splits the double root of a stretched or folded arm, and would take it out
            # of line with an aligned shoulder or wrist
            kind, first = DOUBLE, atan2(X, Y) + (0.0 if Z > 0.0 else pi)
        no_line = length < NO_LINE
        if not no_line:
            reference_axes(line[0] / length, line[1] / length, line[2] / length, B)
        count = 0
        for root in range(kind):
            q4 = first if root == 0 else second
            if no_line:
                # the upper arm may point anywhere: the shoulder stays at its reference
                for i in range(3):
                    x_shoulder[0, i] = reference[i]
                shoulders, free_shoulder[0] = 1, 1
                upper_arm_pose(D, reference, P, Q)
                for i in range(3):
                    for j in range(3):
                        R[i, j] = P[i, j]
            else:
                upper_arm(points, flat, q4, F)
                turned_arm(B, F, psi[n], G, R)
                # R = D_0 M_1 D_1 M_2 D_2 M_3 D_3
                times_transposed(R, D[3], G)
                transposed_times(D[0], G, M)
                shoulders = wrist_postures(
                    D[1], D[2], M, slack_angle, reference[0], x_shoulder, free_shoulder, G
                )
            wrist_target(R, q4, D, U, G, M)
            wrists = wrist_postures(
                D[5], D[6], M, slack_angle, reference[4], x_wrist, free_wrist, G
            )
            for i in range(shoulders):
                for j in range(wrists):
                    for m in range(3):
                        q[n, count, m], q[n, count, 4 + m] = x_shoulder[i, m], x_wrist[j, m]
                        free[n, count, m] = no_line or (m == 0 and free_shoulder[i] == 1)
                    q[n, count, 3] = q4
                    free[n, count, 4] = free_wrist[j] == 1
                    present[n, count] = True
                    count += 1
