"""Compiled: points of the section of an arm of three joints, and the determinant there.

Joint variables of a section are those of the last two joints; the first is at zero, and the chain
starts in its frame, so that a turn or slide of it leaves the section as it is.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from ..igm.kernels.pieper import advance, triple
from ..kernels._compile import INTS, MATRIX, NOTHING, OUT2, STACK, Floats, Ints, compiled

VALUES = 9  # of a point of the section, see `section_values`


@compiled(counted=False)
def section_point(
    kinds: Ints, D: Floats, a: float, b: float, T: Floats, J: Floats, H: Floats
) -> tuple[float, float, float]:
    """Jacobian of the point and its determinant, with the derivatives by the last two joints.

    Shapes: D (4, 4, 4) -> T (4, 3, 4), J, H (3, 3).
    """
    for i in range(3):
        for j in range(4):
            T[0, i, j] = D[0, i, j]
    for k in range(3):
        x = 0.0 if k == 0 else (a if k == 1 else b)
        advance(T[k], kinds[k] == 0, x, D[k + 1], T[k + 1])
    for k in range(3):
        for i in range(3):
            j, m = (i + 1) % 3, (i + 2) % 3
            J[i, k] = T[k, i, 2]
            if kinds[k] == 0:
                J[i, k] = T[k, j, 2] * (T[3, m, 3] - T[k, m, 3])
                J[i, k] -= T[k, m, 2] * (T[3, j, 3] - T[k, j, 3])
    slope_a, slope_b = 0.0, 0.0
    for by in range(1, 3):
        # the derivative of a column by a joint: the axis of the one nearer the base times the other
        for k in range(3):
            near, far = (by, k) if by < k else (k, by)
            for i in range(3):
                j, m = (i + 1) % 3, (i + 2) % 3
                H[i, k] = 0.0
                if kinds[near] == 0:
                    H[i, k] = T[near, j, 2] * J[m, far] - T[near, m, 2] * J[j, far]
        slope = triple(H, 0, J, 1, J, 2) + triple(J, 0, H, 1, J, 2) + triple(J, 0, J, 1, H, 2)
        if by == 1:
            slope_a = slope
        else:
            slope_b = slope
    return triple(J, 0, J, 1, J, 2), slope_a, slope_b


@compiled(NOTHING(INTS, STACK, MATRIX, OUT2))
def section_values(kinds: Ints, D: Floats, x: Floats, out: Floats) -> None:
    """Section coordinates, their derivatives, and the determinant. Shapes: x (N, 2) -> (N, 9).

    Columns: u, v; du/da, du/db, dv/da, dv/db; determinant and its derivatives by a and b.
    """
    T, J, H = np.empty((4, 3, 4)), np.empty((3, 3)), np.empty((3, 3))
    for n in range(x.shape[0]):
        det, slope_a, slope_b = section_point(kinds, D, x[n, 0], x[n, 1], T, J, H)
        px, py = T[3, 0, 3], T[3, 1, 3]
        if kinds[0] == 0:  # distance from the first axis, and height along it
            r = sqrt(px * px + py * py)
            out[n, 0], out[n, 1] = r, T[3, 2, 3]
            for k in range(2):
                out[n, 2 + k] = (px * J[0, k + 1] + py * J[1, k + 1]) / r if r > 0.0 else 0.0
                out[n, 4 + k] = J[2, k + 1]
        else:  # across the first axis
            out[n, 0], out[n, 1] = px, py
            for k in range(2):
                out[n, 2 + k], out[n, 4 + k] = J[0, k + 1], J[1, k + 1]
        out[n, 6], out[n, 7], out[n, 8] = det, slope_a, slope_b
