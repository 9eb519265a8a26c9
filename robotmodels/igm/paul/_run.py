"""The kernel that runs plans: one compiled program for every arm.

It walks the tree of solutions depth first. Registers hold what the branch so far has computed;
going to the next branch of a step overwrites what belongs to the levels below it.
"""

from __future__ import annotations

from math import pi, sqrt

import numpy as np
from numba import types

from ...kernels._compile import INTS, MATRIX, OUT2, OUT3, STACK, VECTOR, Floats, Ints, compiled
from ._types import (
    DOUBLE, FREE_1, FREE_2, SMALL, polynomial, quartic, two_angles, type_1, type_2, type_2_zero,
    type_3, type_3_direct, type_4, type_5, type_8,
)  # fmt: skip

STEP = 24
MOST_STEPS = 8
FALSE = 1e-2  # errors above this are of false candidates, not of rough ones
EXACT = 5e-13  # errors above this are polished

_COUNTS = types.Array(types.int64, 1, "C")
_MARKS = types.Array(types.int64, 2, "C")
_TABLE = types.Array(types.int64, 2, "C", readonly=True)


@compiled()
def operate(operations: Ints, factors: Floats, start: int, stop: int, x: Floats) -> None:
    """``x_d = f x_a x_b + g x_c x_e`` for a range of operations."""
    for i in range(start, stop):
        x[operations[i, 0]] = (
            factors[i, 0] * x[operations[i, 1]] * x[operations[i, 2]]
            + factors[i, 1] * x[operations[i, 3]] * x[operations[i, 4]]
        )


@compiled()
def solve(step: Ints, x: Floats, tolerances: Floats, wanted: Floats, found: Floats
          ) -> tuple[int, int]:  # fmt: skip
    """Solutions of one step from the coefficients in the registers."""
    code = step[0]
    slack, zero, small = tolerances[0], tolerances[1], tolerances[2]
    a, b = x[step[9]], x[step[10]]
    if code == 10:
        return type_3_direct(a, b, zero, small, wanted[step[7]], found)
    if code == 9:
        return type_2_zero(a, b, zero, small, wanted[step[7]], found)
    if code == 1:
        return type_1(a, b, zero, small, wanted[step[7]], found)
    c = x[step[11]]
    if code == 2:
        return type_2(a, b, c, slack, zero, small, wanted[step[7]], found)
    d = x[step[12]]
    if code == 4:
        return type_4(a, b, c, d, zero, small, wanted[step[8]], found)
    if code == 8:
        return type_8(a, b, c, d, slack, zero, small, wanted[step[7]], wanted[step[8]], found)
    e = x[step[13]]
    if code == 11:
        return quartic(a, b, c, d, e, slack, wanted[step[7]], found)
    if code == 12:
        return polynomial(a, b, c, d, e, slack, wanted[step[7]], found)
    f = x[step[14]]
    if code == 3:
        return type_3(a, b, c, d, e, f, zero, small, wanted[step[7]], found)
    if code == 5:
        return type_5(a, b, c, d, e, f, slack, zero, small, found)
    return two_angles(
        a, b, c, d, e, f, x[step[15]], slack, zero, small, wanted[step[7]], wanted[step[8]], found
    )


@compiled()
def residual(results: Ints, k: int, x: Floats, lever: Floats) -> float:
    """The larger of the tool's position error [m] and the rotation angle [rad]."""
    turn = 0.0
    p0 = x[results[k + 9]] - x[results[k + 21]]
    p1 = x[results[k + 10]] - x[results[k + 22]]
    p2 = x[results[k + 11]] - x[results[k + 23]]
    for j in range(3):
        d0 = x[results[k + 3 * j]] - x[results[k + 12 + 3 * j]]
        d1 = x[results[k + 3 * j + 1]] - x[results[k + 13 + 3 * j]]
        d2 = x[results[k + 3 * j + 2]] - x[results[k + 14 + 3 * j]]
        turn += d0 * d0 + d1 * d1 + d2 * d2
        h = lever[j]
        p0 += h * d0
        p1 += h * d1
        p2 += h * d2
    # the chord of a rotation by phi: the squares of its nine elements sum to 8 sin^2(phi / 2)
    return sqrt(max(p0 * p0 + p1 * p1 + p2 * p2, 0.5 * turn))


