"""Sets of candidates with a large observability index: greedy start, exchanges, local moves.

Candidate i brings rows ``R_i`` (k, p); a set has the information ``M = sum R_i^T R_i``, whose
eigenvalues are the squares of the singular values of the identification matrix.

Source: V. V. Fedorov, "Theory of optimal experiments", Academic Press 1972; R. D. Cook, C. J.
Nachtsheim, Technometrics 22(3), 1980 (member by member); T. J. Mitchell, Technometrics 16(2), 1974.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array
from .._arrays.tasks import Workers
from ..geometry import PRISMATIC
from ..model import RobotModel
from .observability import Criterion

_RIDGE = 1e-12
"""Added to the information, relative to its mean, so that sets that are too small compare too."""
_GAIN = 1e-10
_SWEEPS = 50
_CHUNK = 4096
_STEP = 1e-6  # of a configuration, for differences
_MOVE_SWEEPS, _MOVE_ITERATIONS = 2, 15


def index_of(information: Array, criterion: Criterion) -> Array:
    """Logarithm of an observability index up to a constant. Shapes: information (..., p, p)."""
    if criterion is Criterion.O1:
        sign, value = np.linalg.slogdet(information)
        return np.where(sign > 0.0, 0.5 * value / information.shape[-1], -np.inf)
    s = np.sqrt(np.maximum(np.linalg.eigvalsh(information), 1e-300))
    first, last = np.log(s[..., -1]), np.log(s[..., 0])
    if criterion is Criterion.O5:
        return -np.log((1.0 / s).sum(axis=-1))
    return {Criterion.O2: last - first, Criterion.O3: last, Criterion.O4: 2.0 * last - first}[
        criterion
    ]


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
    M = _ridge(rows)
    left = np.ones(len(rows), dtype=bool)
    selected: list[int] = []
    for _ in range(count):
        # with too few rows the worst combination of every set is the ridge: volume decides then
        enough = len(selected) * rows.shape[1] >= rows.shape[-1]
        value = added(M, rows, criterion if enough else Criterion.O1)
        best = int(np.argmax(np.where(left, value, -np.inf)))
        left[best] = False
        selected.append(best)
        M = M + rows[best].T @ rows[best]
    return np.array(selected, dtype=np.int64)


def exchanged(
    rows: Array, start: NDArray[np.int64], criterion: Criterion, work: Workers
) -> NDArray[np.int64]:
    """Exchange algorithm: swap members while the criterion improves.

    Shapes: rows (N, k, p), start (count,) -> (count,).
    """
    members = np.array(start, dtype=np.int64)
    ridge, count = _ridge(rows), len(members)
    free = np.ones(len(rows), dtype=bool)
    free[members] = False
    value = float(index_of(ridge + information(rows[members]), criterion))
    unchanged, done, total = 0, 0, _SWEEPS * count
    while unchanged < count and done < total:
        k = done % count
        done += 1
        # summed anew: repeated subtraction leaves rounding
        rest = ridge + information(rows[np.delete(members, k)])
        values = np.where(free, added(rest, rows, criterion), -np.inf)
        best = int(np.argmax(values))
        unchanged += 1
        if values[best] > value + _GAIN:
            after = float(index_of(rest + rows[best].T @ rows[best], criterion))
            if after > value + _GAIN:
                free[members[k]], free[best] = True, False
                members[k], value, unchanged = best, after, 0
        work.done(done / total)
    if done < total:
        work.done()
    return members


def nested(rows: Array, members: NDArray[np.int64], criterion: Criterion) -> NDArray[np.int64]:
    """Order a set so that its leading subsets are good sets.

    Shapes: rows (N, k, p), members (count,) -> (count,).
    """
    left, last = [int(c) for c in members], []
    while len(left) > 1:
        part = rows[left]
        rest = _ridge(rows) + information(part) - part.swapaxes(-1, -2) @ part
        last.append(left.pop(int(np.argmax(index_of(rest, criterion)))))
    return np.array([*left, *last[::-1]], dtype=np.int64)


def moved_configurations(
    groups: Array,
    rows: Array,
    criterion: Criterion,
    rows_of: Callable[[Array], Array],
    is_allowed: Callable[[Array], NDArray[np.bool_]],
    model: RobotModel,
    work: Workers,
) -> Array:
    """Move configurations one after another while the criterion improves.

    Shapes: groups (count, m, n), rows (count, k, p) -> (count, m, n).
    """
    from scipy.optimize import minimize

    groups, rows = groups.copy(), rows.copy()
    count, m, n = groups.shape
    lower, upper = np.tile(model.lower, m), np.tile(model.upper, m)
    sigma = np.tile(model.table.sigma[model.table.joint_rows], m)
    # without limits strokes would grow without bound, as longer levers are always better
    endless = (sigma == PRISMATIC) & ~(np.isfinite(lower) & np.isfinite(upper))
    value = float(index_of(information(rows), criterion))
    for g in np.tile(np.arange(count), _MOVE_SWEEPS):
        rest, x0 = information(rows[np.arange(count) != g]), groups[g].ravel()
        base = rest + _ridge(rows)
        low, high = np.where(endless, x0, lower), np.where(endless, x0, upper)

        def cost(x: Array, base: Array = base, high: Array = high) -> Any:
            # a step back from an upper limit, as rows beyond it mean nothing
            h = np.where(x + _STEP > high, -_STEP, _STEP)
            points = np.vstack([x, x + np.diag(h)]).reshape(-1, m, n)
            index = added(base, rows_of(points), criterion)
            return -float(index[0]), -(index[1:] - index[0]) / h

        x = minimize(
            cost, np.clip(x0, low, high), jac=True, method="L-BFGS-B",
            bounds=list(zip(low, high, strict=True)), options={"maxiter": _MOVE_ITERATIONS},
        ).x  # fmt: skip
        for part in (1.0, 0.5, 0.25, 0.1):
            trial = np.clip(x0 + part * (x - x0), lower, upper).reshape(1, m, n)
            if not is_allowed(trial)[0]:
                continue
            new = rows_of(trial)
            after = float(index_of(rest + information(new), criterion))
            if after > value:
                groups[g], rows[g], value = trial[0], new[0], after
                break
    work.done()
    return groups


def information(rows: Array) -> Array:
    """Information matrix of a set. Shapes: rows (c, k, p) -> (p, p)."""
    R = rows.reshape(-1, rows.shape[-1])
    return R.T @ R


def _ridge(rows: Array) -> Array:
    """A small multiple of the identity beside the mean information of a candidate."""
    p = rows.shape[-1]
    size = float((rows**2).sum()) / max(len(rows), 1) / p
    return (_RIDGE * size or 1e-300) * np.eye(p)
