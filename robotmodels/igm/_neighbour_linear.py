"""Six equations in six unknowns: elimination, and the vectors of the smallest singular value.

The size is a constant so that the compiler unrolls the loops.
"""

from __future__ import annotations

from math import sqrt

from ..kernels._compile import Floats, Ints, compiled


@compiled()
def factor(A: Floats, pivots: Ints) -> None:
    """LU factors of ``A (6, 6)`` with row exchanges, in place."""
    for k in range(6):
        best = k
        for i in range(k + 1, 6):
            if abs(A[i, k]) > abs(A[best, k]):
                best = i
        pivots[k] = best
        if best != k:
            for j in range(6):
                A[k, j], A[best, j] = A[best, j], A[k, j]
        if abs(A[k, k]) < 1e-300:
            # a singular matrix still serves inverse iteration
            A[k, k] = 1e-300
        for i in range(k + 1, 6):
            A[i, k] /= A[k, k]
            for j in range(k + 1, 6):
                A[i, j] -= A[i, k] * A[k, j]


@compiled()
def solve(A: Floats, pivots: Ints, x: Floats) -> None:
    """Solve ``A y = x`` from the factors, x overwritten by y."""
    for k in range(6):
        p = pivots[k]
        x[k], x[p] = x[p], x[k]
    for i in range(6):
        for k in range(i):
            x[i] -= A[i, k] * x[k]
    for i in range(5, -1, -1):
        for k in range(i + 1, 6):
            x[i] -= A[i, k] * x[k]
        x[i] /= A[i, i]


@compiled()
def solve_transposed(A: Floats, pivots: Ints, x: Floats) -> None:
    """Solve ``A^T y = x`` from the factors, x overwritten by y."""
    for i in range(6):
        for k in range(i):
            x[i] -= A[k, i] * x[k]
        x[i] /= A[i, i]
    for i in range(5, -1, -1):
        for k in range(i + 1, 6):
            x[i] -= A[k, i] * x[k]
    for k in range(5, -1, -1):
        p = pivots[k]
        x[k], x[p] = x[p], x[k]


@compiled()
def unit(x: Floats) -> float:
    """Scale x to length 1; the length it had."""
    largest = 0.0
    for i in range(6):
        largest = max(largest, abs(x[i]))
    if not 0.0 < largest < 1e300:
        # the solution overflowed: any direction will do for the next round
        for i in range(6):
            x[i] = 1.0 / sqrt(6.0)
        return 1e300
    total = 0.0
    for i in range(6):
        x[i] /= largest
        total += x[i] * x[i]
    length = sqrt(total)
    for i in range(6):
        x[i] /= length
    return largest * length


@compiled()
def anywhere(u: Floats) -> None:
    """A direction to start inverse iteration from: unsymmetric, so orthogonal to no axis."""
    for i in range(6):
        u[i] = 1.0 + (0.3 * i if i % 2 == 0 else -0.3 * i)
    unit(u)


@compiled()
def smallest_singular(A: Floats, pivots: Ints, u: Floats, v: Floats, rounds: int) -> float:
    """Smallest singular value by inverse iteration from u; its vectors in ``u, v``."""
    grown = 1.0
    for _ in range(rounds):
        for i in range(6):
            v[i] = u[i]
        solve(A, pivots, v)
        unit(v)
        for i in range(6):
            u[i] = v[i]
        solve_transposed(A, pivots, u)
        grown = unit(u)
    return 1.0 / grown
