"""Compiled: limits, branch numbers and order of the solutions of each pose."""

from __future__ import annotations

from math import floor, inf, nan, pi, sqrt

import numpy as np
from numba import types
from numpy.typing import NDArray

from ...kernels._compile import INT, INTS, MATRIX, OUT2, OUT3, STACK, VECTOR, Floats, Ints, compiled
from ..paul.layout import AT_LIMIT, GIVEN, WITHIN_LIMITS
from ..status import IGMStatus

REACHED, REACHED_FAMILY = int(IGMStatus.REACHED), int(IGMStatus.REACHED_FAMILY)
OUTSIDE_LIMITS, NOT_CONVERGED = int(IGMStatus.OUTSIDE_LIMITS), int(IGMStatus.NOT_CONVERGED)
_FLAGS = [types.Array(types.boolean, ndim, "C") for ndim in (2, 3)]
_FLAGS_IN = [types.Array(types.boolean, ndim, "C", readonly=True) for ndim in (2, 3)]
_CODES, _STATUS = types.Array(types.int64, 2, "C"), types.Array(types.int64, 1, "C")
_FOUND = types.Tuple((STACK, MATRIX, _FLAGS_IN[0], _FLAGS_IN[1], _FLAGS_IN[1]))
_OUT = types.Tuple((OUT3, OUT2, _FLAGS[0], _FLAGS[0], _FLAGS[1], _FLAGS[1]))

Found = tuple[Floats, Floats, NDArray[np.bool_], NDArray[np.bool_], NDArray[np.bool_]]
Out = tuple[Floats, Floats, NDArray[np.bool_], NDArray[np.bool_], NDArray[np.bool_],
            NDArray[np.bool_]]  # fmt: skip


@compiled()
def turned_inside(x: float, lower: float, upper: float, goal: float) -> float:
    """``x`` plus whole turns, inside the limits and nearest to ``goal`` there; NaN if none is."""
    turn = 2.0 * pi
    lowest = x - turn * floor((x - lower + AT_LIMIT) / turn) if lower > -1e9 else -inf
    highest = x + turn * floor((upper + AT_LIMIT - x) / turn) if upper < 1e9 else inf
    if lowest > highest:
        return nan
    nearest = x + turn * floor((goal - x) / turn + 0.5)
    return lowest if nearest < lowest else (highest if nearest > highest else nearest)


@compiled()
def lower_joints(q: Floats, i: int, j: int) -> bool:
    """Whether row i has the lower value in the first joint where two rows differ."""
    for m in range(q.shape[1]):
        if abs(q[i, m] - q[j, m]) > 1e-9:
            return q[i, m] < q[j, m]
    return False


@compiled()
def ordered(
    q: Floats,
    codes: Ints,
    labels: int,
    goal: Floats,
    joints: Floats,
    mode: int,
    rows: Floats,
    order: Ints,
) -> int:
    """Order of the solutions of a pose by distance and branch; returns how many are kept.

    Shapes: q (S, n); codes, order (S,), codes from 0 on; rows (S, more than n); joints (3 n,).
    """
    # solutions of one branch are numbered apart by their rank in ascending joint variables, in
    # steps of ``labels``; rows get the joint variables, with limits those inside
    S, n = q.shape
    given, boxed, count = mode & GIVEN, mode & WITHIN_LIMITS, 0
    for i in range(S if labels > 0 else 0):
        order[i] = 0
        for j in range(S):
            if codes[i] >= 0 and codes[j] == codes[i] and lower_joints(q, j, i):
                order[i] += labels
    for i in range(S if labels > 0 else 0):
        codes[i] += order[i]
    for i in range(S):
        fits, total = codes[i] >= 0, 0.0
        for m in range(n if fits else 0):
            value, wanted = q[i, m], goal[m]
            lower, upper, revolute = joints[m], joints[n + m], joints[2 * n + m] != 0.0
            delta = value - wanted
            if boxed:
                if not given:
                    middle = 0.5 * (lower + upper)
                    wanted = middle if abs(middle) < 1e9 else 0.0
                if revolute:
                    value = turned_inside(value, lower, upper, wanted)
                fits = fits and lower - AT_LIMIT <= value <= upper + AT_LIMIT
                delta = value - wanted
            elif revolute:
                delta -= 2.0 * pi * floor(delta / (2.0 * pi) + 0.5)
            rows[i, m] = value
            total += delta * delta
        if not fits:
            continue
        rows[i, n] = sqrt(total) if given else 0.0
        at = count
        while at > 0:
            other = order[at - 1]
            if rows[other, n] < rows[i, n] or (
                rows[other, n] == rows[i, n] and codes[other] < codes[i]
            ):
                break
            order[at] = other
            at -= 1
        order[at] = i
        count += 1
    return count


@compiled()
def inside(rows: Floats, i: int, joints: Floats) -> bool:
    """Whether a row is within the limits of all joints."""
    n, kept = joints.size // 3, True
    for m in range(n):
        kept = kept and joints[m] - AT_LIMIT <= rows[i, m] <= joints[n + m] + AT_LIMIT
    return kept


@compiled(types.int64(_FOUND, INTS, MATRIX, VECTOR, INT, INT, _CODES, _STATUS, _OUT))
def arranged_rows(
    found: Found,
    columns: Ints,
    references: Floats,
    joints: Floats,
    labels: int,
    mode: int,
    codes: Ints,
    status: Ints,
    out: Out,
) -> int:
    """Solutions of a chain in the columns of the model, ordered; returns the most of any pose.

    Shapes: columns (k,), references (N, n), joints (3 n,), codes (N, S), status (N,).
    """
    # found: q (N, S, k), residual, double (N, S), free, moving (N, S, k); codes: their branches, -1
    # for none, in the new order at the end. out: q (N, S, n), residual, within the limits, double
    # (N, S), free, family (N, S, n), cleared before. Joints without a column keep their reference
    q, residual, double, free, moving = found
    N, S, k = q.shape
    n, most = references.shape[1], 0
    whole, rows = np.empty((S, n)), np.empty((S, n + 1))
    order, own = np.empty(S, np.int64), np.empty(S, np.int64)
    for p in range(N):
        for i in range(S):
            own[i] = codes[p, i]
            for m in range(n):
                whole[i, m] = references[p, m]
            for m in range(k):
                whole[i, columns[m]] = q[p, i, m]
        count = ordered(whole, own, labels, references[p], joints, mode, rows, order)
        # another member of a family may lie within the limits: left to a search
        some, family = False, False
        for i in range(S):
            if codes[p, i] >= 0:
                some = True
                for m in range(k):
                    family = family or moving[p, i, m] or free[p, i, m]
        status[p] = OUTSIDE_LIMITS if some and not family else NOT_CONVERGED
        for at in range(S):
            codes[p, at] = -1
        for at in range(count):
            i = order[at]
            codes[p, at] = own[i]
            out[1][p, at], out[3][p, at] = residual[p, i], double[p, i]
            out[2][p, at] = inside(rows, i, joints)
            for m in range(n):
                out[0][p, at, m] = rows[i, m]
            if at == 0:
                status[p] = REACHED
            for m in range(k):
                out[4][p, at, columns[m]] = free[p, i, m]
                out[5][p, at, columns[m]] = moving[p, i, m] and not free[p, i, m]
                if moving[p, i, m] or free[p, i, m]:
                    status[p] = REACHED_FAMILY
        most = max(most, count)
    return most
