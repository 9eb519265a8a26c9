"""Iterations until the parameters converge or the simulation diverges.

Source: H. Walker and P. Ni, "Anderson acceleration for fixed-point iterations", SIAM J. Numerical
Analysis 49(4), 2011.
"""

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
    """Result of an iteration: values and status. Shapes: values (b,)."""

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
    """Fixed-point iteration: simulate and solve until the parameters converge."""
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
    """Iterate with fixed weights, then again with weights from the residuals."""
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
