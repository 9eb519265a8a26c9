"""Singular postures: null directions of the Jacobian, double roots, continuation of self-motions.

A self-motion is continued by predictor and corrector: a step along the null space of the Jacobian,
then Newton refinement that leaves the null space alone. Lengths are in units of the arm, so that
one tolerance serves metres and radians. Joints that are held are bits of a number.
"""

from __future__ import annotations

from math import cos, sqrt

import numpy as np
from numba import types
from numpy.typing import NDArray

from ...kernels._compile import INT, INTS, MATRIX, OUT1, OUT2, STACK, VECTOR, Floats, Ints, compiled
from .chain import forward, jacobian, pose_error, wrapped
from .newton import refined, singular_directions

MET = 1e-11  # error up to which a posture belongs to a self-motion
SINGULAR = 1e-6  # singular values that count as zero at a posture
SMALL = 1e-6  # part of a null direction below which a joint does not move
PROBE = 0.02  # step that tells a self-motion from a double root [rad]
STRIDE = 0.1  # first step along a curve
LONGEST = 0.4  # longest one: far less than half a turn
ENDLESS = 50.0  # longest one where no joint turns
FAR = 1e4  # distance of a prismatic joint after which a curve counts as endless
MERGED = 2e-6  # a double root is two postures closer than this; rounding parts them by half of it

_FLOAT = types.float64
_PAIR = types.Tuple((INT, INT))
_FLAGS = types.Array(types.boolean, 2, "C", readonly=True)
_FLAGS_OUT = types.Array(types.boolean, 2, "C")
_NUMBERS = types.Array(types.int64, 2, "C", readonly=True)
_NUMBERS_OUT = types.Array(types.int64, 2, "C")


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


@compiled()
def decomposed(sigma: Ints, D: Floats, q: Floats, held: int, rows: Floats, s: Floats) -> int:
    """`singular_directions` at a posture."""
    k = sigma.size
    P, axes, J = np.empty((3, 4)), np.empty((k, 6)), np.empty((6, k))
    forward(sigma, D, q, P, axes)
    return singular_directions(sigma, P, axes, held, np.ones(2), J, rows, s)


@compiled()
def first_zero(s: Floats, f: int) -> int:
    """Place of the first of the descending singular values that counts as zero.

    With slides run out far beyond the arm, small angles matter more than their size shows.
    """
    first = f
    while first > 0 and s[first - 1] < SINGULAR * min(1.0, (10.0 / max(s[0], 1e-300)) ** 2):
        first -= 1
    return first


@compiled(_FLOAT(INTS, STACK, MATRIX, OUT1, INT, INT))
def corrected(sigma: Ints, D: Floats, U: Floats, q: Floats, held: int, spare: int) -> float:
    """Refine q in place, not along the ``spare`` flattest directions; its error."""
    way, angle = refined(U, sigma, D, held, spare, np.ones(2), 2e-15, 1e3, q)
    return max(way, angle)


@compiled()
def fold_slope(sigma: Ints, D: Floats, q: Floats, rows: Floats, s: Floats, i: int) -> float:
    """Change of singular value i along its own direction: its slope where it passes zero."""
    k = sigma.size
    P, axes, J, trial = np.empty((3, 4)), np.empty((k, 6)), np.empty((6, k)), np.empty(k)
    change = 0.0
    for side in range(2):
        step = 1e-4 if side == 0 else -1e-4
        for m in range(k):
            trial[m] = q[m] + step * rows[i, 6 + m]
        forward(sigma, D, trial, P, axes)
        jacobian(sigma, P, axes, J)
        for r in range(6):
            for m in range(k):
                change += rows[i, r] / s[i] * J[r, m] * rows[i, 6 + m] / (2.0 * step)
    return change


