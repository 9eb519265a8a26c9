"""Common part of the methods that simulate the controlled robot: iteration and result.

Source: H. Walker and P. Ni, "Anderson acceleration for fixed-point iterations", SIAM J. Numerical
Analysis 49(4), 2011.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..._arrays import Array, Frozen, as_exact
from ...errors import InvalidValueError
from ...estimation.covariance import CorrelatedCovariance, correlated_covariance
from ...estimation.estimate import Estimate, EstimateStatus
from ...estimation.factor import TriangularFactors
from ...estimation.linear import (
    check_count,
    inverse_std,
    residual_std,
    solved,
    value_sizes,
    weighted,
)
from ..equations import Block, Equations
from ..methods.base import Covariance, Method
from .controller import Controller
from .loop import ClosedLoop, closed_loop
from .simulation import ClosedLoopSimulator, SimulationDivergedError

_STILL, _ROUNDING = 1e-3, 1e-11
"""Convergence tolerances of a parameter: in standard errors, relative to its torque size."""
_HALVINGS, _WEIGHTINGS = 8, 3
_SAME_WEIGHTS = 0.02
"""Convergence tolerance: relative change of the weights."""
_WEAK = 0.3
"""Least correlation of instruments and regressor; below it instruments are weak."""


@dataclass(frozen=True, slots=True, eq=False)
class SimulationDetails(Frozen):
    """Details of a simulating method; ``strength`` is the instrument strength.

    Shapes: iid_standard_errors (b,). The loop is None if the first mass matrix was not definite.
    """

    iid_standard_errors: Array
    correlation_lags: int
    condition: float
    strength: float
    loop: ClosedLoop | None


class Step(NamedTuple):
    """Parameters (b,) that follow from one simulation, with the weights (m,) of the equations.

    The next weights are those of the residuals, None where weights change in every step.
    """

    values: Array
    standard_errors: Array
    inverse: Array
    sigma: Array
    weights: Array
    next_weights: Array | None
    condition: float
    strength: float = 1.0
    cost: float = 0.0


Advance = Callable[[Array, Array | None], Step]
"""One simulation with parameters, and the weights of its equations."""
Scores = Callable[[Array], Callable[[], Iterable[Block]]]
"""Blocks of the covariance at the parameters, for several passes."""


@dataclass(frozen=True, slots=True, eq=False)
class SimulatingMethod(Method):
    """Base of the methods: initial parameters, simulations until convergence, covariance."""

    controller: Controller | None = None
    start: ArrayLike | None = None
    iterations: int = 20
    lags: int | None = None
    width: ArrayLike | None = None
    substeps: int | None = None
    covariance: ClassVar[Covariance] = "given"
    _memory: ClassVar[int] = 0  # steps of the Anderson mixing
    _slack: ClassVar[float] = 0.0  # rounding tolerance: increase of the cost per equation
    _advice: ClassVar[tuple[str, ...]] = ()  # where the iteration does not converge

    def __post_init__(self) -> None:
        n, controller = self.iterations, self.controller
        if isinstance(n, bool) or not isinstance(n, (int, np.integer)) or n < 1:
            raise InvalidValueError(f"iterations: expected a whole number from 1, got {n!r:.60}.")
        if not isinstance(controller, Controller | None):
            raise InvalidValueError(
                f"controller: expected a Controller or None, got {type(controller).__name__}."
            )

    @abstractmethod
    def _prepare(
        self, simulator: ClosedLoopSimulator, factors: TriangularFactors, size: Array
    ) -> tuple[Advance, Scores]:
        """One step of the method, and the equations of its covariance. Shapes: size (b,)."""

    def _loop(self, system: Equations, values: Array) -> ClosedLoop | None:
        """Settings of the simulation. Shapes: values (b,)."""
        return closed_loop(system, values, self.controller, self.width, self.substeps)

    def solve(self, system: Equations, factors: TriangularFactors) -> Estimate:
        """Estimate the parameters; NaN where the simulation diverged."""
        check_count(factors)
        b, n = len(system.names), system.model.n
        values = weighted(factors).values if self.start is None else self.start
        values = as_exact(values, (b,), "start")
        loop = self._loop(system, values)
        status, count, why = EstimateStatus.UNSTABLE, 0, "its mass matrix is not positive definite"
        last = spread = None
        if loop is not None:
            why, size = "it diverges", value_sizes(factors)
            simulator = ClosedLoopSimulator(system if system.cache else system.cached(), loop)
            advance, scores = self._prepare(simulator, factors, size)
            slack = self._slack * factors.rows
            values, last, status, count = _reweighted(
                values, advance, size, self.iterations, slack, self._memory
            )
            if last is not None and status is not EstimateStatus.UNSTABLE:
                try:
                    spread = _sandwich(scores(values), values, last, self.lags)
                except SimulationDivergedError:
                    status = EstimateStatus.UNSTABLE
        notes = () if loop is None else loop.notes
        if last is None or spread is None:
            whose = f"parameters after {count} iterations" if count else "first parameters"
            note = (
                f"The robot of the {whose} cannot be simulated: {why}. Give start= of a robot "
                "whose joints all move inertia (such as base.values of a model with its inertia), "
                "or lower gains."
            )
            values, nothing = np.full(b, np.nan), np.full((b, b), np.nan)
            details = SimulationDetails(values, 0, np.nan, 0.0, loop)
            sigma, notes = np.full(n, np.nan), (*notes, note)
            return Estimate(system.names, values, nothing, sigma, status, count, notes, details)
        if last.strength < _WEAK:
            note = (
                "The instruments are weak: a combination of regressor columns has a "
                f"correlation of {last.strength:.2g} with them. Give the robot's controller "
                "and references, a lower cutoff, or a motion that excites it more."
            )
            notes = (*notes, note)
        if status is not EstimateStatus.SOLVED:
            notes = (*notes, status.sentence, *self._advice)
        details = SimulationDetails(
            last.standard_errors, spread.lags, last.condition, last.strength, loop
        )
        return Estimate(
            system.names, values, spread.covariance, last.sigma, status, count, notes, details
        )


Iterated = tuple[Array, Step | None, EstimateStatus, int]
"""Values (b,), last step, status and number of iterations."""


def _iterated(
    values: Array,
    advance: Advance,
    size: Array,
    most: int,
    slack: float,
    memory: int,
    weights: Array | None = None,
) -> Iterated:
    """Simulate and solve until the parameters converge. Shapes: values, size (b,), weights (m,)."""
    past: list[tuple[Array, Array]] = []
    try:
        step = advance(values, weights)
    except SimulationDivergedError:
        return values, None, EstimateStatus.UNSTABLE, 0
    for count in range(1, most + 1):
        move = step.values - values
        if not np.isfinite(move).all():
            return values, step, EstimateStatus.UNSTABLE, count
        if (np.abs(move) <= _STILL * step.standard_errors + _ROUNDING * size).all():
            return step.values, step, EstimateStatus.SOLVED, count
        if count == most:
            break
        past = [*past, (values / size, move / size)][-(memory + 1) :]
        goals = [values + move / 2**k for k in range(_HALVINGS)]
        if len(past) > 1:
            goals.insert(0, _mixed(past) * size)
        failed = EstimateStatus.NOT_CONVERGED
        for goal in goals:
            try:
                following = advance(goal, step.weights)
            except SimulationDivergedError:
                failed = EstimateStatus.UNSTABLE
                continue
            if following.cost <= step.cost + slack:
                break
        else:
            return values, step, failed, count
        values, step = goal, following
    return values, step, EstimateStatus.NOT_CONVERGED, most


def _reweighted(
    values: Array, advance: Advance, size: Array, most: int, slack: float, memory: int
) -> Iterated:
    """Iterate with fixed weights, then again with weights from the residuals."""
    values, last, status, done = _iterated(values, advance, size, most, slack, memory)
    for _ in range(_WEIGHTINGS):
        weights = None if last is None else last.next_weights
        if last is None or weights is None or status is not EstimateStatus.SOLVED or done >= most:
            break
        before = last.weights
        values, last, status, count = _iterated(
            values, advance, size, most - done, slack, memory, weights
        )
        done += count
        if np.allclose(before, weights, rtol=_SAME_WEIGHTS, atol=0.0):
            break
    return values, last, status, done


def _mixed(past: list[tuple[Array, Array]]) -> Array:
    """Anderson mixing of the last steps, shape (b,)."""
    x, f = past[-1]
    dx = np.column_stack([x - other for other, _ in past[:-1]])
    df = np.column_stack([f - other for _, other in past[:-1]])
    return x + f - (dx + df) @ np.linalg.lstsq(df, f, rcond=1e-8)[0]


def weighted_step(factors: TriangularFactors, values: Array, weights: Array | None) -> Step:
    """Weighted least squares on the equations of one simulation."""
    shown = [R[:, :-1].any(axis=0) for R in factors.factors]
    check_excited(factors.names, np.any(shown, axis=0))
    check_count(factors)
    if weights is None:
        weights = inverse_std(factors, residual_std(factors, values))
    solution, inverse, rest = solved(factors, weights)
    variances = rest / max(factors.rows - len(values), 1) * np.diag(inverse)
    sigma = residual_std(factors, solution)
    R, _, _ = factors.stacked(weights)
    condition = float(np.linalg.cond(R / np.linalg.norm(R, axis=0)))
    errors, following = np.sqrt(np.maximum(variances, 0.0)), inverse_std(factors, sigma)
    return Step(solution, errors, inverse, sigma, weights, following, condition)


def check_excited(names: tuple[str, ...], shown: NDArray[np.bool_]) -> None:
    """Raise where a parameter has no effect on the equations."""
    if not shown.all():
        missing = ", ".join(names[k] for k in np.flatnonzero(~shown))
        raise InvalidValueError(
            f"log: the simulated motion does not depend on {missing}; its joints do not leave the "
            "dead band. Give a smaller dead band (processing=), or drop these parameters."
        )


@dataclass(frozen=True, slots=True)
class GivenBlocks:
    """Blocks with the interface of equations, for `correlated_covariance`."""

    blocks: Callable[[], Iterable[Block]]


def _sandwich(
    blocks: Callable[[], Iterable[Block]], values: Array, step: Step, lags: int | None
) -> CorrelatedCovariance:
    """Sandwich covariance for correlated residuals; the step's inverse need not be symmetric."""

    def turned() -> Iterator[Block]:
        for block in blocks():
            e = block.y - block.W @ values
            W = block.W @ step.inverse.T
            yield replace(block, W=W, y=W @ values + e)

    spread = correlated_covariance(
        GivenBlocks(turned), values, step.weights, np.eye(len(values)), lags
    )
    return replace(spread, covariance=0.5 * (spread.covariance + spread.covariance.T))
