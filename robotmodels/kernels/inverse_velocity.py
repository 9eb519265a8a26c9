"""Joint velocities of twists, or joint accelerations, by the singular values of the Jacobian.

The equations are ``A y = b``: rows of the task, divided by a characteristic length where they are
linear (``row_scale``), and columns divided by the square roots of the joints' weights
(``column_scale``), so that ``v = column_scale y``.
"""

from math import sqrt

import numpy as np
from numba import types

from ._compile import INT, INTS, MATRIX, NOTHING, OUT2, STACK, VECTOR, Floats, Ints, compiled
from .inverse_factors import inverse_factors
from .svd import orthogonal_rows

__all__ = ["inverse_velocities"]

MET, IN_PART, SINGULAR = 0, 1, 2
"""Codes of `robotmodels.kinematics.IKMStatus`."""

ZERO = 1e-13
"""Singular values up to this, beside the size of the Jacobian, are rounding errors of zeros."""
NULL_SPACE = 1e-14
"""Directions whose singular value is above this, beside the size, are kept out of motions that
must not disturb the task."""
RANK = 1e-10
"""Singular values above this, beside the size, count for the rank."""
NOTICED = 1e-9
"""Part of a twist that may be missing before it is reported."""

_CODES = types.Array(types.int8, 2, "C")
_METHOD = (INT, types.float64, types.float64, types.float64)


@compiled(NOTHING(STACK, MATRIX, VECTOR, VECTOR, INTS, *_METHOD, OUT2, _CODES))
def inverse_velocities(
    J: Floats,
    rate: Floats,
    row_scale: Floats,
    column_scale: Floats,
    asked: Ints,
    kind: int,
    threshold: float,
    largest: float,
    speed: float,
    out: Floats,
    codes: Ints,
) -> None:
    """Joint velocities of the rates of M rows, of which the m in ``asked`` are requested.

    Shapes: J (N, M, n); rate (N, M), or (N, M + n) with a secondary motion; row_scale (M,);
    column_scale (n,); asked (m,) -> out (N, n + 3 M + k + 1), codes (N, 2).
    """
    N, M, n = J.shape
    m = asked.shape[0]
    k = min(m, n)
    A, work, vectors = np.empty((m, n)), np.empty((m, n + m + 1)), np.empty((6, n + m))
    sigma, inner, factors = vectors[0], vectors[1], vectors[2]
    y, z, b = vectors[3], vectors[4], vectors[5]
    secondary = rate.shape[1] > M
    for i in range(N):
        size = 0.0
        for r in range(M):
            for j in range(n):
                size += (row_scale[r] * column_scale[j] * J[i, r, j]) ** 2
        size = sqrt(size)
        length = 0.0
        for r in range(m):
            row = asked[r]
            b[r] = row_scale[row] * rate[i, row]
            length += b[r] * b[r]
            for j in range(n):
                A[r, j] = row_scale[row] * column_scale[j] * J[i, row, j]
        # rows become sigma v; beside them u . b and, where the rank is not full, u
        width, rank = n + 1, -1
        while rank < 0 or (rank < m and width == n + 1):
            width = n + 1 if rank < 0 else n + 1 + m
            for r in range(m):
                for j in range(n):
                    work[r, j] = A[r, j]
                work[r, n] = b[r]
                for j in range(n + 1, width):
                    work[r, j] = 1.0 if j == n + 1 + r else 0.0
            orthogonal_rows(work, m, n, width, sigma)
            rank = 0
            while rank < k and sigma[rank] > RANK * size:
                rank += 1
        for r in range(m):
            inner[r] = work[r, n]
        out[i, n + 3 * M + k] = inverse_factors(
            kind, threshold, largest, speed, sigma, inner, k, ZERO * size, factors
        )
        for j in range(n):
            y[j] = 0.0
            z[j] = rate[i, M + j] / column_scale[j] if secondary else 0.0
        lost, outside = 0.0, 0.0
        for r in range(m):
            if r >= rank:
                outside += inner[r] * inner[r]
            else:
                lost += ((1.0 - sigma[r] * factors[r]) * inner[r]) ** 2
        for r in range(k):
            if sigma[r] > 0.0:
                along = factors[r] * inner[r] / sigma[r]
                for j in range(n):
                    y[j] += along * work[r, j]
            if secondary and sigma[r] > NULL_SPACE * size:
                along = 0.0
                for j in range(n):
                    along += z[j] * work[r, j]
                along /= sigma[r] * sigma[r]
                for j in range(n):
                    z[j] -= along * work[r, j]
        for j in range(n):
            y[j] += z[j]
            out[i, j] = column_scale[j] * y[j]
        for r in range(k):
            out[i, n + 3 * M + r] = sigma[r]
        for r in range(3 * M):
            out[i, n + r] = 0.0
        for r in range(m):
            row = asked[r]
            done, part = 0.0, b[r]
            for j in range(n):
                done += A[r, j] * y[j]
            if rank < m:
                part = 0.0
                for s in range(rank):
                    part += inner[s] * work[s, n + 1 + r]
            out[i, n + row] = done / row_scale[row]
            out[i, n + M + row] = rate[i, row] - done / row_scale[row]
            out[i, n + 2 * M + row] = part / row_scale[row]
        codes[i, 0], codes[i, 1] = MET, rank
        if sqrt(outside) > NOTICED * sqrt(length):
            codes[i, 0] = SINGULAR
        elif sqrt(lost) > NOTICED * sqrt(length):
            codes[i, 0] = IN_PART
