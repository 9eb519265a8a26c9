"""The kernel that runs plans: one compiled program for every arm.

It searches the tree of solutions depth first, for a block of poses (lanes) at a time. Registers
hold what the branch so far has computed; the next branch of a step overwrites what belongs to the
levels below it. One array holds, row by row: registers, references, solutions of every step, joint
variables, errors.
"""

from __future__ import annotations

from math import nan, pi, sqrt

import numpy as np
from numba import types

from ...kernels._compile import INT, MATRIX, OUT2, OUT3, STACK, VECTOR, Floats, Ints, compiled
from ...kernels.poses import improper_pose
from ..kernels.order import NOT_CONVERGED, OUTSIDE_LIMITS, REACHED, inside, ordered
from ..request import FARTHEST, FARTHEST_POSITION
from . import layout
from ._types import atan2, solve, solve_rare

LANES = 16
FALSE = 1e-2  # errors above this are of false candidates, not of rough ones
EXACT = 5e-13  # errors above this are refined by Newton's method

Task = tuple[Ints, Floats, Floats, Floats]
"""Instructions, numbers, poses (N, 4, 4) and references (N, k)."""
Out = tuple[Floats, Floats, Ints]
"""Joint variables (N, S, k), errors (N, S) and marks (N, 2 + 2 S)."""

_PLAN = types.Array(types.uint32, 1, "C", readonly=True)
_MARKS = types.Array(types.int64, 2, "C")


@compiled()
def operate(plan: Ints, numbers: Floats, level: int, x: Floats) -> None:
    """``x_d = f x_a x_b + g x_c x_e`` for the operations of a level and every lane."""
    lanes, at = x.shape[1], plan[layout.OPERATIONS]
    for i in range(plan[plan[layout.STARTS] + level], plan[plan[layout.STARTS] + level + 1]):
        row = at + 5 * i
        d, a, b, c, e = plan[row], plan[row + 1], plan[row + 2], plan[row + 3], plan[row + 4]
        f, g = numbers[2 * i], numbers[2 * i + 1]
        if lanes == 1:
            x[d, 0] = f * x[a, 0] * x[b, 0] + g * x[c, 0] * x[e, 0]
        else:
            for lane in range(LANES):
                x[d, lane] = f * x[a, lane] * x[b, lane] + g * x[c, lane] * x[e, lane]


@compiled()
def load(task: Task, n: int, x: Floats, lane: int) -> None:
    """``U0 = before pose after`` into registers 1 to 12, column by column, and the references."""
    plan, numbers, poses, references = task
    before, after, k = plan[layout.SIDES], plan[layout.SIDES] + 12, plan[layout.JOINTS]
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
            x[1 + 3 * j + i, lane] = value + m3 * numbers[e + 12]
    for i in range(plan[layout.UNKNOWNS]):
        row = plan[layout.REFERENCES] + i * (k + 1)
        value = numbers[row + k]
        for j in range(k):
            value += numbers[row + j] * references[n, j]
        x[plan[layout.REGISTERS] + i, lane] = value


@compiled()
def solve_step(
    plan: Ints,
    numbers: Floats,
    level: int,
    start: int,
    x: Floats,
    o: int,
    state: Ints,
    g: Floats,
    marks: Ints,
    rare: None,
) -> int:
    """Solve the equation of a level for every lane; returns the most solutions of any.

    ``state``: for each level, whether a lane is still valid, its solutions and flags.
    """
    at, limits = plan[layout.STEP_TABLE] + layout.STEP * level, plan[layout.TOLERANCES]
    code, wanted = plan[at + layout.CODE], plan[layout.REGISTERS] + plan[at + layout.REFERENCE]
    second = plan[layout.REGISTERS] + plan[at + layout.REFERENCE + 1]
    # amplitudes are compared with their usual size
    scale = numbers[plan[layout.SCALES] + level]
    eps = (numbers[limits], numbers[limits + 1] * scale, numbers[limits + 2] * scale)
    widest, lanes, direct = 0, x.shape[1], code <= layout.OPPOSITE_ANGLES
    if direct:
        sine, cosine = plan[at + layout.COEFFICIENTS], plan[at + layout.COEFFICIENTS + 1]
        for lane in range(LANES if lanes > 1 else 1):
            S, C = x[sine, lane], x[cosine, lane]
            x[o + 1, lane], x[o + 2, lane], x[o + 7, lane], x[o + 8, lane] = C, S, -C, -S
    for lane in range(lanes):
        count, flags = 0, 0
        if state[3 * level, lane] == 0:
            pass
        elif direct and x[o + 1, lane] ** 2 + x[o + 2, lane] ** 2 > eps[2] * eps[2]:
            count = 2 if code == layout.OPPOSITE_ANGLES else 1
        else:
            for i in range(7):
                g[i] = x[plan[at + layout.COEFFICIENTS + i], lane]
            pair = (x[wanted, lane], x[second, lane])
            if rare is None:
                count, flags = solve(code, g, eps, pair, x, o, lane)
            elif code == layout.QUARTIC or code > layout.LENGTH:
                count, flags = solve_rare(code, g, eps, pair, x, o, lane)
            else:
                count, flags = solve(code, g, eps, pair, x, o, lane)
            marks[start + lane, 1] |= flags
        state[3 * level + 1, lane], state[3 * level + 2, lane] = count, flags
        if count > widest:
            widest = count
    between = 3 if code == layout.TWO_ANGLES else 6
    for row in range(o if code < layout.LENGTH else o + 3, o + 6 * widest, between):
        complete(x[row], x[row + 1], x[row + 2])
    return widest


