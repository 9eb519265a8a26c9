"""Common part of the methods that simulate the controlled robot: step, iteration and result.

Source: H. Walker and P. Ni, SIAM J. Numerical Analysis 49(4), 2011 (Anderson mixing).
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..._arrays import Array, Frozen, as_count, as_exact
from ...errors import InvalidValueError
from ...estimation.covariance import CorrelatedCovariance, correlated_covariance
from ...estimation.estimate import Estimate, EstimateStatus
from ...estimation.factor import TriangularFactors, reduced, triangle
from ...estimation.linear import check_count, inverse_triangle, value_sizes, weighted
from ..equations import Block, Equations
from ..methods.base import Covariance, Method
from .loop import ClosedLoop, Controller, closed_loop
from .simulation import ClosedLoopSimulator, SimulationDivergedError

_STILL, _ROUNDING = 1e-3, 1e-11
"""Convergence tolerances of a parameter: in standard errors, relative to its torque size."""
_RESIDUAL = 1e-10  # rounding tolerance: residuals relative to the right side
_SLACK = 1e-9  # rounding tolerance: relative increase of the weighted squares of residuals
_HALVINGS, _WEIGHTINGS = 8, 3
_SAME_WEIGHTS = 0.02  # convergence tolerance: relative change of the weights
_SINGULAR = 1e10
"""Condition number above which the simulated motion does not determine the parameters."""
_WEAK = 0.3  # least correlation of instruments and regressor; below it instruments are weak


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


Pairs = Callable[[], Iterable[tuple[Array, Block]]]
"""Instruments Z (k, m, b) and equations of a simulation, for several passes."""


class Step(NamedTuple):
    """Parameters (b,) that follow from one simulation; weights, sigma and squares of groups (m,).

    Squares are those of the residuals before the step.
    """

    values: Array
    standard_errors: Array
    inverse: Array
    sigma: Array
    weights: Array
    squares: Array
    condition: float
    strength: float


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
    by_parameter: ClassVar[tuple[str, ...]] = ("start",)
    _memory: ClassVar[int] = 0  # steps of the Anderson mixing
    _descends: ClassVar[bool] = False  # whether each step must reduce the residuals
    _advice: ClassVar[tuple[str, ...]] = ()  # where the iteration does not converge

    def __post_init__(self) -> None:
        as_count(self.iterations, "iterations")
        if not isinstance(self.controller, Controller | None):
            raise InvalidValueError(
                f"controller: expected a Controller or None, got {self.controller!r:.60}."
            )

    @abstractmethod
    def _simulated(self, simulator: ClosedLoopSimulator, values: Array, size: Array) -> Pairs:
        """Instruments and equations of the robot with some parameters. Shapes: (b,)."""

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
            values, last, status, count = self._iterated(simulator, values, size)
            if last is not None and status is not EstimateStatus.UNSTABLE:
                try:
                    pairs = self._simulated(simulator, values, size)
                    spread = _sandwich(pairs, values, last, self.lags)
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

    def _iterated(
        self, simulator: ClosedLoopSimulator, values: Array, size: Array
    ) -> tuple[Array, Step | None, EstimateStatus, int]:
        """Simulate and solve until the parameters converge. Shapes: values, size (b,)."""

        def advance(values: Array, weights: Array | None = None) -> Step:
            pairs = self._simulated(simulator, values, size)
            return instrument_step(simulator.system.names, values, pairs, size, weights)

        past: list[tuple[Array, Array]] = []
        changes = 0  # of the weights, which are constant between them
        try:
            step = advance(values)
        except SimulationDivergedError:
            return values, None, EstimateStatus.UNSTABLE, 0
        for count in range(1, self.iterations + 1):
            move = step.values - values
            still = bool((np.abs(move) <= _STILL * step.standard_errors + _ROUNDING * size).all())
            weights = _inverse(step.sigma) if still else step.weights
            same = changes == _WEIGHTINGS or np.allclose(weights, step.weights, _SAME_WEIGHTS, 0.0)
            if still and same:
                return step.values, step, EstimateStatus.SOLVED, count
            if count == self.iterations:
                break
            changes, past = changes + still, [] if still else past
            past = [*past, (values / size, move / size)][-(self._memory + 1) :]
            goals = [values + move / 2**k for k in range(_HALVINGS)]
            if len(past) > 1:
                goals.insert(0, _mixed(past) * size)
            failed, bound = EstimateStatus.NOT_CONVERGED, step.weights**2 @ step.squares
            for goal in goals:
                try:
                    following = advance(goal, weights)
                except SimulationDivergedError:
                    failed = EstimateStatus.UNSTABLE
                    continue
                cost = step.weights**2 @ following.squares
                if not self._descends or cost <= (1.0 + _SLACK) * bound:
                    break
            else:
                return values, step, failed, count
            values, step = goal, following
        return values, step, EstimateStatus.NOT_CONVERGED, self.iterations


def _mixed(past: list[tuple[Array, Array]]) -> Array:
    """Anderson mixing of the last steps, shape (b,)."""
    x, f = past[-1]
    dx = np.column_stack([x - other for other, _ in past[:-1]])
    df = np.column_stack([f - other for _, other in past[:-1]])
    return x + f - (dx + df) @ np.linalg.lstsq(df, f, rcond=1e-8)[0]


def instrument_step(
    names: tuple[str, ...], values: Array, pairs: Pairs, size: Array, weights: Array | None = None
) -> Step:
    """Solve ``Z^T S (y - W b) = 0`` for the correction of the values, which limits rounding.

    Weights S are given (m,) or those of the residuals. Least squares is the case ``Z = W``. With
    ``Z = Q R_z`` the equations are ``Q^T W x = Q^T e``, without products that square conditions.
    """
    b = len(values)

    def blocks() -> Iterator[Block]:
        for Z, block in pairs():
            e = block.y - block.W @ values
            W = np.concatenate((Z * size, block.W * size, e[:, :, None]), axis=2)
            yield replace(block, W=W)

    factors = reduced((*names, *names, "residual"), blocks())
    squares, lengths = (np.array([R[:, k] @ R[:, k] for R in factors.factors]) for k in (-2, -1))
    squares = np.maximum(squares, _RESIDUAL**2 * lengths)
    left = max(1.0 - b / max(factors.rows, 1), 1e-3)
    sigma = np.sqrt(squares / np.maximum(factors.counts * left, 1e-300))
    weights = _inverse(sigma) if weights is None else weights
    R, _, _ = factors.stacked(weights)
    Rz, QW, Rw = R[:b, :b], R[:b, b : 2 * b], triangle(R[: 2 * b, b : 2 * b])
    rows, columns = np.linalg.norm(Rz, axis=0), np.linalg.norm(Rw, axis=0)
    if not (rows * columns).all():
        missing = ", ".join(names[k] for k in np.flatnonzero(rows * columns == 0.0))
        raise InvalidValueError(
            f"log: the simulated motion does not depend on {missing}; its joints do not leave the "
            "dead band. Give a smaller dead band (processing=), or drop these parameters."
        )
    condition = float(np.max([np.linalg.cond(QW / columns), np.linalg.cond(Rz / rows)]))
    if not condition < _SINGULAR:
        raise SimulationDivergedError
    inverse = np.linalg.inv(QW / columns) / columns[:, None]
    scale = np.sqrt(weights**2 @ squares / max(factors.rows * left, 1e-300))
    return Step(
        values=values + inverse @ R[:b, 2 * b] * size,
        standard_errors=scale * np.linalg.norm(inverse, axis=1) * size,
        inverse=inverse @ inverse_triangle(Rz).T * np.outer(size, size),
        sigma=sigma,
        weights=weights,
        squares=squares,
        condition=condition,
        # least canonical correlation
        strength=min(1.0, float(np.linalg.norm(QW @ inverse_triangle(Rw), -2))),
    )


def _inverse(sigma: Array) -> Array:
    return 1.0 / np.where(sigma > 0.0, sigma, 1.0)


@dataclass(frozen=True, slots=True)
class GivenBlocks:
    """Blocks with the interface of equations, for `correlated_covariance`."""

    blocks: Callable[[], Iterable[Block]]


def _sandwich(pairs: Pairs, values: Array, step: Step, lags: int | None) -> CorrelatedCovariance:
    """Sandwich covariance for correlated residuals; the step's inverse need not be symmetric."""

    def scores() -> Iterator[Block]:
        for Z, block in pairs():
            yield replace(block, W=Z @ step.inverse.T, y=block.y - block.W @ values)

    b = len(values)
    spread = correlated_covariance(GivenBlocks(scores), np.zeros(b), step.weights, np.eye(b), lags)
    return replace(spread, covariance=0.5 * (spread.covariance + spread.covariance.T))
