"""Covariance of estimates whose residuals are correlated in time and between joints."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from .._arrays import Array, Rebuilt, read_only
from .equations import Block, Equations

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
    successive residuals, summed with those of the instants around it (Bartlett's window), and
    coloured again, so that correlation in time, between joints, and variances that change count.

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
        Instants on either side; default the fifth root of the number of instants.

    Returns
    -------
    CorrelatedCovariance
        Corrected for the number of parameters.

    References
    ----------
    W. Newey and K. West, "A simple, positive semi-definite, heteroskedasticity and autocorrelation
    consistent covariance matrix", Econometrica 55(3), 1987; D. Andrews and C. Monahan, "An improved
    heteroskedasticity and autocorrelation consistent covariance matrix estimator", Econometrica
    60(4), 1992 (whitening).
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
    shares = squares * weights**2
    rho = float(shares @ correlation / shares.sum()) if shares.any() else 0.0
    rho = min(max(rho, -_STRONGEST), _STRONGEST)
    if lags is None:
        lags = int(count**0.2)
    lags = max(0, min(lags, count - 2))
    window = 1.0 - np.arange(1, lags + 1) / (lags + 1.0)
    total = np.zeros((b, b))
    last, before = np.zeros((0, b)), np.zeros((0, b))
    for block, e in _residuals(system, values):
        scores = np.vstack((last, np.einsum("kjb,kj->kb", block.W, e * weights**2)))
        last = scores[-1:]
        white = scores[1:] - rho * scores[:-1]
        total += white.T @ white
        chain = np.vstack((before, white))
        k = len(before)
        for lag, share in enumerate(window, start=1):
            first = max(k - lag, 0)
            ahead = chain[first + lag :]
            if len(ahead):
                part = chain[first : first + len(ahead)].T @ ahead
                total += share * (part + part.T)
        before = chain[max(len(chain) - lags, 0) :] if lags else before
    # one instant less, and the parameters that were taken from the residuals
    factor = count / max(count - 1, 1) * rows / max(rows - b, 1) / (1.0 - rho) ** 2
    return CorrelatedCovariance(factor * inverse @ total @ inverse, lags, correlation)


def _residuals(system: Equations, values: Array) -> Iterator[tuple[Block, Array]]:
    """Blocks and their residuals, zero where an equation does not take part."""
    for block in system.blocks():
        yield block, np.where(block.use, block.y - block.W @ values, 0.0)
