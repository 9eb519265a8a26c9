"""Sets of candidates with the largest observability index: greedy start, then exchanges.

Candidate i brings rows ``R_i`` (k, p), and a set has the information ``M = sum R_i^T R_i``, whose
eigenvalues are the squares of the singular values of the identification matrix.

Source: V. V. Fedorov, "Theory of optimal experiments", Academic Press 1972; R. D. Cook, C. J.
Nachtsheim, Technometrics 22(3), 1980 (member by member); T. J. Mitchell, "An algorithm for the
construction of D-optimal experimental designs", Technometrics 16(2), 1974.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array
from .observability import Criterion

Progress = Callable[[int, int], None]
_RIDGE = 1e-12
"""Added to the information, relative to its mean, so that sets that are too small compare too."""
_GAIN = 1e-10
_SWEEPS = 50
_CHUNK = 4096


def index_of(information: Array, criterion: Criterion) -> Array:
    """Observability criterion of information matrices, up to a constant.

    Shapes: information (..., p, p).
    """
    if criterion is Criterion.O1:
        sign, value = np.linalg.slogdet(information)
        return np.where(sign > 0.0, 0.5 * value / information.shape[-1], -np.inf)
    s = np.sqrt(np.maximum(np.linalg.eigvalsh(information), 1e-300))
    first, last = np.log(s[..., -1]), np.log(s[..., 0])
    if criterion is Criterion.O2:
        return last - first
    if criterion is Criterion.O3:
        return last
    if criterion is Criterion.O4:
        return 2.0 * last - first
    return -np.log((1.0 / s).sum(axis=-1))


def added(base: Array, rows: Array, criterion: Criterion) -> Array:
    """Criterion of an information matrix after adding each candidate.

    Shapes: base (p, p), rows (N, k, p) -> (N,).
    """
    N, k, p = rows.shape
    if criterion is Criterion.O1 and k < p:
        # det(M + R^T R) = det(M) det(1 + R M^-1 R^T): small determinants only
        L = np.linalg.cholesky(base)
        Y = np.linalg.solve(L, rows.reshape(-1, p).T).T.reshape(N, k, p)
        gain = np.linalg.slogdet(np.eye(k) + Y @ Y.swapaxes(-1, -2))[1]
        return (np.log(np.diag(L)).sum() + 0.5 * gain) / p
    parts = [
        index_of(base + (part := rows[a : a + _CHUNK]).swapaxes(-1, -2) @ part, criterion)
        for a in range(0, N, _CHUNK)
    ]
    return np.concatenate(parts)


def greedy(rows: Array, count: int, criterion: Criterion) -> NDArray[np.int64]:
    """Greedy forward selection of candidates. Shapes: rows (N, k, p) -> (count,)."""
    M = _floor(rows)
    left = np.ones(len(rows), dtype=bool)
    chosen = []
    p = rows.shape[-1]
    for _ in range(count):
        # until all parameters are seen every set's worst combination is the ridge: volume then
        seen = len(chosen) * rows.shape[1] >= p
        value = added(M, rows, criterion if seen else Criterion.O1)
        best = int(np.argmax(np.where(left, value, -np.inf)))
        left[best] = False
        chosen.append(best)
        M = M + rows[best].T @ rows[best]
    return np.array(chosen, dtype=np.int64)


def exchanged(
    rows: Array,
    start: NDArray[np.int64],
    criterion: Criterion,
    progress: Progress | None = None,
    fixed: int = 0,
) -> NDArray[np.int64]:
    """Exchange algorithm: swap members while the criterion improves.

    Shapes: rows (N, k, p), start (count,) -> (count,).
    """
    chosen = np.array(start, dtype=np.int64)
    floor = _floor(rows)
    free = np.ones(len(rows), dtype=bool)
    free[chosen] = False
    value = float(index_of(floor + _information(rows, chosen), criterion))
    members = range(fixed, len(chosen))
    unchanged, done, total = 0, 0, _SWEEPS * len(members)
    while unchanged < len(members) and done < total:
        k = members[done % len(members)]
        done += 1
        # summed anew: what is taken away again and again leaves rounding
        rest = floor + _information(rows, np.delete(chosen, k))
        values = np.where(free, added(rest, rows, criterion), -np.inf)
        best = int(np.argmax(values))
        unchanged += 1
        if values[best] > value + _GAIN:
            after = float(index_of(rest + rows[best].T @ rows[best], criterion))
            if after > value + _GAIN:
                free[chosen[k]], free[best] = True, False
                chosen[k], value, unchanged = best, after, 0
        if progress is not None:
            progress(done, total)
    if progress is not None and done < total:
        progress(total, total)
    return chosen


def nested(rows: Array, chosen: NDArray[np.int64], criterion: Criterion) -> NDArray[np.int64]:
    """Order a set so that its leading subsets are good sets.

    Shapes: rows (N, k, p), chosen (count,) -> (count,).
    """
    floor = _floor(rows)
    members, last = [int(c) for c in chosen], []
    while len(members) > 1:
        whole = floor + _information(rows, np.array(members))
        part = rows[members]
        value = index_of(whole - part.swapaxes(-1, -2) @ part, criterion)
        last.append(members.pop(int(np.argmax(value))))
    return np.array([*members, *last[::-1]], dtype=np.int64)


def _information(rows: Array, chosen: NDArray[np.int64]) -> Array:
    R = rows[chosen].reshape(-1, rows.shape[-1])
    return R.T @ R


def _floor(rows: Array) -> Array:
    p = rows.shape[-1]
    size = float((rows**2).sum()) / max(len(rows), 1) / p
    return (_RIDGE * size or 1e-300) * np.eye(p)
