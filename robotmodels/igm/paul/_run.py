"""The kernel that runs plans: one compiled program for every arm.

It walks the tree of solutions depth first, for a block of poses (lanes) at a time. Registers hold
what the branch so far has computed; going to the next branch of a step overwrites what belongs to
the levels below it.
"""

from __future__ import annotations

from math import pi, sqrt

import numpy as np
from numba import types

from ...kernels._compile import MATRIX, OUT2, OUT3, STACK, VECTOR, Floats, Ints, compiled
from ._pairs import two_angles, type_4, type_5, type_8
from ._types import (
    FREE_1,
    FREE_2,
    atan2,
    polynomial,
    quartic,
    type_1,
    type_2,
    type_2_zero,
    type_3,
    type_3_direct,
)

STEP = 24
MOST_STEPS = 8
LANES = 16
FALSE = 1e-2  # errors above this are of false candidates, not of rough ones
EXACT = 5e-13  # errors above this are polished
ROUGH = 16

_PLAN = types.Array(types.uint32, 1, "C", readonly=True)
_MARKS = types.Array(types.int64, 2, "C")


@compiled()
def operate(
    plan: Ints, numbers: Floats, at: int, of: int, start: int, stop: int, x: Floats
) -> None:
    """``x_d = f x_a x_b + g x_c x_e`` for a range of operations and every lane."""
    lanes = x.shape[1]
    for i in range(start, stop):
        row = at + 5 * i
        d, a, b, c, e = plan[row], plan[row + 1], plan[row + 2], plan[row + 3], plan[row + 4]
        f, g = numbers[of + 2 * i], numbers[of + 2 * i + 1]
        if lanes == 1:
            x[d, 0] = f * x[a, 0] * x[b, 0] + g * x[c, 0] * x[e, 0]
        else:
            for lane in range(LANES):
                x[d, lane] = f * x[a, lane] * x[b, lane] + g * x[c, lane] * x[e, lane]


@compiled()
def solve(
    plan: Ints,
    at: int,
    x: Floats,
    lane: int,
    slack: float,
    zero: float,
    small: float,
    wanted: Floats,
    found: Floats,
    o: int,
) -> tuple[int, int]:
    """Solutions of one step from the coefficients in the registers."""
    code = plan[at]
    first, second = wanted[plan[at + 7], lane], wanted[plan[at + 8], lane]
    a, b = x[plan[at + 9], lane], x[plan[at + 10], lane]
    if code == 10:
        return type_3_direct(a, b, zero, small, first, found, o, lane)
    if code == 9:
        return type_2_zero(a, b, zero, small, first, found, o, lane)
    if code == 1:
        return type_1(a, b, zero, small, first, found, o, lane)
    c = x[plan[at + 11], lane]
    if code == 2:
        return type_2(a, b, c, slack, zero, small, first, found, o, lane)
    d = x[plan[at + 12], lane]
    if code == 4:
        return type_4(a, b, c, d, zero, small, second, found, o, lane)
    if code == 8:
        return type_8(a, b, c, d, slack, zero, small, first, second, found, o, lane)
    e = x[plan[at + 13], lane]
    if code == 11:
        return quartic(a, b, c, d, e, slack, first, found, o, lane)
    if code == 12:
        return polynomial(a, b, c, d, e, slack, first, found, o, lane)
    f = x[plan[at + 14], lane]
    if code == 3:
        return type_3(a, b, c, d, e, f, zero, small, first, found, o, lane)
    if code == 5:
        return type_5(a, b, c, d, e, f, slack, zero, small, found, o, lane)
    return two_angles(
        a, b, c, d, e, f, x[plan[at + 15], lane], slack, zero, small, first, second, found, o, lane
    )


@compiled()
def solve_lanes(
    plan: Ints, at: int, x: Floats, small: float, found: Floats, o: int, weak: Ints
) -> int:
    """The two commonest types in vector code, for lanes whose amplitude is not small.

    Returns the number of solutions, 0 for other types; ``weak`` marks lanes that `solve` must do.
    """
    code = plan[at]
    a, b = plan[at + 9], plan[at + 10]
    if code == 10:
        for lane in range(LANES):
            S, C = x[a, lane], x[b, lane]
            rho = sqrt(S * S + C * C)
            weak[lane] = 0 if rho > small else 1
            scale = 1.0 / rho
            found[o, lane], found[o + 1, lane], found[o + 2, lane] = (
                atan2(S, C), C * scale, S * scale
            )  # fmt: skip
        return 1
    if code == 9:
        for lane in range(LANES):
            C, S = x[a, lane], -x[b, lane]
            rho = sqrt(S * S + C * C)
            weak[lane] = 0 if rho > small else 1
            scale = 1.0 / rho
            angle = atan2(S, C)
            C, S = C * scale, S * scale
            found[o, lane], found[o + 1, lane], found[o + 2, lane] = angle, C, S
            found[o + 6, lane] = angle - pi if angle > 0.0 else angle + pi
            found[o + 7, lane], found[o + 8, lane] = -C, -S
        return 2
    return 0


