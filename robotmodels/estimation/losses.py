"""Robust losses of whole measurements: weights, tuning, and the scale of residuals from a median.

A measurement of k rows whose noise is Gaussian of standard deviation 1 has residuals of length
chi with k degrees of freedom. A loss acts on that length, so that it does not depend on the axes
in which the rows are written. Its constant is chosen for each k so that the estimate has 95 % of
the efficiency of least squares where there is no outlier.

Source: P. J. Huber, E. M. Ronchetti, "Robust Statistics", 2nd ed., Wiley 2009, chapters 4 and 7.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from enum import Enum
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from .._arrays import Array

EFFICIENCY = 0.95
"""Variance of least squares relative to that of the robust estimate, on Gaussian residuals."""

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(80)


class Loss(Enum):
    """How much a measurement of a given length counts. Members act on lengths divided by scale.

    Examples
    --------
    >>> from robotmodels.estimation import Loss
    >>> [loss.name for loss in Loss]
    ['SQUARES', 'HUBER', 'CAUCHY', 'TUKEY']
    """

    SQUARES = "squares"
    """Least squares: each counts in full."""
    HUBER = "Huber"
    """Squares, from the constant on lengths: an outlier keeps a bounded influence."""
    CAUCHY = "Cauchy"
    """Logarithms: the influence of an outlier falls with its length."""
    TUKEY = "Tukey"
    """Biweight: an outlier beyond the constant has no influence at all."""


def loss_terms(loss: Loss, u: Array, c: Array) -> tuple[Array, Array, Array]:
    """Loss, weight and derivative of the influence, of measurements of length u."""
    if loss is Loss.SQUARES:
        return u * u, np.ones_like(u), np.ones_like(u)
    if loss is Loss.HUBER:
        inside = u <= c
        return (
            np.where(inside, u * u, (2 * u - c) * c),
            np.where(inside, 1.0, c / np.where(inside, 1.0, u)),
            inside.astype(np.float64),
        )
    t = (u / c) ** 2
    if loss is Loss.CAUCHY:
        return c * c * np.log1p(t), 1 / (1 + t), (1 - t) / (1 + t) ** 2
    rest = np.maximum(1 - t, 0.0)
    return c * c / 3 * (1 - rest**3), rest**2, rest * (1 - 5 * np.minimum(t, 1.0))


def tuning(loss: Loss, rows: NDArray[np.int64]) -> Array:
    """Tuning constants of a loss for measurements of k rows at efficiency `EFFICIENCY`."""
    return _by_rows(lambda k: _constant(loss, k), rows)


def expected_slope(loss: Loss, rows: NDArray[np.int64]) -> Array:
    """Mean of ``(slope + (k - 1) weight) / k`` on Gaussian residuals: the loss' curvature."""
    return _by_rows(lambda k: _moments(loss, k, _constant(loss, k))[0], rows)


def median_length(rows: NDArray[np.int64]) -> Array:
    """Median of chi with k degrees of freedom. Shapes: rows (B,) -> (B,)."""
    return _by_rows(lambda k: _quantile(k, 0.5), rows)


def length_quantile(rows: NDArray[np.int64], probability: float) -> Array:
    """Length that chi with k degrees of freedom stays under with this probability."""
    return _by_rows(lambda k: _quantile(k, probability), rows)


def robust_scale(length: Array, rows: NDArray[np.int64], freedom: float) -> float:
    """Standard deviation of rows from the median of the lengths of their measurements."""
    if not len(length):
        return 0.0
    number = float(rows.sum())
    share = number / max(number - freedom, 1.0)
    return float(np.median(length / median_length(rows))) * math.sqrt(share)


def _by_rows(value: Callable[[int], float], rows: NDArray[np.int64]) -> Array:
    sizes, where = np.unique(rows, return_inverse=True)
    return np.array([value(int(k)) for k in sizes], dtype=np.float64)[where]


def _density(k: int, u: Array) -> Array:
    constant = (k / 2 - 1) * math.log(2) + math.lgamma(k / 2)
    return np.asarray(u ** (k - 1) * np.exp(-u * u / 2 - constant))


def _moments(loss: Loss, k: int, c: float) -> tuple[float, float]:
    """Mean curvature and mean square of the influence, per row."""
    centre = math.sqrt(k)
    low, high = max(0.0, centre - 9.0), centre + 9.0
    kink = min(max(c, low), high)  # pieces, as the losses have kinks where the constant is
    curvature = square = 0.0
    for start, end in ((low, kink), (kink, high)):
        u = start + (end - start) / 2 * (1 + _NODES)
        share = _WEIGHTS * (end - start) / 2 * _density(k, u)
        _, weight, slope = loss_terms(loss, u, np.full_like(u, c))
        curvature += float(share @ (slope + (k - 1) * weight)) / k
        square += float(share @ (weight * u) ** 2) / k
    return curvature, square


@lru_cache(maxsize=256)
def _constant(loss: Loss, k: int) -> float:
    if loss is Loss.SQUARES:
        return math.inf
    low, high = 0.05, 3 * math.sqrt(k) + 20.0
    if loss is Loss.TUKEY:
        low = math.sqrt(k)  # below, the curvature is negative and its square misleads
    for _ in range(60):
        middle = (low + high) / 2
        slope, square = _moments(loss, k, middle)
        low, high = (middle, high) if slope * slope < EFFICIENCY * square else (low, middle)
    return (low + high) / 2


@lru_cache(maxsize=256)
def _quantile(k: int, probability: float) -> float:
    low, high = 0.0, math.sqrt(k) + 9.0
    start = max(0.0, math.sqrt(k) - 9.0)
    for _ in range(60):
        middle = (low + high) / 2
        half = max(middle - start, 0.0) / 2
        below = float((_WEIGHTS * half) @ _density(k, start + half * (1 + _NODES)))
        low, high = (middle, high) if below < probability else (low, middle)
    return (low + high) / 2
