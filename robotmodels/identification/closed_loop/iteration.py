"""Iterations that end when the parameters stand still, or the simulated robot runs away."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

import numpy as np

from ..._arrays import Array
from ..estimate import EstimateStatus
from .simulated import RanAwayError

STILL = 1e-3
"""Parts of its deviation by which a parameter may still move."""
ROUNDING = 1e-11
"""Parts of the torque that a parameter's last move may still change."""
_HALVINGS = 8


class Step(Protocol):
    """What one simulation with given parameters tells."""

    @property
    def values(self) -> Array:
        """The parameters that follow from it, shape (b,)."""
        ...

    @property
    def deviations(self) -> Array:
        """Their standard deviations, shape (b,)."""
        ...

    @property
    def cost(self) -> float:
        """What the given parameters cost, not to grow; 0 where nothing is minimised."""
        ...


S = TypeVar("S", bound=Step)


@dataclass(frozen=True, slots=True, eq=False)
class Iterated(Generic[S]):
    """How an iteration ended.

    Parameters
    ----------
    values : ndarray, shape (b,)
        Parameters.
    last : Step or None
        The last simulation; None where there was none that did not run away.
    status : EstimateStatus
        What became of it.
    iterations : int
        Simulations of the robot, those that were halved not counted.
    """

    values: Array
    last: S | None
    status: EstimateStatus
    iterations: int


def iterated(
    start: Array, advance: Callable[[Array], S], size: Array, most: int, slack: float = 0.0
) -> Iterated[S]:
    """Simulate and solve until the parameters stand still.

    A step after which the simulated robot runs away, or the cost grows, is halved.

    Parameters
    ----------
    start : ndarray, shape (b,)
        Parameters to begin with.
    advance : callable
        The `Step` of a simulation with given parameters; raises `RanAwayError`.
    size : ndarray, shape (b,)
        Value of each parameter whose torque alone would be as large as that measured.
    most : int
        Iterations.
    slack : float
        By which the cost may grow.

    Returns
    -------
    Iterated
        Values and status.
    """
    values = start
    try:
        step = advance(values)
    except RanAwayError:
        return Iterated(start, None, EstimateStatus.UNSTABLE, 0)
    for count in range(1, most + 1):
        move = step.values - values
        if not np.isfinite(move).all():
            return Iterated(values, step, EstimateStatus.UNSTABLE, count)
        if (np.abs(move) <= STILL * step.deviations + ROUNDING * size).all():
            return Iterated(step.values, step, EstimateStatus.SOLVED, count)
        if count == most:
            break
        share, following, away = 1.0, None, False
        for _ in range(_HALVINGS):
            try:
                tried = advance(values + share * move)
            except RanAwayError:
                away = True
            else:
                if tried.cost <= step.cost + slack:
                    following = tried
                    break
            share /= 2.0
        if following is None:
            bad = EstimateStatus.UNSTABLE if away else EstimateStatus.NOT_CONVERGED
            return Iterated(values, step, bad, count)
        values, step = values + share * move, following
    return Iterated(values, step, EstimateStatus.NOT_CONVERGED, most)