@compiled()
def errors_of(
    plan: Ints, results: int, x: Floats, numbers: Floats, lever: int, errors: Floats
) -> None:
    """The larger of the tool's position error [m] and the rotation angle [rad], of every lane.

    ``results`` is where the registers of the twelve elements of both sides stand.
    """
    e0, e1, e2 = numbers[lever], numbers[lever + 1], numbers[lever + 2]
    for lane in range(x.shape[1]):
        turn, far = 0.0, 0.0
        for i in range(3):
            at = results + i
            d0 = x[plan[at], lane] - x[plan[at + 12], lane]
            d1 = x[plan[at + 3], lane] - x[plan[at + 15], lane]
            d2 = x[plan[at + 6], lane] - x[plan[at + 18], lane]
            d3 = x[plan[at + 9], lane] - x[plan[at + 21], lane]
            d3 += e0 * d0 + e1 * d1 + e2 * d2
            turn += d0 * d0 + d1 * d1 + d2 * d2
            far += d3 * d3
        # the chord of a rotation by phi: the squares of its nine elements sum to 8 sin^2(phi / 2)
        turn *= 0.5
        errors[lane] = sqrt(far if far > turn else turn)


@compiled()
def joints_of(plan: Ints, results: int, sigma: int, k: int, x: Floats, values: Floats) -> None:
    """Joint variables of every lane, angles in (-pi, pi]."""
    for j in range(k):
        row = plan[results + j]
        if plan[sigma + j] == 0:
            for lane in range(x.shape[1]):
                value = x[row, lane]
                values[j, lane] = value - 2.0 * pi * np.ceil((value - pi) * (0.5 / pi))
        else:
            for lane in range(x.shape[1]):
                values[j, lane] = x[row, lane]


@compiled()
def load(numbers: Floats, sides: int, poses: Floats, n: int, x: Floats, lane: int) -> None:
    """``U0 = before pose after`` into registers 1 to 12, column by column."""
    before, after = sides, sides + 12
    for i in range(3):
        at = before + 4 * i
        a, b, c = numbers[at], numbers[at + 1], numbers[at + 2]
        m0 = a * poses[n, 0, 0] + b * poses[n, 1, 0] + c * poses[n, 2, 0]
        m1 = a * poses[n, 0, 1] + b * poses[n, 1, 1] + c * poses[n, 2, 1]
        m2 = a * poses[n, 0, 2] + b * poses[n, 1, 2] + c * poses[n, 2, 2]
        m3 = a * poses[n, 0, 3] + b * poses[n, 1, 3] + c * poses[n, 2, 3] + numbers[at + 3]
        for j in range(4):
            e = after + j
            value = m0 * numbers[e] + m1 * numbers[e + 4] + m2 * numbers[e + 8]
            x[1 + 3 * j + i, lane] = value + m3 if j == 3 else value


