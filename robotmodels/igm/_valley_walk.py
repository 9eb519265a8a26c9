"""Walks along a valley, the curve of postures where the Jacobian of the arm is nearly singular.

The other five joints do for the pose what they can while one is kept: the joint that moves most
drives, and another takes over where it slows down.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from ..kernels._compile import Floats, Ints, compiled
from ._neighbour import Work, distance, error_at, factored_jacobian
from ._neighbour_linear import anywhere, smallest_singular, solve, solve_transposed, unit

STRIDE = 0.1  # step along a valley [rad]
SHORTEST = STRIDE / 40  # step at which it is given up
STRIDES = 240  # steps one way
LOST = 1e-3  # error beside the valley above which the curve was lost

Curve = tuple[Floats, Floats, Floats, Ints]


@compiled()
def slide(
    sigma: Ints,
    D: Floats,
    U: Floats,
    q: Floats,
    joint: int,
    u: Floats,
    v: Floats,
    rounds: int,
    work: Work,
) -> tuple[float, float, float]:
    """Bring ``q`` to the curve with one joint kept: what is missing along u, and beside it.

    ``u`` is the direction that the other five joints cannot give, ``v`` the direction of the
    curve. The third result is the distance of the joint's column of the Jacobian from the others'.
    """
    J, pivots, e = work[2], work[3], work[4]
    along, beside, apart = 0.0, np.inf, np.inf
    for turn in range(rounds + 1):
        error_at(sigma, D, U, q, work)
        factored_jacobian(sigma, work)
        for i in range(6):
            u[i] = 0.0
        u[joint] = 1.0
        solve_transposed(J, pivots, u)
        apart = 1.0 / unit(u)
        along, size = 0.0, 0.0
        for i in range(6):
            along += u[i] * e[i]
        for i in range(6):
            e[i] -= along * u[i]
            size += e[i] * e[i]
        beside = sqrt(size)
        if turn == rounds or beside < 1e-3 * abs(along) or beside < 1e-14 or not beside < 0.5:
            break
        # u is square to the other columns, so that the step leaves the joint where it is
        solve(J, pivots, e)
        e[joint] = 0.0
        largest = 0.0
        for i in range(6):
            largest = max(largest, abs(e[i]))
        scale = 0.5 / largest if largest > 0.5 else 1.0
        for i in range(6):
            q[i] += scale * e[i]
    for i in range(6):
        v[i] = u[i]
    solve(J, pivots, v)
    unit(v)
    return along, beside, apart


@compiled()
def product(a: Floats, b: Floats) -> float:
    """Scalar product in six dimensions."""
    total = 0.0
    for i in range(6):
        total += a[i] * b[i]
    return total


@compiled()
def foremost(v: Floats) -> int:
    """The joint that moves most."""
    best = 0
    for i in range(1, 6):
        if abs(v[i]) > abs(v[best]):
            best = i
    return best


@compiled()
def walk(
    sigma: Ints,
    D: Floats,
    U: Floats,
    origin: Floats,
    valley: float,
    far: float,
    curve: Curve,
    work: Work,
) -> tuple[int, int]:
    """Continuation of the curve through ``origin`` both ways while the Jacobian is nearly singular.

    Stops at an error above ``far``. Writes points, errors, u and the driving joint to ``curve``;
    returns the first and one past the last row.
    """
    points, missing, us, drivers = curve
    middle = STRIDES + 2
    first, last = middle, middle + 1
    q, u, v = np.zeros(6), np.zeros(6), np.zeros(6)
    ahead, start = np.zeros(6), np.zeros(6)
    closed = False
    for i in range(6):
        q[i] = origin[i]
    error_at(sigma, D, U, q, work)
    factored_jacobian(sigma, work)
    anywhere(u)
    smallest_singular(work[2], work[3], u, v, 3)
    driver = foremost(v)
    along, beside, apart = slide(sigma, D, U, q, driver, u, v, 6, work)
    if not (beside < LOST and apart < valley and abs(along) < far):
        return middle, middle
    points[middle], us[middle], missing[middle], drivers[middle] = q, u, along, driver
    start[:] = v
    for side in range(2):
        if closed:
            break
        at, way = middle, STRIDE
        for i in range(6):
            ahead[i] = start[i] if side == 0 else -start[i]
        left = STRIDES
        while left > 0:
            left -= 1
            driver = drivers[at]
            best = foremost(ahead)
            if abs(ahead[driver]) < 0.5 * abs(ahead[best]):
                driver = best
                q[:] = points[at]
                way_on = 0.0
            else:
                for i in range(6):
                    q[i] = points[at, i] + way * ahead[i]
                way_on = way
            along, beside, apart = slide(sigma, D, U, q, driver, u, v, 4, work)
            same, forth = product(u, us[at]), product(v, ahead)
            good = beside < LOST and apart < valley and abs(forth) > 0.7
            if way_on > 0.0 and not (good and abs(same) > 0.7):
                way *= 0.5
                if way < SHORTEST:
                    break
                continue
            if not good:
                break
            way = min(1.5 * way, STRIDE)
            at += 1 if side == 0 else -1
            for i in range(6):
                points[at, i] = q[i]
                us[at, i] = u[i] if same >= 0.0 else -u[i]
                ahead[i] = v[i] if forth >= 0.0 else -v[i]
            missing[at] = along if same >= 0.0 else -along
            drivers[at] = driver
            first, last = min(first, at), max(last, at + 1)
            if abs(along) > far:
                break
            once = side == 0 and not closed and at - middle > 10
            if once and distance(sigma, q, points[middle]) < STRIDE:
                # two steps more, so that the ends overlap
                closed = True
                left = 2
    return first, last
