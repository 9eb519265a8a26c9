"""Reachability analysis of a path: two passes over its grid, a two-variable program at each point.

With x the squared rate of the path parameter and u its acceleration, x grows by ``2 step u`` over
an interval of the grid, and every limit is linear: ``lower <= a u + b x + c <= upper``. Backward,
the range of x from which the end is reached; forward, the greatest x within that range. Each
program has two variables and is solved exactly by elimination of u.
Source: H. Pham and Q.-C. Pham, IEEE Transactions on Robotics 34 (2018), pp. 645-659.
"""

import numpy as np

from ..kernels._compile import INT, INTS, MATRIX, OUT2, VECTOR, Floats, Ints, compiled

__all__ = ["path_rates"]

_ROUNDING = 1e-12  # relative, of a limit
_ACTIVE = 1e-6  # of a limit: nearer than this it binds


@compiled(counted=False)
def _collect(
    i: int, step: float, a: Floats, b: Floats, c: Floats, lower: Floats, upper: Floats,
    ends: Ints, rows: Floats,
) -> int:  # fmt: skip
    """Rows ``(p, r, h)`` of ``p u + r x <= h`` on the interval i; how many there are."""
    count = 0
    for k in range(a.shape[1]):
        for end in range(1 + ends[k]):
            r = b[i + end, k]
            p = a[i + end, k] + 2.0 * step * r * end
            for side in (1.0, -1.0):
                h = upper[i, k] - c[i + end, k] if side > 0.0 else c[i + end, k] - lower[i, k]
                if h < np.inf:
                    rows[count, 0], rows[count, 1], rows[count, 2] = side * p, side * r, h
                    rows[count, 3] = k
                    count += 1
    return count


@compiled(counted=False)
def _range(rows: Floats, count: int, top: float) -> tuple[float, float]:
    """Least and greatest x for which some u keeps all rows; least > greatest if there is none."""
    low, high = 0.0, top
    for i in range(count):
        p, r, h = rows[i, 0], rows[i, 1], rows[i, 2]
        if p < 0.0:
            continue
        for j in range(count):
            q = rows[j, 0]
            if p > 0.0 and q < 0.0:  # u is eliminated
                one, two = -q * r, p * rows[j, 1]
                first, second = -q * h, p * rows[j, 2]
            elif p == 0.0 and j == i:
                one, two, first, second = r, 0.0, h, 0.0
            else:
                continue
            slope, bound = one + two, first + second
            if abs(slope) <= 1e-14 * (abs(one) + abs(two)):
                if bound < -_ROUNDING * (abs(first) + abs(second)):
                    return 1.0, 0.0
            elif slope > 0.0:
                high = min(high, bound / slope)
            else:
                low = max(low, bound / slope)
    if low > high and low - high <= 1e-10 * low:
        low = high
    return low, high


@compiled(counted=False)
def _acceleration(rows: Floats, count: int, x: float) -> float:
    """Greatest u that keeps all rows at x, or the one that exceeds them least by rounding."""
    low, high, over, under = -np.inf, np.inf, -1, -1
    for i in range(count):
        p, r, h = rows[i, 0], rows[i, 1], rows[i, 2]
        slack = h - r * x + _ROUNDING * (abs(h) + abs(r) * x)
        if p > 0.0 and slack / p < high:
            high, over = slack / p, i
        elif p < 0.0 and slack / p > low:
            low, under = slack / p, i
    if high >= low or over < 0:
        return high
    slack = (rows[over, 2] - rows[under, 2]) - (rows[over, 1] - rows[under, 1]) * x
    return slack / (rows[over, 0] - rows[under, 0])


@compiled(
    INT(VECTOR, MATRIX, MATRIX, MATRIX, MATRIX, MATRIX, INTS, VECTOR, VECTOR, OUT2)
)  # fmt: skip
def path_rates(
    steps: Floats, a: Floats, b: Floats, c: Floats, lower: Floats, upper: Floats, ends: Ints,
    top: Floats, given: Floats, out: Floats,
) -> int:  # fmt: skip
    """Quickest squared rates on a grid; the first point that is not controllable, or -1.

    Shapes: steps (N,), a, b, c (N + 1, K), lower, upper (N, K), ends (K,), top (N + 1,), given (2,)
    -> out (N + 1, 6): x, u, range of x, greatest x under the limits, number of the active limit.
    """
    N, K = steps.shape[0], a.shape[1]
    rows = np.empty((4 * K + 2, 4))
    low, high = given[1], given[1]
    for i in range(N, -1, -1):
        if i == N:
            if given[1] > top[N] * (1.0 + 1e-9):
                return N
            out[N, 4] = top[N]
        else:
            step = steps[i]
            count = _collect(i, step, a, b, c, lower, upper, ends, rows)
            out[i, 4] = _range(rows, count, top[i])[1]
            count = _within(rows, count, step, low, high)
            low, high = _range(rows, count, top[i])
        out[i, 2], out[i, 3] = low, high
        if low > high:
            return i
    x = given[0]
    if not out[0, 2] * (1.0 - 1e-9) <= x <= out[0, 3] * (1.0 + 1e-9):
        return 0
    for i in range(N):
        step = steps[i]
        count = _collect(i, step, a, b, c, lower, upper, ends, rows)
        limits = count
        count = _within(rows, count, step, out[i + 1, 2], out[i + 1, 3])
        u = _acceleration(rows, count, x)
        after = min(max(x + 2.0 * step * u, out[i + 1, 2]), out[i + 1, 3])
        u = 0.5 * (after - x) / step
        out[i, 0], out[i, 1] = x, u
        least, code = _ACTIVE, -1.0
        for k in range(limits):
            slack = rows[k, 2] - rows[k, 0] * u - rows[k, 1] * x
            if slack < least:
                least, code = slack, rows[k, 3]
        slack = min(1.0 - x / top[i], 1.0 - after / top[i + 1])
        out[i, 5] = K if slack < least else code
        x = after
    out[N, 0], out[N, 1], out[N, 5] = x, out[N - 1, 1], out[N - 1, 5]
    return -1


@compiled(counted=False)
def _within(rows: Floats, count: int, step: float, low: float, high: float) -> int:
    """Rows that lead from x to a range at the next point of the grid."""
    if high < np.inf:
        rows[count, 0], rows[count, 1], rows[count, 2] = 2.0 * step, 1.0, high
        count += 1
    rows[count, 0], rows[count, 1], rows[count, 2] = -2.0 * step, -1.0, -low
    return count + 1
