"""Compiled: one start after the other, for the whole pose and then for its position alone."""

from __future__ import annotations

from math import inf, sqrt

from ...kernels._compile import (
    Floats,
    Ints,
    compiled,
)
from ...kernels._vectors import (
    Vector,
    cross,
    dot,
    scale,
    subtract,
    times,
    transpose_times,
    vector,
)
from ..status import IGMStatus
from ._descent import Bounds, Flags, Work, copy, descend, gradient, look, settle
from ._pose_error import Arm, Goal, cost_of, is_met, sizes

# weights, mask, tolerances, units and turning joints; restarts and iterations
Task = tuple[Floats, Ints, Floats, Floats, Flags, int, int]

GIVE_UP = 0.7  # of the cost that is left after five steps; more, and another start is better
STIFF = 1e3  # weights of the position while the least orientation error is looked for
STIFFER = 1e5
SIDE_STARTS = 16  # starts for the questions asked when a pose could not be met
SPREAD = 0.5  # weight of the orientation in the choice of the next start
FOUND = int(IGMStatus.REACHED)
NO_ORIENTATION = int(IGMStatus.ORIENTATION_NOT_AVAILABLE)
TOO_FAR = int(IGMStatus.TOO_FAR)
TOO_NEAR = int(IGMStatus.TOO_NEAR)
NOTHING_FOUND = int(IGMStatus.NOT_CONVERGED)


@compiled()
def rate_starts(poses: Floats, goal: Goal, weight: Floats, score: Floats) -> None:
    """How far the pose of each start is from the goal, smallest first to be tried."""
    Rd, pd, axes = goal
    angular = max(weight[3], weight[4], weight[5])
    for s in range(score.shape[0]):
        p = (poses[s, 0, 3], poses[s, 1, 3], poses[s, 2, 3])
        away = transpose_times(axes, subtract(pd, p))
        total = 0.0
        for c in range(3):
            total += (weight[c] * away[c]) ** 2
        if angular > 0.0:
            trace = 0.0
            for row in range(3):
                for c in range(3):
                    trace += poses[s, row, c] * Rd[3 * row + c]
            total += SPREAD * angular * angular * (3.0 - trace)
        score[s] = total


@compiled()
def take_start(
    s: int, first: Floats, starts: Floats, score: Floats, unit: Floats, bounds: Bounds, q: Floats
) -> None:
    """Start number s into q: the given one for s = 0, else the best that is left.

    Joints off the path stay where the given start has them.
    """
    lower, upper = bounds
    best = 0
    if s > 0:
        for k in range(score.shape[0]):
            if score[k] < score[best]:
                best = k
        score[best] = inf
    for i in range(q.shape[0]):
        value = starts[best, i] if s > 0 and unit[i] > 0.0 else first[i]
        q[i] = min(max(value, lower[i]), upper[i])


@compiled()
def which_side(p: Vector, arm: Arm, goal: Goal, mask: Ints, work: Work) -> int:
    """Whether the target is too far or too near for the posture that comes closest.

    There the line from the tool to the target meets every axis that turns the tool. TOO_NEAR if
    one of them lies at the target or beyond: the tool does not come closer to it. Else TOO_FAR.
    """
    sigma, joint, _, _, _, _, path, _, _ = arm
    _, _, axes = goal
    _, _, e, _, _, _, _, held, z, o = work
    missed = times(axes, (mask[0] * e[0], mask[1] * e[1], mask[2] * e[2]))
    distance = sqrt(dot(missed, missed))
    ahead = scale(1.0 / distance, missed)
    for s in range(path.shape[0]):
        k = path[s] - 1
        if sigma[k] != 0 or held[joint[k]]:
            continue
        # where the line passes the axis; along the line it says nothing
        axis = vector(z, s)
        across = cross(axis, cross(ahead, axis))
        slope = dot(across, ahead)
        if slope > 0.01 and dot(across, subtract(vector(o, s), p)) > 0.5 * slope * distance:
            return TOO_NEAR
    return TOO_FAR


@compiled()
def reach_pose(
    goal: Goal,
    arm: Arm,
    task: Task,
    bounds: Bounds,
    box: Bounds,
    first: Floats,
    given: int,
    starts: Floats,
    score: Floats,
    kept: Floats,
    work: Work,
) -> bool:
    """The whole task from one start after the other; the posture that comes closest into kept."""
    asked, mask, tolerance, unit, turns, restarts, iterations = task
    q, _, e, _, _, _, _, _, _, _ = work
    least = inf
    for s in range(1 - given, restarts + 1):
        take_start(s, first, starts, score, unit, bounds, q)
        descend(goal, arm, asked, mask, tolerance, bounds, unit, iterations, GIVE_UP, work)
        settle(q, turns, box, first)
        look(goal, arm, work)
        cost = cost_of(e, asked)
        if cost < least:
            least = cost
            copy(q, kept)
        if is_met(sizes(e, mask), tolerance):
            copy(q, kept)
            return True
    return False


@compiled()
def reach_position(
    goal: Goal,
    arm: Arm,
    task: Task,
    place: Floats,
    place_mask: Ints,
    stiff: Floats,
    bounds: Bounds,
    box: Bounds,
    first: Floats,
    starts: Floats,
    score: Floats,
    kept: Floats,
    work: Work,
) -> int:
    """The position alone, and there the least orientation error; the best posture into kept.

    Returns FOUND if the pose is met after all, NO_ORIENTATION if its position is, else on which
    side the target lies.
    """
    asked, mask, tolerance, unit, turns, restarts, iterations = task
    q, _, e, _, _, _, _, _, _, _ = work
    placed = False
    closest, angle = inf, inf
    for s in range(min(SIDE_STARTS, restarts) + 2):
        if s == 0:
            copy(kept, q)
        else:
            take_start(s - 1, first, starts, score, unit, bounds, q)
        weight, part, patience = place, place_mask, GIVE_UP
        for stage in range(4):
            # the position; the orientation with it, twice; again the position
            if stage == 1:
                weight, part, patience = stiff, mask, 0.999
                for c in range(3):
                    stiff[c] = STIFF * asked[c]
            elif stage == 2:
                for c in range(3):
                    stiff[c] = STIFFER * asked[c]
            elif stage == 3:
                weight, part, patience = place, place_mask, GIVE_UP
            size = descend(
                goal, arm, weight, part, tolerance, bounds, unit, iterations, patience, work
            )
            if (stage == 0 and not is_met(size, tolerance)) or is_met(sizes(e, mask), tolerance):
                break
        settle(q, turns, box, first)
        look(goal, arm, work)
        away, off = sizes(e, mask)
        if away <= tolerance[0]:
            if off <= tolerance[1]:
                copy(q, kept)
                return FOUND
            if off < angle:
                angle = off
                copy(q, kept)
            placed = True
        elif not placed and away < closest:
            closest = away
            copy(q, kept)
    if placed:
        return NO_ORIENTATION
    copy(kept, q)
    side = NOTHING_FOUND
    for _ in range(20):
        descend(goal, arm, place, place_mask, tolerance, bounds, unit, iterations, GIVE_UP, work)
        p = look(goal, arm, work)
        slope = gradient(place, bounds, unit, work)
        if slope <= 1e-3 * sqrt(cost_of(e, place)):
            side = which_side(p, arm, goal, mask, work)
            break
    settle(q, turns, box, first)
    copy(q, kept)
    look(goal, arm, work)
    away, off = sizes(e, mask)
    if away <= tolerance[0]:
        # the last steps came upon the position after all: it is neither too far nor too near
        return FOUND if off <= tolerance[1] else NOTHING_FOUND
    return side
