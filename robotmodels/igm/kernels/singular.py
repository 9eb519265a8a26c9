"""Singular postures: singular directions of the Jacobian, folds, continuation of self-motions.

A self-motion is continued by predictor and corrector: a step along the null space of the Jacobian,
then Newton refinement that leaves the null space alone. Lengths are in units of the arm, so that
one tolerance serves metres and radians. Joints that are held are bits of a number.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numba import types

from ...kernels._compile import INT, INTS, MATRIX, OUT1, OUT2, STACK, VECTOR, Floats, Ints, compiled
from .chain import forward, jacobian, pose_error, wrapped
from .newton import refined, singular_directions

MET = 1e-11  # error up to which a posture belongs to a self-motion
SINGULAR = 1e-6  # singular values that count as zero at a posture
STRIDE = 0.1  # first step along a curve
LONGEST = 0.4  # longest one: far less than half a turn
ENDLESS = 50.0  # longest one where no joint turns
FAR = 1e4  # distance of a prismatic joint after which a curve counts as endless

_FLOAT = types.float64
_PAIR = types.Tuple((INT, INT))


@compiled()
def distance(a: Floats, b: Floats) -> float:
    """Length of ``b - a``."""
    total = 0.0
    for i in range(a.size):
        total += (b[i] - a[i]) ** 2
    return sqrt(total)


@compiled()
def cosine(a: Floats, b: Floats) -> float:
    """Inner product of two unit vectors."""
    total = 0.0
    for i in range(a.size):
        total += a[i] * b[i]
    return total


@compiled(INT(INTS, STACK, VECTOR, INT, OUT2, OUT1))
def decomposed(sigma: Ints, D: Floats, q: Floats, held: int, rows: Floats, s: Floats) -> int:
    """`singular_directions` at a posture."""
    k = sigma.size
    P, axes, J = np.empty((3, 4)), np.empty((k, 6)), np.empty((6, k))
    forward(sigma, D, q, P, axes)
    return singular_directions(sigma, P, axes, held, np.ones(2), J, rows, s)


@compiled(_FLOAT(INTS, STACK, MATRIX, OUT1, INT, INT))
def corrected(sigma: Ints, D: Floats, U: Floats, q: Floats, held: int, spare: int) -> float:
    """Refine q in place, not along the ``spare`` flattest directions; its error."""
    way, angle = refined(U, sigma, D, held, spare, np.ones(2), 2e-15, 1e3, q)
    return max(way, angle)


@compiled(types.UniTuple(_FLOAT, 2)(INTS, STACK, VECTOR, INT, INT, OUT1))
def fold(
    sigma: Ints, D: Floats, q: Floats, held: int, spare: int, out: Floats
) -> tuple[float, float]:
    """Flattest singular value but ``spare``, and its change along its own direction, in ``out``.

    That is its slope where it passes zero; 0 if it is not near a fold or is on it.
    """
    k = sigma.size
    P, axes, J, trial = np.empty((3, 4)), np.empty((k, 6)), np.empty((6, k)), np.empty(k)
    rows, s = np.empty((k, 6 + k)), np.empty(k)
    i = decomposed(sigma, D, q, held, rows, s) - spare - 1
    if not 0 <= i < 6 or not 1e-300 < s[i] < 1e-4:
        return (1.0 if not 0 <= i < 6 or s[i] > 1e-300 else 0.0), 0.0
    for m in range(k):
        out[m] = rows[i, 6 + m]
        trial[m] = q[m] + 1e-4 * out[m]
    forward(sigma, D, trial, P, axes)
    jacobian(sigma, P, axes, J)
    ahead = 0.0
    for r in range(6):
        for m in range(k):
            ahead += rows[i, r] / s[i] * J[r, m] * out[m]
    return float(s[i]), (ahead - float(s[i])) / 1e-4


@compiled(types.void(INTS, STACK, MATRIX, OUT1, INT, INT))
def move_to_fold(sigma: Ints, D: Floats, U: Floats, q: Floats, held: int, spare: int) -> None:
    """Move a posture beside a fold onto it, in place: there two postures of every pose are one.

    The error falls with the square of the distance, the singular value with the distance itself.
    """
    k = sigma.size
    trial, e, P, axes = np.empty(k), np.empty(6), np.empty((3, 4)), np.empty((k, 6))
    size, slope = fold(sigma, D, q, held, spare, trial)
    if abs(slope) < 1e-3:
        return
    for m in range(k):
        trial[m] = q[m] - size / slope * trial[m]
    forward(sigma, D, trial, P, axes)
    way, angle = pose_error(U, P, e)
    if max(way, angle) <= 1e-13:
        for m in range(k):
            q[m] = trial[m]


@compiled()
def projected(rows: Floats, first: int, f: int, v: Floats, out: Floats) -> float:
    """Part of v in the null space, rows first to f, made a unit vector; its size."""
    k = v.size
    for m in range(k):
        out[m] = 0.0
    for i in range(first, f):
        part = 0.0
        for m in range(k):
            part += rows[i, 6 + m] * v[m]
        for m in range(k):
            out[m] += part * rows[i, 6 + m]
    size = sqrt(cosine(out, out))
    for m in range(k):
        out[m] /= size if size > 0.0 else 1.0
    return size


@compiled(_FLOAT(INTS, STACK, VECTOR, INT, INT, VECTOR, OUT1))
def tangent(
    sigma: Ints, D: Floats, q: Floats, held: int, rank: int, before: Floats, out: Floats
) -> float:
    """Part of ``before`` in the null space, of dimension ``rank`` or more, as a unit vector.

    Returns the flattest singular value outside of the first dimension.
    """
    k = sigma.size
    rows, s = np.empty((k, 6 + k)), np.empty(k)
    f = decomposed(sigma, D, q, held, rows, s)
    first = f - rank
    while first > 0 and s[first - 1] < SINGULAR:
        first -= 1
    if projected(rows, first, f, before, out) == 0.0:
        return -1.0
    return float(s[f - 2]) if f > 1 else 1.0


@compiled(_PAIR(INTS, STACK, MATRIX, VECTOR, VECTOR, INT, OUT2, OUT2))
def curve(
    sigma: Ints, D: Floats, U: Floats, start: Floats, along: Floats, held: int, points: Floats,
    tangents: Floats,
) -> tuple[int, int]:  # fmt: skip
    """Points of a self-motion and its directions, continued from the start along ``along``.

    Returns how many, and 1 if the curve came back to its start, which is then its last point
    again, whole turns not taken off.
    """
    k = sigma.size
    q, t, ahead, y, after = np.empty(k), np.empty(k), np.empty(k), np.empty(k), np.empty(k)
    tangent(sigma, D, start, held, 1, along, t)
    for m in range(k):
        q[m], points[0, m], tangents[0, m] = start[m], start[m], t[m]
    n, h = 1, STRIDE
    while n < points.shape[0]:
        turning = 0.0
        for m in range(k):
            turning = max(turning, abs(t[m]) if sigma[m] == 0 else 0.0)
            ahead[m] = q[m] + h * t[m]
            y[m] = ahead[m]
        error = corrected(sigma, D, U, y, held, 1)
        second = tangent(sigma, D, y, held, 1, t, after)
        if 1e-9 < second < 1e-5:
            move_to_fold(sigma, D, U, y, held, 1)
            second = tangent(sigma, D, y, held, 1, t, after)
        same = cosine(after, t)
        if error > MET or second < 0.0 or same < 0.97 or distance(y, ahead) > 0.25 * h:
            h *= 0.5
            if h < 1e-4:
                return n, 0
            continue
        # whether the start lies between the last point and this one
        onwards, total, endless = 0.0, 0.0, False
        for m in range(k):
            d = start[m] - q[m]
            d = wrapped(d) if sigma[m] == 0 else d
            total += d * d
            onwards += d * t[m]
            endless = endless or (sigma[m] == 1 and abs(y[m] - start[m]) > FAR)
        off = sqrt(max(total - onwards * onwards, 0.0))
        closed = (
            n > 2
            and 0.0 < onwards <= 1.01 * h
            and off < 0.3 * onwards + 1e-9
            and cosine(after, tangents[0]) > 0.7
        )
        for m in range(k):
            d = start[m] - q[m]
            points[n, m] = q[m] + (wrapped(d) if sigma[m] == 0 else d) if closed else y[m]
            tangents[n, m] = tangents[0, m] if closed else after[m]
            q[m], t[m] = points[n, m], tangents[n, m]
        n += 1
        if closed or endless:
            return n, int(closed)
        if same > 0.995:
            h = min(1.5 * h, LONGEST if turning > 1e-7 else ENDLESS)
    return n, 0
