"""The compiled iterative inverse, pose by pose: one posture, or the closest one and why.

The way of a pose: its starts are rated and tried (`_reach`), each by damped steps (`_descent`) on
what is missing of the pose (`_pose_error`); a posture that is found is asked for its family.
"""

from __future__ import annotations

from math import inf, nan, pi, sqrt

import numpy as np
from numba import types
from numpy.typing import NDArray

from ...kernels import Chain
from ...kernels._compile import (
    CHAIN,
    INT,
    INTS,
    MATRIX,
    NOTHING,
    OUT1,
    OUT2,
    STACK,
    VECTOR,
    Floats,
    Ints,
    compiled,
)
from ...kernels._vectors import (
    add,
    dot,
    subtract,
    times,
    vector,
    whole_matrix,
    whole_vector,
)
from ..status import IGMStatus
from ._descent import Flags, copy, look
from ._pose_error import sizes
from ._reach import FOUND, NOTHING_FOUND, TOO_FAR, rate_starts, reach_pose, reach_position

Codes = NDArray[np.int8]
FLOAT = types.float64
ROW_FLAGS, JOINT_FLAGS = (types.Array(types.boolean, ndim, "C") for ndim in (1, 2))
CODES = types.Array(types.int8, 1, "C")
FAMILY = int(IGMStatus.REACHED_FAMILY)
BEYOND_LIMITS = int(IGMStatus.OUTSIDE_LIMITS)
IDENTITY = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)


@compiled()
def row_space(J: Floats, weight: Floats, unit: Floats, rows: Floats, moves: Floats) -> int:
    """Rank of the asked-for rows of J; ``moves[i]``: motion without effect goes through joint i.

    Gram and Schmidt's method with pivoting gives an orthonormal basis of the rows; what it
    leaves of the unit vector of a joint is the part of it that the task does not see.
    """
    n = J.shape[1]
    for i in range(n):
        moves[i] = 0.0 if unit[i] == 0.0 else 1.0
        for c in range(6):
            rows[c, i] = 0.0 if unit[i] == 0.0 else weight[c] * J[c, i] / unit[i]
    rank = 0
    largest = 0.0
    for _ in range(6):
        best, size = 0, 0.0
        for c in range(6):
            total = 0.0
            for i in range(n):
                total += rows[c, i] * rows[c, i]
            if total > size:
                best, size = c, total
        largest = max(largest, size)
        if size <= 1e-14 * largest:
            break
        rank += 1
        for i in range(n):
            rows[best, i] /= sqrt(size)
            moves[i] -= rows[best, i] * rows[best, i]
        for c in range(6):
            if c != best:
                total = 0.0
                for i in range(n):
                    total += rows[c, i] * rows[best, i]
                for i in range(n):
                    rows[c, i] -= total * rows[best, i]
        for i in range(n):
            rows[best, i] = 0.0
    return rank


