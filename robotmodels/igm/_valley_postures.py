"""Postures on a valley that was walked: where what is missing changes sign, touches zero or stays.

The curve has at each row a point, what is missing there, the direction of that, and the joint that
drives (`_valley_walk`).
"""

from __future__ import annotations

import numpy as np

from ..kernels._compile import Floats, Ints, compiled
from ._check import wrapped
from ._neighbour import MERGE, MET, Work, distance, error_at, factored_jacobian, keep, newton
from ._neighbour_linear import anywhere, smallest_singular
from ._valley_walk import STRIDE, Curve, product, slide

ALIKE = 1e-3  # distance of best approaches that are one [rad]


@compiled()
def missing_at(
    sigma: Ints, D: Floats, U: Floats, side: Floats, driver: int, q: Floats, work: Work
) -> float:
    """What is missing at the point of the curve next to q, u on the side of ``side``."""
    u, v = np.zeros(6), np.zeros(6)
    along, _, _ = slide(sigma, D, U, q, driver, u, v, 4, work)
    return along if product(u, side) >= 0.0 else -along


@compiled()
def posture_between(
    sigma: Ints,
    D: Floats,
    U: Floats,
    a: Floats,
    at_a: float,
    b: Floats,
    at_b: float,
    side: Floats,
    driver: int,
    found: Floats,
    count: int,
    work: Work,
) -> int:
    """The posture between two points of the curve where what is missing changes sign."""
    low, high, q = a.copy(), b.copy(), np.zeros(6)
    f_low, f_high = at_a, at_b
    for _ in range(30):
        share = f_low / (f_low - f_high) if f_low != f_high else 0.5
        for i in range(6):
            q[i] = low[i] + share * (high[i] - low[i])
        f = missing_at(sigma, D, U, side, driver, q, work)
        if abs(f) < 1e-12:
            break
        # the false position that does not stick at one end (Illinois)
        if (f > 0.0) == (f_low > 0.0):
            low[:], f_low = q, f
            f_high *= 0.5
        else:
            high[:], f_high = q, f
            f_low *= 0.5
    newton(sigma, D, U, q, 10, work)
    if error_at(sigma, D, U, q, work) <= MET:
        count = keep(sigma, q, found, count)
    return count


@compiled()
def postures_near_zero(
    sigma: Ints,
    D: Floats,
    U: Floats,
    curve: Curve,
    at: int,
    touch: float,
    found: Floats,
    count: int,
    work: Work,
) -> int:
    """Two postures, or a double one, between rows at - 1 and at + 1 without a change of sign."""
    points, missing, us, drivers = curve
    f0, f1, f2 = missing[at - 1], missing[at], missing[at + 1]
    bend = f0 - 2.0 * f1 + f2
    a, b, c, q = points[at - 1].copy(), points[at].copy(), points[at + 1].copy(), np.zeros(6)
    x0, x1, x2 = -1.0, 0.0, 1.0
    sign = 1.0 if f1 > 0.0 else -1.0
    if bend * sign <= 0.0 or f1 * sign - (f2 - f0) ** 2 / (8.0 * abs(bend)) > 0.5 * abs(bend):
        return count
    for _ in range(30):
        # vertex of the parabola through the three
        d1, d2 = (f1 - f0) / (x1 - x0), (f2 - f1) / (x2 - x1)
        second = (d2 - d1) / (x2 - x0)
        if second * sign <= 0.0:
            break
        x = 0.5 * (x0 + x1) - 0.5 * d1 / second
        if not x0 < x < x2:
            break
        # near a point that is known a little aside says more
        if abs(x - x1) < 1e-3 * (x2 - x0):
            x = x1 + 2e-3 * (x2 - x1 if x2 - x1 > x1 - x0 else x0 - x1)
        low, high, xl, xh = (a, b, x0, x1) if x < x1 else (b, c, x1, x2)
        for i in range(6):
            q[i] = low[i] + (x - xl) / (xh - xl) * (high[i] - low[i])
        f = missing_at(sigma, D, U, us[at], drivers[at], q, work)
        if f * sign <= 0.0:
            count = posture_between(
                sigma, D, U, a, f0, q, f, us[at], drivers[at], found, count, work
            )
            return posture_between(
                sigma, D, U, q, f, c, f2, us[at], drivers[at], found, count, work
            )
        if f * sign < f1 * sign:
            if x < x1:
                c[:], x2, f2 = b, x1, f1
            else:
                a[:], x0, f0 = b, x1, f1
            b[:], x1, f1 = q, x, f
        elif x < x1:
            a[:], x0, f0 = q, x, f
        else:
            c[:], x2, f2 = q, x, f
        if x2 - x0 < 1e-8:
            break
    # the curve turns back at zero: a double posture, within rounding or the tolerance
    if abs(f1) <= touch:
        q[:] = b
        if newton(sigma, D, U, q, 30, work) > MET or distance(sigma, q, b) > STRIDE:
            q[:] = b
            # found before, from the other side
            for j in range(count):
                if distance(sigma, q, found[j]) < ALIKE:
                    return count
        count = keep(sigma, q, found, count)
    return count