@compiled(types.void(INTS, STACK, MATRIX, OUT1, INT, INT))
def move_to_fold(sigma: Ints, D: Floats, U: Floats, q: Floats, held: int, spare: int) -> None:
    """Move a posture beside a fold onto it, in place: there two postures of every pose are one.

    The error falls with the square of the distance and leaves half of the digits open; the
    singular value falls with the distance itself.
    """
    k = sigma.size
    rows, s, trial, e = np.empty((k, 6 + k)), np.empty(k), np.empty(k), np.empty(6)
    P, axes = np.empty((3, 4)), np.empty((k, 6))
    i = decomposed(sigma, D, q, held, rows, s) - spare - 1
    if not 0 <= i < 6 or not 1e-300 < s[i] < 1e-4:
        return
    slope = fold_slope(sigma, D, q, rows, s, i)
    if abs(slope) < 1e-3:
        return
    for m in range(k):
        trial[m] = q[m] - s[i] / slope * rows[i, 6 + m]
    forward(sigma, D, trial, P, axes)
    way, angle = pose_error(U, P, e)
    if max(way, angle) <= 1e-13:
        for m in range(k):
            q[m] = trial[m]


@compiled()
def eliminate(B: Floats, start: int) -> None:
    """Combine the columns of a basis so that some joints, from ``start`` on, are in one only."""
    k, n = B.shape
    done = 0
    for turn in range(k):
        m = (start + turn) % k
        pivot = done
        for c in range(done, n):
            if abs(B[m, c]) > abs(B[m, pivot]):
                pivot = c
        if done == n or abs(B[m, pivot]) < SMALL:
            continue
        for r in range(k):
            B[r, done], B[r, pivot] = B[r, pivot], B[r, done]
        for c in range(n):
            if c != done:
                share = B[m, c] / B[m, done]
                for r in range(k):
                    B[r, c] -= share * B[r, done]
        done += 1


@compiled()
def add_direction(v: Floats, out: Floats, count: int) -> int:
    """Add the unit vector along v unless it is there, either way round; the new number."""
    size = sqrt(cosine(v, v))
    if count == out.shape[0] or not size > 0.0:
        return count
    for i in range(count):
        if abs(cosine(out[i], v)) > (1.0 - 1e-9) * size:
            return count
    for m in range(v.size):
        out[count, m] = v[m] / size
    return count + 1


@compiled()
def null_directions(rows: Floats, first: int, f: int, out: Floats) -> int:
    """Directions of the null space, rows first to f, that may be those of a curve. How many.

    A fold beside a self-motion adds a direction to the null space that the self-motion does not
    have. The self-motion's own often leave some joints at rest, which elimination brings out.
    """
    k, n = out.shape[1], f - first
    B, v, count = np.empty((k, n)), np.empty(k), 0
    for start in range(k if n > 1 else 1):
        for r in range(k):
            for c in range(n):
                B[r, c] = rows[first + c, 6 + r]
        eliminate(B, start)
        for c in range(n):
            for r in range(k):
                v[r] = B[r, c]
            if count < out.shape[0] - 2:
                count = add_direction(v, out, count)
    for turn in range(2 if n > 1 else 0):
        for r in range(k):
            v[r] = 0.0
            for c in range(n):
                v[r] += cos(1.0 + 2.3 * c + 1.7 * turn) * rows[first + c, 6 + r]
        count = add_direction(v, out, count)
    return count


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


@compiled(_PAIR(INTS, STACK, MATRIX, VECTOR, INT, OUT2))
def directions(
    sigma: Ints, D: Floats, U: Floats, q: Floats, held: int, out: Floats
) -> tuple[int, int]:
    """Unit vectors along which the arm moves while the pose stays, in rows of out.

    Returns how many, and the dimension of the null space, folds included.
    """
    k = sigma.size
    rows, s = np.empty((k, 6 + k)), np.empty(k)
    f = decomposed(sigma, D, q, held, rows, s)
    first = first_zero(s, f)
    if first == f:
        return 0, 0
    tried = np.empty((40, k))
    number, count = null_directions(rows, first, f, tried), 0
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
            if distance(y, ahead) < 0.2 * PROBE:
                count = add_direction(v, out, count)
                break
            # beside a fold the corrector came to the self-motion all the same: try that direction
            if attempt == 1 or distance(y, q) < 0.2 * PROBE:
                break
            for m in range(k):
                ahead[m] = y[m] - q[m]
            if projected(rows, first, f, ahead, v) == 0.0:
                break
    return count, f - first


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


