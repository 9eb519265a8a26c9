"""Three turning joints that reach an orientation: ``Rz(a) A Rz(b) B Rz(c) = M``."""

from __future__ import annotations

from math import atan2, cos, sin

import numpy as np

from ..kernels._compile import Floats, Ints, compiled
from ._equations import ANY, DOUBLE, NONE, type_2

# sine between axes below which they count as aligned: any first angle is then good to 1e-12
ALIGNED = 4e-13


@compiled()
def wrist_postures(
    A: Floats,
    B: Floats,
    M: Floats,
    slack: float,
    reference: Floats,
    x: Floats,
    free: Ints,
) -> int:
    """The (at most two) ``x (m, 3)`` with ``Rz(x_0) A Rz(x_1) B Rz(x_2) = M``. Returns how many.

    The first angle comes from the last axis, the others by substitution, so that any first angle is
    exact where it is free (``free[i] = 1``, value from ``reference``): first and last axis aligned.
    """
    m0, m1, m2 = M[0, 2], M[1, 2], M[2, 2]
    n0, n1, n2 = B[0, 2], B[1, 2], B[2, 2]
    X = A[0, 2] * m1 - A[1, 2] * m0
    Y = A[0, 2] * m0 + A[1, 2] * m1
    kind, first, second = type_2(X, Y, n2 - A[2, 2] * m2, max(slack, 1e-9), ALIGNED)
    if kind == NONE:
        return 0
    count = 1 if kind in (ANY, DOUBLE) else 2
    R = np.empty((3, 3))
    S = np.empty((3, 3))
    for i in range(count):
        a = reference[0] if kind == ANY else (first if i == 0 else second)
        free[i] = 1 if kind == ANY else 0
        c, s = cos(a), sin(a)
        # R = A^T Rz(-a) M, whose last column is Rz(b) n
        for j in range(3):
            u, v = c * M[0, j] + s * M[1, j], c * M[1, j] - s * M[0, j]
            for r in range(3):
                R[r, j] = A[0, r] * u + A[1, r] * v + A[2, r] * M[2, j]
        b = atan2(R[1, 2], R[0, 2]) - atan2(n1, n0)
        c, s = cos(b), sin(b)
        # S = B^T Rz(-b) R = Rz(c): its first column is enough
        u, v = c * R[0, 0] + s * R[1, 0], c * R[1, 0] - s * R[0, 0]
        S[0, 0] = B[0, 0] * u + B[1, 0] * v + B[2, 0] * R[2, 0]
        S[1, 0] = B[0, 1] * u + B[1, 1] * v + B[2, 1] * R[2, 0]
        x[i, 0], x[i, 1], x[i, 2] = a, b, atan2(S[1, 0], S[0, 0])
    return count
