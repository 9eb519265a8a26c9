"""Durbin-Wu-Hausman test: whether noise in the regressor biases least squares."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array, Rebuilt, read_only
from ...errors import InvalidValueError
from ..correlated import correlated_covariance
from ..equations import Block, Equations
from ..methods.least_squares import shares, solved
from .blocks import given, reduced, simulated_blocks
from .estimate import SimulatedEstimate
from .instrumental import instrument_step, torque_sizes
from .simulated import RanAwayError

_EFFECT = 0.5
"""Standard errors of least squares that a bias must exceed."""
_KEPT = 256_000_000
"""Bytes of blocks that are kept; of longer logs they are simulated again."""


@dataclass(frozen=True, slots=True, eq=False)
class HausmanResult(Rebuilt):
    """Bias of least squares, parameter by parameter, and whether it matters. Read-only.

    Parameters
    ----------
    names : tuple of str
        The b parameters.
    effect : ndarray, shape (b,)
        Least squares less instrumental variables, SI units; NaN where the robot could not be
        simulated.
    standard_errors : ndarray, shape (b,)
        Of the effect.
    least_squares_errors : ndarray, shape (b,)
        Standard errors of least squares, by which an effect is judged.
    parameter_p : ndarray, shape (b,)
        Probability of such an effect if the bias is half a standard error of least squares, times
        the number of parameters (Bonferroni), 1 at most.
    lags : int
        Equations over which correlation of the residuals was taken into account.
    level : float
        Of the verdict: probability that it names any parameter wrongly.
    """

    names: tuple[str, ...]
    effect: Array
    standard_errors: Array
    least_squares_errors: Array
    parameter_p: Array
    lags: int
    level: float

    def __post_init__(self) -> None:
        for name in ("effect", "standard_errors", "least_squares_errors", "parameter_p"):
            object.__setattr__(self, name, read_only(getattr(self, name)))

    @property
    def p(self) -> float:
        """Least of the parameters' probabilities; NaN where nothing was tested."""
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
        """What a person reads."""
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
            f"errors: {named}. Use a lower cutoff= or instrumental variables."
        )


def hausman_test(
    system: Equations, estimate: SimulatedEstimate, level: float = 0.05, lags: int | None = None
) -> HausmanResult:
    """Durbin-Wu-Hausman test: whether least squares and instrumental variables differ too much.

    Noise of the positions is in the regressor and biases least squares; instrumental variables are
    consistent. Any noise does so a little, and many equations show it: the test is whether the
    difference of a parameter exceeds half a standard error of least squares. The variance of the
    difference is that of V_IV - V_LS, for residuals of least squares that are correlated in time
    and between joints.

    Parameters
    ----------
    system : Equations
        The equations that least squares would solve.
    estimate : SimulatedEstimate
        Of `instrumental` on these equations: its parameters, its deviations for the weights, and
        the simulation that gives the instruments.
    level : float
        Probability of a false alarm, all parameters together.
    lags : int, optional
        As for `correlated_covariance`.

    Returns
    -------
    HausmanResult
        Differences, their standard errors and probabilities, and a sentence.

    Raises
    ------
    InvalidValueError
        A level that is not between 0 and 1; an estimate of other parameters.

    See Also
    --------
    fit : ``result = fit(model, log, "iv")`` has both, ``result.system`` and ``result.estimate``.

    References
    ----------
    J. Hausman, "Specification tests in econometrics", Econometrica 46(6), 1978; A. Janot, P.-O.
    Vandanjon and M. Gautier, "A Durbin-Wu-Hausman test for industrial robot identification", IEEE
    ICRA 2014; J. Hodges and E. Lehmann, "Testing the approximate validity of statistical
    hypotheses", J. Royal Statistical Society B 16(2), 1954 (effects above a bound).

    Examples
    --------
    >>> from robotmodels.identification import (
    ...     Log,
    ...     choose_processing,
    ...     equations,
    ...     instrumental,
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
    >>> 0.0 <= hausman_test(system, found).p <= 1.0
    True
    """
    if not 0.0 < level < 1.0:
        raise InvalidValueError(f"level: expected a number between 0 and 1, got {level!r}.")
    if estimate.names != system.names:
        raise InvalidValueError(
            "estimate: it is of other parameters than these equations; estimate them by "
            "instrumental(system, ...) first."
        )
    b, loop, values = len(system.names), estimate.loop, estimate.values
    none = np.full(b, np.nan)
    nothing = HausmanResult(system.names, none, none, none, none, 0, level)
    if loop is None or not np.isfinite(estimate.deviations).all():
        return nothing

    def pairs() -> Iterator[tuple[Array, Block]]:
        for piece, block in simulated_blocks(system, loop, values):
            own = system.block(piece)
            yield block.W, replace(own, use=own.use & block.use)

    rows = len(system.log) // system.processing.decimation + 1
    try:
        kept = list(pairs()) if 16 * rows * system.model.n * b <= _KEPT else None
        both = pairs if kept is None else lambda: iter(kept)
        squares = reduced(system, (own for _, own in both()))
    except RanAwayError:  # the last step of an estimate that did not converge
        return nothing
    step = instrument_step(squares, values, both(), torque_sizes(squares))
    found, inverse, _ = solved(squares, step.weights)

    def residuals() -> Iterator[Block]:
        """Scores of the difference and of least squares."""
        for Z, own in both():
            least = own.W @ inverse
            W = np.concatenate((least - Z @ step.inverse.T, least), axis=2)
            yield replace(own, W=W, y=own.y - own.W @ found)

    spread = correlated_covariance(
        given(system, residuals), np.zeros(2 * b), step.weights, np.eye(2 * b), lags,
        shares(squares, step.weights, inverse),
    )  # fmt: skip
    errors, least = np.sqrt(np.maximum(np.diag(spread.covariance), 0.0)).reshape(2, b)
    return HausmanResult(
        system.names, found - values, errors, least, _chances(found - values, errors, least),
        spread.lags, level,
    )  # fmt: skip


def _chances(effect: Array, errors: Array, least: Array) -> Array:
    """Probabilities of effects where the bias is as large as is allowed, for any of so many."""
    from scipy.stats import norm

    safe = np.maximum(errors, np.finfo(float).tiny)
    each = sum(norm.sf((np.abs(effect) + side * _EFFECT * least) / safe) for side in (-1.0, 1.0))
    return np.minimum(len(effect) * each, 1.0)
