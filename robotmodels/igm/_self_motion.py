"""Compiled steps along infinite families of postures: the arm moves and the tool does not.

A family is walked by predictor and corrector: a step along the null space of the Jacobian, then
Gauss-Newton steps back to the pose that leave the null space alone.

Lengths are in units of the arm, so that one tolerance serves metres and radians. Joints that are
held are bits of a number.
"""

from __future__ import annotations

from math import cos, sqrt

import numpy as np
from numba import types

from ..kernels._compile import INT, INTS, MATRIX, OUT1, OUT2, STACK, VECTOR, compiled
from ._check import forward, jacobian, missing, wrapped

SINGULAR = 1e-6  # singular values that count as zero at a posture
MET = 1e-11  # error up to which a posture is a member
MERGED = 2e-6  # double roots are postures closer than this; rounding parts them by half of it
PROBE = 0.02  # step that tells a family from a double root [rad]
STRIDE = 0.1  # first step along a curve
LONGEST = 0.4  # longest one: far less than half a turn
ENDLESS = 50.0  # longest one where no joint turns
FAR = 1e4  # way of a prismatic joint after which a curve counts as endless

FLOAT = types.float64
_PAIR = types.Tuple((FLOAT, FLOAT))
_COUNTS = types.Tuple((INT, INT))
_FLAGS = types.Array(types.boolean, 2, "C", readonly=True)
_FLAGS_OUT = types.Array(types.boolean, 2, "C")
_NUMBERS = types.Array(types.int64, 2, "C", readonly=True)
_NUMBERS_OUT = types.Array(types.int64, 2, "C")


@compiled()
def product(a, b):
    """Inner product of two vectors."""
    total = 0.0
    for i in range(a.size):
        total += a[i] * b[i]
    return total


@compiled()
def way_between(a, b):
    """Length of b - a."""
    total = 0.0
    for i in range(a.size):
        total += (b[i] - a[i]) ** 2
    return sqrt(total)


@compiled(FLOAT(INTS, STACK, MATRIX, VECTOR, OUT1))
def error_at(sigma, D, U, q, e):
    """What is missing to the pose U, the vector in ``e (6,)``."""
    P, axes = np.empty((3, 4)), np.empty((sigma.size, 6))
    forward(sigma, D, q, P, axes)
    way, angle = missing(U, P, e)
    return max(way, angle)


