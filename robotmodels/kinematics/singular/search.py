"""Search of the points of the singular set nearest to a configuration, many starts at once.

The rank of J drops below M where the block ``S = U^T J V`` vanishes, with U and V the singular
vectors from the M-th on. Along the joints it changes as ``G = U^T (dJ/dq) V``, up to the second
order, so that ``-G^+ S`` is Newton's step of least length to the set, and the rows of G span its
normals. On the set, the nearest point is where the way back to the start has nothing tangential.
Everything here is in joint units in which distance is Euclidean.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array
from .task import SingularTask, task_derivatives, task_jacobians

_WEAK = 1e-3  # normals beside the strongest one below which they are none
_ON_SET = 1e-13
_STATIONARY = 1e-10
_DIFFERENCE = 1e-5
_TIGHT = 1e-9  # at a limit


@dataclass(frozen=True, slots=True, eq=False)
class SearchSpace:
    """Search space: scaled joints and the singular set."""

    task: SingularTask
    dimension: int
    unit: Array
    start: Array
    lower: Array
    upper: Array


@dataclass(frozen=True, slots=True, eq=False)
class FoundPoints:
    """End points of a search, N of them.

    Shapes: x, escape, held (N, n); weakest, tangential, slope, codimension (N,).
    """

    x: Array
    weakest: Array
    tangential: Array
    slope: Array
    codimension: NDArray[np.int64]
    escape: Array
    held: NDArray[np.bool_]


def nearest_points(space: SearchSpace, starts: Array) -> FoundPoints:
    """Points of the singular set locally nearest to a configuration. Shapes: starts (N, n)."""
    x = to_set(space, starts, 60)
    good = on_set(space, x)[1] < 1e-9
    if good.any():
        x[good] = _polished(space, _descended(space, x[good], 30))
    tangent, held = _tangent(space, x)
    _, weakest, G = on_set(space, x)
    every, codimension = normals_of(G)
    escape = _along(every, space.start - x)
    size = np.linalg.norm(escape, axis=1)
    near = size < 1e-9
    escape = np.where(near[:, None], every[:, 0], escape / np.where(near, 1.0, size)[:, None])
    slope = np.linalg.norm(np.einsum("aei,ai->ae", G, escape), axis=1)
    along = np.linalg.norm(tangent, axis=1)
    return FoundPoints(x, weakest, along, slope, codimension, escape, held)


def slope_along(space: SearchSpace, x: Array, direction: Array) -> float:
    """Growth of the M-th singular value from a point of the set, per unit of distance."""
    U, sigma, Vt = np.linalg.svd(task_jacobians(space.task, x * space.unit), full_matrices=True)
    rank = int((sigma > 1e-8 * sigma[:1]).sum())
    rates = task_derivatives(space.task, x * space.unit)
    along = np.tensordot(direction * space.unit / space.task.joint_scale, rates, axes=1)
    growth = np.linalg.svd(U[:, rank:].T @ along @ Vt[rank:].T, compute_uv=False)
    return float(growth[space.dimension - rank - 1])


def on_set(space: SearchSpace, x: Array) -> tuple[Array, Array, Array]:
    """Blocks S (N, e), weakest singular values (N,), and gradients G (N, e, n)."""
    task, M, q = space.task, space.dimension, x * space.unit
    U, sigma, Vt = np.linalg.svd(task_jacobians(task, q), full_matrices=True)
    U, V = U[:, :, M - 1 :], Vt[:, M - 1 :]
    S = np.zeros((len(x), U.shape[2], V.shape[1]))
    k = min(S.shape[1:])
    S[:, range(k), range(k)] = sigma[:, M - 1 :]
    derivatives = task_derivatives(task, q) * (space.unit / task.joint_scale)[:, None, None]
    half = np.matmul(derivatives, V.transpose(0, 2, 1)[:, None])
    G = np.matmul(U.transpose(0, 2, 1)[:, None], half)
    top = np.where(sigma[:, 0] > 0.0, sigma[:, 0], 1.0)
    N, e = len(x), S.shape[1] * S.shape[2]
    return S.reshape(N, e), sigma[:, M - 1] / top, G.reshape(N, x.shape[1], e).swapaxes(1, 2)


def normals_of(G: Array) -> tuple[Array, NDArray[np.int64]]:
    """Orthonormal rows (N, e, n) spanning those of G, zero beyond their number (N,)."""
    _, size, Vt = np.linalg.svd(G, full_matrices=False)
    counts = size > _WEAK * np.maximum(size[:, :1], 1e-12)
    return Vt * counts[..., None], counts.sum(axis=1)


def _along(rows: Array, x: Array) -> Array:
    """Parts of vectors x (N, n) in the spaces of orthonormal rows (N, r, n)."""
    return np.einsum("ari,ar->ai", rows, np.einsum("ari,ai->ar", rows, x))


def _step(S: Array, G: Array) -> Array:
    """Newton's steps of least length to the set, damped by the distance from it."""
    U, size, Vt = np.linalg.svd(G, full_matrices=False)
    off = np.linalg.norm(S, axis=1, keepdims=True)
    damped = size / np.maximum(size**2 + 0.1 * off, 1e-300)
    step = -np.einsum("ari,ar->ai", Vt, damped * np.einsum("aer,ae->ar", U, S))
    length = np.linalg.norm(step, axis=1, keepdims=True)
    return step * np.minimum(1.0, 0.5 / np.maximum(length, 1e-300))


