"""Outliers of a least-squares fit: by deleted residuals, one measurement at a time, without refits.

An outlier bends the fit, so that the residuals of good measurements are long as well. A deleted
residual is that of the fit without the measurement. All are had from the last linearisation: with
rows T that are orthonormal together with those of the prior, a measurement of rows T_b has the
deleted residual ``(I - T_b T_b')^-1 r_b`` of covariance ``(I - T_b T_b')^-1``.

Source: R. D. Cook, S. Weisberg, "Residuals and Influence in Regression", 1982, section 2.2.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from .losses import length_quantile, median_length

FALSE_OUTLIERS = 0.05
"""Outliers expected to be listed in a whole fit of Gaussian residuals."""
_AS_BAD = 0.7
"""Measurements whose deleted residuals are that part of the longest are taken away with it."""
_ALONE = 1e-8
"""Share of a row that is not fitted by itself, under which it has no deleted residual."""


class _Reduced:
    """Rows of a fit from which measurements are taken away and given back."""

    def __init__(self, T: Array, r: Array, starts: NDArray[np.int64]) -> None:
        self.T, self.r = T.copy(), r.copy()
        self.parts = [slice(a, b) for a, b in pairwise([*starts.tolist(), len(r)])]
        self.kept = np.ones(len(self.parts), dtype=bool)

    def move(self, blocks: NDArray[np.int64]) -> bool:
        """Take measurements away, or give them back; False if nothing would say what they say."""
        rows = np.concatenate([np.arange(self.parts[b].start, self.parts[b].stop) for b in blocks])
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

    def squares(self, blocks: NDArray[np.int64]) -> tuple[Array, NDArray[np.int64]]:
        """Squares of deleted residuals relative to their covariance, and numbers of rows.

        Zero for a measurement that determines something alone: it has no deleted residual.
        """
        found = np.zeros(len(blocks))
        sizes = np.array([self.parts[b].stop - self.parts[b].start for b in blocks])
        for k in np.unique(sizes):
            which = np.flatnonzero(sizes == k)
            at = np.array([self.parts[blocks[i]].start for i in which])[:, None] + np.arange(k)
            T = self.T[at]
            sign = np.where(self.kept[blocks[which]], -1.0, 1.0)
            share, axes = np.linalg.eigh(np.eye(k) + sign[:, None, None] * (T @ T.swapaxes(1, 2)))
            along = (axes.swapaxes(1, 2) @ self.r[at][..., None])[..., 0]
            alone = share.min(axis=1) < _ALONE
            share[alone] = np.inf
            found[which] = (along**2 / share).sum(axis=1)
        return found, sizes


def outlying(
    T: Array,
    r: Array,
    starts: NDArray[np.int64],
    freedom: float,
    trusted: NDArray[np.bool_] | None = None,
    removed: NDArray[np.int64] | None = None,
) -> NDArray[np.int64]:
    """Measurements that noise of the scale of the others does not explain, the worst first.

    Shapes: T (M, rank); r (M,); starts, trusted (B,). T and r are of a fit without ``removed``.
    """
    from scipy.special import fdtri

    reduced = _Reduced(T, r, starts)
    everything = np.arange(len(starts))
    chance = FALSE_OUTLIERS / max(len(starts), 1)
    judged = np.ones(len(starts), dtype=bool) if trusted is None else ~trusted
    removed = everything[:0] if removed is None else removed
    reduced.kept[removed] = False
    while len(removed) < len(starts) // 2:
        kept = everything[reduced.kept & judged]
        square, rows = reduced.squares(kept)
        length = np.sqrt(square)
        told = square > 0.0
        scale = float(np.median((length / median_length(rows))[told])) if told.any() else 0.0
        excess = length / length_quantile(rows, 1.0 - chance)
        longest = float(excess.max())
        worst = kept[excess >= _AS_BAD * longest]
        if longest <= scale or not reduced.move(worst):
            break
        removed = np.concatenate([removed, worst])
    while len(removed):
        inside = np.concatenate([reduced.r[reduced.parts[b]] for b in everything[reduced.kept]])
        left = len(inside) - freedom
        square, rows = reduced.squares(removed)
        if left <= 0.0:
            return everything[:0]
        ratio = square / rows / (float(inside @ inside) / left or np.finfo(float).tiny)
        ratio = ratio / fdtri(rows, left, 1.0 - chance)
        order = np.argsort(-ratio, kind="stable")
        removed = removed[order]
        if ratio[order[-1]] > 1.0:
            break
        reduced.move(removed[-1:])
        removed = removed[:-1]
    return removed
