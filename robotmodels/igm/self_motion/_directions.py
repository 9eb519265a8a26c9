"""Compiled: the directions of an infinite family at a posture, and curves of it walked.

A family is walked by predictor and corrector: a step along the null space of the Jacobian, then
Gauss-Newton steps back to the pose that leave the null space alone. Units as in `_correction`.
"""

from __future__ import annotations

from math import cos, sqrt

import numpy as np
from numba import types

from ...kernels._compile import INT, INTS, MATRIX, OUT1, OUT2, STACK, VECTOR, Floats, Ints, compiled
from .._check import wrapped
from ._correction import FLOAT, MET, corrected, decomposed, on_fold, product, way_between

SINGULAR = 1e-6  # singular values that count as zero at a posture
PROBE = 0.02  # step that tells a family from a double root [rad]
STRIDE = 0.1  # first step along a curve
LONGEST = 0.4  # longest one: far less than half a turn
ENDLESS = 50.0  # longest one where no joint turns
FAR = 1e4  # way of a prismatic joint after which a curve counts as endless
_PAIR = types.Tuple((FLOAT, FLOAT))
_COUNTS = types.Tuple((INT, INT))


@compiled()
def projected(V: Floats, first: int, f: int, v: Floats, out: Floats) -> float:
    """Part of v in the span of columns ``first`` to f of V, made a unit vector; its size."""
    k = v.size
    for m in range(k):
        out[m] = 0.0
    for i in range(first, f):
        part = 0.0
        for m in range(k):
            part += V[m, i] * v[m]
        for m in range(k):
            out[m] += part * V[m, i]
    size = sqrt(product(out, out))
    if size > 0.0:
        for m in range(k):
            out[m] /= size
    return size


@compiled()
def add_direction(v: Floats, rows: Floats, count: int) -> int:
    """Add the unit vector along v unless it is there, either way round; the new number."""
    size = sqrt(product(v, v))
    if count == rows.shape[0] or not size > 0.0:
        return count
    for i in range(count):
        if abs(product(rows[i], v)) > (1.0 - 1e-9) * size:
            return count
    for m in range(v.size):
        rows[count, m] = v[m] / size
    return count + 1


@compiled()
def candidates(V: Floats, first: int, f: int, out: Floats) -> int:
    """Directions of the null space ``V[:, first:f]`` worth trying, in rows of out. How many.

    A fold beside a family adds a direction to the null space that the family does not have. The
    family's own are often those that leave some joints at rest, which elimination brings out.
    """
    k, n = V.shape[0], f - first
    v = np.empty(k)
    B = np.empty((k, n))
    count = 0
    for start in range(k if n > 1 else 1):
        for r in range(k):
            for c in range(n):
                B[r, c] = V[r, first + c]
        done = 0
        for turn in range(k):
            m = (start + turn) % k
            pivot = done
            for c in range(done, n):
                if abs(B[m, c]) > abs(B[m, pivot]):
                    pivot = c
            if done == n or abs(B[m, pivot]) < 1e-6:
                continue
            for r in range(k):
                B[r, done], B[r, pivot] = B[r, pivot], B[r, done]
            for c in range(n):
                if c != done:
                    share = B[m, c] / B[m, done]
                    for r in range(k):
                        B[r, c] -= share * B[r, done]
            done += 1
        for c in range(n):
            for r in range(k):
                v[r] = B[r, c]
            if count < out.shape[0] - 2:
                count = add_direction(v, out, count)
    for turn in range(2 if n > 1 else 0):
        for r in range(k):
            v[r] = 0.0
            for c in range(n):
                v[r] += cos(1.0 + 2.3 * c + 1.7 * turn) * V[r, first + c]
        count = add_direction(v, out, count)
    return count


@compiled()
def first_flat(s: Floats, f: int) -> int:
    """Place of the first of the falling singular values that counts as zero.

    With slides run out far beyond the arm small angles matter more than their size tells.
    """
    limit = SINGULAR * min(1.0, (10.0 / s[0]) ** 2) if f > 0 and s[0] > 0.0 else SINGULAR
    first = f
    while first > 0 and s[first - 1] < limit:
        first -= 1
    return first