@compiled()
def family_members(
    sigma: Ints,
    D: Floats,
    U: Floats,
    curve: Curve,
    first: int,
    last: int,
    reference: Floats,
    touch: float,
    found: Floats,
    free: Ints,
    count: int,
    work: Work,
) -> int:
    """A curve that meets the pose within the tolerance all along: its members at the reference.

    Postures on it that were found before make room for them.
    """
    points = curve[0]
    u, v = np.zeros(6), np.zeros(6)
    kept = 0
    for j in range(count):
        on = False
        for m in range(first, last):
            on = on or distance(sigma, found[j], points[m]) < STRIDE
        if not on:
            found[kept], free[kept] = found[j], free[j]
            kept += 1
    for j in range(kept, free.size):
        free[j] = 0
    count = kept
    # the first joint that moves
    joint = 5
    for k in range(5, -1, -1):
        low, high = np.inf, -np.inf
        for m in range(first, last):
            low, high = min(low, points[m, k]), max(high, points[m, k])
        if high - low > STRIDE:
            joint = k
    nearest, best, q = first, np.inf, np.zeros(6)
    for m in range(first, last):
        gap = reference[joint] - points[m, joint]
        gap = wrapped(gap) if sigma[joint] == 0 else gap
        if abs(gap) < best:
            nearest, best = m, abs(gap)
        if m + 1 == last:
            break
        after = reference[joint] - points[m + 1, joint]
        after = wrapped(after) if sigma[joint] == 0 else after
        if gap * after <= 0.0 and abs(gap - after) < 1.0:
            share = gap / (gap - after) if gap != after else 0.0
            for i in range(6):
                q[i] = points[m, i] + share * (points[m + 1, i] - points[m, i])
            q[joint] = points[m, joint] + gap
            _, beside, _ = slide(sigma, D, U, q, joint, u, v, 12, work)
            if beside < touch:
                before = count
                count = keep(sigma, q, found, count)
                if count > before:
                    free[before] = joint + 1
    if count == kept:
        # out of the reference's reach: the nearest value
        before = count
        count = keep(sigma, points[nearest], found, count)
        if count > before:
            free[before] = joint + 1
    return count


@compiled()
def is_double(sigma: Ints, D: Floats, goal: Floats, root: Floats, work: Work) -> bool:
    """Whether the partner of a posture at a fold is nearer than 1e-6.

    Along the null direction v the error is ``s sigma + s^2 h / 2`` with sigma the smallest
    singular value (left vector u) and ``h = u . d(J v)/ds``: the partner is at ``-2 sigma / h``.
    """
    u, v, w, t = np.zeros(6), np.zeros(6), np.zeros(6), np.zeros(6)
    if error_at(sigma, D, goal, root, work) > MET:
        return True  # the best approach of a fold that the tolerance reaches
    factored_jacobian(sigma, work)
    anywhere(u)
    small = smallest_singular(work[2], work[3], u, v, 3)
    if small > 1e-5:
        return False
    # sigma on either side along v, with the sign of u kept
    step, q = 1e-4, np.zeros(6)
    bend = 0.0
    for side in (-1.0, 1.0):
        for i in range(6):
            q[i] = root[i] + side * step * v[i]
        error_at(sigma, D, goal, q, work)
        factored_jacobian(sigma, work)
        for i in range(6):
            w[i] = u[i]
        value = smallest_singular(work[2], work[3], w, t, 4)
        same = 0.0
        forth = 0.0
        for i in range(6):
            same += w[i] * u[i]
            forth += t[i] * v[i]
        bend += side * (value if same * forth >= 0.0 else -value) / (2.0 * step)
    return abs(bend) > 1e-6 and 2.0 * small <= MERGE * abs(bend)
