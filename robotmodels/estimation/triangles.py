"""Triangular factors of long regressors, piece by piece: memory does not grow with the samples."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from .._arrays import Array


def triangular_factor(pieces: Iterable[Array], columns: int) -> Array:
    """Triangular factor R of all rows, ``R^T R = sum W^T W``.

    Parameters
    ----------
    pieces : iterable of ndarray, shapes (k, rows, p)
        Samples, a piece at a time; the second axis is the kind, see `factors_by_kind`.
    columns : int
        p, which is needed where there is no piece.

    Returns
    -------
    ndarray, shape (r, p)
        Upper triangular, r at most p.

    Examples
    --------
    >>> W = np.random.default_rng(0).normal(size=(50, 2, 4))
    >>> R = triangular_factor([W[:20], W[20:]], 4)
    >>> bool(np.allclose(R.T @ R, np.einsum("kip,kiq->pq", W, W)))
    True
    """
    return _factor(np.vstack([np.zeros((0, columns)), *factors_by_kind(pieces, columns)]))


def factors_by_kind(pieces: Iterable[Array], columns: int) -> list[Array]:
    """Of each kind of rows (the torques of one joint), a matrix R with ``R^T R = sum W^T W``.

    Rows of one kind have zeros in many columns, always in the same ones. So each kind has a
    triangle of its own over the columns that were ever seen in it.

    Parameters
    ----------
    pieces : iterable of ndarray, shapes (k, rows, p)
        Samples, a piece at a time; the second axis is the kind.
    columns : int
        p.

    Returns
    -------
    list of ndarray, shapes (r, p)
        One for each kind, r at most p; none where there is no piece.

    Examples
    --------
    >>> W = np.random.default_rng(0).normal(size=(50, 2, 4))
    >>> [R.shape for R in factors_by_kind([W], 4)]
    [(4, 4), (4, 4)]
    """
    triangles: list[Array] = []
    seen = np.zeros((0, columns), dtype=bool)
    for W in pieces:
        if not triangles:
            triangles = [np.zeros((0, columns)) for _ in range(W.shape[1])]
            seen = np.zeros(W.shape[1:], dtype=bool)
        seen |= W.any(axis=0)
        for j, own in enumerate(seen):
            # a column that is seen for the first time has zeros in the triangle so far
            rows = np.vstack((triangles[j][:, own], W[:, j, own]))
            R = _factor(rows) if len(rows) > rows.shape[1] else rows
            triangles[j] = np.zeros((len(R), columns))
            triangles[j][:, own] = R
    return triangles


def _factor(rows: Array) -> Array:
    return np.asarray(np.linalg.qr(rows, mode="r"))
