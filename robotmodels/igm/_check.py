"""Candidate postures of any chain checked on the chain itself: improved, wrapped, merged.

What is missing of a pose is a translation (m) and a rotation (rad). A candidate is improved by
Gauss-Newton steps of least length, each missing part in units of its tolerance, so that with fewer
than six joints it ends at the posture that comes nearest to the pose.
"""

from __future__ import annotations

from math import atan2, cos, floor, pi, sin, sqrt

import numpy as np
from numba import types
from numpy.typing import NDArray

from ..kernels._compile import INT, INTS, STACK, VECTOR, Floats, Ints, compiled

MERGE = 1e-6  # postures closer than this in every joint are one [rad, m]
EXACT = 2e-13  # error below which nothing is left to improve [m, rad]
CUTS = (1e-10, 1e-7, 1e-5, 1e-3)  # singular values beside the largest that count as zero

_FLAGS = types.Array(types.boolean, 2, "C")
_OUT3 = types.Array(types.float64, 3, "C")
_OUT2 = types.Array(types.float64, 2, "C")


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
def missing(U: Floats, P: Floats, e: Floats) -> tuple[float, float]:
    """Translation and rotation vector from P to U in the axes of R_0; their lengths."""
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


@compiled()
def improved(
    U: Floats,
    sigma: Ints,
    D: Floats,
    held: Ints,
    tolerances: Floats,
    steps: int,
    rough: float,
    q: Floats,
) -> tuple[float, float]:
    """Improve ``q`` in place, joints with ``held`` 1 kept; the position and angle left missing.

    A candidate that misses by more than ``rough`` (metres or radians) is left as it is.
    """
    k = sigma.size
    P, axes, J, e = np.zeros((3, 4)), np.zeros((k, 6)), np.zeros((6, k)), np.zeros(6)
    trial, nearer, after = np.zeros(k), np.zeros(k), np.zeros(6)
    forward(sigma, D, q, P, axes)
    way, angle = missing(U, P, e)
    for _ in range(steps):
        if max(way, angle) <= EXACT or not max(way, angle) < rough:
            break
        jacobian(sigma, P, axes, J)
        for i in range(6):
            weight = 1.0 / tolerances[0 if i < 3 else 1]
            e[i] *= weight
            for m in range(k):
                J[i, m] = 0.0 if held[m] == 1 else J[i, m] * weight
        now = max(way / tolerances[0], angle / tolerances[1])
        best, least_way, least_angle = now, way, angle
        # beside a fold the whole step may lead astray: then without its longest parts
        for cut in CUTS:
            trial[:] = q + np.linalg.lstsq(J, e, cut)[0][:k]
            forward(sigma, D, trial, P, axes)
            next_way, next_angle = missing(U, P, after)
            size = max(next_way / tolerances[0], next_angle / tolerances[1])
            if size < best:
                best, least_way, least_angle = size, next_way, next_angle
                nearer[:] = trial
            if best < 0.5 * now:
                break
        if not best < now:
            break
        for m in range(k):
            q[m] = nearer[m]
        way, angle = least_way, least_angle
        forward(sigma, D, q, P, axes)
        missing(U, P, e)
    return way, angle


@compiled(
    types.int64(
        STACK, INTS, STACK, STACK, types.Array(types.boolean, 2, "C", readonly=True),
        types.Array(types.int64, 3, "C", readonly=True), VECTOR, INT, types.float64,
        _OUT3, _FLAGS, _OUT2, _FLAGS, types.Array(types.int64, 2, "C"),
    )
)  # fmt: skip
def checked_postures(
    poses: Floats,
    sigma: Ints,
    D: Floats,
    candidates: Floats,
    there: NDArray[np.bool_],
    held: Ints,
    tolerances: Floats,
    steps: int,
    rough: float,
    q: Floats,
    valid: NDArray[np.bool_],
    residual: Floats,
    double: NDArray[np.bool_],
    source: Ints,
) -> int:
    """Candidates ``(N, C, k)`` to postures ``q (N, S, k)``, packed; ``source`` says from which.

    ``held (N, C, k)`` keeps joints (1) at their value while a candidate is improved. Returns how
    many postures found no row because S was too small.
    """
    k, S = sigma.size, q.shape[1]
    x = np.zeros(k)
    lost = 0
    for n in range(poses.shape[0]):
        count = 0
        for i in range(candidates.shape[1]):
            if not there[n, i]:
                continue
            for m in range(k):
                x[m] = candidates[n, i, m]
            way, angle = improved(poses[n], sigma, D, held[n, i], tolerances, steps, rough, x)
            if not (way <= tolerances[0] and angle <= tolerances[1]):
                continue
            for m in range(k):
                if sigma[m] == 0:
                    x[m] = wrapped(x[m])
            known = -1
            for j in range(count):
                gap = 0.0
                for m in range(k):
                    turn = x[m] - q[n, j, m]
                    gap = max(gap, abs(wrapped(turn) if sigma[m] == 0 else turn))
                if gap < MERGE:
                    known = j
                    break
            if known >= 0:
                # the better of two that are one
                if max(way, angle) < residual[n, known]:
                    residual[n, known] = max(way, angle)
                    for m in range(k):
                        q[n, known, m] = x[m]
                double[n, known] = True
                continue
            if count == S:
                lost += 1
                continue
            for m in range(k):
                q[n, count, m] = x[m]
            residual[n, count], source[n, count] = max(way, angle), i
            valid[n, count] = True
            count += 1
    return lost
