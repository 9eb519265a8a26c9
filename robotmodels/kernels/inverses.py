"""Inverses of many small square matrices, with their conditioning and the sign of the determinant.

LAPACK's overhead per call is more than the work itself for matrices of six rows.
"""

import numpy as np

from ._compile import INT, OUT1, OUT3, STACK, Floats, compiled

__all__ = ["inverses"]


@compiled(INT(STACK, OUT3, OUT1, OUT1))
def inverses(A: Floats, inverse: Floats, conditioning: Floats, sign: Floats) -> int:
    """Inverses by elimination with the greatest pivot of the column.

    Shapes: A (N, n, n) -> inverse (N, n, n); conditioning, sign (N,).
    """
    N, n = A.shape[0], A.shape[1]
    work = np.empty((n, 2 * n))
    for k in range(N):
        size = 0.0
        for i in range(n):
            for j in range(n):
                a = A[k, i, j]
                size += a * a
                work[i, j] = a
                work[i, n + j] = 1.0 if i == j else 0.0
        s = 1.0
        for c in range(n):
            best, row = abs(work[c, c]), c
            for i in range(c + 1, n):
                if abs(work[i, c]) > best:
                    best, row = abs(work[i, c]), i
            if not best > 0.0:
                return k
            if row != c:
                s = -s
                for j in range(2 * n):
                    work[c, j], work[row, j] = work[row, j], work[c, j]
            pivot = work[c, c]
            if pivot < 0.0:
                s = -s
            for j in range(c, 2 * n):
                work[c, j] /= pivot
            for i in range(n):
                f = work[i, c]
                if i != c and f != 0.0:
                    for j in range(c, 2 * n):
                        work[i, j] -= f * work[c, j]
        other = 0.0
        for i in range(n):
            for j in range(n):
                b = work[i, n + j]
                other += b * b
                inverse[k, i, j] = b
        sign[k] = s
        conditioning[k] = n / (np.sqrt(size) * np.sqrt(other))
    return -1
