"""Compiled linear algebra of the elimination: reflections, LU factors, smallest singular vectors.

Sizes are 6, 12 and 24.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from ...kernels._compile import (
    Floats,
    Ints,
    compiled,
)


@compiled()
def eliminate(Q: Floats, P: Floats, order: Ints) -> float:
    """Householder reflections that make ``Q (14, 8)`` triangular, also applied to ``P (14, 27)``.

    Columns are taken in order of size; ``order (8,)`` receives them. Returns the ratio of the
    last diagonal entry to the first, 0 where the columns are dependent.
    """
    m, n = Q.shape
    for k in range(n):
        order[k] = k
    for k in range(n):
        best, largest = k, -1.0
        for j in range(k, n):
            total = 0.0
            for i in range(k, m):
                total += Q[i, j] * Q[i, j]
            if total > largest:
                best, largest = j, total
        if best != k:
            order[k], order[best] = order[best], order[k]
            for i in range(m):
                Q[i, k], Q[i, best] = Q[i, best], Q[i, k]
        size = sqrt(largest)
        if size == 0.0:
            return 0.0
        if Q[k, k] > 0.0:
            size = -size
        # v = column - size e_k, kept below the diagonal; H = I - v v^T / h
        first = Q[k, k] - size
        h = -size * first
        for j in range(k + 1, n):
            total = first * Q[k, j]
            for i in range(k + 1, m):
                total += Q[i, k] * Q[i, j]
            total /= h
            Q[k, j] -= total * first
            for i in range(k + 1, m):
                Q[i, j] -= total * Q[i, k]
        for j in range(P.shape[1]):
            total = first * P[k, j]
            for i in range(k + 1, m):
                total += Q[i, k] * P[i, j]
            total /= h
            P[k, j] -= total * first
            for i in range(k + 1, m):
                P[i, j] -= total * Q[i, k]
        Q[k, k] = size
    return abs(Q[n - 1, n - 1]) / abs(Q[0, 0])


@compiled()
def factor(A: Floats, pivots: Ints) -> float:
    """LU factors of A with row exchanges, in place; smallest pivot over the largest."""
    n = A.shape[0]
    smallest, largest = np.inf, 0.0
    for k in range(n):
        best = k
        for i in range(k + 1, n):
            if abs(A[i, k]) > abs(A[best, k]):
                best = i
        pivots[k] = best
        if best != k:
            for j in range(n):
                A[k, j], A[best, j] = A[best, j], A[k, j]
        size = abs(A[k, k])
        smallest = min(smallest, size)
        largest = max(largest, size)
        if size == 0.0:
            # a singular matrix is still usable for inverse iteration
            A[k, k] = 1e-300
        for i in range(k + 1, n):
            A[i, k] /= A[k, k]
            scale = A[i, k]
            if scale != 0.0:
                for j in range(k + 1, n):
                    A[i, j] -= scale * A[k, j]
    if largest == 0.0:
        return 0.0
    return smallest / largest


@compiled()
def solve_columns(A: Floats, pivots: Ints, B: Floats) -> None:
    """Solve ``A X = B`` from the factors, B (n, m) overwritten by X."""
    n, m = B.shape
    for k in range(n):
        p = pivots[k]
        if p != k:
            for j in range(m):
                B[k, j], B[p, j] = B[p, j], B[k, j]
    for i in range(n):
        for k in range(i):
            scale = A[i, k]
            for j in range(m):
                B[i, j] -= scale * B[k, j]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            scale = A[i, k]
            for j in range(m):
                B[i, j] -= scale * B[k, j]
        scale = 1.0 / A[i, i]
        for j in range(m):
            B[i, j] *= scale


@compiled()
def solve_one(A: Floats, pivots: Ints, x: Floats) -> None:
    """Solve ``A y = x`` from the factors, x overwritten by y."""
    n = x.shape[0]
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


@compiled()
def solve_transposed(A: Floats, pivots: Ints, x: Floats) -> None:
    """Solve ``A^T y = x`` from the factors, x overwritten by y."""
    n = x.shape[0]
    for i in range(n):
        for k in range(i):
            x[i] -= A[k, i] * x[k]
        x[i] /= A[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            x[i] -= A[k, i] * x[k]
    for k in range(n - 1, -1, -1):
        p = pivots[k]
        x[k], x[p] = x[p], x[k]


@compiled()
def to_unit(x: Floats) -> float:
    """Scale x to length one; its length."""
    largest = 0.0
    for i in range(x.shape[0]):
        largest = max(largest, abs(x[i]))
    if largest == 0.0:
        return 0.0
    total = 0.0
    for i in range(x.shape[0]):
        x[i] /= largest
        total += x[i] * x[i]
    total = sqrt(total)
    for i in range(x.shape[0]):
        x[i] /= total
    return total * largest


@compiled()
def smallest_vectors(A: Floats, pivots: Ints, u: Floats, v: Floats) -> float:
    """Singular vectors ``A v = s u`` of the smallest singular value, from the factors; s."""
    n = v.shape[0]
    for i in range(n):
        v[i] = 1.0 + 0.1 * i
    s = 0.0
    for _ in range(3):
        for i in range(n):
            u[i] = v[i]
        solve_transposed(A, pivots, u)
        to_unit(u)
        for i in range(n):
            v[i] = u[i]
        solve_one(A, pivots, v)
        length = to_unit(v)
        s = 1.0 / length if length > 0.0 else 0.0
    return s


@compiled()
def orthonormal_rows(Z: Floats) -> float:
    """Gram and Schmidt's method, twice, on the rows of Z in place; least share that was left."""
    m, n = Z.shape
    least = 1.0
    for i in range(m):
        size = 0.0
        for k in range(n):
            size += Z[i, k] * Z[i, k]
        for _ in range(2):
            for j in range(i):
                total = 0.0
                for k in range(n):
                    total += Z[j, k] * Z[i, k]
                for k in range(n):
                    Z[i, k] -= total * Z[j, k]
        left = 0.0
        for k in range(n):
            left += Z[i, k] * Z[i, k]
        if left <= 1e-28 * size:
            return 0.0
        least = min(least, left / size)
        left = 1.0 / sqrt(left)
        for k in range(n):
            Z[i, k] *= left
    return sqrt(least)
