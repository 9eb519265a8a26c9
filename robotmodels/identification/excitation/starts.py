"""Random motions that keep the limits, and the way back to them."""

from __future__ import annotations

import numpy as np

from ..._arrays import Array
from ...dynamics import idm
from .boxes import clearances
from .kept import limits_kept
from .problem import ExcitationProblem

_POSTURES = 400  # looked at for one that the boxes and torques allow
_FACTORS = (
    1.0, 0.9998, 0.9995, 0.999, 0.998, 0.995, 0.99, 0.98, 0.95, 0.9, 0.8, 0.65, 0.5, 0.35, 0.2,
    0.1, 0.05,
)  # fmt: skip


def random_motion(problem: ExcitationProblem, rng: np.random.Generator) -> Array:
    """Random motion within each joint's own limits. Shapes: -> (P, n)."""
    low, high, half = problem.bounds[0]
    middle = _middle(problem, 0.5 * (low + high), half, rng)
    X = problem.units * rng.standard_normal(problem.units.shape)
    X -= problem.basis.centred(_means(problem, X))
    reach = np.full(problem.model.n, np.inf)
    for order, (B, (low, high, _)) in enumerate(zip(problem.functions, problem.bounds,
                                                    strict=True)):  # fmt: skip
        y, offset = B @ X, middle if order == 0 else 0.0
        with np.errstate(divide="ignore"):
            most = np.where(y.max(axis=0) > 0.0, (high - offset) / y.max(axis=0), np.inf)
            least = np.where(y.min(axis=0) < 0.0, (low - offset) / y.min(axis=0), np.inf)
        reach = np.minimum(reach, np.minimum(most, least))
    X = X * reach + problem.basis.centred(middle)
    shrunk = within_limits(problem, X)
    return X if shrunk is None else shrunk


def within_limits(problem: ExcitationProblem, X: Array) -> Array | None:
    """Motion scaled about its mean to keep the limits. Shapes: X (P, n) -> (P, n)."""
    still = problem.basis.centred(_means(problem, X))

    def kept(k: int) -> bool:
        less = still + _FACTORS[k] * (X - still)
        return limits_kept(problem, problem.basis.trajectory(less)).kept

    # bisection: broken keeps no limits, good is the largest factor that was seen to
    broken, good = -1, len(_FACTORS)
    k = 0  # the whole motion first, then in the middle
    while good - broken > 1:
        if kept(k):
            good = k
        else:
            broken = k
        k = (broken + good) // 2
    return None if good == len(_FACTORS) else still + _FACTORS[good] * (X - still)


def _means(problem: ExcitationProblem, X: Array) -> Array:
    """Mean posture of a motion."""
    return (problem.functions[0] @ X).mean(axis=0)


def _middle(
    problem: ExcitationProblem, centre: Array, half: Array, rng: np.random.Generator
) -> Array:
    """A posture about the middle of the ranges that boxes and torques allow, if there is one."""
    drawn = centre + 0.3 * half * rng.uniform(-1.0, 1.0, (_POSTURES, centre.size))
    drawn[_POSTURES // 4 :] = centre + 0.95 * half * rng.uniform(
        -1.0, 1.0, (_POSTURES - _POSTURES // 4, centre.size)
    )
    excess = np.zeros(_POSTURES)
    if problem.values.any():
        still = np.zeros(drawn.shape)
        torque = np.abs(idm(problem.model, drawn, still, still, drive=False))
        excess += np.maximum(torque / problem.torque_limits - 0.8, 0.0).sum(axis=1)
    for box in problem.boxes:
        excess += np.maximum(0.02 - clearances(problem.model, box, drawn), 0.0).sum(axis=1)
    return drawn[int(excess.argmin())]
