"""Postures of a chain to rows of a result: the model's columns, limits, order, status."""

from __future__ import annotations

from math import floor, inf, nan, pi, sqrt

import numpy as np
from numba import types
from numpy.typing import NDArray

from ..kernels._compile import INT, INTS, MATRIX, STACK, Floats, Ints, compiled
from .status import IGMStatus

Flags = NDArray[np.bool_]
_IN2 = types.Array(types.boolean, 2, "C", readonly=True)
_IN3 = types.Array(types.boolean, 3, "C", readonly=True)
_FLAGS = types.Array(types.boolean, 2, "C")
_FLAGS3 = types.Array(types.boolean, 3, "C")
_FLOATS2 = types.Array(types.float64, 2, "C")
_FLOATS3 = types.Array(types.float64, 3, "C")
_CODES1 = types.Array(types.int8, 1, "C")
_CODES2 = types.Array(types.int16, 2, "C")
_CODES2_IN = types.Array(types.int16, 2, "C", readonly=True)

AT_LIMIT = 1e-9  # what rounding may carry a posture over its limits [rad, m]
_REACHED, _FAMILY = int(IGMStatus.REACHED), int(IGMStatus.REACHED_FAMILY)
_OUTSIDE, _NOTHING = int(IGMStatus.OUTSIDE_LIMITS), int(IGMStatus.NOT_CONVERGED)


@compiled()
def turned_inside(x: float, lower: float, upper: float, goal: float) -> float:
    """``x`` plus whole turns, inside the limits and nearest to ``goal`` there; NaN if none is."""
    lowest = x + 2.0 * pi * np.ceil((lower - AT_LIMIT - x) / (2.0 * pi)) if lower > -1e9 else -inf
    highest = x + 2.0 * pi * floor((upper + AT_LIMIT - x) / (2.0 * pi)) if upper < 1e9 else inf
    if lowest > highest:
        return nan
    near = x + 2.0 * pi * np.round((goal - x) / (2.0 * pi))
    return min(max(near, lowest), highest)


@compiled()
def before(a: Floats, code_a: int, key_a: float, b: Floats, code_b: int, key_b: float) -> bool:
    """Order of two rows: by distance, then by branch, then by the joints themselves."""
    if key_a != key_b:
        return key_a < key_b
    if code_a != code_b:
        return code_a < code_b
    for m in range(a.size):
        if abs(a[m] - b[m]) > 1e-9:
            return a[m] < b[m]
    return False


@compiled(
    types.int64(
        STACK, _IN2, MATRIX, _IN2, _IN3, _IN3, _CODES2_IN, INTS, MATRIX, INT, MATRIX, INT,
        _FLOATS3, _FLAGS, _FLOATS2, _FLAGS, _CODES2, _FLAGS, _FLAGS3, _FLAGS3, _CODES1,
    )
)  # fmt: skip
def arranged(
    found: Floats,
    there: Flags,
    error: Floats,
    merged: Flags,
    took: Flags,
    moving: Flags,
    branch: NDArray[np.int16],
    columns: Ints,
    references: Floats,
    given: int,
    joints: Floats,
    boxed: int,
    q: Floats,
    valid: Flags,
    residual: Floats,
    inside: Flags,
    code: NDArray[np.int16],
    double: Flags,
    free: Flags,
    family: Flags,
    status: NDArray[np.int8],
) -> int:
    """Fill the rows of a result; returns the most postures of any pose.

    Joints without a column in ``columns`` do not move the tool: they keep their reference.

    ``joints (3, n)`` holds lower and upper limits and 1 for joints that turn.
    """
    N, S, k = found.shape
    lower, upper, turns = joints[0], joints[1], joints[2]
    n = references.shape[1]
    rows, keys = np.zeros((S, n)), np.zeros(S)
    order = np.zeros(S, dtype=np.int64)
    most = 0
    for p in range(N):
        count, dropped, endless, loose = 0, 0, False, False
        for i in range(S):
            if not there[p, i]:
                continue
            for m in range(n):
                rows[i, m] = references[p, m]
            for m in range(k):
                rows[i, columns[m]] = found[p, i, m]
            reachable = True
            if boxed:
                for m in range(n):
                    middle = 0.5 * (lower[m] + upper[m])
                    goal = references[p, m] if given else (middle if abs(middle) < 1e9 else 0.0)
                    if turns[m] != 0.0:
                        rows[i, m] = turned_inside(rows[i, m], lower[m], upper[m], goal)
                    if not lower[m] - AT_LIMIT <= rows[i, m] <= upper[m] + AT_LIMIT:
                        reachable = False
            if not reachable:
                dropped += 1
                for m in range(k):
                    loose = loose or moving[p, i, m]
                continue
            keys[i] = 0.0
            if given:
                for m in range(n):
                    way = rows[i, m] - references[p, m]
                    if turns[m] != 0.0 and not boxed:
                        way -= 2.0 * pi * np.round(way / (2.0 * pi))
                    keys[i] += way * way
                keys[i] = sqrt(keys[i])
            at = count
            while at > 0:
                j = order[at - 1]
                if not before(rows[i], branch[p, i], keys[i], rows[j], branch[p, j], keys[j]):
                    break
                order[at] = j
                at -= 1
            order[at] = i
            count += 1
        for at in range(count):
            i = order[at]
            valid[p, at], residual[p, at], code[p, at] = True, error[p, i], branch[p, i]
            double[p, at] = merged[p, i]
            fits = True
            for m in range(n):
                q[p, at, m] = rows[i, m]
                fits = fits and lower[m] - AT_LIMIT <= rows[i, m] <= upper[m] + AT_LIMIT
            inside[p, at] = fits
            for m in range(k):
                free[p, at, columns[m]] = took[p, i, m]
                family[p, at, columns[m]] = moving[p, i, m] and not took[p, i, m]
                endless = endless or took[p, i, m] or moving[p, i, m]
        if count > 0:
            status[p] = _FAMILY if endless else _REACHED
        else:
            # another member of a family may lie within the limits: left to a search
            status[p] = _OUTSIDE if dropped > 0 and not loose else _NOTHING
        most = max(most, count)
    return most
