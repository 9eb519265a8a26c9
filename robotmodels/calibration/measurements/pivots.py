"""The pivot from which lengths were measured, from the nominal positions of the end."""

from __future__ import annotations

import numpy as np

from ..._arrays import Array

_FLAT = 1e-2
"""Spread across a plane, relative to that in it, below which positions do not tell the side."""
_STEPS = 20


def pivot_of(p: Array, length: Array, offset: bool) -> Array:
    """Least-squares centre of positions at measured distances.

    Shapes: p (N, 3), length (N,) -> (3,).
    """
    mean = p.mean(axis=0)
    x = p - mean
    size = float(np.abs(x).max()) or 1.0
    # |x - c|^2 = (length - o)^2 is linear in c, o and o^2 - c.c
    square = (x**2).sum(axis=1) - length**2
    columns = [2.0 * x / size, np.ones((len(x), 1))]
    if offset:
        columns.append(-2.0 * length[:, None] / size)
    A = np.hstack(columns)
    _, spread, axes = np.linalg.svd(x, full_matrices=True)
    spread = np.append(spread, np.zeros(3))[:3]
    flat = spread[2] < _FLAT * spread[0]
    c = np.linalg.lstsq(A, square / size**2, rcond=_FLAT if flat else 1e-9)[0][:3] * size
    if flat:
        c -= axes[2] * (axes[2] @ c)
        if not offset:
            height = float(np.mean(length**2 - ((x - c) ** 2).sum(axis=1)))
            down = axes[2] if axes[2, 2] <= 0.0 else -axes[2]
            c += np.sqrt(max(height, 0.0)) * down
    return mean + _refined(x, length, c, offset)


def _refined(x: Array, length: Array, c: Array, offset: bool) -> Array:
    """Gauss-Newton on the distances themselves; kept only as far as they improve."""
    apart = x - c
    distance = np.linalg.norm(apart, axis=1)
    o = float(np.mean(length - distance)) if offset else 0.0
    cost = float(((distance + o - length) ** 2).sum())
    for _ in range(_STEPS):
        J = -apart / np.where(distance > 0.0, distance, 1.0)[:, None]
        if offset:
            J = np.hstack([J, np.ones((len(x), 1))])
        step = np.linalg.lstsq(J, length - distance - o, rcond=1e-6)[0]
        tried = c + step[:3]
        apart = x - tried
        distance = np.linalg.norm(apart, axis=1)
        tried_o = o + step[3] if offset else 0.0
        new = float(((distance + tried_o - length) ** 2).sum())
        if not new < cost:
            break
        c, o, cost = tried, tried_o, new
    return c
