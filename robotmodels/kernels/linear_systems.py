"""LU factors of small square matrices with row exchanges, and linear systems solved by them."""

from math import inf

from ._compile import Floats, Ints, compiled


@compiled()
def factor(A: Floats, pivots: Ints) -> float:
    """LU factors of a square matrix with row exchanges, in place; the least pivot."""
    n = A.shape[0]
    least = inf
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(A[i, k]) > abs(A[best, k]):
                best = i
        pivots[k] = best
        if best != k:
            for j in range(n):
                A[k, j], A[best, j] = A[best, j], A[k, j]
        least = min(least, abs(A[k, k]))
        if abs(A[k, k]) < 1e-300:  # singular: the solutions grow without bound
            A[k, k] = 1e-300
        for i in range(k + 1, n):
            A[i, k] /= A[k, k]
            for j in range(k + 1, n):
                A[i, j] -= A[i, k] * A[k, j]
    return least


@compiled()
def solve(A: Floats, pivots: Ints, x: Floats) -> None:
    """Solve ``A y = x`` from the factors, x overwritten by y."""
    n = x.size
    for k in range(n):
        p = pivots[k]
        x[k], x[p] = x[p], x[k]
    for i in range(n):
        for k in range(i):
            x[i] -= A[i, k] * x[k]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            x[i] -= A[i, k] * x[k]
        x[i] /= A[i, i]
