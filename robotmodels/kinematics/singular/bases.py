"""Bases of subspaces that a person can read: as many zeros as the subspace allows."""

from __future__ import annotations

from itertools import combinations
from math import comb

import numpy as np

from ..._arrays import Array

_MOST_CHOICES = 2000


def sparse_basis(vectors: Array, tolerance: float = 1e-9) -> Array:
    """Basis of a row space with many zeros, each vector normalised to its largest entry.

    Shapes: vectors (k, m) -> (k, m).
    """
    k = vectors.shape[0]
    if k == 0:
        return vectors.copy()
    if k == 1:
        return normalised(vectors[0])[None]
    orthonormal = np.linalg.qr(vectors.T)[0].T
    choices = _pivot_choices(orthonormal)
    blocks = orthonormal[:, choices].transpose(1, 0, 2)
    weakest = np.linalg.svd(blocks, compute_uv=False)[:, -1]
    choices = [c for c, weak in zip(choices, weakest, strict=True) if weak > 0.02]
    if not choices:
        return np.array([normalised(row) for row in orthonormal])
    blocks, weakest = blocks[weakest > 0.02], weakest[weakest > 0.02]
    bases = np.linalg.solve(blocks, np.broadcast_to(orthonormal, (len(choices), *vectors.shape)))
    sizes = np.abs(bases)
    zeros = (sizes < tolerance * sizes.max(axis=2, keepdims=True)).sum(axis=(1, 2))
    # of equally sparse ones the best conditioned; rounding must not decide
    best = bases[np.lexsort((-weakest.round(6), -zeros))[0]]
    return np.array([normalised(row) for row in best])


def normalised(vector: Array, rounding: float = 1e-13) -> Array:
    """A vector divided by its entry of largest magnitude, its rounding errors set to zero."""
    size = np.abs(vector)
    pivot = int(np.argmax(size > (1.0 - 1e-9) * size.max()))
    row = vector / vector[pivot]
    row[np.abs(row) < rounding] = 0.0
    return row


def _pivot_choices(basis: Array) -> list[list[int]]:
    k, m = basis.shape
    if comb(m, k) <= _MOST_CHOICES:
        return [list(choice) for choice in combinations(range(m), k)]
    from scipy.linalg import qr

    # too many: the pivots of a pivoted factorisation, which are well conditioned
    return [[int(i) for i in qr(basis, pivoting=True)[-1][:k]]]