@compiled()
def moving_joints(
    sigma: Ints, D: Floats, U: Floats, q: Floats, free: int, rows: Floats, s: Floats
) -> int:
    """Bits of the joints that move along a self-motion, if the free ones are the first; else 0.

    A self-motion with a fold beside it is not judged here.
    """
    k = sigma.size
    f = decomposed(sigma, D, q, 0, rows, s)
    first = first_zero(s, f)
    n, freed, chosen, moving, done = f - first, 0, 0, 0, 0
    for m in range(k):
        freed += (free >> m) & 1
    if n == 0 or freed != n:
        return 0
    B, y, ahead = np.empty((k, n)), np.empty(k), np.empty(k)
    # at a turning point the joint's part of the null space is zero: test a neighbouring posture
    for at in range(2):
        for m in range(k):
            ahead[m] = q[m]
            for c in range(n):
                B[m, c] = rows[first + c, 6 + m]
                ahead[m] += PROBE * cos(1.0 + 2.3 * c) * B[m, c]
                if abs(B[m, c]) > SMALL:
                    moving |= 1 << m
            y[m] = ahead[m] if at == 0 else y[m]
        if at == 0:
            if corrected(sigma, D, U, y, 0, n) > MET or distance(y, ahead) > 0.2 * PROBE:
                return 0
            decomposed(sigma, D, y, 0, rows, s)
    eliminate(B, 0)
    for m in range(k):
        # the first joint of each column
        if done < n and abs(B[m, done]) > SMALL:
            chosen |= 1 << m
            done += 1
    return moving if chosen == free and s[first] < SINGULAR else 0


@compiled()
def far_from_singular(J: Floats) -> bool:
    """Whether ``J (6, 6)``, overwritten, is far from singular, from the pivots of elimination."""
    for c in range(6):
        best = c
        for r in range(c + 1, 6):
            if abs(J[r, c]) > abs(J[best, c]):
                best = r
        if not abs(J[best, c]) > 1e-4:
            return False
        for m in range(c, 6):
            J[c, m], J[best, m] = J[best, m], J[c, m]
        for r in range(c + 1, 6):
            share = J[r, c] / J[c, c]
            for m in range(c + 1, 6):
                J[r, m] -= share * J[c, m]
    return True


@compiled(
    types.void(STACK, INTS, STACK, STACK, _FLAGS, _FLAGS, _NUMBERS, _FLAGS_OUT, _FLAGS_OUT,
               _NUMBERS_OUT)
)  # fmt: skip
def classify(
    poses: Floats,
    sigma: Ints,
    D: Floats,
    q: Floats,
    there: NDArray[np.bool_],
    known: NDArray[np.bool_],
    free: Ints,
    double: NDArray[np.bool_],
    member: NDArray[np.bool_],
    moving: Ints,
) -> None:
    """Which postures ``q (N, S, k)`` are double roots, and which members of a self-motion.

    ``known (N, S)``: members by what the solver found. ``moving (N, S)``: bits of the joints that
    move where the ``free`` ones, at their reference, are the first that do; else 0.
    """
    k = sigma.size
    P, axes, J = np.empty((3, 4)), np.empty((k, 6)), np.empty((6, k))
    out, rows, s = np.empty((24, k)), np.empty((k, 6 + k)), np.empty(k)
    for n in range(q.shape[0]):
        for r in range(q.shape[1]):
            double[n, r], member[n, r], moving[n, r] = False, known[n, r], 0
            if not there[n, r]:
                continue
            if known[n, r] or free[n, r] != 0:
                moving[n, r] = moving_joints(sigma, D, poses[n], q[n, r], free[n, r], rows, s)
                if moving[n, r] != 0:
                    member[n, r] = True
                    continue
            forward(sigma, D, q[n, r], P, axes)
            jacobian(sigma, P, axes, J)
            if k == 6 and far_from_singular(J):
                continue
            count, null = directions(sigma, D, P, q[n, r], 0, out)
            double[n, r], member[n, r] = null > 0 and count == 0, known[n, r] or count > 0
            if null == 1 and count == 0 and k == 6:
                # the other root is twice as far as the singularity, if there is one near
                decomposed(sigma, D, q[n, r], 0, rows, s)
                if s[5] > 1e-12:
                    slope = abs(fold_slope(sigma, D, q[n, r], rows, s, 5))
                    double[n, r] = 2.0 * s[5] < MERGED * slope
