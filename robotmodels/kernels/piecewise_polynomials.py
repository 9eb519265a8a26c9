"""Values and derivatives of piecewise polynomials of time, many times and joints in one pass."""

import numpy as np
from numba import types

from ._compile import INTS, MATRIX, NOTHING, OUT4, STACK, Floats, Ints, compiled

__all__ = ["piecewise_derivatives"]

_STACKS = types.Array(types.float64, 4, "C", readonly=True)


@compiled()
def _piece(t: float, breaks: Floats, m: int, g: int, last: int, near: int) -> int:
    """Number of the piece that holds a time; the search begins at the piece before."""
    k = min(near, last)
    while k < last and t >= breaks[m, g, k + 1]:
        k += 1
    while k > 0 and t < breaks[m, g, k]:  # times that do not ascend
        k -= 1
    return k


@compiled(NOTHING(MATRIX, STACK, STACK, _STACKS, INTS, OUT4))
def piecewise_derivatives(
    t: Floats, breaks: Floats, lengths: Floats, coefficients: Floats, orders: Ints, out: Floats
) -> None:
    """Derivatives of piecewise polynomials of normalised time.

    Shapes: t (M, N), breaks (M, c, K + 1), lengths (M, c, K), coefficients (M, K, d + 1, n), orders
    (p,) -> out (p, M, N, n).
    """
    M, K, powers, n = coefficients.shape
    groups = breaks.shape[1]
    count = orders.shape[0]
    last = np.empty(groups, np.int64)
    piece = np.empty(groups, np.int64)
    begin, end, inverse, x = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    here = np.empty((count, powers, n))  # coefficients of the derivatives on the present pieces
    for m in range(M):
        for g in range(groups):
            last[g], piece[g] = 0, 0
            for k in range(K):
                if lengths[m, g, k] > 0.0:
                    last[g] = k
        # the present pieces serve times from low on and below high
        low, high = np.inf, np.inf
        for s in range(t.shape[1]):
            now = t[m, s]
            if not low <= now < high:
                low, high = -np.inf, np.inf
                for g in range(groups):
                    k = _piece(now, breaks, m, g, last[g], piece[g])
                    piece[g] = k
                    if k > 0:
                        low = max(low, breaks[m, g, k])
                    if k < last[g]:
                        high = min(high, breaks[m, g, k + 1])
                for j in range(n):
                    g = 0 if groups == 1 else j
                    k = piece[g]
                    h = lengths[m, g, k]
                    begin[j], end[j] = breaks[m, g, k], breaks[m, g, k + 1]
                    if h <= 0.0:  # a motion without duration stays at its start
                        h, end[j] = 1.0, np.inf
                    inverse[j] = 1.0 / h
                    for p in range(count):
                        for i in range(orders[p], powers):
                            c = coefficients[m, k, i, j]
                            # one by one: the power of a short length may vanish
                            for r in range(orders[p]):
                                c = c * (i - r) / h
                            here[p, i, j] = c
            # joints that share their times share this as well
            for j in range(1 if groups == 1 else n):
                part = (now - begin[j]) * inverse[j]
                x[j] = 1.0 if now >= end[j] else min(max(part, 0.0), 1.0)
            if groups == 1:
                for j in range(1, n):
                    x[j] = x[0]
            for p in range(count):
                if orders[p] >= powers:
                    for j in range(n):
                        out[p, m, s, j] = 0.0
                    continue
                for j in range(n):
                    out[p, m, s, j] = here[p, powers - 1, j]
                for i in range(powers - 2, orders[p] - 1, -1):
                    for j in range(n):
                        out[p, m, s, j] = out[p, m, s, j] * x[j] + here[p, i, j]
