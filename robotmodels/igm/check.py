"""The shared tail of the families: candidates of a chain become checked postures."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from .loop import JointChain
from .solver import Found, Tolerances, nothing_found

STEPS = 12  # Gauss-Newton steps for a candidate
CHUNK = 4096


def checked(
    chain: JointChain,
    U: Array,
    candidates: Array,
    there: NDArray[np.bool_],
    tolerances: Tolerances,
    free: NDArray[np.bool_] | None = None,
    double: NDArray[np.bool_] | None = None,
    most: int | None = None,
    rough: float = 1e-2,
) -> Found:
    """Improve candidates on the chain itself, keep those that meet their pose, merge equal ones.

    Shapes: U (N, 4, 4); candidates, free (N, C, k); there, double (N, C).
    """
    from ._check import checked_postures

    N, C, k = candidates.shape
    S = C if most is None else most
    out = nothing_found(N, S, k)
    sigma = np.ascontiguousarray(chain.sigma)
    limits = np.array([tolerances.position, tolerances.orientation])
    source = np.zeros((N, S), np.int64)
    held = np.zeros((N, C, k), np.int64) if free is None else free.astype(np.int64)
    for start in range(0, N, CHUNK):
        rows = slice(start, start + CHUNK)
        checked_postures(
            np.ascontiguousarray(U[rows]), sigma, chain.D,
            np.ascontiguousarray(candidates[rows]), np.ascontiguousarray(there[rows]), held[rows],
            limits, STEPS, rough, out.q[rows], out.valid[rows], out.residual[rows],
            out.double[rows], source[rows],
        )  # fmt: skip
    pick = np.arange(N)[:, None]
    if double is not None:
        out.double[...] = double[pick, source] & out.valid
    if free is not None:
        out.free[...] = free[pick, source] & out.valid[..., None]
        out.family[...] = out.free.any(axis=-1)
    return out
