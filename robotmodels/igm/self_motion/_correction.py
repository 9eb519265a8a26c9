"""Compiled: Gauss-Newton steps back to a pose that leave its flattest directions alone.

Lengths are in units of the arm, so that one tolerance serves metres and radians. Joints that are
held are bits of a number.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numba import types

from ...kernels._compile import INT, INTS, MATRIX, OUT1, OUT2, STACK, VECTOR, Floats, Ints, compiled
from .._check import forward, jacobian, missing

MET = 1e-11  # error up to which a posture is a member
FLOAT = types.float64


@compiled()
def product(a: Floats, b: Floats) -> float:
    """Inner product of two vectors."""
    total = 0.0
    for i in range(a.size):
        total += a[i] * b[i]
    return total


@compiled()
def way_between(a: Floats, b: Floats) -> float:
    """Length of b - a."""
    total = 0.0
    for i in range(a.size):
        total += (b[i] - a[i]) ** 2
    return sqrt(total)


@compiled(FLOAT(INTS, STACK, MATRIX, VECTOR, OUT1))
def error_at(sigma: Ints, D: Floats, U: Floats, q: Floats, e: Floats) -> float:
    """What is missing to the pose U, the vector in ``e (6,)``."""
    P, axes = np.empty((3, 4)), np.empty((sigma.size, 6))
    forward(sigma, D, q, P, axes)
    way, angle = missing(U, P, e)
    return max(way, angle)


@compiled(INT(INTS, STACK, VECTOR, INT, OUT2, OUT1, OUT2))
def decomposed(
    sigma: Ints,
    D: Floats,
    q: Floats,
    held: int,
    W: Floats,
    s: Floats,
    V: Floats,
) -> int:
    """``J V = W`` with orthogonal columns of lengths s, for the f joints that are not held.

    One-sided Jacobi (Hestenes 1958): small singular values to full accuracy. ``V (k, f)`` is
    orthonormal, zero in rows of held joints; the lengths descend. Returns f.
    """
    k = sigma.size
    P, axes, J = np.empty((3, 4)), np.empty((k, 6)), np.empty((6, k))
    forward(sigma, D, q, P, axes)
    jacobian(sigma, P, axes, J)
    f = 0
    for m in range(k):
        if (held >> m) & 1 == 0:
            for i in range(6):
                W[i, f] = J[i, m]
            for r in range(k):
                V[r, f] = 1.0 if r == m else 0.0
            f += 1
    for _ in range(30):
        turned = False
        for i in range(f - 1):
            for j in range(i + 1, f):
                a, b, c = 0.0, 0.0, 0.0
                for r in range(6):
                    a += W[r, i] * W[r, i]
                    b += W[r, j] * W[r, j]
                    c += W[r, i] * W[r, j]
                if c == 0.0 or abs(c) <= 1e-16 * sqrt(a * b) or a + b < 1e-30:
                    continue
                turned = True
                zeta = 0.5 * (b - a) / c
                t = (1.0 if zeta >= 0.0 else -1.0) / (abs(zeta) + sqrt(1.0 + zeta * zeta))
                cosine = 1.0 / sqrt(1.0 + t * t)
                sine = cosine * t
                for r in range(6):
                    x, y = W[r, i], W[r, j]
                    W[r, i], W[r, j] = cosine * x - sine * y, sine * x + cosine * y
                for r in range(k):
                    x, y = V[r, i], V[r, j]
                    V[r, i], V[r, j] = cosine * x - sine * y, sine * x + cosine * y
        if not turned:
            break
    for i in range(f):
        total = 0.0
        for r in range(6):
            total += W[r, i] * W[r, i]
        s[i] = sqrt(total)
    for i in range(f):
        best = i
        for j in range(i + 1, f):
            if s[j] > s[best]:
                best = j
        if best != i:
            s[i], s[best] = s[best], s[i]
            for r in range(6):
                W[r, i], W[r, best] = W[r, best], W[r, i]
            for r in range(k):
                V[r, i], V[r, best] = V[r, best], V[r, i]
    return f


@compiled(FLOAT(INTS, STACK, MATRIX, OUT1, INT, INT))
def corrected(sigma: Ints, D: Floats, U: Floats, q: Floats, held: int, spare: int) -> float:
    """Gauss-Newton steps back to the pose, in place, none along the ``spare`` flattest directions.

    Returns the error. At a fold convergence is linear, so steps go on while the error falls.
    """
    k = sigma.size
    e, trial, trial_e = np.empty(6), np.empty(k), np.empty(6)
    W, s, V = np.empty((6, k)), np.empty(k), np.empty((k, k))
    error = error_at(sigma, D, U, q, e)
    for _ in range(40):
        if error <= 2e-15 or not error < 1.0:
            break
        f = decomposed(sigma, D, q, held, W, s, V)
        for m in range(k):
            trial[m] = q[m]
        for i in range(min(f - spare, 6)):
            if s[i] < 1e-9:
                break
            part = 0.0
            for r in range(6):
                part += W[r, i] * e[r]
            part /= s[i] * s[i]
            for m in range(k):
                trial[m] += part * V[m, i]
        now = error_at(sigma, D, U, trial, trial_e)
        falls = now < 0.7 * error
        if now < error:
            error = now
            for m in range(k):
                q[m] = trial[m]
            for r in range(6):
                e[r] = trial_e[r]
        if not falls:
            break
    return error


@compiled(FLOAT(INTS, STACK, MATRIX, OUT1, INT))
def sought(sigma: Ints, D: Floats, U: Floats, q: Floats, held: int) -> float:
    """Gauss-Newton steps of at most half a radian from anywhere, in place. Returns the error."""
    k = sigma.size
    e, W, s, V = np.empty(6), np.empty((6, k)), np.empty(k), np.empty((k, k))
    step = np.empty(k)
    for _ in range(25):
        if error_at(sigma, D, U, q, e) < 1e-3:
            return corrected(sigma, D, U, q, held, 0)
        f = decomposed(sigma, D, q, held, W, s, V)
        largest = 0.0
        for m in range(k):
            step[m] = 0.0
        for i in range(min(f, 6)):
            if s[i] < 1e-6:
                break
            part = 0.0
            for r in range(6):
                part += W[r, i] * e[r]
            for m in range(k):
                step[m] += part / (s[i] * s[i]) * V[m, i]
        for m in range(k):
            largest = max(largest, abs(step[m]))
        scale = min(1.0, 0.5 / largest) if largest > 0.0 else 1.0
        for m in range(k):
            q[m] += scale * step[m]
    return error_at(sigma, D, U, q, e)


@compiled()
def bend(sigma: Ints, D: Floats, q: Floats, W: Floats, s: Floats, V: Floats, i: int) -> float:
    """Change of singular value i along its own direction: its slope where it passes zero."""
    k = sigma.size
    P, axes, J, trial = np.empty((3, 4)), np.empty((k, 6)), np.empty((6, k)), np.empty(k)
    change = 0.0
    for side in range(2):
        step = 1e-4 if side == 0 else -1e-4
        for m in range(k):
            trial[m] = q[m] + step * V[m, i]
        forward(sigma, D, trial, P, axes)
        jacobian(sigma, P, axes, J)
        for r in range(6):
            for m in range(k):
                change += W[r, i] / s[i] * J[r, m] * V[m, i] / (2.0 * step)
    return change


@compiled(types.void(INTS, STACK, MATRIX, OUT1, INT, INT))
def on_fold(sigma: Ints, D: Floats, U: Floats, q: Floats, held: int, spare: int) -> None:
    """Move a posture beside a fold onto it, in place: there two postures of every pose are one.

    The error falls with the square of the way and leaves half of the digits open; the singular
    value falls with the way itself.
    """
    k = sigma.size
    W, s, V = np.empty((6, k)), np.empty(k), np.empty((k, k))
    f = decomposed(sigma, D, q, held, W, s, V)
    i = f - spare - 1
    if not 0 <= i < 6 or not 1e-300 < s[i] < 1e-4:
        return
    change = bend(sigma, D, q, W, s, V, i)
    if abs(change) < 1e-3:
        return
    trial, e = np.empty(k), np.empty(6)
    for m in range(k):
        trial[m] = q[m] - s[i] / change * V[m, i]
    if error_at(sigma, D, U, trial, e) <= 1e-13:
        for m in range(k):
            q[m] = trial[m]
