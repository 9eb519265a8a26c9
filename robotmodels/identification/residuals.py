"""Tests of the residuals of an identification: white in time, and normal.

Source: G. Ljung and G. Box, Biometrika 65, 1978; D. Stoffer and C. Toloi, Statistics & Probability
Letters 13, 1992 (gaps); I. Lobato and C. Velasco, Econometric Theory 20, 2004 (normality of
correlated series).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array, Frozen
from .equations import Equations

_LAGS = 40
SIGNIFICANCE = 0.01
"""Significance level of the residual tests."""
_FEW = 20  # least number of equations for the residual tests


@dataclass(frozen=True, slots=True, eq=False)
class ResidualDiagnostics(Frozen):
    """Statistics of the residuals of m groups of equations over L lags. Read-only.

    Shapes: counts, mean, std, skewness, kurtosis (less 3 of a normal distribution) (m,);
    autocorrelation and its 95 % bounds if white (m, L + 1); p-values (m,), NaN if not tested.
    """

    counts: NDArray[np.int64]
    mean: Array
    std: Array
    autocorrelation: Array
    bounds: Array
    skewness: Array
    kurtosis: Array
    white_p: Array
    normal_p: Array

    @property
    def lags(self) -> int:
        """Number of lags."""
        return self.autocorrelation.shape[1] - 1


def residual_diagnostics(system: Equations, values: Array) -> ResidualDiagnostics:
    """Statistics of the residuals of equations at values (b,).

    Equations in a dead band and the ends of recordings are gaps, which no pair of residuals spans.
    """
    from scipy.special import chdtrc

    residuals, use = _series(system, values)
    lags = max(1, min(_LAGS, int(use.any(axis=1).sum()) // 4))
    counts = use.sum(axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        mean = residuals.sum(axis=0) / counts
        e = np.where(use, residuals - mean, 0.0)
        std = np.sqrt((e**2).sum(axis=0) / counts)
        e = e / np.where(std > 0.0, std, np.nan)
        both = ((use[k:] & use[: len(e) - k], e[k:] * e[: len(e) - k]) for k in range(lags + 1))
        sums = np.array([(x.sum(axis=0), y.sum(axis=0)) for x, y in both])
        pairs, products = sums.transpose(1, 2, 0)
        rho = products / pairs
        bounds = 1.959964 / np.sqrt(pairs)
        bounds[:, 0] = 0.0
        skewness = (e**3).sum(axis=0) / counts
        kurtosis = (e**4).sum(axis=0) / counts - 3.0
        Q = (counts + 2.0) / counts * np.nansum(pairs[:, 1:] * rho[:, 1:] ** 2, axis=1)
        # variances of the moments of a correlated series
        r = np.nan_to_num(rho[:, 1:])
        F3 = np.maximum(1.0 + 2.0 * (r**3).sum(axis=1), 0.1)
        F4 = 1.0 + 2.0 * (r**4).sum(axis=1)
        G = counts * (skewness**2 / (6.0 * F3) + kurtosis**2 / (24.0 * F4))
    enough = (counts >= _FEW) & (std > 0.0)
    white, normal = (np.where(enough, p, np.nan) for p in (chdtrc(lags, Q), chdtrc(2, G)))
    return ResidualDiagnostics(counts, mean, std, rho, bounds, skewness, kurtosis, white, normal)


def _series(system: Equations, values: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Residuals (N, m), zero in gaps, and mask of equations (N, m)."""
    residuals, use, begin = [], [], None
    gap = np.zeros((_LAGS, system.groups))
    for piece in system.pieces():
        block = system.block(piece)
        if begin not in (None, piece.begin):
            residuals.append(gap)
            use.append(gap > 0.0)
        begin = piece.begin
        residuals.append(np.where(block.use, block.y - block.W @ values, 0.0))
        use.append(block.use)
    return np.concatenate(residuals), np.concatenate(use)
