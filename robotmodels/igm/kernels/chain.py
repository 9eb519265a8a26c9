"""Pose, pose error and Jacobian of a `JointChain` at one posture."""

from __future__ import annotations

from math import atan2, cos, floor, pi, sin, sqrt

import numpy as np

from ...kernels._compile import Floats, Ints, compiled


@compiled()
def wrapped(angle: float) -> float:
    """The same angle in (-pi, pi]."""
    if -pi < angle <= pi:
        return angle
    turned = angle - 2.0 * pi * floor((angle + pi) / (2.0 * pi))
    return pi if turned <= -pi else turned


@compiled()
def forward(sigma: Ints, D: Floats, q: Floats, P: Floats, axes: Floats) -> None:
    """``P = D_0 M_1 D_1 ... M_k D_k``; z and origin of each axis in ``axes (k, 6)``."""
    T = np.empty((3, 4))
    for i in range(3):
        for j in range(4):
            P[i, j] = D[0, i, j]
    for k in range(sigma.size):
        for i in range(3):
            axes[k, i], axes[k, 3 + i] = P[i, 2], P[i, 3]
        c, s = (cos(q[k]), sin(q[k])) if sigma[k] == 0 else (1.0, 0.0)
        r = 0.0 if sigma[k] == 0 else q[k]
        for i in range(3):
            a, b, d = c * P[i, 0] + s * P[i, 1], c * P[i, 1] - s * P[i, 0], P[i, 2]
            for j in range(4):
                T[i, j] = a * D[k + 1, 0, j] + b * D[k + 1, 1, j] + d * D[k + 1, 2, j]
            T[i, 3] += r * d + P[i, 3]
        for i in range(3):
            for j in range(4):
                P[i, j] = T[i, j]


@compiled()
def pose_error(U: Floats, P: Floats, e: Floats) -> tuple[float, float]:
    """Translation and rotation vector from P to U, axes of R_0, into ``e (6,)``; their lengths."""
    x, y, z, trace = 0.0, 0.0, 0.0, 0.0
    for j in range(3):
        e[j] = U[j, 3] - P[j, 3]
        x += P[1, j] * U[2, j] - P[2, j] * U[1, j]
        y += P[2, j] * U[0, j] - P[0, j] * U[2, j]
        z += P[0, j] * U[1, j] - P[1, j] * U[0, j]
        for i in range(3):
            trace += P[i, j] * U[i, j]
    # x, y, z are 2 sin(angle) times the axis, the trace is 1 + 2 cos(angle)
    twice = sqrt(x * x + y * y + z * z)
    angle = atan2(twice, trace - 1.0)
    grow = angle / twice if twice > 1e-12 else 0.5
    e[3], e[4], e[5] = grow * x, grow * y, grow * z
    return sqrt(e[0] * e[0] + e[1] * e[1] + e[2] * e[2]), angle


@compiled()
def jacobian(sigma: Ints, P: Floats, axes: Floats, J: Floats) -> None:
    """``J (6, k)`` at the tool, axes of R_0."""
    for k in range(sigma.size):
        z, o = axes[k, :3], axes[k, 3:]
        if sigma[k] == 0:
            x, y, h = P[0, 3] - o[0], P[1, 3] - o[1], P[2, 3] - o[2]
            J[0, k], J[1, k] = z[1] * h - z[2] * y, z[2] * x - z[0] * h
            J[2, k] = z[0] * y - z[1] * x
            J[3, k], J[4, k], J[5, k] = z[0], z[1], z[2]
        else:
            J[0, k], J[1, k], J[2, k] = z[0], z[1], z[2]
            J[3, k] = J[4, k] = J[5, k] = 0.0
