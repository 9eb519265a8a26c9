"""Covariance of estimates whose residuals are correlated in time and between joints."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from .._arrays import Array, Rebuilt, read_only
from .equations import Block, Equations

_MOST = 60
"""Lags at most."""
_LEFT = 5.0
"""Equations that a kind must have beyond the parameters it determines."""
_QUIET = 5
"""Lags in a row without correlation, after which there is none."""
_LEAST = 0.1
"""Variance with all lags, relative to that without them, below which the lags are not used."""


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
    system: Equations,
    values: Array,
    weights: Array,
    inverse: Array,
    lags: int | None = None,
    taken: Array | None = None,
) -> CorrelatedCovariance:
    """Covariance of weighted least squares without the assumption that residuals are white.

    The residuals of the joints are taken as stationary: their covariances, between joints and over
    as many instants as they are correlated, come from the residuals themselves (a window that is
    flat first, then falls), and the regressor carries them to the parameters.

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

    taken : ndarray, shape (m,), optional
        Parameters that each kind of equations has determined (sums of leverages); default in equal
        shares of the equations.

    Returns
    -------
    CorrelatedCovariance
        Corrected for the number of parameters.

    References
    ----------
    D. Cochrane and G. Orcutt, "Application of least squares regression to relationships containing
    autocorrelated error terms", J. American Statistical Association 44, 1949 (the covariance); D.
    Politis, "Adaptive bandwidth choice", Journal of Nonparametric Statistics 15, 2003 (the window
    and its length); J. MacKinnon and H. White, "Some heteroskedasticity-consistent covariance
    matrix estimators with improved finite sample properties", Journal of Econometrics 29, 1985 (the
    jackknife).

    Examples
    --------
    >>> from robotmodels.identification import (
    ...     Log,
    ...     choose_processing,
    ...     equations,
    ...     reduce_equations,
    ...     weighted,
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
    >>> found = weighted(reduce_equations(system))
    >>> w = 1.0 / found.sigma
    >>> W = np.concatenate([x.W * w[:, None] * x.use[..., None] for x in system.blocks()])
    >>> inverse = np.linalg.inv(np.einsum("kji,kjl->il", W, W))
    >>> spread = correlated_covariance(system, found.values, w, inverse)
    >>> bool((np.diag(spread.covariance) > 0.0).all())
    True
    """
    b, m = len(values), len(weights)
    products, pairs = np.zeros((2, _MOST + 1, m, m))
    last, count = np.zeros((2, 0, m)), 0
    for block, e in _residuals(system, values):
        chain = np.concatenate((last, np.stack((e, block.use))), axis=1)
        k = last.shape[1]
        for lag in range(min(_MOST + 1, chain.shape[1])):
            first = max(k, lag)  # pairs whose later one is new
            before, now = chain[:, first - lag : chain.shape[1] - lag], chain[:, first:]
            products[lag] += before[0].T @ now[0]
            pairs[lag] += before[1].T @ now[1]
        last = chain[:, -_MOST:]
        count += len(e)
    own = np.arange(m)
    size = products[0, own, own]
    correlation = products[1, own, own] / np.where(size > 0.0, size, 1.0)
    rows = int(pairs[0, own, own] @ (weights > 0.0))  # a kind without weight says nothing
    if lags is None:
        lags = _correlated(products[:, own, own] @ weights**2, rows)
    window = _flat_then_falling(lags, count)
    gamma = products / np.maximum(pairs, 1.0)
    # residuals that the parameters made smaller, the more so where they have more to say: as the
    # jackknife does, with the mean leverage of each kind
    counts = pairs[0, own, own]
    took = counts * (b / max(rows, 1)) if taken is None else taken
    few = (counts > 0.0) & (counts - took < _LEFT)
    larger = np.where(few, 1.0, counts / np.maximum(counts - took, 1.0))
    gamma *= np.outer(larger, larger)
    pooled = float(size.sum()) / max(rows - b, 1)
    gamma[0, own, own] = np.where(few, np.maximum(gamma[0, own, own], pooled), gamma[0, own, own])
    total, straight = np.zeros((b, b)), np.zeros((b, b))
    before = np.zeros((0, m, b))
    for block in system.blocks():
        W = block.W * np.where(block.use, weights**2, 0.0)[:, :, None]
        straight += _carried(W, gamma[0], W)
        chain = np.concatenate((before, W))
        k = len(before)
        # what residuals of the instants before carry to each row, all lags together
        flat = np.ascontiguousarray(chain.transpose(1, 0, 2)).reshape(m, -1)
        carried = np.zeros((m, len(W) * b))
        for lag, share in enumerate(window, start=1):
            first = max(k, lag)
            if first < len(chain):
                then = flat[:, (first - lag) * b : (len(chain) - lag) * b]
                carried[:, (first - k) * b :] += (share * gamma[lag].T) @ then
        part = carried.reshape(-1, b).T @ flat[:, k * b :].reshape(-1, b)
        total += part + part.T
        before = chain[max(len(chain) - len(window), 0) :]
    total = inverse @ (straight + total) @ inverse
    straight = inverse @ straight @ inverse
    # such a window may give less than nothing where instants are few
    if (np.diag(total) < _LEAST * np.diag(straight)).any():
        total, window = straight, window[:0]
    return CorrelatedCovariance(total, len(window), correlation)


def _carried(before: Array, gamma: Array, now: Array) -> Array:
    """Sum over instants of ``W_before^T gamma W_now``, shape (b, b)."""
    b = now.shape[2]
    mixed = np.matmul(gamma.T, before)
    return mixed.reshape(-1, b).T @ np.ascontiguousarray(now).reshape(-1, b)


def _correlated(pooled: Array, rows: int) -> int:
    """Lags of the window: twice those over which residuals are correlated."""
    if not pooled[0] > 0.0:
        return 0
    r = np.abs(pooled / pooled[0])
    bound = 2.0 * np.sqrt(np.log10(max(rows, 10)) / max(rows, 10))
    for lag in range(len(r) - _QUIET):
        if (r[lag + 1 : lag + 1 + _QUIET] < bound).all():
            return min(2 * lag, _MOST)  # no covariances are known beyond
    return len(r) - 1


def _flat_then_falling(lags: int, count: int) -> Array:
    """Weights of lags 1 to ``lags``: one for the first half, then falling to zero."""
    k = np.arange(1, max(0, min(lags, count - 2)) + 1)
    return np.minimum(1.0, 2.0 * (1.0 - k / (len(k) + 1.0))) if len(k) else np.zeros(0)


def _residuals(system: Equations, values: Array) -> Iterator[tuple[Block, Array]]:
    """Blocks and their residuals, zero where an equation does not take part."""
    for block in system.blocks():
        yield block, np.where(block.use, block.y - block.W @ values, 0.0)