def to_set(space: SearchSpace, x: Array, steps: int) -> Array:
    """Newton's iteration to the set, inside the limits: points (N, n) after some steps."""
    x = np.clip(x, space.lower, space.upper)
    for _ in range(steps):
        S, weakest, G = on_set(space, x)
        off = weakest > _ON_SET
        if not off.any():
            break
        step = _step(S, G)
        for _ in range(2):  # joints at a limit do not take part in a step that leads outside
            stuck = ((x <= space.lower) & (step < 0.0)) | ((x >= space.upper) & (step > 0.0))
            if not stuck.any():
                break
            step = _step(S, np.where(stuck[:, None], 0.0, G))
        x = np.where(off[:, None], np.clip(x + step, space.lower, space.upper), x)
    return x


def _descended(space: SearchSpace, x: Array, steps: int) -> Array:
    """Points of the set moved along it towards the start, as long as this shortens the distance."""
    pace = np.ones(len(x))
    for _ in range(steps):
        if not len(x):
            break
        tangent, _ = _tangent(space, x)
        length = np.linalg.norm(tangent, axis=1)
        if (length * (pace > 1e-3) < 1e-7).all():
            break
        there = to_set(space, x + pace[:, None] * tangent, 12)
        now, then = (np.linalg.norm(p - space.start, axis=1) for p in (x, there))
        better = (then < now - 1e-4 * pace * length**2) & (on_set(space, there)[1] < 1e-9)
        x = np.where(better[:, None], there, x)
        pace = np.where(better, np.minimum(1.0, 2.0 * pace), 0.25 * pace)
    return x


def _tangent(space: SearchSpace, x: Array) -> tuple[Array, NDArray[np.bool_]]:
    """The difference to the start along the set and inside the limits; joints held."""
    G = on_set(space, x)[2]
    held = np.zeros(x.shape, dtype=bool)
    tangent = np.zeros(x.shape)
    low, high = x <= space.lower + _TIGHT, x >= space.upper - _TIGHT
    for _ in range(x.shape[1] + 1):
        normals, _ = normals_of(np.where(held[:, None], 0.0, G))
        back = np.where(held, 0.0, space.start - x)
        tangent = back - _along(normals, back)
        leaves = ~held & ((low & (tangent < -_TIGHT)) | (high & (tangent > _TIGHT)))
        if not leaves.any():
            break
        held |= leaves
    return tangent, held


def _polished(space: SearchSpace, x: Array) -> Array:
    """Newton's iteration on both conditions at once: on the set, and nothing tangential."""
    n = x.shape[1]
    _, held = _tangent(space, x)
    for _ in range(12):
        F = _conditions(space, x, held)
        size = np.linalg.norm(F, axis=1)
        active = (size > 0.01 * _STATIONARY) & (size < 0.3)
        if not active.any():
            break
        at = x[active]
        shifts = _DIFFERENCE * np.eye(n)
        points = np.concatenate([at[:, None] + shifts, at[:, None] - shifts], axis=1)
        stay = np.repeat(held[active], 2 * n, axis=0)
        values = _conditions(space, points.reshape(-1, n), stay).reshape(len(at), 2 * n, n)
        slope = ((values[:, :n] - values[:, n:]) / (2.0 * _DIFFERENCE)).swapaxes(1, 2)
        slope = np.where(held[active][:, :, None], np.eye(n), slope)
        step = -np.einsum("aij,aj->ai", np.linalg.pinv(slope, rcond=1e-9), F[active])
        length = np.linalg.norm(step, axis=1, keepdims=True)
        there = at + step * np.minimum(1.0, 0.3 / np.maximum(length, 1e-300))
        there = np.clip(there, space.lower, space.upper)
        smaller = np.linalg.norm(_conditions(space, there, held[active]), axis=1) < size[active]
        if not smaller.any():
            break
        x = x.copy()
        x[active] = np.where(smaller[:, None], there, at)
    return x


def _conditions(space: SearchSpace, x: Array, held: NDArray[np.bool_]) -> Array:
    """Conditions (N, n): difference to the start along the set plus the step to it, both zero."""
    S, _, G = on_set(space, x)
    G = np.where(held[:, None], 0.0, G)
    U, size, Vt = np.linalg.svd(G, full_matrices=False)
    counts = size > _WEAK * np.maximum(size[:, :1], 1e-12)
    inverse = np.where(counts, 1.0 / np.where(counts, size, 1.0), 0.0)
    to_set = np.einsum("ari,ar->ai", Vt, inverse * np.einsum("aer,ae->ar", U, S))
    back = np.where(held, 0.0, x - space.start)
    return back - _along(Vt * counts[..., None], back) + to_set
