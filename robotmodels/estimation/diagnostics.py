"""Diagnostics of a fit: correlations, condition, leverage, Cook's distance, residual tests.

Book section 1.4.4.3; N. R. Draper, H. Smith, "Applied Regression Analysis", 1998; R. D. Cook,
S. Weisberg, "Residuals and Influence in Regression", 1982, section 3.

Parameters
----------
fit : NonlinearFit
    A fit of P parameters to B measurements.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from .._arrays import Array, Frozen, as_number
from .nonlinear import NonlinearFit
from .outlying import blocks_by_size

_LEVEL = 0.01


@dataclass(frozen=True, slots=True)
class ResidualTest:
    """A statistical test of the residuals.

    Its statistic, the probability of so extreme a one if the assumption holds (NaN where there are
    too few rows), and the conclusion.
    """

    statistic: float
    p: float
    sentence: str

    @property
    def passed(self) -> bool:
        """Whether the assumption is not rejected (also where there are too few rows)."""
        return not self.p < _LEVEL


@dataclass(frozen=True, slots=True, eq=False)
class FitDiagnostics(Frozen):
    """Statistics of a fit. Read-only.

    Parameters
    ----------
    relative_standard_errors, correlation : ndarray, shapes (P,), (P, P)
        Infinite for a parameter that is 0; NaN for parameters without a finite standard error.
    condition : float
        Condition number of the weighted Jacobian with the prior, columns scaled to length 1.
    chi_squared, normality, independence : ResidualTest
        Size of the residuals relative to sigma, their distribution, correlation of successive ones.
    leverage, influence : ndarray, shape (B,)
        Effective number of parameters that each measurement determines, by its number. Cook's
        distance: square of the change of the estimate without it, relative to its covariance and
        the number of parameters; infinite where it alone determines something.
    """

    relative_standard_errors: Array
    correlation: Array
    condition: float
    chi_squared: ResidualTest
    normality: ResidualTest
    independence: ResidualTest
    leverage: Array
    influence: Array


def fit_diagnostics(fit: NonlinearFit) -> FitDiagnostics:
    """Statistics of a fit.

    Returns
    -------
    FitDiagnostics
        Standard errors, correlations, condition, tests, leverage and influence.

    Examples
    --------
    >>> from robotmodels.estimation import fit_nonlinear
    >>> t = np.array([0.0, 0.1, 0.2, 0.3, 5.0])
    >>> A = np.column_stack((np.ones(5), t))
    >>> fit = fit_nonlinear(lambda x: (A @ x - [0.0, 0.2, 0.1, 0.3, 9.0], A), [0.0, 0.0])
    >>> int(fit_diagnostics(fit).influence.argmax())
    4
    """
    error = fit.standard_errors
    with np.errstate(invalid="ignore", divide="ignore"):
        correlation = fit.covariance / np.outer(error, error)
        correlation[~np.isfinite(correlation)] = np.nan
        relative = np.where(fit.x != 0, error / np.abs(fit.x), np.inf)
        condition = float(fit.singular_values[0] / fit.singular_values[-1])
    tests = _chi_squared(fit), _normality(fit), _independence(fit)
    return FitDiagnostics(relative, correlation, condition, *tests, *_influence(fit))


def confidence_intervals(fit: NonlinearFit, level: float = 0.95) -> Array:
    """Confidence intervals of single parameters, at a level between 0 and 1.

    Returns
    -------
    ndarray, shape (P, 2)
        Lower and upper ends: of Student's distribution where the noise is estimated, of the normal
        one where it is known.

    Examples
    --------
    >>> from robotmodels.estimation import fit_nonlinear
    >>> y = np.array([1.0, 2.0, 3.0])
    >>> fit = fit_nonlinear(lambda x: (x - y, np.ones((3, 1))), [0.0])
    >>> confidence_intervals(fit).round(3)
    array([[-0.484,  4.484]])
    """
    from scipy.special import ndtri, stdtrit

    level = as_number(level, "level", above=0.0, below=1.0)
    tail = (1 + level) / 2
    wide = ndtri(tail) if fit.sigma_known else stdtrit(max(fit.freedom_left, 0.0), tail)
    return fit.x[:, None] + wide * fit.standard_errors[:, None] * np.array([-1.0, 1.0])


def _influence(fit: NonlinearFit) -> tuple[Array, Array]:
    """Leverage and Cook's distance of each measurement, shapes (B,)."""
    T, r = fit.orthonormal_rows, fit.whitened * np.sqrt(fit.weights)
    _, place = np.unique(fit.block, return_inverse=True)
    leverage, influence = np.zeros((2, int(place.max(initial=-1)) + 1))
    noise = 1.0 if fit.sigma_known else max(fit.scale**2, np.finfo(float).tiny)
    for which, rows in blocks_by_size(place):
        shares, axes = np.linalg.eigh(T[rows] @ T[rows].swapaxes(1, 2))
        along = (axes.swapaxes(1, 2) @ r[rows][..., None])[..., 0]
        alone = 1 - shares <= 1e-10
        change = np.where(alone, 0.0, along / np.where(alone, 1.0, 1 - shares))
        moved = (change**2 * np.maximum(shares, 0.0)).sum(axis=1) / noise / max(fit.rank, 1)
        leverage[which] = shares.sum(axis=1)
        influence[which] = np.where(alone.any(axis=1), np.inf, moved)
    return leverage, influence


