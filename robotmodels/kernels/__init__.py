"""Compiled recursions on plain arrays, in the order of the table.

Kernels use no robot objects: a kernel takes the arrays of a `Chain`, one sample per row of
``q (N, n)``, and writes into an array that its caller allocated. Kernels release the GIL, run on
one thread and check nothing: shapes, types and finiteness are the caller's to guarantee
(C-contiguous float64 and int64).

A kernel is compiled when it is first called, with the functions that it calls, and kept on the disk
for later processes (`_cache`); `prepare.compile_all` compiles everything in advance. Importing this
package does not import numba; importing one of its modules does.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["Chain"]


class Chain(NamedTuple):
    """The arrays every kernel takes: a Khalil-Kleinfinger table with its constants multiplied out.

    Shapes: antecedent, sigma, joint (f,); rotation (f, 3, 3); position (f, 3); base_rotation
    (3, 3); base_position (3,).
    """

    antecedent: NDArray[np.int64]
    sigma: NDArray[np.int64]
    joint: NDArray[np.int64]
    rotation: NDArray[np.float64]
    position: NDArray[np.float64]
    base_rotation: NDArray[np.float64]
    base_position: NDArray[np.float64]
