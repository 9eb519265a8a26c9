"""Durbin-Wu-Hausman test: whether noise in the regressor biases least squares."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array, Frozen, as_number
from ...errors import InvalidValueError
from ...estimation.covariance import correlated_covariance
from ...estimation.estimate import Estimate
from ...estimation.factor import reduced
from ...estimation.linear import group_leverage, solved, value_sizes
from ..equations import Block, Equations
from .method import GivenBlocks, instrument_step
from .methods import instrument_pairs
from .simulation import ClosedLoopSimulator, SimulationDivergedError

_EFFECT = 0.5  # least relevant bias, in standard errors of least squares


@dataclass(frozen=True, slots=True, eq=False)
class HausmanResult(Frozen):
    """Result of the Durbin-Wu-Hausman test: bias of least squares by parameter. Read-only.

    Shapes: effect, standard_errors, least_squares_errors, parameter_p (b,).
    """

    names: tuple[str, ...]
    effect: Array
    standard_errors: Array
    least_squares_errors: Array
    parameter_p: Array
    lags: int
    level: float

    @property
    def p(self) -> float:
        """Smallest p-value of the parameters; NaN without a test."""
        return float(self.parameter_p.min())

    @property
    def biased_parameters(self) -> NDArray[np.bool_]:
        """Parameters whose bias exceeds half a standard error of least squares, shape (b,)."""
        return self.parameter_p < self.level

    @property
    def biased(self) -> bool:
        """Whether any parameter is biased."""
        return bool(self.biased_parameters.any())

    @property
    def sentence(self) -> str:
        """Outcome of the test as a sentence."""
        if np.isnan(self.p):
            return "Whether least squares are biased was not tested: the robot was not simulated."
        if not self.biased:
            return (
                "No bias of least squares above half a standard error was found "
                f"(Durbin-Wu-Hausman, p = {self.p:.2g})."
            )
        size = np.abs(self.effect) / self.least_squares_errors
        order = [k for k in np.argsort(-size) if self.biased_parameters[k]]
        named = ", ".join(f"{self.names[k]} ({size[k]:.2g})" for k in order)
        return (
            f"Least squares are biased (Durbin-Wu-Hausman, p = {self.p:.2g}). Bias in standard "
            f"errors: {named}. Use a lower cutoff (processing=) or instrumental variables."
        )


def hausman_test(
    system: Equations, estimate: Estimate, level: float = 0.05, lags: int | None = None
) -> HausmanResult:
    """Durbin-Wu-Hausman test: whether least squares and instrumental variables differ too much.

    Noise of the positions in the regressor biases least squares. The test is whether the difference
    of a parameter exceeds half a standard error of least squares; its variance holds for residuals
    that are correlated in time and between joints.

    Parameters
    ----------
    system : Equations
        The equations that least squares would solve.
    estimate : Estimate
        Estimate of `Instrumental` on these equations, with the simulation of the instruments.
    level : float
        Probability of a false alarm, all parameters together.
    lags : int, optional
        As for `correlated_covariance`.

    Returns
    -------
    HausmanResult
        Differences, standard errors, p-values, and a sentence.

    References
    ----------
    J. Hausman, Econometrica 46(6), 1978; A. Janot, P.-O. Vandanjon and M. Gautier, IEEE ICRA 2014;
    J. Hodges and E. Lehmann, J. Royal Statistical Society B 16(2), 1954 (effects above a bound).

    Examples
    --------
    >>> from robotmodels.datasets import example_log
    >>> from robotmodels.identification import fit
    >>> arm, log = example_log()
    >>> result = fit(arm, log, "iv", drive=("Fv",))
    >>> 0.0 <= hausman_test(result.equations, result.estimate).p <= 1.0
    True
    """
    from scipy.stats import norm

    level = as_number(level, "level", above=0.0, below=1.0)
    if estimate.names != system.names or not hasattr(estimate.details, "loop"):
        raise InvalidValueError(
            "estimate: expected instrumental variables on the parameters of these equations, as "
            "Instrumental().solve(system, ...) gives them."
        )
    b, loop, values = len(system.names), estimate.details.loop, estimate.values
    none = np.full(b, np.nan)
    untested = HausmanResult(system.names, none, none, none, none, 0, level)
    if loop is None or not np.isfinite(estimate.standard_errors).all():
        return untested
    simulator = ClosedLoopSimulator(system, loop)
    try:
        pairs = instrument_pairs(simulator, values)
        factors = reduced(system.names, (block for _, block in pairs()))
        step = instrument_step(system.names, values, pairs, value_sizes(factors))
    except SimulationDivergedError:  # the last step of an estimate that did not converge
        return untested
    ls_values, inverse, _ = solved(factors, step.weights)

    def residuals() -> Iterator[Block]:
        """Scores of the difference of the estimates and of least squares."""
        for Z, block in pairs():
            least = block.W @ inverse
            W = np.concatenate((least - Z @ step.inverse.T, least), axis=2)
            yield replace(block, W=W, y=block.y - block.W @ ls_values)

    blocks, leverage = GivenBlocks(residuals), group_leverage(factors, step.weights, inverse)
    spread = correlated_covariance(
        blocks, np.zeros(2 * b), step.weights, np.eye(2 * b), lags, leverage
    )
    errors, least = np.sqrt(np.maximum(np.diag(spread.covariance), 0.0)).reshape(2, b)
    effect = ls_values - values
    # p-values under the largest allowed bias, with Bonferroni's correction
    safe = np.maximum(errors, np.finfo(float).tiny)
    each = sum(norm.sf((np.abs(effect) + side * _EFFECT * least) / safe) for side in (-1.0, 1.0))
    p = np.minimum(b * each, 1.0)
    return HausmanResult(system.names, effect, errors, least, p, spread.lags, level)
