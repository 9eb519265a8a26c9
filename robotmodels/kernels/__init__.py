"""Compiled recursions on plain arrays, in the order of the table.

This floor knows no robot object: a kernel takes the arrays of a `Chain`, one sample per row of
``q (N, n)``, and writes into an array that its caller allocated. Kernels release the GIL, run on
one thread and check nothing: shapes, types and finiteness are the caller's to guarantee
(C-contiguous float64 and int64).

Importing this package costs nothing; importing one of its modules imports numba and, the first
time on a machine, compiles that module's kernels. Later processes load them from numba's cache.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["Chain"]


class Chain(NamedTuple):
    """The arrays every kernel takes: a Khalil-Kleinfinger table with its constants multiplied out.

    Frames are numbered 1..f and stored at index number - 1; 0 is the base frame R_0. The motion
    of a joint commutes with the last two factors of its row, so ``T(a(j), j) = C_j Motion(q_j)``
    with a constant ``C_j``. Unpack it into a call: ``tip_poses(q, *chain, path, ...)``.

    Attributes
    ----------
    antecedent : (f,) int64
        Number of the frame each frame is attached to, smaller than its own; 0 is the base.
    sigma : (f,) int64
        0 revolute, 1 prismatic, 2 fixed.
    joint : (f,) int64
        Column of the frame's joint in q, -1 for a fixed frame.
    rotation : (f, 3, 3)
        Rotation of ``C_j``.
    position : (f, 3)
        Position of ``C_j`` [m].
    base_rotation : (3, 3)
        Rotation of R_0 in the world.
    base_position : (3,)
        Position of R_0 in the world [m].
    """

    antecedent: NDArray[np.int64]
    sigma: NDArray[np.int64]
    joint: NDArray[np.int64]
    rotation: NDArray[np.float64]
    position: NDArray[np.float64]
    base_rotation: NDArray[np.float64]
    base_position: NDArray[np.float64]