@compiled(
    NOTHING(
        STACK, MATRIX, INT, MATRIX, STACK, CHAIN, INTS, MATRIX, VECTOR, VECTOR, VECTOR, INT,
        INTS, INT, FLOAT, FLOAT, VECTOR, INT, INT, OUT2, OUT2, OUT2, OUT1, ROW_FLAGS,
        ROW_FLAGS, JOINT_FLAGS, CODES,
    )
)  # fmt: skip
def solve_poses(
    targets: Floats,
    first: Floats,
    given: int,
    starts: Floats,
    poses: Floats,
    chain: Chain,
    path: Ints,
    tool_rotation: Floats,
    tool_position: Floats,
    lower: Floats,
    upper: Floats,
    boxed: int,
    mask: Ints,
    tool_axes: int,
    length: float,
    reach: float,
    tolerance: Floats,
    restarts: int,
    iterations: int,
    closest: Floats,
    postures: Floats,
    error: Floats,
    residual: Floats,
    valid: Flags,
    inside: Flags,
    family: Flags,
    status: Codes,
) -> None:
    """Numeric inverse: one posture per pose, or the closest posture and the reason.

    Shapes: targets (N, 4, 4), first (N, n), starts (K, n), poses (K, 4, 4) -> closest, postures,
    family (N, n); error (N, 6); residual, valid, inside, status (N,).
    """
    n = starts.shape[1]
    k = path.shape[0]
    arm = (
        chain.sigma, chain.joint, chain.rotation, chain.position, whole_matrix(chain.base_rotation),
        whole_vector(chain.base_position), path, whole_matrix(tool_rotation),
        whole_vector(tool_position),
    )  # fmt: skip
    q, e, J = np.empty(n), np.zeros(6), np.zeros((6, n))
    work = (
        q, np.empty(n), e, J, np.empty((n, n)), np.empty(n), np.empty(n), np.empty(n, np.bool_),
        np.empty((k, 3)), np.empty((k, 3)),
    )  # fmt: skip
    kept, score = np.empty(n), np.empty(starts.shape[0])
    rows, moves = np.empty((6, n)), np.empty(n)

    # weights of the whole task, of its position alone, and of a position that must not be lost
    asked, place, stiff = np.empty(6), np.zeros(6), np.empty(6)
    whole_mask, place_mask = mask.copy(), np.zeros(6, np.int64)
    for c in range(6):
        asked[c] = mask[c] / length if c < 3 else mask[c]
        stiff[c] = asked[c]
        if c < 3:
            place[c], place_mask[c] = asked[c], mask[c]
    unit, turns = np.zeros(n), np.zeros(n, np.bool_)
    for j in range(chain.sigma.shape[0]):
        if chain.sigma[j] == 0:
            turns[chain.joint[j]] = True
    free = 0
    for j in path:
        if chain.sigma[j - 1] != 2:
            unit[chain.joint[j - 1]] = 1.0 if chain.sigma[j - 1] == 0 else 1.0 / length
            free += 1
    # an angle that has a whole turn is not limited: it is shifted inside afterwards
    nowhere = (np.full(n, -inf), np.full(n, inf))
    bounds, box = nowhere, nowhere
    if boxed:
        box = (lower.copy(), upper.copy())
        bounds = (lower.copy(), upper.copy())
        for i in range(n):
            if turns[i] and upper[i] - lower[i] >= 2.0 * pi:
                bounds[0][i], bounds[1][i] = -inf, inf
    task = (asked, whole_mask, tolerance, unit, turns, restarts, iterations)
    has_place = place_mask[0] + place_mask[1] + place_mask[2] > 0
    all_place = place_mask[0] + place_mask[1] + place_mask[2] == 3
    j = path[0] - 1
    centre = add(arm[5], times(arm[4], vector(chain.position, j)))

    generic = -1
    reference = np.empty(n)
    for i in range(targets.shape[0]):
        T = targets[i]
        Rd = (T[0, 0], T[0, 1], T[0, 2], T[1, 0], T[1, 1], T[1, 2], T[2, 0], T[2, 1], T[2, 2])
        pd = (T[0, 3], T[1, 3], T[2, 3])
        goal = (Rd, pd, Rd if tool_axes else IDENTITY)
        if generic < 0:
            # the rank of the task away from singular postures
            for s in range(min(8, starts.shape[0])):
                copy(starts[s], q)
                look(goal, arm, work)
                generic = max(generic, row_space(J, asked, unit, rows, moves))

        copy(first[i], reference)
        copy(reference, kept)
        outcome = NOTHING_FOUND
        away = subtract(pd, centre)
        beyond = sqrt(dot(away, away)) > reach + tolerance[0] and all_place
        if not beyond:
            rate_starts(poses, goal, asked, score)
            if reach_pose(
                goal, arm, task, bounds, box, reference, given, starts, score, kept, work
            ):
                outcome = FOUND
            elif boxed:
                # without limits, to say that they are the reason
                rate_starts(poses, goal, asked, score)
                copy(kept, moves)  # which has no other use here
                if reach_pose(
                    goal, arm, task, nowhere, nowhere, reference, given, starts, score, kept,
                    work,
                ):  # fmt: skip
                    outcome = BEYOND_LIMITS
                else:
                    copy(moves, kept)
        if outcome == NOTHING_FOUND and has_place:
            rate_starts(poses, goal, place, score)
            outcome = reach_position(
                goal, arm, task, place, place_mask, stiff, bounds, box, reference, starts,
                score, kept, work,
            )  # fmt: skip
            if beyond:
                outcome = TOO_FAR

        copy(kept, q)
        look(goal, arm, work)
        solved = outcome == FOUND
        known = solved and generic < free
        known = known and row_space(J, asked, unit, rows, moves) == generic
        within = solved
        for c in range(n):
            family[i, c] = known and moves[c] > 1e-10
            if family[i, c]:
                outcome = FAMILY
            within = within and q[c] >= lower[c] and q[c] <= upper[c]
            closest[i, c] = q[c]
            postures[i, c] = q[c] if solved else nan
        for c in range(6):
            error[i, c] = e[c]
        size = sizes(e, whole_mask)
        residual[i] = max(size[0], size[1])
        valid[i], inside[i] = solved, within
        status[i] = outcome