@compiled(types.void(_PLAN, VECTOR, VECTOR, STACK, MATRIX, OUT3, OUT2, _MARKS))
def run_plan(
    plan: Ints,
    numbers: Floats,
    tolerances: Floats,
    poses: Floats,
    references: Floats,
    q: Floats,
    residuals: Floats,
    marks: Ints,
) -> None:
    """Postures of every pose by a `Program`; see `paul_postures`.

    ``tolerances``: overshoot of a double root, zero and small amplitudes, largest error [m, rad].
    ``marks (N, 2 + 2 S)``: count, flags of the pose, bits of free unknowns and of branches.
    """
    k, m, at_steps, at_starts = int(plan[0]), int(plan[1]), int(plan[2]), int(plan[3])
    at_operations, at_results, at_sigma = int(plan[4]), int(plan[5]), int(plan[6])
    size, unknowns, most = int(plan[7]), int(plan[8]), int(plan[9])
    of_registers, of_references, of_sides = int(plan[10]), int(plan[11]), int(plan[12])
    of_lever = of_sides + 24
    rough = max(FALSE, tolerances[3])
    N = poses.shape[0]
    lanes = 1 if N == 1 else LANES
    # two pieces of memory for everything: allocating costs time where a single pose is asked for
    room = np.empty((size + unknowns + 24 * m + k + 1, lanes))
    x, room = room[:size], room[size:]
    wanted, room = room[:unknowns], room[unknowns:]
    found, room = room[: 24 * m], room[24 * m :]
    values, errors = room[:k], room[k]
    whole = np.zeros((3 * m + 4, lanes if lanes > m else m + 1), np.int64)
    number, flags, alive = whole[:m], whole[m : 2 * m], whole[2 * m : 3 * m + 1]
    weak, branch, widest = whole[3 * m + 1], whole[3 * m + 2], whole[3 * m + 3]
    for i in range(size):
        for lane in range(lanes):
            x[i, lane] = numbers[of_registers + i]
    for start in range(0, N, lanes):
        filled = min(lanes, N - start)
        for lane in range(lanes):
            n = start + min(lane, filled - 1)
            load(numbers, of_sides, poses, n, x, lane)
            for i in range(unknowns):
                row = of_references + i * (k + 1)
                value = numbers[row + k]
                for j in range(k):
                    value += numbers[row + j] * references[n, j]
                wanted[i, lane] = value
            alive[0, lane] = 1 if lane < filled else 0
        for lane in range(filled):
            marks[start + lane, 0] = marks[start + lane, 1] = 0
        level = 0
        branch[0] = -2
        while level >= 0:
            if branch[level] == -2:
                # arrived at this level: what its registers need, then its equation or the check
                first, last = int(plan[at_starts + level]), int(plan[at_starts + level + 1])
                operate(plan, numbers, at_operations, 0, first, last, x)
                if level == m:
                    errors_of(plan, at_results + k, x, numbers, of_lever, errors)
                    joints_of(plan, at_results, at_sigma, k, x, values)
                    way = 0
                    for i in range(m):
                        way |= branch[i] << (2 * i)
                    for lane in range(filled):
                        error = errors[lane]
                        if alive[m, lane] == 0 or not error <= rough:
                            continue
                        n = start + lane
                        count = marks[n, 0]
                        if error > EXACT:
                            marks[n, 1] |= ROUGH
                            if error > tolerances[3]:
                                continue
                        for j in range(k):
                            q[n, count, j] = values[j, lane]
                        residuals[n, count] = error
                        bits = 0
                        if marks[n, 1] & (FREE_1 | FREE_2):
                            for i in range(m):
                                bits |= ((flags[i, lane] & (FREE_1 | FREE_2)) >> 1) << (2 * i)
                        marks[n, 2 + count] = bits
                        marks[n, 2 + most + count] = way
                        marks[n, 0] = count + 1
                    level -= 1
                    continue
                widest[level], step = 0, at_steps + STEP * level
                # amplitudes are measured beside what they usually are
                scale = numbers[of_lever + 3 + level]
                zero, small = tolerances[1] * scale, tolerances[2] * scale
                common = 0
                if lanes > 1:
                    common = solve_lanes(plan, step, x, small, found, 24 * level, weak)
                for lane in range(lanes):
                    if alive[level, lane] == 0:
                        number[level, lane] = 0
                        continue
                    if common > 0 and weak[lane] == 0:
                        number[level, lane], flags[level, lane] = common, 0
                        widest[level] = max(widest[level], common)
                        continue
                    solutions, flag = solve(
                        plan,
                        step,
                        x,
                        lane,
                        tolerances[0],
                        zero,
                        small,
                        wanted,
                        found,
                        24 * level,
                    )
                    number[level, lane], flags[level, lane] = solutions, flag
                    marks[start + lane, 1] |= flag
                    widest[level] = max(widest[level], solutions)
                branch[level] = -1
            branch[level] += 1
            now = branch[level]
            if now >= widest[level]:
                level -= 1
                continue
            step = at_steps + STEP * level
            one, two = int(plan[step + 1]), int(plan[step + 4])
            row = 24 * level + 6 * now
            for lane in range(lanes):
                alive[level + 1, lane] = 1 if now < number[level, lane] else 0
            for i in range(3):
                for lane in range(lanes):
                    x[one + i, lane] = found[row + i, lane]
            if two:
                for i in range(3, 6):
                    for lane in range(lanes):
                        x[two - 3 + i, lane] = found[row + i, lane]
            level += 1
            branch[level] = -2
