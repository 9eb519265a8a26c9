"""Independent columns of a matrix: which are kept, and how the others follow from them.

A column is kept if it is not a combination of those kept before it, so that a dependent column is
regrouped into columns that come earlier. Short columns are considered after the others:
coefficients on a short column are large, and amplify rounding.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .._arrays import Array, Frozen, as_exact, as_floats
from ..errors import InvalidValueError, ShapeError

NEGLIGIBLE = 1e-11
"""Rank tolerance: residual column norm relative to the largest."""
_LEVELS = (1e-4, 1e-8)
"""Residual column norms, relative to the largest, below which a column is postponed."""
_ROUNDING = 1e-14
_TALL = 4  # rows per column above which a triangular factor is computed first


@dataclass(frozen=True, slots=True, eq=False)
class ColumnBasis(Frozen):
    """Independent columns of a matrix, and the others as their combinations. Read-only.

    Parameters
    ----------
    kept, empty : ndarray of int, shapes (b,), (e,)
        Numbers of the independent columns, in the order of the matrix, and of those without effect.
    coefficients : ndarray, shape (b, p)
        ``W = W[:, kept] @ coefficients``: the parameters of the kept columns that give the same
        product as all parameters are ``coefficients @ parameters``.
    distance : ndarray, shape (p,)
        Residual norm of each column after projection on those kept before it, relative to the
        longest column: small for a column that nearly depends on others or is nearly empty.
    """

    kept: NDArray[np.int64]
    empty: NDArray[np.int64]
    coefficients: Array
    distance: Array

    @property
    def rank(self) -> int:
        """Number of independent columns."""
        return len(self.kept)

    @property
    def dependent(self) -> NDArray[np.int64]:
        """Numbers of the dependent columns that have an effect."""
        return np.setdiff1d(np.arange(len(self.distance)), [*self.kept, *self.empty])

    @property
    def gap(self) -> tuple[float, float]:
        """Smallest distance of a kept column and largest of one that is not (1, 0 without any)."""
        others = np.delete(self.distance, self.kept)
        least = self.distance[self.kept].min(initial=1.0)
        return float(least), float(others.max(initial=0.0))


def column_basis(
    W: ArrayLike, *, scale: ArrayLike | None = None, negligible: float = NEGLIGIBLE
) -> ColumnBasis:
    """Choose independent columns, the earlier ones first.

    A column is kept if its residual after projection on the columns kept before is longer than
    ``negligible``. Lengths are in the units that ``scale`` gives, relative to the longest column:
    the error of any product is at most that part of the largest. Columns with residuals below 1e-4
    (then 1e-8) are considered after the others, so that coefficients stay bounded.

    Parameters
    ----------
    W : array_like, shape (N, p)
        The matrix, or the triangular factor of it: only ``W^T W`` matters.
    scale : array_like, shape (p,), optional
        Natural size of the parameter of each column, so that ``W * scale`` has comparable columns;
        default 1.
    negligible : float
        Rank tolerance relative to the longest column; also that of coefficients.

    Returns
    -------
    ColumnBasis
        Kept columns and combinations; coefficients below the tolerance are exactly zero.

    References
    ----------
    Book section 1.5.3; M. Gautier, "Numerical calculation of the base inertial parameters of
    robots", Journal of Robotic Systems 8(4), 1991.

    Examples
    --------
    >>> basis = column_basis([[1.0, 2.0, 0.0], [1.0, 2.0, 1.0]])
    >>> basis.kept, basis.coefficients
    (array([0, 2]), array([[1., 2., 0.],
           [0., 0., 1.]]))
    """
    W = as_floats(W, "W")
    if W.ndim != 2:
        raise ShapeError(f"W: expected a matrix of shape (N, p), got {W.shape}.")
    p = W.shape[1]
    scale = np.ones(p) if scale is None else as_exact(scale, (p,), "scale")
    if not (scale > 0.0).all():
        raise InvalidValueError(f"scale: expected positive numbers, got {scale.min():g}.")
    length = np.sqrt((W * W).sum(axis=0)) * scale
    longest = float(length.max(initial=0.0)) or 1.0
    U, length = W * (scale / longest), length / longest
    if U.shape[0] > _TALL * p:
        U = np.asarray(np.linalg.qr(U, mode="r"))
    kept, parts, left = _kept_columns(U, np.flatnonzero(length > negligible), negligible)
    left[length <= negligible] = length[length <= negligible]
    combinations = _combinations(parts, kept, left, negligible)
    rows = np.argsort(kept)
    kept = kept[rows]
    coefficients = combinations[rows] * scale[kept][:, None] / scale
    return ColumnBasis(kept, np.flatnonzero(length <= negligible), coefficients, left)


def _kept_columns(
    U: Array, order: NDArray[np.int64], negligible: float
) -> tuple[NDArray[np.int64], Array, Array]:
    """Orthogonalisation: kept columns, all columns in their basis, residual norms."""
    p = U.shape[1]
    Q = np.empty((min(U.shape), U.shape[0]))
    parts = np.zeros((len(Q), p))
    left = np.zeros(p)
    kept: list[int] = []
    rest = U.T.copy()
    for level in (*(x for x in _LEVELS if x > negligible), negligible):
        waiting: list[int] = []
        for k in order.tolist():
            basis = Q[: len(kept)]
            for _ in range(2):  # second projection against cancellation
                # einsum: in BLAS, thread synchronisation would dominate these small products
                part = np.einsum("ij,j->i", basis, rest[k])
                rest[k] -= np.einsum("i,ij->j", part, basis)
                parts[: len(kept), k] += part
            left[k] = np.sqrt(rest[k] @ rest[k])
            if left[k] > level and len(kept) < len(Q):
                Q[len(kept)] = rest[k] / left[k]
                parts[len(kept), k] = left[k]
                kept.append(k)
            elif left[k] > _ROUNDING:
                waiting.append(k)
        order = np.array(waiting, dtype=np.int64)
    return np.array(kept, dtype=np.int64), parts[: len(kept)], left


def _combinations(parts: Array, kept: NDArray[np.int64], left: Array, negligible: float) -> Array:
    """All columns as combinations of the kept ones, without coefficients that are rounding."""
    b, p = parts.shape
    if not b:
        return np.zeros((0, p))
    triangle = parts[:, kept]
    whole = np.empty((b, p))
    for i in range(b - 1, -1, -1):
        known = np.einsum("j,jk->k", triangle[i, i + 1 :], whole[i + 1 :])
        whole[i] = (parts[i] - known) / triangle[i, i]
    coefficients: Array = whole.copy()
    # rounding is magnified in coefficients of kept columns with small residuals
    slight = _ROUNDING / left[kept]
    coefficients[np.abs(coefficients) <= np.minimum(slight, negligible)[:, None]] = 0.0
    fewer = np.abs(coefficients) <= np.maximum(slight, negligible)[:, None]
    for k in np.flatnonzero((fewer & (coefficients != 0.0)).any(axis=0)):
        # least-squares compensation by the other columns
        terms = np.flatnonzero(~fewer[:, k])
        again = np.linalg.lstsq(triangle[:, terms], parts[:, k], rcond=None)[0]
        if np.linalg.norm(parts[:, k] - triangle[:, terms] @ again) <= negligible:
            coefficients[:, k] = 0.0
            coefficients[terms, k] = again
    coefficients[:, kept] = np.eye(b)
    return coefficients
