"""Rows folded into triangular factors: the same bits with any number of threads.

LAPACK's factorisation of many rows splits its sums by threads, so that the last digits depend on
how many there are. Here the order of all sums is fixed, and rows are folded in while they are
close to the processor.
"""

from __future__ import annotations

import numpy as np

from ._compile import INT, INTS, MATRIX, NOTHING, OUT2, STACK, compiled

_ROWS = 64
"""Rows that are folded in at a time."""


@compiled()
def _fold(A, count, w, R):
    """Householder reflections of R above the first rows of A, which becomes zero."""
    p = R.shape[1]
    for c in range(p):
        square = 0.0
        for i in range(count):
            square += A[i, c] * A[i, c]
        if square == 0.0:
            continue
        top = R[c, c]
        length = np.sqrt(top * top + square)
        if top > 0.0:
            length = -length
        # v = (1, A[:, c] / (top - length)), of which H = 1 - factor v v^T
        factor = (length - top) / length
        scale = 1.0 / (top - length)
        R[c, c] = length
        for k in range(c + 1, p):
            w[k] = R[c, k]
        for i in range(count):
            A[i, c] *= scale
        # four rows at a time, or the sums would be fetched and stored for each
        fours = count - count % 4
        for i in range(0, fours, 4):
            x0, x1, x2, x3 = A[i, c], A[i + 1, c], A[i + 2, c], A[i + 3, c]
            for k in range(c + 1, p):
                w[k] += (x0 * A[i, k] + x1 * A[i + 1, k]) + (x2 * A[i + 2, k] + x3 * A[i + 3, k])
        for i in range(fours, count):
            x0 = A[i, c]
            for k in range(c + 1, p):
                w[k] += x0 * A[i, k]
        for k in range(c + 1, p):
            w[k] *= factor
            R[c, k] -= w[k]
        for i in range(0, fours, 4):
            x0, x1, x2, x3 = A[i, c], A[i + 1, c], A[i + 2, c], A[i + 3, c]
            for k in range(c + 1, p):
                y = w[k]
                A[i, k] -= x0 * y
                A[i + 1, k] -= x1 * y
                A[i + 2, k] -= x2 * y
                A[i + 3, k] -= x3 * y
        for i in range(fours, count):
            x0 = A[i, c]
            for k in range(c + 1, p):
                A[i, k] -= x0 * w[k]


@compiled(NOTHING(STACK, MATRIX, INT, INTS, INTS, OUT2))
def fold_equations(W, y, kind, rows, columns, R):
    """Fold equations ``[W y]`` of one kind into a triangular factor.

    Shapes: W (k, m, b), y (k, m), columns (c,), R (c + 1, c + 1).
    """
    c = len(columns)
    A = np.empty((_ROWS, c + 1))
    w = np.empty(c + 1)
    for start in range(0, len(rows), _ROWS):
        count = min(_ROWS, len(rows) - start)
        for i in range(count):
            row = rows[start + i]
            for k in range(c):
                A[i, k] = W[row, kind, columns[k]]
            A[i, c] = y[row, kind]
        _fold(A, count, w, R)


@compiled(NOTHING(MATRIX, OUT2))
def fold_rows(rows, R):
    """Fold rows into a triangular factor. Shapes: rows (k, p), R (p, p)."""
    p = rows.shape[1]
    A = np.empty((_ROWS, p))
    w = np.empty(p)
    for start in range(0, len(rows), _ROWS):
        count = min(_ROWS, len(rows) - start)
        A[:count] = rows[start : start + count]
        _fold(A, count, w, R)
