"""Covariance of estimates whose residuals are correlated in time and between joints."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from .._arrays import Array, Rebuilt, read_only
from .equations import Block, Equations

_MOST = 200
"""Lags at most."""


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

    The scores of each instant, of all joints together, are summed with those of the instants
    around it (Bartlett's window), so that correlation in time, between joints, and variances that
    change count.

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
        Instants on either side; default by Andrews' rule from the correlation of successive
        residuals.

    Returns
    -------
    CorrelatedCovariance
        Corrected for the number of parameters.

    References
    ----------
    W. Newey and K. West, "A simple, positive semi-definite, heteroskedasticity and autocorrelation
    consistent covariance matrix", Econometrica 55(3), 1987; D. Andrews, "Heteroskedasticity and
    autocorrelation consistent covariance matrix estimation", Econometrica 59(3), 1991, (6.2).
    """
    b, m = len(values), len(weights)
    products, squares, count, rows = np.zeros(m), np.zeros(m), 0, 0
    last = np.zeros((0, m))
    for block, e in _residuals(system, values):
        chain = np.vstack((last, e))
        products += (chain[1:] * chain[:-1]).sum(axis=0)
        squares += (e * e).sum(axis=0)
        last = e[-1:]
        count += len(e)
        rows += int(block.use.sum())
    correlation = products / np.where(squares > 0.0, squares, 1.0)
    if lags is None:
        shares = squares * weights**2
        rho = float(shares @ correlation / shares.sum()) if shares.any() else 0.0
        rho = min(abs(rho), 0.97)
        alpha = 4.0 * rho**2 / (1.0 - rho**2) ** 2
        lags = int(np.ceil(1.1447 * (alpha * count) ** (1.0 / 3.0)))
    lags = max(0, min(lags, _MOST, count - 1))
    window = 1.0 - np.arange(1, lags + 1) / (lags + 1.0)
    total = np.zeros((b, b))
    before = np.zeros((0, b))
    for block, e in _residuals(system, values):
        scores = np.einsum("kjb,kj->kb", block.W, e * weights**2)
        total += scores.T @ scores
        chain = np.vstack((before, scores))
        k = len(before)
        for lag, share in enumerate(window, start=1):
            first = max(k - lag, 0)
            ahead = chain[first + lag :]
            if len(ahead):
                part = chain[first : first + len(ahead)].T @ ahead
                total += share * (part + part.T)
        before = chain[max(len(chain) - lags, 0) :] if lags else before
    factor = rows / max(rows - b, 1)
    return CorrelatedCovariance(factor * inverse @ total @ inverse, lags, correlation)


def _residuals(system: Equations, values: Array) -> Iterator[tuple[Block, Array]]:
    """Blocks and their residuals, zero where an equation does not take part."""
    for block in system.blocks():
        yield block, np.where(block.use, block.y - block.W @ values, 0.0)
