"""Covariance of estimates whose residuals are correlated in time and between joints."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from .._arrays import Array, Rebuilt, read_only
from .equations import Block, Equations

_MOST = 60
"""Lags at most."""
_QUIET = 5
"""Lags in a row without correlation, after which there is none."""
_LEAST = 0.1
"""Variance with all lags, relative to that without them, below which the lags are not used."""
_STRONGEST = 0.97
"""Correlation of successive residuals beyond which whitening would divide by next to nothing."""


@dataclass(frozen=True, slots=True, eq=False)
class CorrelatedCovariance(Rebuilt):
    """Covariance of parameters that holds for correlated residuals. Read-only.

    Parameters
    ----------
    covariance : ndarray, shape (b, b)
        Of the estimates.
    lags : int
        Equations over which correlation was taken into account.
    correlation : ndarray, shape (m,)
        Of successive residuals, by kind of equations.
    """

    covariance: Array
    lags: int
    correlation: Array

    def __post_init__(self) -> None:
        for name in ("covariance", "correlation"):
            object.__setattr__(self, name, read_only(getattr(self, name)))


def correlated_covariance(
    system: Equations, values: Array, weights: Array, inverse: Array, lags: int | None = None
) -> CorrelatedCovariance:
    """Covariance of weighted least squares without the assumption that residuals are white.

    The scores of each instant, of all joints together, are whitened by the correlation of
    successive residuals, summed with those of as many instants around it as the whitened residuals
    are correlated over (a window that is flat first, then falls), and coloured again. So
    correlation in time and between joints and variances that change count.

    Parameters
    ----------
    system : Equations
        The equations.
    values : ndarray, shape (b,)
        Estimated parameters.
    weights : ndarray, shape (m,)
        Of each kind of equations.
    inverse : ndarray, shape (b, b)
        Inverse of the information ``sum W^T diag(weights^2) W``.
    lags : int, optional
        Instants on either side; default as many as the residuals say.

    Returns
    -------
    CorrelatedCovariance
        Corrected for the number of parameters.

    References
    ----------
    W. Newey and K. West, "A simple, positive semi-definite, heteroskedasticity and autocorrelation
    consistent covariance matrix", Econometrica 55(3), 1987 (the sum over lags); D. Andrews and C.
    Monahan, "An improved heteroskedasticity and autocorrelation consistent covariance matrix
    estimator", Econometrica 60(4), 1992 (whitening); D. Politis, "Adaptive bandwidth choice",
    Journal of Nonparametric Statistics 15, 2003 (the window and its length); J. MacKinnon and H.
    White, "Some heteroskedasticity-consistent covariance matrix estimators with improved finite
    sample properties", Journal of Econometrics 29, 1985 (the jackknife).
    """
    b, m = len(values), len(weights)
    products, count, rows = np.zeros((_MOST + 1, m)), 0, 0
    last = np.zeros((0, m))
    for block, e in _residuals(system, values):
        chain = np.vstack((last, e))
        for lag in range(min(_MOST + 1, len(chain))):
            # pairs whose later one is new
            first = max(len(last), lag)
            products[lag] += (chain[first:] * chain[first - lag : len(chain) - lag]).sum(axis=0)
        last = chain[-_MOST:]
        count += len(e)
        rows += int(block.use.sum())
    correlation = products / np.where(products[0] > 0.0, products[0], 1.0)
    pooled = products @ weights**2
    rho, found = _window(pooled, rows)
    window = _flat_then_falling(found if lags is None else lags, count)
    total, straight = np.zeros((b, b)), np.zeros((b, b))
    last, before = np.zeros((0, b)), np.zeros((0, b))
    for block, e in _residuals(system, values):
        scores = np.vstack((last, np.einsum("kjb,kj->kb", block.W, e * weights**2)))
        last = scores[-1:]
        white = scores[1:] - rho * scores[:-1]
        straight += white.T @ white
        chain = np.vstack((before, white))
        for lag, share in enumerate(window, start=1):
            first = max(len(before), lag)
            if first < len(chain):
                part = chain[first - lag : len(chain) - lag].T @ chain[first:]
                total += share * (part + part.T)
        before = chain[max(len(chain) - len(window), 0) :]
    total = inverse @ (straight + total) @ inverse
    straight = inverse @ straight @ inverse
    # such a window may give less than nothing where lags are few and noisy
    poor = np.diag(total) < _LEAST * np.diag(straight)
    if poor.any():
        total = straight
    # one instant less, and residuals that the parameters made smaller, the more so where they have
    # more to say: as the jackknife does, with the mean leverage
    factor = count / max(count - 1, 1) * (rows / max(rows - b, 1)) ** 2 / (1.0 - rho) ** 2
    return CorrelatedCovariance(factor * total, len(window), correlation[1])


def _window(pooled: Array, rows: int) -> tuple[float, int]:
    """Correlation of successive residuals, and lags over which they are when that is taken off."""
    if not pooled[0] > 0.0:
        return 0.0, 0
    r = pooled / pooled[0]
    rho = float(np.clip(r[1], -_STRONGEST, _STRONGEST))
    around = np.concatenate((r[1:2], r[:-2]))  # of lags -1 to K - 2
    white = (1.0 + rho**2) * r[:-1] - rho * (around + r[1:])
    white = np.abs(white / white[0])
    bound = 2.0 * np.sqrt(np.log10(max(rows, 10)) / max(rows, 10))
    for lag in range(len(white) - _QUIET):
        if (white[lag + 1 : lag + 1 + _QUIET] < bound).all():
            return rho, 2 * lag
    return rho, len(white) - 1


def _flat_then_falling(lags: int, count: int) -> Array:
    """Weights of lags 1 to ``lags``: one for the first half, then falling to zero."""
    k = np.arange(1, max(0, min(lags, count - 2)) + 1)
    return np.minimum(1.0, 2.0 * (1.0 - k / (len(k) + 1.0))) if len(k) else np.zeros(0)


def _residuals(system: Equations, values: Array) -> Iterator[tuple[Block, Array]]:
    """Blocks and their residuals, zero where an equation does not take part."""
    for block in system.blocks():
        yield block, np.where(block.use, block.y - block.W @ values, 0.0)