@compiled(_COUNTS(INTS, STACK, MATRIX, VECTOR, INT, OUT2))
def directions(
    sigma: Ints,
    D: Floats,
    U: Floats,
    q: Floats,
    held: int,
    out: Floats,
) -> tuple[int, int]:
    """Unit vectors along which the arm moves while the pose stays, in rows of out.

    Returns how many, and the dimension of the null space, folds included.
    """
    k = sigma.size
    W, s, V = np.empty((6, k)), np.empty(k), np.empty((k, k))
    f = decomposed(sigma, D, q, held, W, s, V)
    first = first_flat(s, f)
    null = f - first
    if null == 0:
        return 0, 0
    tried = np.empty((40, k))
    number, count = candidates(V, first, f, tried), 0
    ahead, y, v = np.empty(k), np.empty(k), np.empty(k)
    for i in range(number):
        for m in range(k):
            v[m] = tried[i, m]
        for attempt in range(2):
            moved = False
            for side in range(2):
                for m in range(k):
                    ahead[m] = q[m] + (PROBE if side == 0 else -PROBE) * v[m]
                    y[m] = ahead[m]
                if corrected(sigma, D, U, y, held, 1) <= MET:
                    moved = True
                    break
            if not moved:
                break
            if way_between(y, ahead) < 0.2 * PROBE:
                count = add_direction(v, out, count)
                break
            # beside a fold the corrector came to the family all the same: try where it went
            if attempt == 1 or way_between(y, q) < 0.2 * PROBE:
                break
            for m in range(k):
                ahead[m] = y[m] - q[m]
            if projected(V, first, f, ahead, v) == 0.0:
                break
    return count, null


@compiled(_PAIR(INTS, STACK, VECTOR, INT, VECTOR, OUT1))
def tangent(
    sigma: Ints,
    D: Floats,
    q: Floats,
    held: int,
    before: Floats,
    out: Floats,
) -> tuple[float, float]:
    """Direction of a curve at a posture, the way of ``before``.

    Returns the part of ``before`` in it, and the second flattest singular value.
    """
    k = sigma.size
    W, s, V = np.empty((6, k)), np.empty(k), np.empty((k, k))
    f = decomposed(sigma, D, q, held, W, s, V)
    first = f - 1
    while first > 0 and s[first - 1] < SINGULAR:
        first -= 1
    return projected(V, first, f, before, out), (float(s[f - 2]) if f > 1 else 1.0)


@compiled(_COUNTS(INTS, STACK, MATRIX, VECTOR, VECTOR, INT, OUT2, OUT2, OUT1))
def walked(
    sigma: Ints,
    D: Floats,
    U: Floats,
    start: Floats,
    along: Floats,
    held: int,
    points: Floats,
    tangents: Floats,
    flat: Floats,
) -> tuple[int, int]:
    """Points of a curve one way from the start, their directions and second flattest values.

    Returns how many, and 1 if the curve came back to its start, which is then its last point
    again, turns not taken off. As many as there is room for may mean that room ran out.
    """
    k = sigma.size
    q, t, t_start, t_new = np.empty(k), np.empty(k), np.empty(k), np.empty(k)
    ahead, y = np.empty(k), np.empty(k)
    _, second = tangent(sigma, D, start, held, along, t)
    for m in range(k):
        q[m], t_start[m] = start[m], t[m]
        points[0, m], tangents[0, m] = q[m], t[m]
    flat[0] = second
    n, h = 1, STRIDE
    while n < points.shape[0]:
        turning = 0.0
        for m in range(k):
            turning = max(turning, abs(t[m]) if sigma[m] == 0 else 0.0)
            ahead[m] = q[m] + h * t[m]
            y[m] = ahead[m]
        error = corrected(sigma, D, U, y, held, 1)
        size, second = tangent(sigma, D, y, held, t, t_new)
        if 1e-9 < second < 1e-5:
            on_fold(sigma, D, U, y, held, 1)
            size, second = tangent(sigma, D, y, held, t, t_new)
        ahead_of = product(t_new, t)
        if error > MET or size == 0.0 or ahead_of < 0.97 or way_between(y, ahead) > 0.25 * h:
            h *= 0.5
            if h < 1e-4:
                return n, 0
            continue
        # back at the start: it lies between this point and the next
        if n > 2 and product(t_new, t_start) > 0.7:
            way, onwards = 0.0, 0.0
            for m in range(k):
                d = start[m] - q[m]
                d = wrapped(d) if sigma[m] == 0 else d
                way += d * d
                onwards += d * t[m]
            off = sqrt(max(way - onwards * onwards, 0.0))
            if 0.0 < onwards <= 1.01 * h and off < 0.3 * onwards + 1e-9:
                for m in range(k):
                    d = start[m] - q[m]
                    points[n, m] = q[m] + (wrapped(d) if sigma[m] == 0 else d)
                    tangents[n, m] = t_start[m]
                flat[n] = flat[0]
                return n + 1, 1
        endless = False
        for m in range(k):
            q[m], t[m] = y[m], t_new[m]
            points[n, m], tangents[n, m] = q[m], t[m]
            endless = endless or (sigma[m] == 1 and abs(q[m] - start[m]) > FAR)
        flat[n] = second
        n += 1
        if endless:
            return n, 0
        if ahead_of > 0.995:
            h = min(1.5 * h, LONGEST if turning > 1e-7 else ENDLESS)
    return n, 0
