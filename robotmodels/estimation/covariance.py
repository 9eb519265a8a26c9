"""Covariance of linear estimates whose residuals are correlated in time and between groups.

Source: D. Cochrane and G. Orcutt, J. American Statistical Association 44, 1949 (the covariance);
D. Politis, "Adaptive bandwidth choice", J. Nonparametric Statistics 15, 2003 (the window); J.
MacKinnon and H. White, J. Econometrics 29, 1985 (the correction for the number of parameters); H.
Kuensch, Annals of Statistics 17(3), 1989 (the block jackknife).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .._arrays import Array, Frozen
from .factor import Rows, TriangularFactors
from .linear import LEAST_FREEDOM

_MOST_LAGS = 60
_UNCORRELATED = 5  # successive lags without correlation that end the window
_LEAST = 0.1
"""Least ratio of the variance with lags to that without; below it the lags are not used."""
_LARGEST_LEVERAGE = 0.5  # largest leverage of a segment in the jackknife


@dataclass(frozen=True, slots=True, eq=False)
class CorrelatedCovariance(Frozen):
    """Covariance of estimates for correlated residuals. Read-only.

    Parameters
    ----------
    covariance, lags, correlation : ndarray (b, b), int, ndarray (m,)
        Of the estimates; of the window; of successive residuals of each group.
    """

    covariance: Array
    lags: int
    correlation: Array


def correlated_covariance(
    rows: Rows,
    values: Array,
    weights: Array,
    inverse: Array,
    lags: int | None = None,
    leverage: Array | None = None,
) -> CorrelatedCovariance:
    """Covariance of weighted least squares without the assumption of white residuals.

    The residuals of the groups are taken as stationary. Their covariances, between groups and over
    as many instants as they are correlated, are estimated from the residuals themselves, and
    propagated to the parameters by the regressor.

    Parameters
    ----------
    rows : Rows
        The equations.
    values, weights, inverse : ndarray, shapes (b,), (m,), (b, b)
        Estimated parameters, weights of the groups of equations, and the inverse of the information
        ``sum W^T diag(weights^2) W``.
    lags : int, optional
        Lags on either side; default twice the correlation length of the residuals.
    leverage : ndarray, shape (m,), optional
        Parameters that each group determines; default in proportion to its equations.

    Returns
    -------
    CorrelatedCovariance
        Corrected for the number of parameters.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> rng = np.random.default_rng(0)
    >>> W, e = np.ones((4000, 1, 1)), rng.normal(size=(4001, 1))
    >>> block = SimpleNamespace(W=W, y=e[1:] + e[:-1], use=np.ones((4000, 1), dtype=bool))
    >>> rows = SimpleNamespace(blocks=lambda: [block])
    >>> found = correlated_covariance(rows, block.y.mean(axis=0), np.ones(1), np.eye(1) / 4000)
    >>> bool(1.6 < found.covariance[0, 0] / (block.y.var() / 4000) < 2.4)
    True
    """
    b, m = len(values), len(weights)
    diagonal = np.arange(m)
    products, pairs, count = _residual_products(rows, values, m)
    size, counts = products[0, diagonal, diagonal], pairs[0, diagonal, diagonal]
    correlation = products[1, diagonal, diagonal] / np.where(size > 0.0, size, 1.0)
    number = int(counts @ (weights > 0.0))
    if lags is None:
        lags = _correlated_lags(products[:, diagonal, diagonal] @ weights**2, number)
    window = _flat_top_window(lags, count)
    gamma = products / np.maximum(pairs, 1.0)
    # leverage correction of the residuals, as for the jackknife
    taken = counts * (b / max(number, 1)) if leverage is None else leverage
    few = (counts > 0.0) & (counts - taken < LEAST_FREEDOM)
    larger = np.where(few, 1.0, counts / np.maximum(counts - taken, 1.0))
    gamma *= np.outer(larger, larger)
    pooled = float(size.sum()) / max(number - b, 1)
    variance = gamma[0, diagonal, diagonal]
    gamma[0, diagonal, diagonal] = np.where(few, np.maximum(variance, pooled), variance)
    alone, between = _score_covariance(rows, weights, gamma, window, b)
    alone = inverse @ alone @ inverse
    whole = alone + inverse @ between @ inverse
    # with few instants the window may give a variance near or below zero
    if (np.diag(whole) < _LEAST * np.diag(alone)).any():
        return CorrelatedCovariance(alone, 0, correlation)
    return CorrelatedCovariance(whole, len(window), correlation)


def jackknife_inflation(
    segments: Sequence[TriangularFactors],
    factors: TriangularFactors,
    weights: Array,
    standard_errors: Array,
    share: float = 1.0,
) -> float:
    """Ratio, at least 1, of block-jackknife standard errors to the given ones.

    ``share`` is the part of all equations that the segments cover.
    """
    R, y, _ = factors.stacked(weights)
    inverse = np.linalg.inv(R)
    values = inverse @ y
    covariance = np.zeros(R.shape)
    for segment in segments:
        T, z, _ = segment.stacked(weights)
        A = T @ inverse
        leverage, Q = np.linalg.eigh(A @ A.T)
        # residuals of the segment with the parameters of all others
        bounded = np.clip(leverage, 0.0, _LARGEST_LEVERAGE)
        score = A.T @ (Q @ ((Q.T @ (z - T @ values)) / (1.0 - bounded)))
        covariance += np.outer(score, score)
    variances = np.diag(inverse @ covariance @ inverse.T) / share
    ratio = variances / np.maximum(standard_errors**2, 1e-300)
    return float(max(1.0, np.sqrt(ratio.mean())))


def _residual_products(rows: Rows, values: Array, m: int) -> tuple[Array, Array, int]:
    """Sums of products of residuals, and numbers of pairs, by lag (L + 1, m, m); instants."""
    products, pairs = np.zeros((2, _MOST_LAGS + 1, m, m))
    last, count = np.zeros((2, 0, m)), 0
    for block in rows.blocks():
        e = np.where(block.use, block.y - block.W @ values, 0.0)
        chain = np.concatenate((last, np.stack((e, block.use))), axis=1)
        k = last.shape[1]
        for lag in range(min(_MOST_LAGS + 1, chain.shape[1])):
            first = max(k, lag)  # pairs with the later instant in this block
            before, now = chain[:, first - lag : chain.shape[1] - lag], chain[:, first:]
            products[lag] += before[0].T @ now[0]
            pairs[lag] += before[1].T @ now[1]
        last = chain[:, -_MOST_LAGS:]
        count += len(e)
    return products, pairs, count


def _score_covariance(
    rows: Rows, weights: Array, gamma: Array, window: Array, b: int
) -> tuple[Array, Array]:
    """Covariance of the scores (b, b), of each instant alone and between instants."""
    m = len(weights)
    alone, between = np.zeros((2, b, b))
    before = np.zeros((0, m, b))
    for block in rows.blocks():
        W = block.W * np.where(block.use, weights**2, 0.0)[:, :, None]
        flat_W = np.ascontiguousarray(W).reshape(-1, b)
        alone += np.matmul(gamma[0].T, W).reshape(-1, b).T @ flat_W
        chain = np.concatenate((before, W))
        k = len(before)
        # sums over the lags of the residual products for each row
        flat = np.ascontiguousarray(chain.transpose(1, 0, 2)).reshape(m, -1)
        carried = np.zeros((m, len(W) * b))
        for lag, share in enumerate(window, start=1):
            first = max(k, lag)
            if first < len(chain):
                earlier = flat[:, (first - lag) * b : (len(chain) - lag) * b]
                carried[:, (first - k) * b :] += (share * gamma[lag].T) @ earlier
        part = carried.reshape(-1, b).T @ flat[:, k * b :].reshape(-1, b)
        between += part + part.T
        before = chain[max(len(chain) - len(window), 0) :]
    return alone, between


def _correlated_lags(products: Array, count: int) -> int:
    """Window: twice the number of lags over which residuals are correlated."""
    if not products[0] > 0.0:
        return 0
    r = np.abs(products / products[0])
    bound = 2.0 * np.sqrt(np.log10(max(count, 10)) / max(count, 10))
    for lag in range(len(r) - _UNCORRELATED):
        if (r[lag + 1 : lag + 1 + _UNCORRELATED] < bound).all():
            return min(2 * lag, _MOST_LAGS)
    return len(r) - 1


def _flat_top_window(lags: int, count: int) -> Array:
    """Flat-top window of lags 1 to ``lags``: 1 in the first half, then linear to zero."""
    k = np.arange(1, max(0, min(lags, count - 2)) + 1)
    return np.minimum(1.0, 2.0 * (1.0 - k / (len(k) + 1.0)))
