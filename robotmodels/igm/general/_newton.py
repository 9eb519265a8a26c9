"""Compiled: a posture polished on the exact chain, and kept unless it is known.

Lengths are in units of the arm.
"""

from __future__ import annotations

from math import atan2, cos, pi, sin, sqrt

import numpy as np
from numba import types

from ...kernels._compile import (
    Floats,
    Ints,
    compiled,
)
from ._linear import factor, solve_one

COUNTS = types.Array(types.int64, 1, "C")
MERGE = 1e-6  # postures closer than this in every joint are one [rad, or lengths of the arm]
Work = tuple[Floats, Floats, Floats, Floats, Ints, Floats, Floats]


@compiled()
def wrapped(value: float) -> float:
    """Angle in (-pi, pi]."""
    value -= 2.0 * pi * np.round(value / (2.0 * pi))
    if value <= -pi:
        value += 2.0 * pi
    return value


@compiled()
def workspace() -> Work:
    """Arrays that `newton` writes to: pose, axes, origins, Jacobian, pivots, error, best."""
    return (
        np.empty((3, 4)),
        np.empty((6, 3)),
        np.empty((6, 3)),
        np.empty((6, 6)),
        np.empty(6, np.int64),
        np.empty(6),
        np.empty(6),
    )


@compiled()
def pose_of(sigma: Ints, D: Floats, q: Floats, T: Floats, z: Floats, o: Floats) -> None:
    """Pose ``T (3, 4)`` of the tool at ``q (6,)``, with axes z and origins o ``(6, 3)``."""
    for i in range(3):
        for j in range(4):
            T[i, j] = D[0, i, j]
    for k in range(6):
        for i in range(3):
            z[k, i], o[k, i] = T[i, 2], T[i, 3]
        if sigma[k] == 1:
            for i in range(3):
                T[i, 3] += q[k] * T[i, 2]
        else:
            c, s = cos(q[k]), sin(q[k])
            for i in range(3):
                a, b = T[i, 0], T[i, 1]
                T[i, 0] = c * a + s * b
                T[i, 1] = c * b - s * a
        L = D[k + 1]
        for i in range(3):
            a, b, c = T[i, 0], T[i, 1], T[i, 2]
            for j in range(3):
                T[i, j] = a * L[0, j] + b * L[1, j] + c * L[2, j]
            T[i, 3] += a * L[0, 3] + b * L[1, 3] + c * L[2, 3]


@compiled()
def jacobian_of(sigma: Ints, T: Floats, z: Floats, o: Floats, J: Floats) -> None:
    """Jacobian ``J (6, 6)`` of the tool from `pose_of`, rows [v; w] at the tool's origin."""
    for k in range(6):
        if sigma[k] == 1:
            for i in range(3):
                J[i, k], J[3 + i, k] = z[k, i], 0.0
            continue
        x, y, w = T[0, 3] - o[k, 0], T[1, 3] - o[k, 1], T[2, 3] - o[k, 2]
        J[0, k] = z[k, 1] * w - z[k, 2] * y
        J[1, k] = z[k, 2] * x - z[k, 0] * w
        J[2, k] = z[k, 0] * y - z[k, 1] * x
        for i in range(3):
            J[3 + i, k] = z[k, i]


@compiled()
def missing(U: Floats, T: Floats, e: Floats) -> tuple[float, float]:
    """What is missing to the pose U, ``e (6,)`` = [p_d - p; log(R_d R^T)]; position and angle."""
    for i in range(3):
        e[i] = U[i, 3] - T[i, 3]
    # R_d R^T through its rows, whose antisymmetric part is the axis times the sine
    trace, x, y, w = 0.0, 0.0, 0.0, 0.0
    for j in range(3):
        a, b, c = U[0, j], U[1, j], U[2, j]
        r, s, t = T[0, j], T[1, j], T[2, j]
        trace += a * r + b * s + c * t
        x += c * s - b * t
        y += a * t - c * r
        w += b * r - a * s
    sine = 0.5 * sqrt(x * x + y * y + w * w)
    turn = atan2(sine, 0.5 * (trace - 1.0))
    scale = 0.5 if sine < 1e-9 else 0.5 * turn / sine
    e[3], e[4], e[5] = scale * x, scale * y, scale * w
    return sqrt(e[0] * e[0] + e[1] * e[1] + e[2] * e[2]), turn


@compiled()
def newton(sigma: Ints, D: Floats, U: Floats, tolerance: Floats, q: Floats, work: Work) -> bool:
    """Newton's method from q (6,), in place, until rounding stops it; whether the pose is met.

    ``tolerance`` is of the position in lengths of the arm and of the angle in radians. At double
    roots convergence is linear, so steps go on while the error keeps falling.
    """
    T, z, o, J, pivots, e, best = work
    least = np.inf
    met = False
    worse = 0
    for count in range(40):
        pose_of(sigma, D, q, T, z, o)
        position, turn = missing(U, T, e)
        error = max(position, turn)
        if error < least:
            if error > 0.7 * least:
                worse += 1
            least = error
            for k in range(6):
                best[k] = q[k]
            met = position <= tolerance[0] and turn <= tolerance[1]
        else:
            worse += 1
        if error < 1e-16 or worse >= (2 if met else 4) or (count >= 15 and least > 1e-5):
            break
        jacobian_of(sigma, T, z, o, J)
        factor(J, pivots)
        solve_one(J, pivots, e)
        largest = 0.0
        for k in range(6):
            largest = max(largest, abs(e[k]))
        if not largest < 1e100:
            break
        scale = min(1.0, 0.7 / largest)
        for k in range(6):
            q[k] += scale * e[k]
    for k in range(6):
        q[k] = best[k] if sigma[k] == 1 else wrapped(best[k])
    return met


@compiled()
def distance(sigma: Ints, a: Floats, b: Floats) -> float:
    """Largest difference of two postures over the joints."""
    largest = 0.0
    for k in range(6):
        d = a[k] - b[k]
        if sigma[k] == 0:
            d = wrapped(d)
        largest = max(largest, abs(d))
    return largest


@compiled()
def is_near(sigma: Ints, a: Floats, b: Floats, radius: float) -> bool:
    """Whether two postures differ by at most the radius in every joint."""
    for k in range(6):
        d = a[k] - b[k]
        if abs(d) > radius and (sigma[k] == 1 or abs(wrapped(d)) > radius):
            return False
    return True


@compiled()
def keep(sigma: Ints, q: Floats, found: Floats, count: int) -> int:
    """Add q (6,) to ``found (16, 6)`` unless it is there; the new number."""
    for k in range(count):
        if is_near(sigma, q, found[k], MERGE):
            return count
    if count < found.shape[0]:
        for k in range(6):
            found[count, k] = q[k]
        count += 1
    return count
