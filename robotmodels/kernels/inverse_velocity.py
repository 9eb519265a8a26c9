"""Joint velocities of twists, or joint accelerations, by the singular values of the Jacobian.

The equations are ``A y = b``: rows of the task, divided by a characteristic length where they are
linear (``row_scale``), and columns divided by the square roots of the joints' weights
(``column_scale``), so that ``v = column_scale y``.
"""

from math import sqrt

import numpy as np
from numba import types

from . import Chain
from ._compile import (
    INT,
    INTS,
    MATRIX,
    NOTHING,
    OUT2,
    STACK,
    VECTOR,
    Floats,
    Ints,
    compiled,
)
from .inverse_factors import inverse_factors
from .poses import jacobians
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

_CHUNK = 128
_CODES = types.Array(types.int8, 2, "C")
_METHOD = (INT, types.float64, types.float64, types.float64)


@compiled(NOTHING(INTS, STACK, MATRIX, VECTOR, MATRIX, STACK, MATRIX, INT, *_METHOD, OUT2, _CODES))
def inverse_velocities(
    whole: Ints,
    rotations: Floats,
    positions: Floats,
    scales: Floats,
    q: Floats,
    rows: Floats,
    rate: Floats,
    reference: int,
    kind: int,
    threshold: float,
    largest: float,
    speed: float,
    out: Floats,
    codes: Ints,
) -> None:
    """Joint velocities of the rates of M rows, by default of a twist (M = 6).

    Shapes: whole, rotations (f + 2, 3, 3), positions (f + 2, 3), scales (M + n,) as `solver`
    packs them; q (N, n); rows (N or 0, M, n); rate (N, M or M + n) -> out (N, n + 3 M + k + 1).
    """
    N, n = q.shape
    M = scales.shape[0] - n
    f, steps, m = whole[0], whole[1], whole[2]
    k, at = min(m, n), 3 + 3 * f
    chain = Chain(
        whole[3 : 3 + f], whole[3 + f : 3 + 2 * f], whole[3 + 2 * f : at], rotations[:f],
        positions[:f], rotations[f], positions[f],
    )  # fmt: skip
    path, asked = whole[at : at + steps], whole[at + steps :]
    J = np.empty((min(N, _CHUNK), M, n))
    work = np.empty((m + 6, n + m + 1))
    sigma, inner, factors = work[m], work[m + 1], work[m + 2]
    y, z, b = work[m + 3], work[m + 4], work[m + 5]
    given, secondary = rows.shape[0] > 0, rate.shape[1] > M
    for i in range(N):
        c = i % _CHUNK
        if given:
            for r in range(M):
                for j in range(n):
                    J[c, r, j] = rows[i, r, j]
        elif c == 0:
            stop = min(i + _CHUNK, N)
            jacobians(
                q[i:stop], chain, path, rotations[f + 1], positions[f + 1], reference, J[: stop - i]
            )
        size = 0.0
        for r in range(M):
            for j in range(n):
                J[c, r, j] *= scales[r] * scales[M + j]
                size += J[c, r, j] * J[c, r, j]
        size = sqrt(size)
        length = 0.0
        for r in range(m):
            b[r] = scales[asked[r]] * rate[i, asked[r]]
            length += b[r] * b[r]
        # rows become sigma v; beside them u . b and, where the rank is not full, u
        width, rank = n + 1, -1
        while rank < 0 or (rank < m and width == n + 1):
            width = n + 1 if rank < 0 else n + 1 + m
            for r in range(m):
                for j in range(n):
                    work[r, j] = J[c, asked[r], j]
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
            z[j] = rate[i, M + j] / scales[M + j] if secondary else 0.0
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
            out[i, j] = scales[M + j] * y[j]
        for r in range(k):
            out[i, n + 3 * M + r] = sigma[r]
        for r in range(3 * M):
            out[i, n + r] = 0.0
        for r in range(m):
            row = asked[r]
            done, part = 0.0, b[r]
            for j in range(n):
                done += J[c, row, j] * y[j]
            if rank < m:
                part = 0.0
                for s in range(rank):
                    part += inner[s] * work[s, n + 1 + r]
            out[i, n + row] = done / scales[row]
            out[i, n + M + row] = rate[i, row] - done / scales[row]
            out[i, n + 2 * M + row] = part / scales[row]
        codes[i, 0], codes[i, 1] = MET, rank
        if sqrt(outside) > NOTICED * sqrt(length):
            codes[i, 0] = SINGULAR
        elif sqrt(lost) > NOTICED * sqrt(length):
            codes[i, 0] = IN_PART