def _chi_squared(fit: NonlinearFit) -> ResidualTest:
    """Chi-squared test, two-sided: whether residuals are as large as stated."""
    from scipy.special import chdtr, chdtrc

    statistic, left = float(fit.whitened @ fit.whitened), fit.freedom_left
    if left <= 0:
        return ResidualTest(statistic, np.nan, "There are no degrees of freedom for a test.")
    p = min(1.0, 2 * min(float(chdtr(left, statistic)), float(chdtrc(left, statistic))))
    text = f"Residuals are {np.sqrt(statistic / left):.3g} times as large as stated"
    if p < _LEVEL:
        text += ": missing effects or outliers, or the stated standard deviations are wrong"
    return ResidualTest(statistic, p, f"{text}.")


def _normality(fit: NonlinearFit) -> ResidualTest:
    """Test of D'Agostino and Pearson: whether residuals without outliers are Gaussian."""
    z = fit.whitened[~np.isin(fit.block, fit.outliers)]
    if len(z) < 20 or not z.std() > 0:
        return ResidualTest(np.nan, np.nan, "Too few rows (20 are needed) for this test.")
    from scipy.stats import normaltest

    statistic, p = map(float, normaltest(z))
    text = "Gaussian residuals are not rejected."
    if p < _LEVEL:
        text = "Residuals are not Gaussian: check for outliers, mixed accuracies or a wrong model."
    return ResidualTest(statistic, p, text)


def _independence(fit: NonlinearFit) -> ResidualTest:
    """Test of lag-1 correlation of successive measurements of equal size."""
    from scipy.special import erfc

    usual = ~np.isin(fit.block, fit.outliers)
    ends = np.flatnonzero(np.diff(fit.block[usual])) + 1
    both = pairwise(np.split(fit.whitened[usual], ends))
    pairs = [(a, b) for a, b in both if len(a) == len(b)]
    a, b = np.concatenate([np.zeros((2, 0)), *pairs], axis=1)
    if len(a) < 20:
        return ResidualTest(np.nan, np.nan, "Too few rows (20 pairs are needed) for this test.")
    scale = float(np.sqrt((a @ a) * (b @ b)))
    if not scale > 0:
        return ResidualTest(np.nan, np.nan, "There are no residuals to test.")
    correlation = float(a @ b) / scale
    p = float(erfc(abs(correlation) * np.sqrt(len(a) / 2)))
    text = "Successive measurements are not correlated."
    if p < _LEVEL:
        text = (
            f"Successive measurements are correlated ({correlation:.2f}): there is a drift or a "
            "missing effect, and the stated standard errors are too small."
        )
    return ResidualTest(correlation, p, text)
