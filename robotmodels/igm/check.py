"""Candidates of any solver become postures: refined and checked on the chain itself."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from .loop import JointChain
from .postures import Postures, no_postures
from .solver import Tolerances

EXACT = 2e-13
"""Error below which nothing is refined [m, rad]."""
FINE = 2e-15
"""The same at singular positions, where postures beside each other are compared."""
CHUNK = 4096
"""Poses worked on at a time."""


def checked(
    chain: JointChain,
    U: Array,
    candidates: Array,
    there: NDArray[np.bool_],
    tolerances: Tolerances,
    free: NDArray[np.bool_] | None = None,
    double: NDArray[np.bool_] | None = None,
    moving: NDArray[np.bool_] | None = None,
    most: int | None = None,
    rough: float = 1e-2,
    singular: bool = False,
) -> Postures:
    """Refine candidates by Newton's method, keep those that meet their pose, merge equal ones.

    Shapes: U (N, 4, 4); candidates, free, moving (N, C, k); there, double (N, C). Free joints keep
    their value. ``singular``: see `kernels.newton.refined_postures`.
    """
    from .kernels.newton import refined_postures

    N, C, k = candidates.shape
    out = no_postures(N, C if most is None else most, k)
    sigma = np.ascontiguousarray(chain.sigma)
    limits, source = np.array(tolerances), np.zeros(out.valid.shape, np.int64)
    held = np.zeros((N, C), np.int64) if free is None else bits_of(free)
    for start in range(0, N, CHUNK):
        rows = slice(start, start + CHUNK)
        refined_postures(
            np.ascontiguousarray(U[rows]), sigma, chain.D, np.ascontiguousarray(candidates[rows]),
            np.ascontiguousarray(there[rows]), held[rows], limits, FINE if singular else EXACT,
            rough, int(singular), out.q[rows], out.valid[rows], out.residual[rows],
            out.double[rows], source[rows],
        )  # fmt: skip
    pick = np.arange(N)[:, None], source
    if double is not None:
        out.double[...] = double[pick] & out.valid
    if free is not None:
        out.free[...] = free[pick] & out.valid[..., None]
        out.moving[...] = (free if moving is None else moving)[pick] & out.valid[..., None]
        out.family[...] = out.free.any(axis=-1)
    return out


def bits_of(flags: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Flags of joints (..., k) as the bits of a number (...)."""
    return np.sum(flags.astype(np.int64) << np.arange(flags.shape[-1]), axis=-1)