@compiled()
def complete(value: Floats, cosine: Floats, sine: Floats) -> None:
    """Angle, cosine and sine from multiples of the last two."""
    for lane in range(value.size):
        C, S = cosine[lane], sine[lane]
        rho = sqrt(C * C + S * S)
        scale = 1.0 / (rho if rho > 0.0 else 1.0)
        value[lane], cosine[lane], sine[lane] = atan2(S, C), C * scale, S * scale


@compiled()
def error_of(plan: Ints, numbers: Floats, x: Floats, lane: int) -> float:
    """The larger of the tool's position error [m] and the rotation angle [rad]."""
    at, lever = plan[layout.RESULTS] + plan[layout.JOINTS], plan[layout.LEVER]
    turn, far = 0.0, 0.0
    for i in range(at, at + 3):
        d3 = x[plan[i + 9], lane] - x[plan[i + 21], lane]
        for j in range(3):
            d = x[plan[i + 3 * j], lane] - x[plan[i + 12 + 3 * j], lane]
            turn += d * d
            d3 += numbers[lever + j] * d
        far += d3 * d3
    # the chord of a rotation by phi: the squares of its nine elements sum to 8 sin^2(phi / 2)
    turn *= 0.5
    return sqrt(far if far > turn else turn)


@compiled()
def keep(
    plan: Ints,
    numbers: Floats,
    start: int,
    filled: int,
    x: Floats,
    at: int,
    state: Ints,
    branch: Ints,
    out: Out,
) -> None:
    """Check both sides of the pose in every lane, and keep the postures that meet it.

    The error is the larger of the tool's position error [m] and the rotation angle [rad].
    """
    q, residuals, marks = out
    k, m, most = plan[layout.JOINTS], plan[layout.STEPS], plan[layout.MOST]
    results, sigma = plan[layout.RESULTS], plan[layout.SIGMA]
    accepted = numbers[plan[layout.TOLERANCES] + 3]
    way = 0
    for i in range(m):
        way |= branch[i, 0] << (2 * i)
    lanes = LANES if x.shape[1] > 1 else 1
    for lane in range(lanes):
        x[at + k, lane] = error_of(plan, numbers, x, lane)
    for j in range(k):
        row, revolute = plan[results + j], plan[sigma + j] == 0
        for lane in range(lanes):
            value = x[row, lane]
            turns = np.ceil((value - pi) * (0.5 / pi)) if revolute else 0.0
            x[at + j, lane] = value - 2.0 * pi * turns
    for lane in range(filled):
        error, n = x[at + k, lane], start + lane
        if state[3 * m, lane] == 0 or not error <= max(FALSE, accepted):
            continue
        if error > EXACT:
            marks[n, 1] |= layout.ROUGH
            if error > accepted:
                continue
        count, bits = marks[n, 0], 0
        for i in range(m):
            bits |= ((state[3 * i + 2, lane] & (layout.FREE_1 | layout.FREE_2)) >> 1) << (2 * i)
        for j in range(k):
            q[n, count, j] = x[at + j, lane]
        residuals[n, count] = error
        marks[n, 2 + count], marks[n, 2 + most + count] = bits, way
        marks[n, 0] = count + 1


