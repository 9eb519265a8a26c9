"""What a fit says of itself: deviations, correlations, condition, tests of the residuals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array, Rebuilt, as_exact, read_only
from ..errors import InvalidValueError
from ._problem import Linearise
from ._step import triangle
from .leverage import Leverage, leverage
from .nonlinear_fit import NonlinearFit

_DOUBT = 0.01
"""Probability under which a test speaks against its assumption."""


@dataclass(frozen=True, slots=True)
class ResidualTest:
    """A test of the residuals.

    Parameters
    ----------
    statistic : float
        Of the test; NaN where there are too few rows.
    p : float
        Probability of so extreme a statistic if the assumption holds.
    sentence : str
        What it means.
    """

    statistic: float
    p: float
    sentence: str

    @property
    def passed(self) -> bool:
        """Whether nothing speaks against the assumption (also where there are too few rows)."""
        return not self.p < _DOUBT


@dataclass(frozen=True, slots=True, eq=False)
class FitDiagnostics(Rebuilt):
    """Statistics of a fit. Read-only.

    Parameters
    ----------
    variance : float
        Of the residuals, in squares of their stated deviations: ``scale^2``.
    deviations : ndarray, shape (P,)
        Standard deviations of the parameters.
    relative_deviations : ndarray, shape (P,)
        Relative to the parameters; infinite for a parameter that is 0.
    correlation : ndarray, shape (P, P)
        Of the estimates; NaN for parameters without a finite deviation.
    condition : float
        Of the weighted Jacobian with the prior, in the units that it has.
    condition_scaled : float
        Of the same with columns of length 1.
    chi_squared, normality, independence : ResidualTest
        Size of the residuals against the stated deviations, their distribution, their order.
    leverage : Leverage
        What each measurement says.
    """

    variance: float
    deviations: Array
    relative_deviations: Array
    correlation: Array
    condition: float
    condition_scaled: float
    chi_squared: ResidualTest
    normality: ResidualTest
    independence: ResidualTest
    leverage: Leverage

    def __post_init__(self) -> None:
        for name in ("deviations", "relative_deviations", "correlation"):
            object.__setattr__(self, name, read_only(getattr(self, name)))


@dataclass(frozen=True, slots=True, eq=False)
class Linearity(Rebuilt):
    """How far linear steps can be trusted. Read-only.

    Parameters
    ----------
    ratios : ndarray, shape (n,)
        Actual decrease relative to that predicted, of the steps whose decrease is above rounding.
    curvature : ndarray, shape (P,)
        Change of each column of the Jacobian from the start to the estimate, relative to its
        length at the estimate.
    missed : float
        Part of the decrease of the sum that the first linear step does not predict.
    sentence : str
        What it means.
    """

    ratios: Array
    curvature: Array
    missed: float
    sentence: str

    def __post_init__(self) -> None:
        object.__setattr__(self, "ratios", read_only(self.ratios))
        object.__setattr__(self, "curvature", read_only(self.curvature))


def fit_diagnostics(fit: NonlinearFit) -> FitDiagnostics:
    """Statistics of a fit.

    Parameters
    ----------
    fit : NonlinearFit
        A fit.

    Returns
    -------
    FitDiagnostics
        Deviations, correlations, condition, tests and leverage.

    References
    ----------
    Seed book section 1.4.4.3; N. R. Draper, H. Smith, "Applied Regression Analysis", 1998.

    Examples
    --------
    >>> from robotmodels.estimation import fit_nonlinear
    >>> rng = np.random.default_rng(0)
    >>> A = rng.normal(size=(200, 2))
    >>> y = A @ [1.0, 2.0] + 0.1 * rng.normal(size=200)
    >>> found = fit_diagnostics(fit_nonlinear(lambda x: (A @ x - y, A), [0.0, 0.0], sigma=0.1))
    >>> found.chi_squared.passed, found.normality.passed, found.independence.passed
    (True, True, True)
    """
    deviations = fit.deviations
    with np.errstate(invalid="ignore", divide="ignore"):
        correlation = fit.covariance / np.outer(deviations, deviations)
        relative = np.where(fit.x != 0, deviations / np.abs(fit.x), np.inf)
    correlation[~np.isfinite(correlation)] = np.nan
    A = fit.jacobian * (np.sqrt(fit.weights) / fit.sigma)[:, None]
    _, information = fit.prior.rows(fit.x)
    s = np.linalg.svd(np.vstack((triangle(A), np.diag(information))), compute_uv=False)
    s = np.append(np.asarray(s, dtype=np.float64), np.zeros(len(fit.x) - len(s)))
    return FitDiagnostics(
        variance=fit.scale**2,
        deviations=deviations,
        relative_deviations=relative,
        correlation=correlation,
        condition=_condition(s),
        condition_scaled=_condition(fit.singular_values),
        chi_squared=_chi_squared(fit),
        normality=_normality(fit),
        independence=_independence(fit),
        leverage=leverage(fit),
    )


def confidence_intervals(fit: NonlinearFit, level: float = 0.95) -> Array:
    """Intervals that contain the truth with a given probability, each parameter by itself.

    Parameters
    ----------
    fit : NonlinearFit
        A fit.
    level : float
        Probability, between 0 and 1.

    Returns
    -------
    ndarray, shape (P, 2)
        Lower and upper ends: of Student's distribution where the noise is estimated, of the normal
        one where it is known.

    Raises
    ------
    InvalidValueError
        A level that is no probability.

    Examples
    --------
    >>> from robotmodels.estimation import fit_nonlinear
    >>> y = np.array([1.0, 2.0, 3.0])
    >>> fit = fit_nonlinear(lambda x: (x - y, np.ones((3, 1))), [0.0])
    >>> confidence_intervals(fit).round(3)
    array([[-0.484,  4.484]])
    """
    from scipy.special import ndtri, stdtrit

    if not 0 < level < 1:
        raise InvalidValueError(f"level: expected a probability between 0 and 1, got {level!r}.")
    tail = (1 + level) / 2
    if fit.sigma_known:
        wide = float(ndtri(tail))
    else:
        wide = float(stdtrit(fit.freedom_left, tail)) if fit.freedom_left > 0 else np.nan
    return fit.x[:, None] + wide * fit.deviations[:, None] * np.array([-1.0, 1.0])


def linearity(fit: NonlinearFit, linearise: Linearise) -> Linearity:
    """Compare what linear steps predicted with what happened.

    Parameters
    ----------
    fit : NonlinearFit
        A fit.
    linearise : callable
        The function that was fitted; called once, at ``fit.x0``.

    Returns
    -------
    Linearity
        Ratios, change of the Jacobian and a sentence.

    Examples
    --------
    >>> from robotmodels.estimation import fit_nonlinear
    >>> A = np.random.default_rng(0).normal(size=(9, 2))
    >>> linear = lambda x: (A @ x - 1.0, A)
    >>> found = linearity(fit_nonlinear(linear, [0.0, 0.0]), linear)
    >>> bool(abs(found.ratios[0] - 1) < 1e-12), float(found.curvature.max())
    (True, 0.0)
    """
    M, P = fit.jacobian.shape
    J0 = as_exact(linearise(fit.x0.copy())[1], (M, P), "jacobian")
    now = np.linalg.norm(fit.jacobian / fit.sigma[:, None], axis=0)
    change = np.linalg.norm((fit.jacobian - J0) / fit.sigma[:, None], axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        curvature = np.where(change > 0, change / now, 0.0)
    total, predicted, actual = fit.steps[:, 0], fit.steps[:, 1], fit.steps[:, 2]
    seen = predicted > 1e-10 * total
    ratios = actual[seen] / predicted[seen]
    whole = float(actual[seen].sum())
    first = float(actual[seen][0]) if len(ratios) else 0.0
    missed = 1 - first / whole if whole > 0 else 0.0
    return Linearity(ratios, curvature, missed, _linearity_sentence(ratios, curvature))


def _linearity_sentence(ratios: Array, curvature: Array) -> str:
    largest = float(curvature.max(initial=0.0))
    last = float(ratios[-1]) if len(ratios) else 1.0
    change = f"the Jacobian changes by at most {100 * largest:.2g} % on the way"
    if abs(last - 1) > 0.1:
        return (
            f"The last visible step lowered the sum by {last:.2g} of what it predicted, and "
            f"{change}: the statistics, which are linear, are doubtful."
        )
    if largest > 0.3:
        return (
            f"Steps predict what happens at the end, but {change}: one linear step is not enough."
        )
    return f"Steps predict what happens, and {change}: the linear statistics hold."


def _condition(s: Array) -> float:
    smallest = float(s[-1])
    return float(s[0]) / smallest if smallest > 0 else float("inf")


def _chi_squared(fit: NonlinearFit) -> ResidualTest:
    from scipy.special import chdtr, chdtrc

    statistic = float(fit.whitened @ fit.whitened)
    left = fit.freedom_left
    if left <= 0:
        return ResidualTest(statistic, np.nan, "No row is left over: nothing can be tested.")
    ratio = np.sqrt(statistic / left)
    p = min(1.0, 2 * min(float(chdtr(left, statistic)), float(chdtrc(left, statistic))))
    if not p < _DOUBT:
        text = f"Residuals are as large as stated ({ratio:.3g} of the stated deviations)."
    elif ratio > 1:
        text = (
            f"Residuals are {ratio:.3g} times as large as stated: the model lacks something, there "
            "are outliers, or the stated deviations are too small."
        )
    else:
        text = f"Residuals are only {ratio:.3g} of the stated deviations, which are too large."
    return ResidualTest(statistic, p, text)


def _usual(fit: NonlinearFit) -> NDArray[np.bool_]:
    """Rows of the measurements that are not listed as outliers."""
    return ~np.isin(fit.block, fit.outliers)


def _normality(fit: NonlinearFit) -> ResidualTest:
    z = fit.whitened[_usual(fit)]
    if len(z) < 20 or not z.std() > 0:
        return ResidualTest(np.nan, np.nan, "Too few rows (20 are needed) to judge a distribution.")
    from scipy.stats import normaltest

    found = normaltest(z)
    p = float(found.pvalue)
    text = (
        "Nothing speaks against Gaussian residuals."
        if not p < _DOUBT
        else "Residuals are not Gaussian: look for outliers left, mixed accuracies or a bad model."
    )
    return ResidualTest(float(found.statistic), p, text)


def _independence(fit: NonlinearFit) -> ResidualTest:
    """Correlation of rows of successive measurements, in the order of the rows."""
    from scipy.special import erfc

    usual = _usual(fit)
    z, block = fit.whitened[usual], fit.block[usual]
    first = (
        np.flatnonzero(np.concatenate(([True], np.diff(block) != 0))) if len(z) else np.arange(0)
    )
    size = np.diff(np.concatenate((first, [len(z)])))
    pairs = np.flatnonzero(size[:-1] == size[1:]) if len(size) > 1 else np.arange(0)
    left = np.repeat(first[pairs], size[pairs]) + _within(size[pairs])
    right = left + np.repeat(size[pairs], size[pairs])
    if len(left) < 20:
        return ResidualTest(np.nan, np.nan, "Too few rows (20 pairs are needed) to judge an order.")
    a, b = z[left], z[right]
    scale = np.sqrt((a @ a) * (b @ b))
    if not scale > 0:
        return ResidualTest(np.nan, np.nan, "There are no residuals whose order could be judged.")
    correlation = float(a @ b / scale)
    p = float(erfc(abs(correlation) * np.sqrt(len(a) / 2)))
    text = (
        "Successive measurements are not correlated."
        if not p < _DOUBT
        else f"Successive measurements are correlated ({correlation:.2f}): there is a drift or a "
        "missing effect, and the stated deviations of the parameters are too small."
    )
    return ResidualTest(correlation, p, text)


def _within(size: NDArray[np.int64]) -> NDArray[np.int64]:
    """0, 1, ... for each of several runs."""
    ends = np.cumsum(size)
    return np.arange(int(ends[-1]) if len(ends) else 0) - np.repeat(ends - size, size)
