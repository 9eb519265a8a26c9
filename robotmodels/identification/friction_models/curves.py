"""Friction that is not linear in all its parameters, by columns that each joint has of its own."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array
from ...estimation.merging import merged_tree
from ..correlated import correlated_covariance
from ..equations import Block, Equations
from ..forms.rows import Rows, formed_block
from ..scale.reduction import Reduction, block_reduction, merge
from ..several_logs.loaded import column_lengths, residual_noise

OwnColumns = Callable[[Array, Array], tuple[Array, Array]]
"""From W ``(k, n, b)`` and velocities ``(k, n)``: W, changed or not, and ``(k, n, c)`` columns that
multiply c parameters of each joint."""


@dataclass(frozen=True, slots=True, eq=False)
class OwnEquations:
    """Equations with c extra columns whose parameters differ from joint to joint.

    Shapes: shift (n, c).
    """

    system: Equations
    columns: OwnColumns
    count: int
    shift: Array | None = None
    spread: bool = False

    def blocks(self) -> Iterator[Block]:
        """Equations of the whole log, piece by piece."""
        for piece in self.system.pieces():
            yield formed_block(self.system, piece, self._rows)

    def reduced(self) -> Reduction:
        """Factors of each joint, of b + c columns."""
        c, names = self.count, self.system.names
        every = (*names, *(f"own {k}" for k in range(c)))
        found = merged_tree((block_reduction(every, block) for block in self.blocks()), merge)
        assert found is not None
        return found

    def _rows(self, W: Array, tau: Array, v: Array, use: NDArray[np.bool_]) -> Rows:
        changed, own = self.columns(W, v)
        y = tau if self.shift is None else tau + (own * self.shift).sum(axis=2)
        if self.spread:
            own = spread_columns(own)
        return np.concatenate((changed, own), axis=2), y, use


def spread_columns(own: Array) -> Array:
    """Columns ``(k, n, c)`` of each joint at places of their own, ``(k, n, n c)``."""
    k, n, c = own.shape
    wide = np.zeros((k, n, n, c))
    wide[:, range(n), range(n)] = own
    return wide.reshape(k, n, n * c)


def chosen_factors(reduction: Reduction, b: int, which: NDArray[np.int64]) -> Reduction:
    """Reduced equations with selected extra columns for each joint. Shapes: which (n, d)."""
    n, d = which.shape
    names = tuple(str(k) for k in range(b + n * d))
    factors = []
    for j, F in enumerate(reduction.factors):
        rows = np.zeros((len(F), b + n * d + 1))
        rows[:, :b], rows[:, -1] = F[:, :b], F[:, -1]
        for i, k in enumerate(which[j].tolist()):
            if k >= 0:
                rows[:, b + j * d + i] = F[:, b + k]
        factors.append(rows)
    return Reduction(names, tuple(factors), reduction.counts, reduction.left_out)


@dataclass(frozen=True, slots=True, eq=False)
class Fitted:
    """Estimate from `fitted`. Shapes: values (p,), inverse (p, p), sums (n,)."""

    values: Array
    inverse: Array
    sums: Array


def fitted(reduction: Reduction, sigma: Array) -> Fitted:
    """Weighted least squares; columns without effect get 0."""
    rows = np.vstack([F / s for F, s in zip(reduction.factors, sigma, strict=True)])
    W, y = rows[:, :-1], rows[:, -1]
    there = np.flatnonzero(W.any(axis=0))
    size = column_lengths(W[:, there])
    Q, R = np.linalg.qr(W[:, there] / size)
    U, s, V = np.linalg.svd(R, full_matrices=False)
    good = s > 1e-10 * s[0]
    half = np.zeros((W.shape[1], int(good.sum())))
    half[there] = (V[good].T / s[good]) / size[:, None]
    values = half @ (U[:, good].T @ (Q.T @ y))
    return Fitted(values, half @ half.T, reduction.sums(values))


def own_covariance(system: OwnEquations, found: Fitted, values: Array, sigma: Array) -> Array:
    """Covariance of a solution of these equations, corrected for correlated residuals."""
    return correlated_covariance(
        cast(Equations, system), values, 1.0 / sigma, found.inverse
    ).covariance


def own_noise(reduction: Reduction) -> Array:
    """Deviations of the joints' residuals, each joint's equations alone, shape (n,)."""
    return residual_noise(reduction)
