"""Independent columns of a matrix: which are kept, and how the others follow from them.

Columns are taken in an order of preference, and a column is kept if it is not a combination of
those kept before it. So a dependent column is always regrouped into columns that come earlier.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, Rebuilt, as_floats, read_only
from ..errors import InvalidValueError, ShapeError

DEPENDENT = 1e-8
"""Sine of the angle to the span of the columns before, below which a column depends on them."""
EMPTY = 1e-8
"""Length relative to the longest column, below which a column is without effect."""


@dataclass(frozen=True, slots=True, eq=False)
class ColumnBasis(Rebuilt):
    """Columns that span all, and the combinations that give the others. Read-only.

    Parameters
    ----------
    kept : ndarray of int, shape (b,)
        Numbers of the independent columns, in the order of the matrix.
    empty : ndarray of int, shape (e,)
        Numbers of the columns without effect (zero).
    coefficients : ndarray, shape (b, p)
        ``W = W[:, kept] @ coefficients``: the parameters of the kept columns that give the same
        product as all parameters are ``coefficients @ parameters``.
    distance : ndarray, shape (p,)
        Sine of the angle between each column and the span of those kept before it; 0 for columns
        without effect.

    Examples
    --------
    >>> basis = column_basis([[1.0, 2.0, 0.0], [1.0, 2.0, 1.0]])
    >>> basis.kept, basis.coefficients
    (array([0, 2]), array([[1., 2., 0.],
           [0., 0., 1.]]))
    """

    kept: NDArray[np.int64]
    empty: NDArray[np.int64]
    coefficients: Array
    distance: Array

    def __post_init__(self) -> None:
        for name, dtype in (("kept", np.int64), ("empty", np.int64)):
            object.__setattr__(self, name, read_only(getattr(self, name), dtype))
        for name in ("coefficients", "distance"):
            object.__setattr__(self, name, read_only(getattr(self, name)))
        if self.coefficients.shape != (len(self.kept), len(self.distance)):
            raise ShapeError(
                f"coefficients: expected shape {(len(self.kept), len(self.distance))}, got "
                f"{self.coefficients.shape}."
            )

    @property
    def rank(self) -> int:
        """Number of independent columns."""
        return len(self.kept)

    @property
    def dependent(self) -> NDArray[np.int64]:
        """Numbers of the columns that follow from the kept ones, those without effect left out."""
        others = np.ones(len(self.distance), dtype=bool)
        others[self.kept] = others[self.empty] = False
        return np.flatnonzero(others)

    @property
    def gap(self) -> tuple[float, float]:
        """Smallest distance of a kept column and largest of a dependent one (1, 0 without any)."""
        kept, others = self.distance[self.kept], self.distance[self.dependent]
        return float(kept.min(initial=1.0)), float(others.max(initial=0.0))


def column_basis(
    W: ArrayLike,
    order: ArrayLike | None = None,
    scale: ArrayLike | None = None,
    dependent: float = DEPENDENT,
    empty: float = EMPTY,
) -> ColumnBasis:
    """Choose independent columns in an order of preference.

    The decision is free of scale: columns are compared by angles, and the lengths that tell a
    column without effect are taken in the units that ``scale`` gives.

    Parameters
    ----------
    W : array_like, shape (N, p)
        The matrix, or the triangular factor of it: only ``W^T W`` matters.
    order : array_like of int, shape (p,), optional
        Columns from the most to the least preferred; default as they stand.
    scale : array_like, shape (p,), optional
        Natural size of the parameter of each column, so that ``W * scale`` has comparable columns;
        default 1.
    dependent : float
        Sine of the angle to the columns kept before, below which a column depends on them.
    empty : float
        Length of ``W * scale`` relative to its longest column, below which one is without effect.

    Returns
    -------
    ColumnBasis
        Kept columns and combinations; coefficients below rounding are zero.

    Raises
    ------
    ShapeError, InvalidValueError
        Not a matrix, NaN, an order that is no permutation, or scales that are not positive.

    References
    ----------
    Seed book section 1.5.3; M. Gautier, "Numerical calculation of the base inertial parameters of
    robots", Journal of Robotic Systems 8(4), 1991.

    Examples
    --------
    >>> column_basis(np.ones((5, 3)), order=[2, 0, 1]).kept
    array([2])
    """
    W = as_floats(W, "W")
    if W.ndim != 2:
        raise ShapeError(f"W: expected a matrix of shape (N, p), got {W.shape}.")
    p = W.shape[1]
    order = np.arange(p) if order is None else _permutation(order, p)
    scale = np.ones(p) if scale is None else _positive(scale, p)
    length = np.sqrt((W * W).sum(axis=0))
    in_units = length * scale
    seen = in_units > empty * in_units.max(initial=0.0)
    unit: Array = np.divide(W, length, out=np.zeros(W.shape), where=seen)
    if unit.shape[0] > p:
        unit = np.asarray(np.linalg.qr(unit, mode="r"))
    Q = np.empty((min(unit.shape), unit.shape[0]))
    parts = np.zeros((len(Q), p))
    distance = np.zeros(p)
    kept: list[int] = []
    for k in order[seen[order]]:
        basis, rest = Q[: len(kept)], unit[:, k]
        for _ in range(2):  # once more for the digits that the first projection has cancelled
            part = basis @ rest
            rest = rest - part @ basis
            parts[: len(kept), k] += part
        distance[k] = np.sqrt(rest @ rest)
        if distance[k] > dependent and len(kept) < len(Q):
            Q[len(kept)] = rest / distance[k]
            parts[len(kept), k] = distance[k]
            kept.append(int(k))
    b = len(kept)
    combinations = np.linalg.solve(parts[:b, kept], parts[:b]) if b else np.zeros((0, p))
    # unit columns have coefficients near 1; what is below this is rounding, magnified as it may be
    combinations[abs(combinations) < 1e-3 * dependent] = 0.0
    combinations[:, kept] = np.eye(b)
    rows = np.argsort(kept) if b else []
    kept_sorted = np.array(kept, dtype=np.int64)[rows] if b else np.empty(0, dtype=np.int64)
    coefficients = combinations[rows] * length / length[kept_sorted][:, None]
    return ColumnBasis(kept_sorted, np.flatnonzero(~seen), coefficients, distance)


def _permutation(order: ArrayLike, p: int) -> NDArray[np.int64]:
    numbers = np.asarray(order)
    if numbers.shape != (p,) or sorted(numbers.tolist()) != list(range(p)):
        raise InvalidValueError(
            f"order: expected each column number from 0 to {p - 1} once, got {order!r:.80}."
        )
    return numbers.astype(np.int64)


def _positive(scale: ArrayLike, p: int) -> Array:
    values = as_floats(scale, "scale")
    if values.shape != (p,) or not (values > 0).all():
        raise InvalidValueError(f"scale: expected {p} positive numbers, got {scale!r:.80}.")
    return values