@compiled(INT(INTS, STACK, VECTOR, INT, OUT2, OUT1, OUT2))
def decomposed(sigma, D, q, held, W, s, V):
    """``J V = W`` with orthogonal columns of lengths s, for the f joints that are not held.

    ``V (k, f)`` is orthonormal, zero in the rows of held joints; the lengths fall. Columns are
    turned against each other until all are square (Hestenes 1958), which finds a small singular
    value and its direction to full accuracy. Returns f.
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
def corrected(sigma, D, U, q, held, spare):
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
def sought(sigma, D, U, q, held):
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
def bend(sigma, D, q, W, s, V, i):
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
def on_fold(sigma, D, U, q, held, spare):
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


# --- directions of a family ----------------------------------------------------------------------


@compiled()
def projected(V, first, f, v, out):
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
def add_direction(v, rows, count):
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
def candidates(V, first, f, out):
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
def first_flat(s, f):
    """Place of the first of the falling singular values that counts as zero.

    With slides run out far beyond the arm small angles matter more than their size tells.
    """
    limit = SINGULAR * min(1.0, (10.0 / s[0]) ** 2) if f > 0 and s[0] > 0.0 else SINGULAR
    first = f
    while first > 0 and s[first - 1] < limit:
        first -= 1
    return first


@compiled(_COUNTS(INTS, STACK, MATRIX, VECTOR, INT, OUT2))
def directions(sigma, D, U, q, held, out):
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
def tangent(sigma, D, q, held, before, out):
    """Direction of a curve at a posture, the way of ``before``.

    Returns the part of ``before`` in it, and the second flattest singular value.
    """
    k = sigma.size
    W, s, V = np.empty((6, k)), np.empty(k), np.empty((k, k))
    f = decomposed(sigma, D, q, held, W, s, V)
    first = f - 1
    while first > 0 and s[first - 1] < SINGULAR:
        first -= 1
    return projected(V, first, f, before, out), (s[f - 2] if f > 1 else 1.0)


@compiled(_COUNTS(INTS, STACK, MATRIX, VECTOR, VECTOR, INT, OUT2, OUT2, OUT1))
def walked(sigma, D, U, start, along, held, points, tangents, flat):
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


# --- many postures -------------------------------------------------------------------------------


@compiled()
def is_settled(sigma, D, U, q, free, W, s, V):
    """Which joints move along a family whose free joints are the first that do, as bits; else 0.

    Families with a fold beside them are not judged here.
    """
    k = sigma.size
    f = decomposed(sigma, D, q, 0, W, s, V)
    first = first_flat(s, f)
    null, freed = f - first, 0
    for m in range(k):
        freed += (free >> m) & 1
    if null == 0 or freed != null:
        return 0
    B, done, chosen, moving = np.empty((k, null)), 0, 0, 0
    y, ahead = np.empty(k), np.empty(k)
    for m in range(k):
        ahead[m] = q[m]
        for c in range(null):
            ahead[m] += PROBE * cos(1.0 + 2.3 * c) * V[m, first + c]
            if abs(V[m, first + c]) > 1e-6:
                moving |= 1 << m
        y[m] = ahead[m]
    # where a joint turns round it seems to be at rest: a member aside is asked which is the first
    if corrected(sigma, D, U, y, 0, null) > MET or way_between(y, ahead) > 0.2 * PROBE:
        return 0
    decomposed(sigma, D, y, 0, W, s, V)
    for m in range(k):
        for c in range(null):
            B[m, c] = V[m, first + c]
            if abs(B[m, c]) > 1e-6:
                moving |= 1 << m
    for m in range(k):
        pivot = done
        for c in range(done, null):
            if abs(B[m, c]) > abs(B[m, pivot]):
                pivot = c
        if done == null or abs(B[m, pivot]) < 1e-6:
            continue
        chosen |= 1 << m
        for r in range(k):
            B[r, done], B[r, pivot] = B[r, pivot], B[r, done]
        for c in range(done + 1, null):
            share = B[m, c] / B[m, done]
            for r in range(k):
                B[r, c] -= share * B[r, done]
        done += 1
    return moving if chosen == free and s[first] < SINGULAR else 0


@compiled(types.void(STACK, INTS, STACK, STACK, _NUMBERS, _FLAGS, _NUMBERS_OUT))
def settled_already(poses, sigma, D, q, free, family, moving):
    """Joints that move (bits, ``(N, S)``) at postures ``q (N, S, k)`` of settled families, or 0."""
    k = sigma.size
    W, s, V = np.empty((6, k)), np.empty(k), np.empty((k, k))
    for n in range(q.shape[0]):
        for r in range(q.shape[1]):
            moving[n, r] = 0
            if family[n, r]:
                moving[n, r] = is_settled(sigma, D, poses[n], q[n, r], free[n, r], W, s, V)


@compiled()
def well_placed(J):
    """Whether ``J (6, 6)``, overwritten, is far from singular, from the pivots of elimination."""
    for c in range(6):
        best = c
        for r in range(c + 1, 6):
            if abs(J[r, c]) > abs(J[best, c]):
                best = r
        if not abs(J[best, c]) > 1e-4:
            return False
        if best != c:
            for m in range(c, 6):
                J[c, m], J[best, m] = J[best, m], J[c, m]
        for r in range(c + 1, 6):
            share = J[r, c] / J[c, c]
            for m in range(c + 1, 6):
                J[r, m] -= share * J[c, m]
    return True


@compiled(types.void(INTS, STACK, STACK, _FLAGS, _FLAGS_OUT, _FLAGS_OUT))
def singular_postures(sigma, D, q, there, double, member):
    """Postures ``q (N, S, k)`` whose Jacobian is singular: alone there, or one of a family."""
    k = sigma.size
    P, axes, J = np.empty((3, 4)), np.empty((k, 6)), np.empty((6, k))
    rows = np.empty((24, k))
    W, s, V = np.empty((6, k)), np.empty(k), np.empty((k, k))
    for n in range(q.shape[0]):
        for r in range(q.shape[1]):
            double[n, r] = member[n, r] = False
            if not there[n, r]:
                continue
            forward(sigma, D, q[n, r], P, axes)
            jacobian(sigma, P, axes, J)
            if k == 6 and well_placed(J):
                continue
            count, null = directions(sigma, D, P, q[n, r], 0, rows)
            double[n, r], member[n, r] = null > 0 and count == 0, count > 0
            if null == 1 and count == 0 and k == 6:
                # the other root is twice as far as the singularity, if there is one near
                decomposed(sigma, D, q[n, r], 0, W, s, V)
                if s[5] > 1e-12:
                    slope = abs(bend(sigma, D, q[n, r], W, s, V, 5))
                    double[n, r] = 2.0 * s[5] < MERGED * slope
