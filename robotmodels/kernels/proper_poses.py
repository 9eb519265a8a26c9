"""Whether poses are proper ones: the check of a border that many poses pass."""

from __future__ import annotations

import numpy as np

from ._compile import INT, STACK, Floats, compiled


@compiled(INT(STACK))
def improper_pose(T: Floats) -> int:
    """Index of the first pose that is not a rotation and a translation to rounding; -1 if none.

    ``T`` has shape (N, 4, 4). Rounding is 4e-15 on every element of ``R R^T - 1``.
    """
    for n in range(T.shape[0]):
        if T[n, 3, 0] != 0.0 or T[n, 3, 1] != 0.0 or T[n, 3, 2] != 0.0 or T[n, 3, 3] != 1.0:
            return n
        for i in range(3):
            if not np.isfinite(T[n, i, 3]):
                return n
            for j in range(i, 3):
                off = -1.0 if i == j else 0.0
                for k in range(3):
                    off += T[n, i, k] * T[n, j, k]
                # also False for NaN
                if not abs(off) <= 4e-15:
                    return n
        det = (
            T[n, 0, 0] * (T[n, 1, 1] * T[n, 2, 2] - T[n, 1, 2] * T[n, 2, 1])
            - T[n, 0, 1] * (T[n, 1, 0] * T[n, 2, 2] - T[n, 1, 2] * T[n, 2, 0])
            + T[n, 0, 2] * (T[n, 1, 0] * T[n, 2, 1] - T[n, 1, 1] * T[n, 2, 0])
        )
        if det < 0.0:
            return n
    return -1
