"""Newton refinement of candidates: the one iteration of the inverse models, and what it keeps.

The Jacobian is decomposed into singular directions. Beside a fold or a self-motion the whole step
may be far too long, or all that is needed: steps without the directions below one threshold after
the other are tried, and the best one is taken.
"""

from __future__ import annotations

import numpy as np
from numba import types
from numpy.typing import NDArray

from ...kernels._compile import INT, INTS, STACK, VECTOR, Floats, Ints, compiled
from ...kernels.svd import orthogonal_rows
from .chain import forward, jacobian, pose_error, wrapped

MERGE = 1e-6  # postures closer than this in every joint are equal [rad, m]
STEPS = 30
CUTS = (1e-14, 1e-11, 1e-8, 1e-6, 1e-4, 1e-2)  # thresholds beside the largest singular value
MET = 1e-12  # error up to which a pose is met to rounding [m, rad]
BETWEEN = 1e-14  # error between two postures up to which they cannot be told apart [m, rad]

_FLAGS = types.Array(types.boolean, 2, "C")
_FLAGS_IN = types.Array(types.boolean, 2, "C", readonly=True)
_NUMBERS = types.Array(types.int64, 2, "C")
_NUMBERS_IN = types.Array(types.int64, 2, "C", readonly=True)
_OUT3, _OUT2 = types.Array(types.float64, 3, "C"), types.Array(types.float64, 2, "C")


@compiled()
def singular_directions(
    sigma: Ints, P: Floats, axes: Floats, held: int, weights: Floats, J: Floats, rows: Floats,
    s: Floats,
) -> int:  # fmt: skip
    """Singular values s, descending, of the Jacobian without the joints in the bits of held.

    Row i of ``rows (k, 6 + k)``: ``s_i`` times the left vector, then the right one. Returns how
    many joints are not held. ``weights (2,)``: of lengths and of angles.
    """
    k = sigma.size
    jacobian(sigma, P, axes, J)
    f = 0
    for m in range(k):
        if (held >> m) & 1 == 1:
            continue
        for i in range(6):
            rows[f, i] = J[i, m] * weights[0 if i < 3 else 1]
        for j in range(k):
            rows[f, 6 + j] = 1.0 if j == m else 0.0
        f += 1
    orthogonal_rows(rows, f, 6, 6 + k, s)
    return f


@compiled()
def refined(
    U: Floats, sigma: Ints, D: Floats, held: int, spare: int, weights: Floats, exact: float,
    rough: float, q: Floats,
) -> tuple[float, float]:  # fmt: skip
    """Refine ``q`` in place; the position error [m] and the angle [rad] that are left.

    Joints in the bits of held and the ``spare`` flattest directions keep their values. Steps end
    below an error of ``exact``, above one of ``rough``, and where the error falls no more.
    """
    k = sigma.size
    P, axes, J, e = np.empty((3, 4)), np.empty((k, 6)), np.empty((6, k)), np.empty(6)
    rows, s, after = np.empty((k, 6 + k)), np.empty(k), np.empty(6)
    step, trial, best = np.empty(k), np.empty(k), np.empty(k)
    forward(sigma, D, q, P, axes)
    way, angle = pose_error(U, P, e)
    for _ in range(STEPS):
        if max(way, angle) <= exact or not max(way, angle) < rough:
            break
        f = singular_directions(sigma, P, axes, held, weights, J, rows, s)
        now = max(way * weights[0], angle * weights[1])
        least, least_way, least_angle, tried = now, way, angle, -1
        for cut in CUTS:
            used = 0
            while used < min(f - spare, 6) and s[used] > cut * s[0]:
                used += 1
            if used == tried:
                continue
            tried = used
            longest = 0.0
            for m in range(k):
                step[m] = 0.0
            for i in range(used):
                part = 0.0
                for j in range(6):
                    part += rows[i, j] * weights[0 if j < 3 else 1] * e[j]
                part /= s[i] * s[i]
                for m in range(k):
                    step[m] += part * rows[i, 6 + m]
            for m in range(k):
                longest = max(longest, abs(step[m]))
            scale = min(1.0, 1.0 / longest) if longest > 0.0 else 0.0
            for m in range(k):
                trial[m] = q[m] + scale * step[m]
            forward(sigma, D, trial, P, axes)
            next_way, next_angle = pose_error(U, P, after)
            size = max(next_way * weights[0], next_angle * weights[1])
            if size < least:
                least, least_way, least_angle = size, next_way, next_angle
                for m in range(k):
                    best[m] = trial[m]
            if least < 0.5 * now:
                break
        if not least < now:
            break
        way, angle = least_way, least_angle
        for m in range(k):
            q[m] = best[m]
        forward(sigma, D, q, P, axes)
        pose_error(U, P, e)
        if not least < 0.9 * now:
            break
    return way, angle


