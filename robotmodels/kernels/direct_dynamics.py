"""Joint accelerations from torques: M a = tau - h(q, v).

M. Walker and D. Orin 1982: h by Newton-Euler without acceleration, M by composite bodies. The
system is solved by elimination with row pivoting, because M need not be positive definite for
parameters that are not physical.
"""

from math import sqrt

import numpy as np

from ._compile import CHAIN, INT, MATRIX, OUT2, VECTOR, Floats, Ints, compiled
from .mass_matrix import mass_matrices
from .newton_euler import joint_torques

__all__ = ["joint_accelerations"]

BLOCK = 64
EPSILON = float(np.finfo(np.float64).eps)


@compiled()
def solve_in_place(A: Floats, b: Floats, i: int, sizes: Floats) -> bool:
    """Solve ``A[i] x = b[i]`` into b[i], spoiling A[i]; False if A[i] is singular to rounding.

    ``sizes`` (n,) is scratch.
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
            return False
        sizes[row] = sqrt(sizes[row])
    for row in range(n):
        for column in range(n):
            A[i, row, column] /= sizes[row] * sizes[column]
        b[i, row] /= sizes[row]
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
    for row in range(n):
        b[i, row] /= sizes[row]
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

    Parameters
    ----------
    q, v, tau : (N, n)
        Joint positions, velocities and torques on the links [rad or m, per s, N m or N].
    antecedent, ..., base_position
        The `Chain`.
    pi : (f, 10)
        XX XY XZ YY YZ ZZ MX MY MZ M of each link in its frame, any real values.
    gravity : (3,)
        Acceleration of gravity in the world [m/s^2].
    rotor : (n, n)
        Added to the mass matrix [kg m^2 or kg].
    out : (N, n)
        Written: accelerations [rad/s^2 or m/s^2]; NaN in the rows of singular samples.

    Returns
    -------
    int
        -1, or the index of the first sample whose matrix is singular to rounding.
    """
    samples, n = q.shape
    block = min(samples, BLOCK)
    h = np.empty((block, n))
    M = np.empty((block, n, n))
    still = np.zeros((block, n))
    sizes = np.empty(n)
    singular = -1
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
            solved = solve_in_place(M, h, i, sizes)
            if not solved and singular < 0:
                singular = start + i
            for row in range(n):
                out[start + i, row] = h[i, row] if solved else np.nan
    return singular
