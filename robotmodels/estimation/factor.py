"""Triangular factors of groups of equations: linear least squares in bounded memory.

Source: J. Demmel, L. Grigori, M. Hoemmen and J. Langou, "Communication-optimal parallel and
sequential QR and LU factorizations", SIAM J. Scientific Computing 34(1), 2012.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array, Frozen, read_only
from ..errors import InvalidValueError


class Rows(Protocol):
    """Equations ``W @ x = y`` of m groups, in blocks of k instants that can be recomputed.

    Shapes of a block: W (k, m, b), y (k, m), use (k, m) bool: mask of used equations.
    """

    def blocks(self) -> Iterable[Any]:
        """The blocks, in order."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class TriangularFactors(Frozen):
    """Triangular factors of equations, one for each group such as a joint. Read-only.

    Parameters
    ----------
    names : tuple of str
        The b parameters.
    factors : tuple of ndarray, shapes (r, b + 1)
        Factor R of each group, ``R^T R = [W y]^T [W y]``.
    counts, left_out : ndarray of int, shape (m,)
        Used and excluded equations of each group.

    Examples
    --------
    >>> W, y = np.ones((9, 1, 1)), np.full((9, 1), 2.0)
    >>> factors = factors_of(("x",), W, y, np.ones((9, 1), dtype=bool))
    >>> factors.rows, factors.factors[0].shape
    (9, (2, 2))
    """

    names: tuple[str, ...]
    factors: tuple[Array, ...]
    counts: NDArray[np.int64]
    left_out: NDArray[np.int64]

    def __post_init__(self) -> None:
        object.__setattr__(self, "factors", tuple(read_only(R) for R in self.factors))
        Frozen.__post_init__(self)

    @property
    def rows(self) -> int:
        """Number of used equations."""
        return int(self.counts.sum())

    def sums(self, values: Array) -> Array:
        """Sum of squared residuals of each group (m,) at values (b,)."""
        residuals = [R[:, -1] - R[:, :-1] @ values for R in self.factors]
        return np.array([float(e @ e) for e in residuals])

    def stacked(self, weights: Array | None = None) -> tuple[Array, Array, float]:
        """One triangular system of all groups, each multiplied by its weight (m,).

        Shapes: -> R (b, b), y (b,) and the sum of squares that no parameters explain.
        """
        b = len(self.names)
        scaled = self.factors if weights is None else map(np.multiply, self.factors, weights)
        R = triangle(np.vstack([np.zeros((b + 1, b + 1)), *scaled]))
        return R[:b, :b], R[:b, b], float(R[b, b] ** 2)

    def with_names(self, names: tuple[str, ...]) -> TriangularFactors:
        """The equations with the other parameters set to zero."""
        columns = [*(self.names.index(name) for name in names), len(self.names)]
        factors = tuple(R[:, columns] for R in self.factors)
        return TriangularFactors(tuple(names), factors, self.counts, self.left_out)


def factors_of(
    names: tuple[str, ...], W: Array, y: Array, use: NDArray[np.bool_]
) -> TriangularFactors:
    """Reduce the equations of one block. Shapes: W (k, m, b), y (k, m), use (k, m)."""
    factors = tuple(
        _of_columns(np.column_stack((W[taking_part, j], y[taking_part, j])))
        for j, taking_part in enumerate(use.T)
    )
    counts = use.sum(axis=0)
    return TriangularFactors(names, factors, counts, len(use) - counts)


def merged(first: TriangularFactors, second: TriangularFactors) -> TriangularFactors:
    """Factors of the equations of both."""
    if first.names != second.names or len(first.factors) != len(second.factors):
        raise InvalidValueError("equations: make all with the same base parameters and form.")
    both = zip(first.factors, second.factors, strict=True)
    return TriangularFactors(
        first.names,
        tuple(_of_columns(np.vstack(pair)) for pair in both),
        first.counts + second.counts,
        first.left_out + second.left_out,
    )


def merged_all(parts: Iterable[TriangularFactors]) -> TriangularFactors:
    """Factors of the equations of all parts, merged in their order."""
    total = None
    for part in parts:
        total = part if total is None else merged(total, part)
    if total is None:
        raise InvalidValueError("log: expected equations, got none; give a longer log.")
    return total


def reduced(names: tuple[str, ...], blocks: Iterable[Any]) -> TriangularFactors:
    """Triangular factors of blocks of equations in named parameters."""
    return merged_all(factors_of(names, block.W, block.y, block.use) for block in blocks)


def triangles_of(pieces: Iterable[Array], columns: int) -> Array:
    """Rows (r, columns) with the products of all pieces (k, m, columns), a triangle a group."""
    groups: list[Array] = []
    for W in pieces:
        groups = groups or [np.zeros((0, columns))] * W.shape[1]
        groups = [_of_columns(np.vstack((R, W[:, j]))) for j, R in enumerate(groups)]
    return np.vstack([np.zeros((0, columns)), *groups])


def triangle(rows: Array) -> Array:
    """Upper triangular factor R of rows, ``R^T R = rows^T rows``: (k, p) -> (min(k, p), p)."""
    return np.asarray(np.linalg.qr(rows, mode="r"))


def _of_columns(rows: Array) -> Array:
    """Triangular factor of the nonzero columns; the others are zero."""
    columns = np.flatnonzero(rows.any(axis=0))
    R = triangle(rows[:, columns]) if len(rows) > len(columns) else rows[:, columns]
    whole = np.zeros((len(R), rows.shape[1]))
    whole[:, columns] = R
    return whole