@compiled()
def take_branch(step: Ints, found: Floats, branch: int, x: Floats) -> None:
    """Put the solution of a branch into the registers of its step."""
    at = step[1]
    x[at], x[at + 1], x[at + 2] = found[branch, 0], found[branch, 1], found[branch, 2]
    at = step[4]
    if at != 0:
        x[at], x[at + 1], x[at + 2] = found[branch, 3], found[branch, 4], found[branch, 5]


@compiled(
    types.void(
        _TABLE, INTS, _TABLE, MATRIX, VECTOR, INTS, MATRIX, INTS, STACK, VECTOR, VECTOR,
        STACK, MATRIX, OUT3, OUT2, _COUNTS, _MARKS, _MARKS, _COUNTS,
    )
)  # fmt: skip
def run_plan(
    steps: Ints,
    starts: Ints,
    operations: Ints,
    factors: Floats,
    registers: Floats,
    results: Ints,
    reference_rows: Floats,
    sigma: Ints,
    sides: Floats,
    lever: Floats,
    tolerances: Floats,
    poses: Floats,
    references: Floats,
    q: Floats,
    residuals: Floats,
    counts: Ints,
    free: Ints,
    path: Ints,
    flags: Ints,
) -> None:
    """Postures of every pose; see `paul_postures` for what is returned.

    ``tolerances``: slack, zero, small, largest accepted error in m and rad.
    """
    k, m = sigma.shape[0], steps.shape[0]
    x = registers.copy()
    wanted = np.zeros(reference_rows.shape[0])
    found = np.zeros((MOST_STEPS, 4, 6))
    number, branch = np.zeros(MOST_STEPS, np.int64), np.zeros(MOST_STEPS, np.int64)
    marks = np.zeros(MOST_STEPS, np.int64)
    before, after = sides[0], sides[1]
    moved = np.zeros((3, 4))
    accepted = tolerances[3]
    most = q.shape[1]
    for n in range(poses.shape[0]):
        U = poses[n]
        for i in range(3):
            for j in range(4):
                moved[i, j] = before[i, 0] * U[0, j] + before[i, 1] * U[1, j] + before[i, 2] * U[2, j]
            moved[i, 3] += before[i, 3]
        for j in range(4):
            for i in range(3):
                value = (moved[i, 0] * after[0, j] + moved[i, 1] * after[1, j]
                         + moved[i, 2] * after[2, j])  # fmt: skip
                x[1 + 3 * j + i] = value + moved[i, 3] if j == 3 else value
        for i in range(wanted.shape[0]):
            wanted[i] = reference_rows[i, k]
            for j in range(k):
                wanted[i] += reference_rows[i, j] * references[n, j]
        count, delicate = 0, 0
        level = 0
        operate(operations, factors, starts[0], starts[1], x)
        number[0], marks[0] = solve(steps[0], x, tolerances, wanted, found[0])
        delicate |= marks[0]
        branch[0] = -1
        while level >= 0:
            branch[level] += 1
            if branch[level] >= number[level]:
                level -= 1
                continue
            take_branch(steps[level], found[level], branch[level], x)
            level += 1
            operate(operations, factors, starts[level], starts[level + 1], x)
            if level < m:
                number[level], marks[level] = solve(
                    steps[level], x, tolerances, wanted, found[level]
                )
                delicate |= marks[level]
                branch[level] = -1
                continue
            level -= 1
            error = residual(results, k, x, lever)
            if not error <= FALSE or count == most:
                continue
            if error > EXACT:
                delicate |= 16
                if error > accepted:
                    continue
            for j in range(k):
                value = x[results[j]]
                if sigma[j] == 0:
                    if value > pi or value <= -pi:
                        value -= 2.0 * pi * np.floor((value + pi) / (2.0 * pi))
                        if value <= -pi:
                            value = pi
                q[n, count, j] = value
            residuals[n, count] = error
            bits, way = 0, 0
            for i in range(m):
                way |= branch[i] << (2 * i)
                bits |= ((marks[i] & FREE_1) >> 1) << (2 * i) | ((marks[i] & FREE_2) >> 2) << (2 * i + 1)
            free[n, count], path[n, count] = bits, way
            count += 1
        counts[n], flags[n] = count, delicate