@compiled()
def equal(
    U: Floats, sigma: Ints, D: Floats, a: Floats, b: Floats, good: float, P: Floats, axes: Floats,
    e: Floats,
) -> bool:  # fmt: skip
    """Whether two postures are equal, or those between them meet the pose as well as ``good``."""
    k = sigma.size
    gap = 0.0
    for m in range(k):
        d = b[m] - a[m]
        gap = max(gap, abs(wrapped(d) if sigma[m] == 0 else d))
    if gap < MERGE or good <= 0.0:
        return gap < MERGE
    between = np.empty(k)
    for part in (0.5, 0.3):
        for m in range(k):
            d = b[m] - a[m]
            between[m] = a[m] + part * (wrapped(d) if sigma[m] == 0 else d)
        forward(sigma, D, between, P, axes)
        way, angle = pose_error(U, P, e)
        if max(way, angle) > good:
            return False
    return True


@compiled(
    types.int64(
        STACK, INTS, STACK, STACK, _FLAGS_IN, _NUMBERS_IN, VECTOR, types.float64, types.float64,
        INT, _OUT3, _FLAGS, _OUT2, _FLAGS, _NUMBERS,
    )
)  # fmt: skip
def refined_postures(
    poses: Floats,
    sigma: Ints,
    D: Floats,
    candidates: Floats,
    there: NDArray[np.bool_],
    held: Ints,
    tolerances: Floats,
    exact: float,
    rough: float,
    singular: int,
    q: Floats,
    valid: NDArray[np.bool_],
    residual: Floats,
    double: NDArray[np.bool_],
    source: Ints,
) -> int:
    """Candidates ``(N, C, k)`` to distinct postures ``q (N, S, k)``, packed.

    Bits of ``held (N, C)`` are joints that keep their value. Returns how many found no row.
    """
    # singular 1: postures are equal too where those between them meet the pose; where one meets it
    # to rounding, those that only meet the tolerance are dropped. source: the candidate's number
    k, S = sigma.size, q.shape[1]
    x, weights, lost = np.empty(k), np.empty(2), 0
    P, axes, e = np.empty((3, 4)), np.empty((k, 6)), np.empty(6)
    for i in range(2):
        weights[i] = min(tolerances[0], tolerances[1]) / tolerances[i]
    for n in range(poses.shape[0]):
        count, least = 0, np.inf
        for i in range(candidates.shape[1]):
            if not there[n, i]:
                continue
            for m in range(k):
                x[m] = candidates[n, i, m]
            way, angle = refined(poses[n], sigma, D, held[n, i], 0, weights, exact, rough, x)
            if not (way <= tolerances[0] and angle <= tolerances[1]):
                continue
            error = max(way, angle)
            least = min(least, error)
            for m in range(k):
                if sigma[m] == 0:
                    x[m] = wrapped(x[m])
            at = count
            for j in range(count):
                good = min(max(BETWEEN, 3.0 * max(error, residual[n, j])), 2.0 * MET)
                if equal(poses[n], sigma, D, q[n, j], x, singular * good, P, axes, e):
                    at = j
                    break
            if at == S:
                lost += 1
                continue
            double[n, at] = at < count
            if at < count and not error < residual[n, at]:
                continue
            if at == count:
                source[n, at], valid[n, at] = i, True
                count += 1
            residual[n, at] = error
            for m in range(k):
                q[n, at, m] = x[m]
        if singular == 1 and least <= MET:
            kept = 0
            for j in range(count):
                good = residual[n, j] <= MET
                for m in range(k):
                    q[n, kept, m] = q[n, j, m]
                residual[n, kept], double[n, kept] = residual[n, j], double[n, j]
                source[n, kept] = source[n, j]
                kept += 1 if good else 0
            for j in range(kept, count):
                residual[n, j], valid[n, j], double[n, j] = np.nan, False, False
                for m in range(k):
                    q[n, j, m] = np.nan
    return lost
