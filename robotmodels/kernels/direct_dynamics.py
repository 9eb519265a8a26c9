"""Joint accelerations from torques: M a = tau - h(q, v).

M. Walker and D. Orin 1982: h by Newton-Euler without acceleration, M by composite bodies. The
system is solved by Cholesky; M need not be positive definite for parameters that are not
physical: it is then solved by elimination with row pivoting, and the sample is told.
"""

from math import sqrt

import numpy as np

from ._compile import CHAIN, INT, MATRIX, OUT2, VECTOR, Floats, Ints, compiled
from .mass_matrix import mass_matrices
from .newton_euler import joint_torques

__all__ = ["joint_accelerations"]

BLOCK = 64
POSITIVE, INDEFINITE, SINGULAR = 0, 1, 2  # what a symmetric matrix is
EPSILON = float(np.finfo(np.float64).eps)


@compiled()
def solve_definite(A: Floats, b: Floats, i: int, diagonal: Floats) -> int:
    """Solve ``A[i] x = b[i]`` into b[i] by Cholesky: POSITIVE; else SINGULAR or INDEFINITE.

    A[i] has unit diagonal, kept in ``diagonal`` (n,); its lower half is overwritten. A zero pivot
    with a non-zero rest of its column means INDEFINITE.
    """
    n = A.shape[1]
    least = 4.0 * n * EPSILON
    for k in range(n):
        diagonal[k] = A[i, k, k]
    kind = POSITIVE
    for k in range(n):
        pivot = A[i, k, k]
        for column in range(k):
            pivot -= A[i, k, column] * A[i, k, column]
        for row in range(k + 1, n):
            rest = A[i, k, row]
            for column in range(k):
                rest -= A[i, row, column] * A[i, k, column]
            A[i, row, k] = rest
        if not pivot > least:
            kind = INDEFINITE if pivot < -least else SINGULAR
            for row in range(k + 1, n):
                if A[i, row, k] * A[i, row, k] > 4.0 * least:
                    kind = INDEFINITE
            break
        A[i, k, k] = sqrt(pivot)
        for row in range(k + 1, n):
            A[i, row, k] /= A[i, k, k]
    if kind != POSITIVE:
        for row in range(n):
            A[i, row, row] = diagonal[row]
            for column in range(row):
                A[i, row, column] = A[i, column, row]
        return kind
    for row in range(n):
        rest = b[i, row]
        for column in range(row):
            rest -= A[i, row, column] * b[i, column]
        b[i, row] = rest / A[i, row, row]
    for row in range(n - 1, -1, -1):
        rest = b[i, row]
        for column in range(row + 1, n):
            rest -= A[i, column, row] * b[i, column]
        b[i, row] = rest / A[i, row, row]
    return POSITIVE


@compiled()
def solve_in_place(A: Floats, b: Floats, i: int, sizes: Floats, diagonal: Floats) -> int:
    """Solve ``A[i] x = b[i]`` into b[i], spoiling A[i], which is POSITIVE or INDEFINITE.

    Not if it is SINGULAR to rounding. ``sizes`` and ``diagonal`` (n,) are scratch.
    """
    n = A.shape[1]
    # Coordinates of unit diagonal (of the row's size where that is zero), so that the units and
    # sizes of the bodies do not decide what is singular
    for row in range(n):
        sizes[row] = abs(A[i, row, row])
        if not sizes[row] > 0.0:
            for column in range(n):
                sizes[row] = max(sizes[row], abs(A[i, row, column]))
        if not sizes[row] > 0.0:
            return SINGULAR
        sizes[row] = sqrt(sizes[row])
    for row in range(n):
        for column in range(n):
            A[i, row, column] /= sizes[row] * sizes[column]
        b[i, row] /= sizes[row]
    kind = solve_definite(A, b, i, diagonal)
    if kind == SINGULAR:
        return SINGULAR
    if kind == INDEFINITE and not eliminate(A, b, i):
        return SINGULAR
    for row in range(n):
        b[i, row] /= sizes[row]
    return kind


@compiled()
def eliminate(A: Floats, b: Floats, i: int) -> bool:
    """Solve ``A[i] x = b[i]`` into b[i] by pivoting rows; False if A[i] is singular to rounding."""
    n = A.shape[1]
    for row in range(n):
        scale = 0.0
        for column in range(n):
            scale = max(scale, abs(A[i, row, column]))
        if not scale > 0.0:
            return False
        # Rows of unit size, so that rows of different units compare
        for column in range(n):
            A[i, row, column] /= scale
        b[i, row] /= scale
    for k in range(n):
        pivot = k
        largest = abs(A[i, k, k])
        for row in range(k + 1, n):
            if abs(A[i, row, k]) > largest:
                pivot, largest = row, abs(A[i, row, k])
        if not largest > 4.0 * n * EPSILON:
            return False
        if pivot != k:
            for column in range(k, n):
                A[i, k, column], A[i, pivot, column] = A[i, pivot, column], A[i, k, column]
            b[i, k], b[i, pivot] = b[i, pivot], b[i, k]
        for row in range(k + 1, n):
            factor = A[i, row, k] / A[i, k, k]
            for column in range(k + 1, n):
                A[i, row, column] -= factor * A[i, k, column]
            b[i, row] -= factor * b[i, k]
    for row in range(n - 1, -1, -1):
        rest = b[i, row]
        for column in range(row + 1, n):
            rest -= A[i, row, column] * b[i, column]
        b[i, row] = rest / A[i, row, row]
    return True


@compiled(INT(MATRIX, MATRIX, MATRIX, *CHAIN, MATRIX, VECTOR, MATRIX, OUT2))
def joint_accelerations(
    q: Floats,
    v: Floats,
    tau: Floats,
    antecedent: Ints,
    sigma: Ints,
    joint: Ints,
    rotation: Floats,
    position: Floats,
    base_rotation: Floats,
    base_position: Floats,
    pi: Floats,
    gravity: Floats,
    rotor: Floats,
    out: Floats,
) -> int:
    """Accelerations of the joints under given torques.

    Shapes: q, v, tau (N, n); pi (f, 10); gravity (3,); rotor (n, n) -> out (N, n).
    """
    samples, n = q.shape
    block = min(samples, BLOCK)
    h = np.empty((block, n))
    M = np.empty((block, n, n))
    still = np.zeros((block, n))
    sizes = np.empty(n)
    diagonal = np.empty(n)
    singular = -1
    indefinite = -1
    for start in range(0, samples, BLOCK):
        stop = min(start + BLOCK, samples)
        size = stop - start
        joint_torques(
            q[start:stop],
            v[start:stop],
            still[:size],
            antecedent,
            sigma,
            joint,
            rotation,
            position,
            base_rotation,
            base_position,
            pi,
            gravity,
            h[:size],
        )
        mass_matrices(
            q[start:stop],
            antecedent,
            sigma,
            joint,
            rotation,
            position,
            base_rotation,
            base_position,
            pi,
            M[:size],
        )
        for i in range(size):
            for row in range(n):
                h[i, row] = tau[start + i, row] - h[i, row]
                for column in range(n):
                    M[i, row, column] += rotor[row, column]
            kind = solve_in_place(M, h, i, sizes, diagonal)
            if kind == SINGULAR and singular < 0:
                singular = start + i
            if kind == INDEFINITE and indefinite < 0:
                indefinite = start + i
            for row in range(n):
                out[start + i, row] = np.nan if kind == SINGULAR else h[i, row]
    if singular < 0 and indefinite >= 0:
        return -2 - indefinite
    return singular
