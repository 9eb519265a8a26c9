"""Instrumental variables: the regressor of the simulated robot tells signal from noise."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from ..._arrays import Array, as_exact
from ...errors import InvalidValueError
from ..equations import Block, Equations
from ..methods.estimate import EstimateStatus, Method
from ..methods.least_squares import check_count, weighted, weights_of
from ..scale.reduction import Reduction
from .blocks import given, measured_blocks, sandwich, simulated_blocks
from .controller import Controller
from .estimate import SimulatedEstimate
from .iteration import iterated
from .loop import ClosedLoop, closed_loop

_WEAK = 0.3
"""Correlation of instruments and regressor below which the former are weak."""


@dataclass(frozen=True, slots=True, eq=False)
class InstrumentStep:
    """Sums of one simulation, and the parameters that follow from them.

    Shapes: values, deviations (b,); inverse (b, b); sigma, weights (n,).
    """

    values: Array
    deviations: Array
    inverse: Array
    sigma: Array
    weights: Array
    condition: float
    strength: float
    cost: float = 0.0

    @property
    def next_weights(self) -> Array:
        """The same: weights follow every step here."""
        return self.weights


def instrumental(
    system: Equations,
    reduction: Reduction,
    controller: Controller | None = None,
    start: ArrayLike | None = None,
    *,
    loop: ClosedLoop | None = None,
    iterations: int = 20,
    lags: int | None = None,
) -> SimulatedEstimate:
    """Instrumental variables (IDIM-IV): consistent although noise is in the regressor.

    The controlled robot is simulated with the last parameters; the regressor Z of its motion, which
    the noise of the sensors does not reach, is the instrument: ``Z^T S (y - W b) = 0``.

    Parameters
    ----------
    system : Equations
        Robot, log and choices.
    reduction : Reduction
        Of these equations.
    controller : Controller, optional
        That of the robot; default one that is tuned to follow closely.
    start : array_like, shape (b,), optional
        Parameters to begin with; default weighted least squares.
    loop : ClosedLoop, optional
        How the robot is simulated, instead of ``controller``.
    iterations : int
        Simulations at most.
    lags : int, optional
        As for `correlated_covariance`.

    Returns
    -------
    SimulatedEstimate
        Parameters with a covariance that holds for correlated residuals.

    Raises
    ------
    InvalidValueError, ShapeError
        Fewer equations than parameters; a controller that does not fit; a friction model.

    References
    ----------
    A. Janot, P.-O. Vandanjon and M. Gautier, "A generic instrumental variable approach for
    industrial robot identification", IEEE T-CST 22(1), 2014, section III.

    Examples
    --------
    >>> from robotmodels.identification import (
    ...     Log,
    ...     choose_processing,
    ...     equations,
    ...     reduce_equations,
    ... )
    >>> from robotmodels.dynamics import idm
    >>> from robotmodels.minimal_parameters import uniform_bodies
    >>> from robotmodels.robots import load
    >>> arm = load("planar_2r").with_gravity((0.0, -9.81, 0.0))
    >>> arm = arm.with_inertia(uniform_bodies(arm, 5.0))
    >>> t, w = 0.005 * np.arange(4000)[:, None], np.array([2.0, 3.1])
    >>> q, v, a = np.sin(w * t), w * np.cos(w * t), -(w**2) * np.sin(w * t)
    >>> log = Log(0.005, q, idm(arm, q, v, a) + 2.0 * v)
    >>> from robotmodels.minimal_parameters import base_parameters
    >>> base = base_parameters(arm, drive=("Fv",))
    >>> system = equations(base, log, choose_processing(log))
    >>> found = instrumental(system, reduce_equations(system))
    >>> found.status.name, round(float(found.values[found.names.index("Fv1")]), 2)
    ('SOLVED', 2.0)
    """
    check_count(reduction)
    first = first_values(reduction, start)
    if loop is None:
        loop = closed_loop(system, first, controller)
    if loop is None:
        return ran_away(Method.IV, system, loop)
    way = loop
    measured = measured_blocks(system)
    size = torque_sizes(reduction)

    def pairs(values: Array) -> Iterator[tuple[Array, Block]]:
        for piece, block in simulated_blocks(system, way, values):
            own = measured(piece)
            yield block.W, replace(own, use=own.use & block.use)

    def advance(values: Array) -> InstrumentStep:
        return instrument_step(reduction, values, pairs(values), size)

    ended = iterated(first, advance, size, iterations)
    last = ended.last
    if last is None or ended.status is EstimateStatus.UNSTABLE:
        return ran_away(Method.IV, system, loop, ended.iterations)

    def scores() -> Iterator[Block]:
        for Z, own in pairs(ended.values):
            e = own.y - own.W @ ended.values
            yield replace(own, W=Z, y=Z @ ended.values + e)

    spread = sandwich(given(system, scores), ended.values, last.weights, last.inverse, lags)
    notes = list(loop.notes)
    if last.strength < _WEAK:
        notes.append(
            f"The instruments are weak: a combination of regressor columns has a correlation of "
            f"{last.strength:.2g} with them. Give the robot's own controller and references, a "
            "lower cutoff, or a motion that excites it more."
        )
    if ended.status is not EstimateStatus.SOLVED:
        notes.append(ended.status.sentence)
    return SimulatedEstimate(
        Method.IV, system.names, ended.values, spread.covariance, last.sigma, ended.status,
        ended.iterations, tuple(notes), last.deviations, spread.lags, last.condition,
        last.strength, loop,
    )  # fmt: skip


def instrument_step(
    reduction: Reduction, values: Array, pairs: Iterator[tuple[Array, Block]], size: Array
) -> InstrumentStep:
    """Solve ``Z^T S (y - W b) = 0`` from residuals of the values before, which keeps its digits."""
    b, m = len(values), len(reduction.factors)
    ZW, ZZ, WW = (np.zeros((m, b, b)) for _ in range(3))
    Ze, squares, counts = np.zeros((m, b)), np.zeros(m), np.zeros(m)
    for Z, block in pairs:
        e = block.y - block.W @ values
        for j in range(m):
            use = block.use[:, j]
            z, w, r = Z[use, j] * size, block.W[use, j] * size, e[use, j]
            ZW[j] += z.T @ w
            ZZ[j] += z.T @ z
            WW[j] += w.T @ w
            Ze[j] += z.T @ r
            squares[j] += float(r @ r)
            counts[j] += len(r)
    left = max(1.0 - b / max(float(counts.sum()), 1.0), 1e-3)
    sigma = np.sqrt(squares / np.maximum(counts * left, 1e-300))
    weights = weights_of(sigma, reduction)
    s = weights**2
    A, B, C = (np.einsum("j,jxy->xy", s, X) for X in (ZW, ZZ, WW))
    rows, columns = np.sqrt(np.diag(B)), np.sqrt(np.diag(C))
    if not (rows.all() and columns.all()):
        missing = [reduction.names[k] for k in np.flatnonzero((rows == 0.0) | (columns == 0.0))]
        raise InvalidValueError(
            f"log: nothing of the simulated motion shows {', '.join(missing)}; its joints do not "
            "leave the dead band. Give a smaller dead_band=, or drop these parameters."
        )
    scaled = A / rows[:, None] / columns
    inverse = np.linalg.inv(scaled) / rows / columns[:, None]
    move = inverse @ (s @ Ze)
    spread = inverse @ B @ inverse.T
    low, high = (np.linalg.cholesky(_lifted(X)) for X in (B, C))
    from scipy.linalg import solve_triangular

    half = solve_triangular(low, A, lower=True)
    canonical = np.linalg.svd(solve_triangular(high, half.T, lower=True), compute_uv=False)
    return InstrumentStep(
        values + move * size, np.sqrt(np.maximum(np.diag(spread), 0.0)) * size,
        inverse * size[:, None] * size, sigma, weights, float(np.linalg.cond(scaled)),
        float(min(canonical[-1], 1.0)),
    )  # fmt: skip


def _lifted(X: Array) -> Array:
    """A matrix of products with rounding added on its diagonal, so that it has a factor."""
    return X + np.diag(1e-13 * np.diag(X))


def first_values(reduction: Reduction, start: ArrayLike | None) -> Array:
    """Initial parameters: those given, or weighted least squares. Shapes: start (b,) -> (b,)."""
    if start is None:
        return weighted(reduction).values
    return as_exact(start, (len(reduction.names),), "start")


def torque_sizes(reduction: Reduction) -> Array:
    """Value of each parameter whose torque alone would be as large as that measured."""
    whole = np.vstack(reduction.factors)
    length = np.linalg.norm(whole[:, :-1], axis=0)
    torque = max(float(np.linalg.norm(whole[:, -1])), 1e-300)
    return torque / np.where(length > 0.0, length, 1.0)


def ran_away(
    method: Method, system: Equations, loop: ClosedLoop | None, iterations: int = 0
) -> SimulatedEstimate:
    """Estimate with NaN values for a robot whose simulation diverged."""
    b, n = len(system.names), system.model.n
    why = "its mass matrix is not positive definite" if loop is None else "it runs away"
    whose = f"parameters after {iterations} iterations" if iterations else "first parameters"
    note = (
        f"The robot of the {whose} cannot be simulated: {why}. Give start= of a robot "
        "whose joints all move inertia (such as base.values of a model with its inertia), or "
        "lower gains."
    )
    none = np.full(b, np.nan)
    return SimulatedEstimate(
        method, system.names, none, np.full((b, b), np.nan), np.full(n, np.nan),
        EstimateStatus.UNSTABLE, iterations, (*(() if loop is None else loop.notes), note),
        none, 0, np.nan, 0.0, loop,
    )  # fmt: skip