@compiled()
def run_plan(task: Task, out: Out, rare: None) -> None:
    """Postures of every pose in the order of the tree.

    ``marks (N, 2 + 2 S)``: count, flags of the pose, bits of free unknowns and of branches.
    """
    (plan, numbers, poses, _), marks = task, out[2]
    k, m, N = int(plan[layout.JOINTS]), int(plan[layout.STEPS]), poses.shape[0]
    lanes = 1 if N == 1 else LANES
    solutions = int(plan[layout.REGISTERS] + plan[layout.UNKNOWNS])
    x = np.empty((solutions + 24 * m + k + 1, lanes))
    state, branch = np.empty((3 * m + 1, lanes), np.int64), np.empty((m + 1, 2), np.int64)
    g = np.empty(7)
    for i in range(plan[layout.REGISTERS]):
        for lane in range(lanes):
            x[i, lane] = numbers[plan[layout.INITIAL] + i]
    for start in range(0, N, lanes):
        filled = min(lanes, N - start)
        for lane in range(lanes):
            load(task, start + min(lane, filled - 1), x, lane)
            state[0, lane] = int(lane < filled)
        for n in range(start, start + filled):
            marks[n, 0] = marks[n, 1] = 0
        level, arrived = 0, True
        while level >= 0:
            o = solutions + 24 * level
            if arrived:
                operate(plan, numbers, level, x)
                if level == m:
                    keep(plan, numbers, start, filled, x, o, state, branch, out)
                    level, arrived = level - 1, False
                    continue
                branch[level, 1] = solve_step(
                    plan, numbers, level, start, x, o, state, g, marks, rare
                )
                branch[level, 0] = -1
            branch[level, 0] += 1
            now = branch[level, 0]
            arrived = now < branch[level, 1]
            if not arrived:
                level -= 1
                continue
            step = plan[layout.STEP_TABLE] + layout.STEP * level
            for lane in range(lanes):
                state[3 * level + 3, lane] = int(now < state[3 * level + 1, lane])
            for i in range(6):
                to = plan[step + layout.FIRST] + i if i < 3 else plan[step + layout.SECOND] + i - 3
                if to > 12:
                    for lane in range(lanes):
                        x[to, lane] = x[o + 6 * now + i, lane]
            level += 1


@compiled()
def ordered_rows(task: Task, mode: int, out: Out) -> int:
    """Order the postures of each pose; returns the most of any, or -1 - most.

    Poses without a posture, and unreliable ones, get the status NOT_CONVERGED: if there are any,
    the result is negative. ``marks`` becomes count, status, branch codes, within limits.
    """
    (plan, numbers, _, references), (q, residual, marks) = task, out
    N, S, n = q.shape
    limits, labels = int(plan[layout.LIMITS]), int(plan[layout.LABELS])
    joints, named = numbers[limits : limits + 3 * n], labels < numbers.size
    # joint variables, distance, error
    rows, order, codes = np.empty((S, n + 2)), np.empty(S, np.int64), np.empty(S, np.int64)
    most, unreliable = 0, 0
    for p in range(N):
        found, status = marks[p, 0], REACHED
        if marks[p, 1] != 0 or found == 0:
            found, status = 0, NOT_CONVERGED
            unreliable += 1
        for i in range(S):
            codes[i] = -1
            if i < found:
                codes[i] = int(numbers[labels + marks[p, 2 + S + i]]) if named else 0
                rows[i, n + 1] = residual[p, i]
        step = 0 if named else 1
        count = ordered(q[p], codes, step, references[p], joints, mode, rows, order)
        for at in range(S):
            i = order[at] if at < count else 0
            for m in range(n):
                q[p, at, m] = rows[i, m] if at < count else nan
            residual[p, at] = rows[i, n + 1] if at < count else nan
            marks[p, 2 + at] = codes[i] if at < count else -1
            marks[p, 2 + S + at] = int(at < count and inside(rows, i, joints))
        if found > 0 and count == 0:
            status = OUTSIDE_LIMITS
        marks[p, 0], marks[p, 1] = count, status
        most = max(most, count)
    return most if unreliable == 0 else -1 - most


@compiled()
def solved(task: Task, mode: int, out: Out, rare: None) -> int:
    """Run a plan; see `ordered_rows` for the result, which layout.UNORDERED leaves out."""
    _, _, poses, references = task
    if not mode & layout.UNORDERED:
        if improper_pose(poses) >= 0:
            return layout.NEEDS_CHECK
        for p in range(poses.shape[0]):
            for i in range(3):
                if abs(poses[p, i, 3]) > FARTHEST_POSITION:
                    return layout.NEEDS_CHECK
            for m in range(references.shape[1]):
                if not abs(references[p, m]) <= FARTHEST:
                    return layout.NEEDS_CHECK
    run_plan(task, out, rare)
    if mode & layout.UNORDERED:
        return 0
    return ordered_rows(task, mode, out)


_SIGNATURE = types.int64(_PLAN, VECTOR, STACK, MATRIX, INT, OUT3, OUT2, _MARKS)


@compiled(_SIGNATURE)
def solve_poses(
    plan: Ints,
    numbers: Floats,
    poses: Floats,
    references: Floats,
    mode: int,
    q: Floats,
    residual: Floats,
    marks: Ints,
) -> int:
    """Postures of poses by a plan of common equations, checked and ordered."""
    return solved((plan, numbers, poses, references), mode, (q, residual, marks), None)


@compiled(_SIGNATURE)
def solve_poses_rare(
    plan: Ints,
    numbers: Floats,
    poses: Floats,
    references: Floats,
    mode: int,
    q: Floats,
    residual: Floats,
    marks: Ints,
) -> int:
    """Postures of poses by any plan, checked and ordered."""
    return solved((plan, numbers, poses, references), mode, (q, residual, marks), 0)
