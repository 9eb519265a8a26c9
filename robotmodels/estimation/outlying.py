"""Outliers of a least-squares fit by deleted residuals, one measurement at a time, without refits.

An outlier distorts the fit and all residuals. A deleted residual is that of the fit without the
measurement. All follow from the last linearisation: with rows T that are orthonormal together with
those of the prior, a measurement of rows T_b has the deleted residual ``(I - T_b T_b')^-1 r_b`` of
covariance ``(I - T_b T_b')^-1``.

Source: R. D. Cook, S. Weisberg, "Residuals and Influence in Regression", 1982, section 2.2.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from .losses import length_quantile, median_length

FALSE_OUTLIERS = 0.05  # expected number of false outliers in a fit of Gaussian residuals
_AS_BAD = 0.7
"""Measurements with deleted residuals above this share of the longest are deleted with it."""
_ALONE = 1e-8  # least 1 - leverage of a row with a deleted residual


def blocks_by_size(block: NDArray[np.int64]) -> list[tuple[NDArray[np.int64], NDArray[np.int64]]]:
    """Measurements of equal size and their rows. Shapes: block (M,) -> (n,), (n, k) each."""
    size = np.bincount(block)
    order, starts = np.argsort(block, kind="stable"), np.cumsum(size) - size
    groups = [(np.flatnonzero(size == k), np.arange(k)) for k in np.unique(size)]
    return [(which, order[starts[which, None] + rows]) for which, rows in groups]


class _Deletions:
    """Orthonormal rows and residuals of a fit from which measurements are deleted and restored."""

    def __init__(self, T: Array, r: Array, block: NDArray[np.int64]) -> None:
        self.T, self.r, self.block = T.copy(), r.copy(), block
        self.rows = np.bincount(block)
        self.kept = np.ones(len(self.rows), dtype=bool)
        self.sizes = blocks_by_size(block)

    def toggle(self, blocks: NDArray[np.int64]) -> bool:
        """Delete or restore measurements; False if the others do not determine their prediction."""
        rows = np.flatnonzero(np.isin(self.block, blocks))
        sign = -1.0 if self.kept[blocks[0]] else 1.0
        T = self.T[rows]
        share, axes = np.linalg.eigh(np.eye(T.shape[1]) + sign * (T.T @ T))
        if share[0] < _ALONE:
            return False
        step = axes @ ((axes.T @ (T.T @ self.r[rows])) / share)
        self.r -= sign * (self.T @ step)
        self.T = self.T @ ((axes / np.sqrt(share)) @ axes.T)
        self.kept[blocks] = sign > 0.0
        return True

    def squares(self, wanted: NDArray[np.bool_]) -> Array:
        """Squared deleted residuals relative to their covariance (B,); 0 where there is none."""
        lengths = np.zeros(len(self.rows))
        for which, rows in self.sizes:
            rows, which = rows[wanted[which]], which[wanted[which]]
            T = self.T[rows]
            sign = np.where(self.kept[which], -1.0, 1.0)[:, None, None]
            share, axes = np.linalg.eigh(np.eye(rows.shape[1]) + sign * (T @ T.swapaxes(1, 2)))
            along = (axes.swapaxes(1, 2) @ self.r[rows][..., None])[..., 0]
            share[share.min(axis=1) < _ALONE] = np.inf
            lengths[which] = (along**2 / share).sum(axis=1)
        return lengths


def outlying(
    T: Array,
    r: Array,
    block: NDArray[np.int64],
    freedom: float,
    trusted: NDArray[np.bool_] | None = None,
    removed: NDArray[np.int64] | None = None,
) -> NDArray[np.int64]:
    """Outliers by deleted residuals, the worst first.

    Shapes: T (M, rank); r, block (M,), from 0; trusted (B,). T and r are without ``removed``.
    """
    from scipy.special import fdtri

    fit = _Deletions(T, r, block)
    rows, B = fit.rows, len(fit.rows)
    chance = FALSE_OUTLIERS / max(B, 1)
    median, quantile = median_length(rows), length_quantile(rows, 1.0 - chance)
    judged = np.ones(B, dtype=bool) if trusted is None else ~trusted
    removed = np.arange(0) if removed is None else removed
    fit.kept[removed] = False
    while len(removed) < B // 2:
        length = np.sqrt(fit.squares(fit.kept & judged))
        seen = length > 0.0
        scale = float(np.median((length / median)[seen])) if seen.any() else 0.0
        excess = length / quantile
        worst = np.flatnonzero(excess >= _AS_BAD * excess.max())
        if excess.max() <= scale or not fit.toggle(worst):
            break
        removed = np.concatenate([removed, worst])
    while len(removed):
        inside = fit.r[fit.kept[block]]
        left = len(inside) - freedom
        if left <= 0.0:
            return removed[:0]
        variance = float(inside @ inside) / left or np.finfo(float).tiny
        ratio = (fit.squares(~fit.kept) / rows)[removed] / variance
        ratio = ratio / fdtri(rows[removed], left, 1.0 - chance)
        removed = removed[np.argsort(-ratio, kind="stable")]
        if ratio.min() > 1.0:
            break
        fit.toggle(removed[-1:])
        removed = removed[:-1]
    return removed
