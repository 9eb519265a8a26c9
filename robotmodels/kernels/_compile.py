"""How this package compiles, and the types of its kernels' arguments.

Inputs are declared read-only: numba then takes frozen and writable arrays alike with one
compilation, where it would otherwise compile a kernel again for every mixture of the two.
"""

from typing import Any

import numpy as np
from numba import njit, types
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def _input(dtype: types.Type, ndim: int) -> types.Array:
    return types.Array(dtype, ndim, "C", readonly=True)


def _output(ndim: int) -> types.Array:
    return types.Array(types.float64, ndim, "C")


INT = types.int64
NOTHING = types.void
INTS = _input(types.int64, 1)
VECTOR = _input(types.float64, 1)
MATRIX = _input(types.float64, 2)
STACK = _input(types.float64, 3)
CHAIN = (INTS, INTS, INTS, STACK, MATRIX, MATRIX, VECTOR)
OUT1, OUT2, OUT3, OUT4 = (_output(ndim) for ndim in range(1, 5))


def compiled(*signature: Any) -> Any:
    """Return the decorator that compiles a function: cached on disk, without the GIL, exact sums.

    With a signature: a kernel, compiled at import. Without: an inner function for kernels only.
    Typed as Any because type checkers cannot count the arguments of ``kernel(q, *chain, ...)``.
    """
    options: dict[str, Any] = {
        "cache": True,
        "nogil": True,
        "fastmath": False,
        "error_model": "numpy",
        "no_cpython_wrapper": not signature,
        "no_cfunc_wrapper": True,
    }
    return njit(*signature, **options)
