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

    Parameters
    ----------
    chain : JointChain
        Any number of joints.
    U : ndarray, shape (N, 4, 4)
        Poses of the tool in R_0 [m].
    candidates : ndarray, shape (N, C, k)
        Guesses, rad or m.
    there : ndarray of bool, shape (N, C)
        Rows that hold one.
    tolerances : Tolerances
        When a pose counts as met. Improving goes on below them, as far as rounding allows.
    free : ndarray of bool, shape (N, C, k), optional
        Joints that took a reference: improving leaves them where they are.
    double : ndarray of bool, shape (N, C), optional
        Candidates that are double roots. Without it those are marked that fell together here.
    most : int, optional
        Rows to give back for each pose; default C.
    rough : float
        Candidates that miss by more (m or rad) are not improved.

    Returns
    -------
    Found
        Packed. Fewer than six joints end at the posture that is nearest to the pose, in units of
        the tolerances.

    Examples
    --------
    >>> from robotmodels.igm.loop import joint_chain
    >>> from robotmodels.kinematics import dgm
    >>> from robotmodels.robots import load
    >>> arm, q = load("lab_trr"), np.array([[[0.1, 0.2, 0.3]]])
    >>> found = checked(joint_chain(arm), dgm(arm, q[0]), q + 1e-4, np.ones((1, 1), bool),
    ...                 Tolerances())
    >>> found.q[0, 0].round(9)
    array([0.1, 0.2, 0.3])
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
