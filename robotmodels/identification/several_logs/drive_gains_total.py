"""Scaled total least squares for drive gains: some columns are exact, the others are measured.

Source: M. Gautier and S. Briot, "Global identification of joint drive gains and dynamic parameters
of robots", ASME J. Dynamic Systems, Measurement and Control 136(5), 2014, section 3; S. Van Huffel
and J. Vandewalle, "The total least squares problem", SIAM, 1991, sections 3.5 and 3.6 (exact
columns, scaled columns).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..._arrays import Array, Rebuilt, read_only
from ..scale.reduction import Reduction
from .loaded import column_lengths

_ITERATIONS = 30


@dataclass(frozen=True, slots=True, eq=False)
class TotalSolution(Rebuilt):
    """Solution of ``E x + known - diag(currents) g = 0``. Read-only.

    Shapes: x (c,); gains, singular_values, weights (n,); inverse (c + n, c + n).
    """

    x: Array
    gains: Array
    singular_values: Array
    inverse: Array
    weights: Array

    def __post_init__(self) -> None:
        for name in ("x", "gains", "singular_values", "inverse", "weights"):
            object.__setattr__(self, name, read_only(getattr(self, name)))


def homogeneous_factor(reduction: Reduction, weights: Array) -> Array:
    """Triangular factor of the exact columns and, after them, one of currents for each motor.

    Shapes: weights (n,) -> (r, c + n).
    """
    n, c = len(reduction.factors), len(reduction.names)
    parts = []
    for m, F in enumerate(reduction.factors):
        rows = np.zeros((len(F), c + n))
        rows[:, :c] = F[:, :-1]
        rows[:, c + m] = -F[:, -1]
        parts.append(weights[m] * rows)
    R = np.asarray(np.linalg.qr(np.vstack(parts), mode="r"))
    return np.vstack((R, np.zeros((max(c + n - len(R), 0), c + n))))[: c + n]


def total_least_squares(reduction: Reduction, noise: Array) -> TotalSolution:
    """Total least squares with exact columns first, the last of which is known."""
    from scipy.linalg import solve_triangular

    n, c = len(noise), len(reduction.names) - 1
    weights = 1.0 / noise
    for _ in range(_ITERATIONS):
        R = homogeneous_factor(reduction, weights)
        scale = weights * noise * np.sqrt(np.maximum(reduction.counts, 1))
        _, s, V = np.linalg.svd(R[c + 1 :, c + 1 :] / scale)
        g = V[-1] / scale
        exact = -solve_triangular(R[: c + 1, : c + 1], R[: c + 1, c + 1 :] @ g)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            x, gains = exact[:-1] / exact[-1], g / exact[-1]
        size = np.abs(gains)
        if not np.isfinite(size).all() or not size.any():
            break
        # a motor whose gain vanishes would get all the weight
        after = 1.0 / (noise * np.maximum(size, 1e-6 * size.max()))
        still = np.abs(after - weights).max() <= 1e-9 * after.max()
        if still:
            break
        weights = after
    keep = [*range(c), *range(c + 1, c + 1 + n)]
    return TotalSolution(x, gains, s, _information_inverse(R[:, keep], scale), weights)


def _information_inverse(R: Array, scale: Array) -> Array:
    """Inverse of ``R^T R`` without what the noise of the currents adds to it."""
    size = column_lengths(R)
    information = (R / size).T @ (R / size)
    n = len(scale)
    which = np.arange(len(size) - n, len(size))
    information[which, which] -= (scale / size[-n:]) ** 2
    values, vectors = np.linalg.eigh(information)
    values = np.maximum(values, 1e-14 * values[-1])
    return (vectors / values) @ vectors.T / np.outer(size, size)


def known_side(reduction: Reduction, noise: Array) -> TotalSolution:
    """Weighted least squares with the known column on the right side."""
    n, c = len(noise), len(reduction.names) - 1
    keep = [*range(c), *range(c + 1, c + 1 + n)]
    weights = 1.0 / noise
    for _ in range(_ITERATIONS):
        R = homogeneous_factor(reduction, weights)
        size = column_lengths(R[:, keep])
        found = np.linalg.lstsq(R[:, keep] / size, -R[:, c], rcond=1e-13)[0] / size
        gains = np.abs(found[c:])
        if not gains.any():
            break
        after = 1.0 / (noise * np.maximum(gains, 1e-6 * gains.max()))
        still = np.abs(after - weights).max() <= 1e-9 * after.max()
        if still:
            break
        weights = after
    scale = weights * noise * np.sqrt(np.maximum(reduction.counts, 1))
    _, s, _ = np.linalg.svd(R[c + 1 :, c + 1 :] / scale)
    inverse = np.linalg.pinv(
        (R[:, keep] / size).T @ (R[:, keep] / size), rcond=1e-14, hermitian=True
    )
    return TotalSolution(found[:c], found[c:], s, inverse / np.outer(size, size), weights)
