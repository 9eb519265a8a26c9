"""Iterations that end when the parameters stand still, or the simulated robot runs away."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

import numpy as np

from ..._arrays import Array
from ..methods.estimate import EstimateStatus
from .simulated import RanAwayError

STILL = 1e-3
"""Parts of its deviation by which a parameter may still move."""
ROUNDING = 1e-11
"""Parts of the torque that a parameter's last move may still change."""
_HALVINGS = 8
_WEIGHTINGS = 3
_ALIKE = 0.02
"""Part by which weights may still change."""


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

    @property
    def weights(self) -> Array:
        """Of each kind of equations, shape (m,)."""
        ...

    @property
    def next_weights(self) -> Array:
        """Those of the residuals that its parameters leave, shape (m,)."""
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
    start: Array,
    advance: Callable[[Array], S],
    size: Array,
    most: int,
    slack: float = 0.0,
    memory: int = 0,
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
    memory : int
        Steps before, which are mixed with the last one so that a fixed point is reached sooner
        where the simulated motion depends on the parameters.

    Returns
    -------
    Iterated
        Values and status.

    References
    ----------
    H. Walker and P. Ni, "Anderson acceleration for fixed-point iterations", SIAM J. Numerical
    Analysis 49(4), 2011.
    """
    values = start
    past: list[tuple[Array, Array]] = []
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
        past.append((values / size, move / size))
        del past[: -(memory + 1)]
        goals = [values + move / 2**k for k in range(_HALVINGS)]
        if len(past) > 1:
            goals.insert(0, _mixed(past) * size)
        following, away = None, False
        for goal in goals:
            try:
                tried = advance(goal)
            except RanAwayError:
                away = True
            else:
                if tried.cost <= step.cost + slack:
                    following = tried
                    break
        if following is None:
            bad = EstimateStatus.UNSTABLE if away else EstimateStatus.NOT_CONVERGED
            return Iterated(values, step, bad, count)
        values, step = goal, following
    return Iterated(values, step, EstimateStatus.NOT_CONVERGED, most)


def reweighted(
    start: Array,
    advance: Callable[[Array, Array | None], S],
    size: Array,
    most: int,
    slack: float = 0.0,
    memory: int = 0,
) -> Iterated[S]:
    """Iterate with fixed weights, then anew with those of the residuals that were left.

    Weights that follow every step could make the outputs of one joint, once they happen to fit,
    outweigh all others before the parameters are right.

    Parameters
    ----------
    start, size, most, slack, memory
        As for `iterated`; ``most`` holds for all iterations together.
    advance : callable
        The `Step` of a simulation with given parameters and weights; None for those of its own
        errors.

    Returns
    -------
    Iterated
        Values and status.
    """
    weights: Array | None = None

    def fixed(values: Array) -> S:
        nonlocal weights
        step = advance(values, weights)
        weights = step.weights if weights is None else weights
        return step

    done = 0
    ended = iterated(start, fixed, size, most, slack, memory)
    for _ in range(_WEIGHTINGS):
        done += ended.iterations
        if ended.status is not EstimateStatus.SOLVED or ended.last is None or done >= most:
            break
        before, weights = weights, ended.last.next_weights
        ended = iterated(ended.values, fixed, size, most - done, slack, memory)
        if before is not None and np.allclose(before, weights, rtol=_ALIKE, atol=0.0):
            done += ended.iterations
            break
    return Iterated(ended.values, ended.last, ended.status, done)


def _mixed(past: list[tuple[Array, Array]]) -> Array:
    """Where the moves of the last steps, mixed, would vanish; in sizes of the parameters."""
    x, f = past[-1]
    dx = np.column_stack([x - other for other, _ in past[:-1]])
    df = np.column_stack([f - other for _, other in past[:-1]])
    mix = np.linalg.lstsq(df, f, rcond=1e-8)[0]
    return x + f - (dx + df) @ mix
