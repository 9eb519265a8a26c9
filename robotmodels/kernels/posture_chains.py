"""Which posture of the next pose goes on from each posture of a pose."""

import numpy as np
from numba import types
from numpy.typing import NDArray

from ._compile import NOTHING, STACK, Floats, Ints, compiled

__all__ = ["following_postures"]

_FLAGS = types.Array(types.boolean, 2, "C", readonly=True)
_FLAG_ROW = types.Array(types.boolean, 1, "C", readonly=True)
_NUMBERS = types.Array(types.int64, 2, "C")


@compiled(NOTHING(STACK, _FLAGS, _FLAG_ROW, types.float64, _NUMBERS))
def following_postures(
    q: Floats, valid: NDArray[np.bool_], periodic: NDArray[np.bool_], near: float, out: Ints
) -> None:
    """For each posture, the number of the posture of the next pose that continues it.

    Shapes: q (M, S, n), valid (M, S), periodic (n,) -> out (M - 1, S).
    """
    M, S, n = q.shape
    turn = 2.0 * np.pi
    for k in range(M - 1):
        alike = True
        for s in range(S):
            out[k, s] = s
            if not valid[k, s]:
                continue
            for j in range(n):
                way = abs(q[k + 1, s, j] - q[k, s, j])
                if periodic[j]:
                    way = min(way, abs(turn - way))
                # also False for NaN, where the next pose lacks this posture
                if not way < near:
                    alike = False
        if alike:
            continue
        for s in range(S):
            if not valid[k, s]:
                continue
            best = np.inf
            for r in range(S):
                if not valid[k + 1, r]:
                    continue
                distance = 0.0
                for j in range(n):
                    way = q[k + 1, r, j] - q[k, s, j]
                    if periodic[j]:
                        half = np.sin(0.5 * way)
                        distance += 4.0 * half * half
                    else:
                        distance += way * way
                if distance < best:
                    best = distance
                    out[k, s] = r
