"""Poses that Paul's plan solves alone: postures, order, limits and status in one call."""

from __future__ import annotations

from math import nan, pi, sqrt

import numpy as np
from numba import types
from numpy.typing import NDArray

from ..kernels._compile import INT, MATRIX, STACK, VECTOR, Floats, Ints, compiled
from ..kernels.poses import improper_pose
from ._arrange import AT_LIMIT, before, turned_inside
from .asked import FARTHEST, FARTHEST_POSITION, IMPROPER
from .paul._run import run_plan
from .status import IGMStatus

_TABLE = types.Array(types.int16, 1, "C", readonly=True)
_PLAN = types.Array(types.uint32, 1, "C", readonly=True)
_FLOATS3, _FLOATS2 = types.Array(types.float64, 3, "C"), types.Array(types.float64, 2, "C")
_FLAGS3 = types.Array(types.boolean, 3, "C")
_CODES2, _CODES1 = types.Array(types.int16, 2, "C"), types.Array(types.int8, 1, "C")


_REACHED, _OUTSIDE = int(IGMStatus.REACHED), int(IGMStatus.OUTSIDE_LIMITS)
_NOTHING = int(IGMStatus.NOT_CONVERGED)


@compiled()
def ordered_rows(
    marks: Ints,
    labels: NDArray[np.int16],
    references: Floats,
    given: int,
    joints: Floats,
    boxed: int,
    q: Floats,
    residual: Floats,
    flags: NDArray[np.bool_],
    code: NDArray[np.int16],
    status: NDArray[np.int8],
) -> int:
    """Order the postures of each pose; returns the most of any, or -1 - most.

    ``marks`` is what `run_plan` left. Poses that have no posture or that the plan was not sure of
    are left to others, with status NOT_CONVERGED: if there are any, the result is negative.
    """
    N, S, n = q.shape
    row, keys, order = np.empty((S, n)), np.empty(S), np.empty(S, np.int64)
    codes, errors = np.empty(S, np.int64), np.empty(S)
    most, doubtful = 0, 0
    for p in range(N):
        found = marks[p, 0]
        if marks[p, 1] != 0 or found == 0:
            doubtful += 1
            status[p] = _NOTHING
            for i in range(S):
                code[p, i], residual[p, i] = -1, nan
                flags[0, p, i] = flags[1, p, i] = False
                for m in range(n):
                    q[p, i, m] = nan
            continue
        count = 0
        for i in range(found):
            fits = True
            for m in range(n):
                value = q[p, i, m]
                if boxed:
                    middle = 0.5 * (joints[0, m] + joints[1, m])
                    goal = references[p, m] if given else (middle if abs(middle) < 1e9 else 0.0)
                    if joints[2, m] != 0.0:
                        value = turned_inside(value, joints[0, m], joints[1, m], goal)
                    fits = fits and joints[0, m] - AT_LIMIT <= value <= joints[1, m] + AT_LIMIT
                row[i, m] = value
            if boxed and not fits:
                continue
            codes[i] = labels[marks[p, 2 + S + i]] if labels.size > 0 else 0
            errors[i], keys[i] = residual[p, i], 0.0
            if given:
                total = 0.0
                for m in range(n):
                    way = row[i, m] - references[p, m]
                    if joints[2, m] != 0.0 and not boxed:
                        way -= 2.0 * pi * np.round(way / (2.0 * pi))
                    total += way * way
                keys[i] = sqrt(total)
            at = count
            while at > 0:
                j = order[at - 1]
                if not before(row[i], codes[i], keys[i], row[j], codes[j], keys[j]):
                    break
                order[at] = j
                at -= 1
            order[at] = i
            count += 1
        if labels.size == 0:
            # the branches have no names but their rank in ascending joint values
            for a in range(count):
                for b in range(count):
                    i, j = order[a], order[b]
                    codes[i] += a != b and before(row[j], 0, 0.0, row[i], 0, 0.0)
        for at in range(S):
            there = at < count
            flags[0, p, at] = flags[1, p, at] = there
            if not there:
                code[p, at], residual[p, at] = -1, nan
                for m in range(n):
                    q[p, at, m] = nan
                continue
            i = order[at]
            code[p, at], residual[p, at] = codes[i], errors[i]
            for m in range(n):
                q[p, at, m] = row[i, m]
                if not joints[0, m] - AT_LIMIT <= row[i, m] <= joints[1, m] + AT_LIMIT:
                    flags[1, p, at] = False
        status[p] = _REACHED if count > 0 else _OUTSIDE
        most = max(most, count)
    return most if doubtful == 0 else -1 - most


@compiled(
    types.int64(
        _PLAN, VECTOR, VECTOR, STACK, MATRIX, INT, _TABLE, MATRIX, INT, _FLOATS3, _FLOATS2,
        _FLAGS3, _CODES2, _CODES1,
    )
)  # fmt: skip
def regular_postures(
    plan: Ints,
    numbers: Floats,
    tolerances: Floats,
    poses: Floats,
    references: Floats,
    given: int,
    labels: NDArray[np.int16],
    joints: Floats,
    boxed: int,
    q: Floats,
    residual: Floats,
    flags: NDArray[np.bool_],
    code: NDArray[np.int16],
    status: NDArray[np.int8],
) -> int:
    """Postures of poses by Paul's plan, checked and ordered.

    ``labels``: branches; ``joints (3, n)``: limits, and 1 for revolute; ``flags (2, N, S)``: valid,
    within limits. Returns the most postures, -1 - most if poses are left to others, or IMPROPER.
    """
    if improper_pose(poses) >= 0:
        return IMPROPER
    for p in range(poses.shape[0]):
        for i in range(3):
            if abs(poses[p, i, 3]) > FARTHEST_POSITION:
                return IMPROPER
    for p in range(references.shape[0]):
        for m in range(references.shape[1]):
            if not abs(references[p, m]) <= FARTHEST:
                return IMPROPER
    marks = np.empty((poses.shape[0], 2 + 2 * q.shape[1]), np.int64)
    run_plan(plan, numbers, tolerances, poses, references, q, residual, marks)
    return ordered_rows(
        marks, labels, references, given, joints, boxed, q, residual, flags, code, status
    )
