"""Joint velocities of twists, or joint accelerations, by the singular values of the Jacobian.

The equations are ``A y = b``: rows that are not asked for are left out, linear rows are divided by
a characteristic length (``row_scale``), columns by the square roots of the joints' weights
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

__all__ = ["inverse_of_rows", "inverse_velocities", "packed"]

MET, IN_PART, SINGULAR = 0, 1, 2
"""Codes of `robotmodels.kinematics.inverse.status.IKMStatus`."""

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


@compiled()
def decompose(A: Floats, m: int, n: int, b: Floats, whole: int, B: Floats, sigma: Floats) -> None:
    """Singular values of A (m, n), with vectors in B.

    m <= n: row i of B is ``sigma_i v_i``, then ``u_i . b``, then (if whole) ``u_i``. m > n: row i
    is ``sigma_i u_i``, then ``v_i``.
    """
    if m <= n:
        for i in range(m):
            for j in range(n):
                B[i, j] = A[i, j]
            B[i, n] = b[i]
            if whole:
                for j in range(m):
                    B[i, n + 1 + j] = 1.0 if i == j else 0.0
        orthogonal_rows(B, m, n, n + 1 + m if whole else n + 1, sigma)
    else:
        for i in range(n):
            for j in range(m):
                B[i, j] = A[j, i]
            for j in range(n):
                B[i, m + j] = 1.0 if i == j else 0.0
        orthogonal_rows(B, n, m, m + n, sigma)


@compiled()
def solve_row(
    A: Floats,
    m: int,
    n: int,
    b: Floats,
    size: float,
    kind: int,
    threshold: float,
    largest: float,
    speed: float,
    others: int,
    z: Floats,
    work: Floats,
    sigma: Floats,
    y: Floats,
    part: Floats,
) -> tuple[int, float, int]:
    """Solve ``A y = b``; returns rank, largest damping and status code.

    Shapes: A (>= m, >= n), b (>= m,), z (>= n,).
    """
    k = min(m, n)
    decompose(A, m, n, b, 0, work, sigma)
    inner, factors = work[work.shape[0] - 1], work[work.shape[0] - 2]
    wide = m <= n
    rank = 0
    for i in range(k):
        if sigma[i] > RANK * size:
            rank += 1
        if wide:
            inner[i] = work[i, n]
        else:
            total = 0.0
            for j in range(m):
                total += work[i, j] * b[j]
            inner[i] = total / sigma[i] if sigma[i] > 0.0 else 0.0
    damping = inverse_factors(
        kind, threshold, largest, speed, sigma, inner, k, ZERO * size, factors
    )
    first = 0 if wide else m
    for j in range(n):
        y[j] = 0.0
    whole, lost = 0.0, 0.0
    for i in range(m):
        whole += b[i] * b[i]
    for i in range(k):
        # rows of work have the length sigma where they are wide
        unit = 1.0 / sigma[i] if wide and sigma[i] > 0.0 else 1.0
        along = factors[i] * inner[i] * unit
        for j in range(n):
            y[j] += along * work[i, first + j]
        if sigma[i] > RANK * size:
            lost += ((1.0 - sigma[i] * factors[i]) * inner[i]) ** 2
        if others and sigma[i] > NULL_SPACE * size:
            total = 0.0
            for j in range(n):
                total += work[i, first + j] * z[j]
            total *= unit * unit
            for j in range(n):
                z[j] -= total * work[i, first + j]
    if others:
        for j in range(n):
            y[j] += z[j]
    outside = 0.0
    if rank == m:
        for i in range(m):
            part[i] = b[i]
    else:
        if wide:
            # the left vectors, which regular rows do without
            decompose(A, m, n, b, 1, work, sigma)
        for i in range(m):
            part[i] = 0.0
        for i in range(rank):
            along = work[i, n] if wide else inner[i] / sigma[i]
            for j in range(m):
                part[j] += along * work[i, n + 1 + j if wide else j]
        for i in range(m):
            outside += (b[i] - part[i]) ** 2
    code = MET
    if sqrt(outside) > NOTICED * sqrt(whole):
        code = SINGULAR
    elif sqrt(lost) > NOTICED * sqrt(whole):
        code = IN_PART
    return rank, damping, code


def packed(
    chain: Chain,
    point: tuple[Ints, Floats, Floats],
    asked: Ints,
    row_scale: Floats,
    column_scale: Floats,
) -> tuple[Ints, Floats]:
    """Robot, frame, task and scales as `inverse_velocities` takes them: integers and floats.

    One pose spends 0.3 us on each array that is passed to a kernel.
    """
    path, *tool = point
    sizes = chain.sigma.size, path.size, asked.size
    whole = np.concatenate([sizes, *chain[:3], path, asked]).astype(np.int64)
    numbers = [*chain[3:], *tool, row_scale, column_scale]
    return whole, np.concatenate([array.ravel() for array in numbers])


@compiled(NOTHING(INTS, VECTOR, MATRIX, MATRIX, MATRIX, INT, *_METHOD, OUT2, _CODES))
def inverse_velocities(
    whole: Ints,
    numbers: Floats,
    q: Floats,
    twist: Floats,
    secondary: Floats,
    reference: int,
    kind: int,
    threshold: float,
    largest: float,
    speed: float,
    out: Floats,
    codes: Ints,
) -> None:
    """Joint velocities of twists; q (N, n), twist (N, 6), secondary (N, n) or (0, n).

    out (N, n + 19 + k): velocities, twist, error, reachable twist, k singular values, damping.
    """
    N, n = q.shape
    f, steps, m = whole[0], whole[1], whole[2]
    k = min(m, n)
    at, E = 3 + 3 * f, 12 * f + 12
    chain = Chain(
        whole[3 : 3 + f], whole[3 + f : 3 + 2 * f], whole[3 + 2 * f : at],
        numbers[: 9 * f].reshape(f, 3, 3), numbers[9 * f : 12 * f].reshape(f, 3),
        numbers[12 * f : 12 * f + 9].reshape(3, 3), numbers[12 * f + 9 : E],
    )  # fmt: skip
    path, asked = whole[at : at + steps], whole[at + steps :]
    tool_rotation, tool_position = numbers[E : E + 9].reshape(3, 3), numbers[E + 9 : E + 12]
    row_scale, column_scale = numbers[E + 12 : E + 18], numbers[E + 18 :]
    J = np.empty((min(N, _CHUNK), 6, n))
    A, b, part = np.empty((m, n)), np.empty(m), np.empty(m)
    y, z = np.empty(n), np.empty(n)
    values = np.empty(k + 1)
    work = np.empty((k + 2, 2 * max(m, n) + 2))
    others = 1 if secondary.shape[0] > 0 else 0
    for start in range(0, N, _CHUNK):
        stop = min(start + _CHUNK, N)
        jacobians(
            q[start:stop], chain, path, tool_rotation, tool_position, reference, J[: stop - start]
        )
        for i in range(start, stop):
            c = i - start
            size = 0.0
            for r in range(6):
                for j in range(n):
                    size += (row_scale[r] * J[c, r, j] * column_scale[j]) ** 2
            for r in range(m):
                row = asked[r]
                b[r] = row_scale[row] * twist[i, row]
                for j in range(n):
                    A[r, j] = row_scale[row] * J[c, row, j] * column_scale[j]
            if others:
                for j in range(n):
                    z[j] = secondary[i, j] / column_scale[j]
            codes[i, 1], out[i, n + 18 + k], codes[i, 0] = solve_row(
                A, m, n, b, sqrt(size), kind, threshold, largest, speed, others, z, work, values,
                y, part,
            )  # fmt: skip
            for j in range(n):
                out[i, j] = column_scale[j] * y[j]
            for j in range(k):
                out[i, n + 18 + j] = values[j]
            for r in range(18):
                out[i, n + r] = 0.0
            for r in range(m):
                row = asked[r]
                total = 0.0
                for j in range(n):
                    total += J[c, row, j] * out[i, j]
                out[i, n + row] = total
                out[i, n + 6 + row] = twist[i, row] - total
                out[i, n + 12 + row] = part[r] / row_scale[row]


@compiled(NOTHING(STACK, MATRIX, VECTOR, VECTOR, *_METHOD, OUT2, _CODES))
def inverse_of_rows(
    J: Floats,
    rate: Floats,
    size: Floats,
    column_scale: Floats,
    kind: int,
    threshold: float,
    largest: float,
    speed: float,
    out: Floats,
    codes: Ints,
) -> None:
    """The same for given rows ``J v = rate``, which are comparable already.

    Shapes: J (N, m, n), rate (N, m), size (N,) -> out (N, n + m + k + 1): velocities, reachable
    rate, singular values, damping; codes (N, 2).
    """
    N, m, n = J.shape
    k = min(m, n)
    A, b, part = np.empty((m, n)), np.empty(m), np.empty(m)
    y, z = np.empty(n), np.empty(n)
    values = np.empty(k + 1)
    work = np.empty((k + 2, 2 * max(m, n) + 2))
    for i in range(N):
        for r in range(m):
            b[r] = rate[i, r]
            for j in range(n):
                A[r, j] = J[i, r, j] * column_scale[j]
        codes[i, 1], out[i, n + m + k], codes[i, 0] = solve_row(
            A, m, n, b, size[i], kind, threshold, largest, speed, 0, z, work, values, y, part
        )
        for j in range(n):
            out[i, j] = column_scale[j] * y[j]
        for r in range(m):
            out[i, n + r] = part[r]
        for j in range(k):
            out[i, n + m + j] = values[j]
