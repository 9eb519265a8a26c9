"""Which joints of a redundant arm take their reference."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations, islice

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array
from ..arm_angle import prepare_arm_angle
from ..loop import JointChain
from ..motion import jacobians
from ..solver import Prepare, Solver
from .arm import Redundant
from .locked_arms import LockedArms, at_an_end

TRIALS = 40
"""Choices of joints that are tried when an arm is prepared."""
_MOVES = 1e-6  # part of a null space below which a joint stands still


def prepare_redundant(
    chain: JointChain, prepare: Prepare, lockable: Sequence[int] | None = None
) -> Solver | None:
    """Prepare a redundant arm: choose the joints set to `q_ref`, and a solver of the others."""
    if chain.k <= 6:
        return None
    real = np.flatnonzero(chain.columns >= 0) if lockable is None else np.unique(lockable)
    if real.size == chain.k == 7:
        angle = prepare_arm_angle(chain)
        if angle is not None:
            return angle
    order, dimension = _moving_in_order(chain, real)
    if len(order) < dimension:
        return None
    arms = LockedArms(chain, prepare)
    # a value that is special for no arm: at 0 axes may be aligned that are not elsewhere
    typical = tuple(0.5 + 0.1 * i for i in range(dimension))
    # joints that swing far along the family first: an elbow hardly moves
    swing = _swings(chain)
    choices = sorted(
        islice(combinations(real.tolist(), dimension), TRIALS),
        key=lambda joints: -min(swing[list(joints)]),
    )
    for sampled in (order, *choices):
        inner = arms.solver(sampled, () if at_an_end(sampled, chain.k) else typical)
        if inner is not None:
            last = tuple(real[-dimension:].tolist())
            if last == sampled or arms.solver(last, typical) is None:
                last = ()
            return Redundant(chain, order, sampled, last, inner.method, arms)
    return None


def _moving_in_order(chain: JointChain, real: NDArray[np.int64]) -> tuple[tuple[int, ...], int]:
    """Joints that move along the family, each given those before; dimension of the family."""
    rng = np.random.default_rng(0)
    J = jacobians(chain, rng.uniform(-2.0, 2.0, (7, chain.k)))
    rank = int(np.median(np.linalg.matrix_rank(J, tol=_MOVES)))
    dimension = chain.k - rank
    kept, order = np.ones(chain.k, np.bool_), []
    for j in real.tolist():
        if len(order) == dimension:
            break
        # the joint moves if its column depends on those that are left
        kept[j] = False
        others = int(np.median(np.linalg.matrix_rank(J[:, :, kept], tol=_MOVES)))
        if others == rank:
            order.append(j)
        else:
            kept[j] = True
    return tuple(order), dimension


def _swings(chain: JointChain) -> Array:
    """How much joints move along the family, on average over random postures, shape (k,)."""
    rng = np.random.default_rng(1)
    J = jacobians(chain, rng.uniform(-2.0, 2.0, (40, chain.k)))
    along = np.linalg.svd(J)[2][:, 6:]
    return np.linalg.norm(along, axis=1).mean(axis=0)
