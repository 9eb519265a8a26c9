"""Compiled: postures along valleys, where the Jacobian is nearly singular.

Beside a pose with an infinite family of postures the Jacobian is nearly singular all along the
former family, and the few postures that are left lie on it, too far apart for Newton's method.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from ...kernels._compile import (
    INTS,
    MATRIX,
    NOTHING,
    OUT3,
    STACK,
    VECTOR,
    Floats,
    Ints,
    compiled,
)
from ._linear import factor, smallest_vectors, solve_one
from ._newton import (
    COUNTS,
    Work,
    distance,
    is_near,
    jacobian_of,
    keep,
    missing,
    newton,
    pose_of,
    workspace,
    wrapped,
)

VALLEY = 1e-2  # smallest singular value of the Jacobian in a valley: nearly an infinite family
STRIDE = 0.02  # step along a valley [rad]
STRIDES = 1200  # steps one way
POINTS = 6000  # points of valleys remembered per pose


@compiled()
def slide_down(
    sigma: Ints,
    D: Floats,
    U: Floats,
    q: Floats,
    u: Floats,
    v: Floats,
    work: Work,
) -> tuple[float, float, float]:
    """Correct q (6,) in all but the null direction; what is missing along it, and the rest.

    ``u, v`` receive the singular vectors of the smallest singular value. The third result is that
    value.
    """
    T, z, o, J, pivots, e, _ = work
    along, rest, small = 0.0, np.inf, np.inf
    for step in range(3):
        pose_of(sigma, D, q, T, z, o)
        missing(U, T, e)
        jacobian_of(sigma, T, z, o, J)
        factor(J, pivots)
        small = smallest_vectors(J, pivots, u, v)
        along, size = 0.0, 0.0
        for i in range(6):
            along += u[i] * e[i]
            size += e[i] * e[i]
        rest = sqrt(max(size - along * along, 0.0))
        if step == 2 or rest > 0.3:
            break
        for i in range(6):
            e[i] -= along * u[i]
        solve_one(J, pivots, e)
        onto = 0.0
        for i in range(6):
            onto += e[i] * v[i]
        for i in range(6):
            q[i] += e[i] - onto * v[i]
    return along, rest, small


@compiled(NOTHING(INTS, STACK, STACK, MATRIX, OUT3, COUNTS))
def fall_into_valleys(
    sigma: Ints,
    D: Floats,
    goals: Floats,
    starts: Floats,
    valleys: Floats,
    count: Ints,
) -> None:
    """From ``starts (S, 6)`` fall to where the pose is met but for the flattest direction.

    Those that end in a valley go into ``valleys (N, S, 6)``. A family may have been so small that
    nothing is left of it at poses aside; Newton's method itself would leap along the valley.
    """
    T, z, o, J, pivots, e, _ = workspace()
    u, v, q = np.empty(6), np.empty(6), np.empty(6)
    for n in range(goals.shape[0]):
        count[n] = 0
        for k in range(starts.shape[0]):
            for i in range(6):
                q[i] = starts[k, i]
            rest, small = np.inf, np.inf
            for _ in range(30):
                pose_of(sigma, D, q, T, z, o)
                missing(goals[n], T, e)
                jacobian_of(sigma, T, z, o, J)
                factor(J, pivots)
                small = smallest_vectors(J, pivots, u, v)
                along, size = 0.0, 0.0
                for i in range(6):
                    along += u[i] * e[i]
                    size += e[i] * e[i]
                rest = sqrt(max(size - along * along, 0.0))
                if rest < 1e-6:
                    break
                for i in range(6):
                    e[i] -= along * u[i]
                solve_one(J, pivots, e)
                onto, largest = 0.0, 0.0
                for i in range(6):
                    onto += e[i] * v[i]
                for i in range(6):
                    e[i] -= onto * v[i]
                    largest = max(largest, abs(e[i]))
                if not largest < 1e100:
                    break
                scale = min(1.0, 0.5 / largest)
                for i in range(6):
                    q[i] += scale * e[i]
            # a family leaves next to nothing missing along the valley
            if rest < 1e-6 and small < VALLEY and abs(along) < VALLEY:
                for i in range(6):
                    valleys[n, count[n], i] = q[i]
                count[n] += 1


@compiled(NOTHING(INTS, STACK, STACK, VECTOR, STACK, INTS, OUT3, COUNTS))
def follow_valleys(
    sigma: Ints,
    D: Floats,
    goals: Floats,
    tolerance: Floats,
    starts: Floats,
    starting: Ints,
    found: Floats,
    count: Ints,
) -> None:
    """Continuation along nearly singular curves for postures that Newton's method merges.

    From ``starts (N, S, 6)`` along the null direction; a posture is where the error along the left
    null vector changes sign.
    """
    u, v, before, behind = np.empty(6), np.empty(6), np.empty(6), np.empty(6)
    q, origin, trial, aside = np.empty(6), np.empty(6), np.empty(6), np.empty(6)
    path = np.empty((POINTS, 6))
    work = workspace()
    for n in range(goals.shape[0]):
        points = 0
        for k in range(starting[n]):
            # beside or on a family more is found than there is room for
            if count[n] == found.shape[1]:
                break
            for i in range(6):
                origin[i] = starts[n, k, i]
            along, rest, small = np.inf, np.inf, np.inf
            for _ in range(4):
                along, rest, small = slide_down(sigma, D, goals[n], origin, u, v, work)
            if rest > 1e-6 or small > VALLEY:
                continue
            # where nothing is missing along it either the valley is the family: a member is kept
            if max(abs(along), rest) < 5e-13:
                for i in range(6):
                    trial[i] = origin[i] if sigma[i] == 1 else wrapped(origin[i])
                count[n] = keep(sigma, trial, found[n], count[n])
            known = False
            for j in range(points):
                if is_near(sigma, path[j], origin, 2.0 * STRIDE):
                    known = True
                    break
            if known:
                continue
            closed = False
            for side in range(2):
                if closed:
                    break
                for i in range(6):
                    q[i] = origin[i]
                last, _, _ = slide_down(sigma, D, goals[n], q, u, v, work)
                for i in range(6):
                    before[i] = v[i] if side == 0 else -v[i]
                    behind[i] = u[i]
                for step in range(STRIDES):
                    for i in range(6):
                        trial[i] = q[i]
                        q[i] += STRIDE * before[i]
                    now, rest, small = slide_down(sigma, D, goals[n], q, u, v, work)
                    if rest > 1e-3 or small > VALLEY:
                        break
                    # singular vectors have no sign of their own: keep going, keep the side
                    ahead, same = 0.0, 0.0
                    for i in range(6):
                        ahead += v[i] * before[i]
                        same += u[i] * behind[i]
                    if same < 0.0:
                        now = -now
                    for i in range(6):
                        before[i] = v[i] if ahead > 0.0 else -v[i]
                        behind[i] = u[i] if same > 0.0 else -u[i]
                    # on the family itself nothing is missing anywhere, and rounding changes signs
                    if now * last < 0.0 and max(abs(now), abs(last)) > 1e-14:
                        share = last / (last - now)
                        for i in range(6):
                            trial[i] += share * (q[i] - trial[i])
                            aside[i] = trial[i]
                        met = newton(sigma, D, goals[n], tolerance, trial, work)
                        if not met:
                            # Newton's method leaps along the valley where it is as good as level
                            for i in range(6):
                                trial[i] = aside[i]
                            now_there, rest, _ = slide_down(sigma, D, goals[n], trial, u, v, work)
                            met = max(abs(now_there), rest) < 5e-13
                            for i in range(6):
                                trial[i] = trial[i] if sigma[i] == 1 else wrapped(trial[i])
                        if met:
                            count[n] = keep(sigma, trial, found[n], count[n])
                    last = now
                    if points < POINTS:
                        for i in range(6):
                            path[points, i] = q[i]
                        points += 1
                    if step > 10 and distance(sigma, q, origin) < STRIDE:
                        closed = True
                        break
