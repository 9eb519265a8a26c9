"""Postures along valleys, where the Jacobian of the arm is nearly singular.

Where a structured arm has an infinite family of postures (an aligned wrist, a wrist centre on
the shoulder's axis), its neighbour has a few isolated ones along what is left of the family, far
from each other; where it has a fold (a stretched elbow), two that are close. Both lie on a
curve of postures at which the other five joints do for the pose what they can while one is kept: a
valley of the error. The curve is walked, driven by the joint that moves most, and a posture is
where what is missing changes sign.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numba import types
from numpy.typing import NDArray

from ..kernels._compile import INTS, MATRIX, NOTHING, OUT3, STACK, VECTOR, Floats, Ints, compiled
from ._check import wrapped
from ._neighbour import (
    COUNTS,
    FLAGS,
    FLAGS_IN,
    MARKS,
    MERGE,
    MET,
    Work,
    distance,
    error_at,
    factored_jacobian,
    keep,
    newton,
    workspace,
)
from ._neighbour_linear import anywhere, smallest_singular, solve, solve_transposed, unit

STRIDE = 0.1  # step along a valley [rad]
SHORTEST = STRIDE / 40  # step at which it is given up
STRIDES = 240  # steps one way
MOST_MOVED = 0.05  # of a start, that is taken into account [rad]
ALIKE = 1e-3  # distance of best approaches that are one [rad]
WIDE = 0.4  # distance of the Jacobian from singular at which any valley ends
POINTS = 4000  # points of valleys remembered for a pose
LOST = 1e-3  # error beside the valley above which the curve was lost
NARROW = 10  # points that the infinite family of a tolerance has at least

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
    """Walk the curve through ``origin`` both ways while the Jacobian stays nearly singular.

    No further than to where more than ``far`` is missing. The points, what is missing at each, its
    u (one sense throughout) and the joint that drives are written to ``curve``, in order; where the
    driving joint changes the point stands twice. Returns the first and one past the last row.
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


@compiled()
def _at(
    sigma: Ints, D: Floats, U: Floats, side: Floats, driver: int, q: Floats, work: Work
) -> float:
    """What is missing at the point of the curve next to q, u on the side of ``side``."""
    u, v = np.zeros(6), np.zeros(6)
    along, _, _ = slide(sigma, D, U, q, driver, u, v, 4, work)
    return along if product(u, side) >= 0.0 else -along


@compiled()
def _between(
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
        f = _at(sigma, D, U, side, driver, q, work)
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
def _near_zero(
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
        f = _at(sigma, D, U, us[at], drivers[at], q, work)
        if f * sign <= 0.0:
            count = _between(sigma, D, U, a, f0, q, f, us[at], drivers[at], found, count, work)
            return _between(sigma, D, U, q, f, c, f2, us[at], drivers[at], found, count, work)
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
def _family(
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
def _is_double(sigma: Ints, D: Floats, goal: Floats, root: Floats, work: Work) -> bool:
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


@compiled(
    NOTHING(
        INTS, STACK, STACK, STACK, FLAGS_IN, MATRIX, MATRIX, VECTOR,
        types.float64, types.float64, types.float64, types.float64, types.float64,
        OUT3, COUNTS, FLAGS, MARKS,
    )
)  # fmt: skip
def valleys(
    sigma: Ints,
    D: Floats,
    goals: Floats,
    starts: Floats,
    there: NDArray[np.bool_],
    moved: Floats,
    references: Floats,
    tolerances: Floats,
    deviation: float,
    small: float,
    valley: float,
    far: float,
    spread: float,
    found: Floats,
    count: Ints,
    double: NDArray[np.bool_],
    free: Ints,
) -> None:
    """Search the valleys through ``starts (N, C, 6)`` and through nearly singular postures.

    A valley is left where the Jacobian is ``valley`` times the root of the deviation from singular,
    or where ``far`` deviations are missing; a start that moved further than the deviation on its
    way from the neighbour (``moved (N, C)``) shows that it counts for more there.

    ``tolerances`` are of the position in lengths of the arm and of the angle. A curve along which
    every point is within them is an infinite family: of it the members at the reference are kept,
    with the number of the freed joint (from 1) in ``free (N, 16)``. Of starts that are closer than
    ``spread`` one is taken.
    """
    work = workspace()
    rows = 2 * STRIDES + 8
    curve = (
        np.zeros((rows, 6)), np.zeros(rows), np.zeros((rows, 6)), np.zeros(rows, np.int64)
    )  # fmt: skip
    points, missing, us, drivers = curve
    known = np.zeros((POINTS, 6))
    u, v, q = np.zeros(6), np.zeros(6), np.zeros(6)
    # an error of this length is within both tolerances
    touch = 0.5 * min(tolerances[0], tolerances[1])
    for n in range(goals.shape[0]):
        remembered = 0
        C = starts.shape[1]
        k = 0
        while k < C + count[n]:
            if k < C:
                at = k
                k += 1
                if not there[n, at]:
                    continue
                alike = False
                for m in range(C):
                    if m < at and there[n, m]:
                        alike = alike or distance(sigma, starts[n, m], starts[n, at]) < spread
                    if m >= at or alike:
                        break
                if alike:
                    continue
                scale = max(deviation, min(moved[n, at], MOST_MOVED))
                for i in range(6):
                    q[i] = starts[n, at, i]
            else:
                scale = deviation
                for i in range(6):
                    q[i] = found[n, k - C, i]
                k += 1
                error_at(sigma, D, goals[n], q, work)
                factored_jacobian(sigma, work)
                anywhere(u)
                if smallest_singular(work[2], work[3], u, v, 3) > small:
                    continue
            passed = False
            for m in range(remembered):
                if distance(sigma, q, known[m]) < 0.7 * STRIDE:
                    passed = True
                    break
            if passed:
                continue
            narrow = min(max(valley * sqrt(scale), 1e-3), WIDE)
            end = max(far * scale, 2.0 * touch)
            first, last = walk(sigma, D, goals[n], q, narrow, end, curve, work)
            if last == first:
                continue
            for m in range(first, last):
                if remembered < POINTS:
                    known[remembered] = points[m]
                    remembered += 1
            most = 0.0
            for m in range(first, last):
                most = max(most, abs(missing[m]))
            if last - first >= NARROW and most <= touch:
                count[n] = _family(
                    sigma, D, goals[n], curve, first, last, references[n], touch,
                    found[n], free[n], count[n], work,
                )  # fmt: skip
                continue
            for m in range(first, last - 1):
                if missing[m] * missing[m + 1] <= 0.0:
                    count[n] = _between(
                        sigma, D, goals[n], points[m], missing[m], points[m + 1], missing[m + 1],
                        us[m], drivers[m + 1], found[n], count[n], work,
                    )  # fmt: skip
                elif (
                    m > first
                    and missing[m] * missing[m - 1] > 0.0
                    and drivers[m - 1] == drivers[m] == drivers[m + 1]
                    and abs(missing[m]) <= min(abs(missing[m - 1]), abs(missing[m + 1]))
                ):
                    count[n] = _near_zero(
                        sigma, D, goals[n], curve, m, touch, found[n], count[n], work
                    )
        for k in range(count[n]):
            double[n, k] = free[n, k] == 0 and _is_double(sigma, D, goals[n], found[n, k], work)
