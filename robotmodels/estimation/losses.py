"""Robust losses that act on whole measurements: weights, tuning constants, scale from a median.

A measurement of k rows with Gaussian noise of standard deviation 1 has residuals of length chi with
k degrees of freedom. A loss acts on that length, so it does not depend on the axes in which the
rows are written. Its constant is chosen for each k so that the estimate has 95 % of the efficiency
of least squares where there is no outlier.

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
"""Efficiency: variance of least squares relative to the robust estimate, for Gaussian residuals."""

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(80)


class Loss(Enum):
    """Loss of a measurement as a function of the length of its residuals divided by their scale.

    The influence of an outlier grows with its length (squares), is bounded (Huber: linear beyond
    the constant), decreases (Cauchy: logarithms), or is zero (Tukey's biweight).

    Examples
    --------
    >>> [loss.name for loss in Loss]
    ['SQUARES', 'HUBER', 'CAUCHY', 'TUKEY']
    """

    SQUARES = "squares"
    HUBER = "Huber"
    CAUCHY = "Cauchy"
    TUKEY = "Tukey"


def loss_terms(loss: Loss, u: Array, c: Array) -> tuple[Array, Array, Array]:
    """Loss, weight and derivative of the influence, of measurements of length u."""
    if loss is Loss.SQUARES:
        return u * u, np.ones_like(u), np.ones_like(u)
    if loss is Loss.HUBER:
        inside = u <= c
        weight = np.where(inside, 1.0, c / np.where(inside, 1.0, u))
        return np.where(inside, u * u, (2 * u - c) * c), weight, inside.astype(np.float64)
    t = (u / c) ** 2
    if loss is Loss.CAUCHY:
        return c * c * np.log1p(t), 1 / (1 + t), (1 - t) / (1 + t) ** 2
    rest = np.maximum(1 - t, 0.0)
    return c * c / 3 * (1 - rest**3), rest**2, rest * (1 - 5 * np.minimum(t, 1.0))


def tuning(loss: Loss, rows: NDArray[np.int64]) -> Array:
    """Tuning constants of a loss for measurements of k rows at efficiency `EFFICIENCY`."""
    return _by_rows(lambda k: _constant(loss, k), rows)


Terms = Callable[[Array], tuple[Array, Array, Array]]


def terms_of(loss: Loss, rows: NDArray[np.int64], scale: float) -> Terms:
    """`loss_terms` as a function of the lengths of measurements of k rows, given their scale."""
    constant = tuning(loss, rows)

    def terms(length: Array) -> tuple[Array, Array, Array]:
        rho, weight, slope = loss_terms(loss, length / scale, constant)
        return scale**2 * rho, weight, slope

    return terms


def expected_slope(loss: Loss, rows: NDArray[np.int64]) -> Array:
    """Mean of ``(slope + (k - 1) weight) / k`` on Gaussian residuals: the loss' curvature."""
    return _by_rows(lambda k: _moments(loss, k, _constant(loss, k))[0], rows)


def length_quantile(rows: NDArray[np.int64], probability: float) -> Array:
    """Quantile of chi with k degrees of freedom. Shapes: rows (B,) -> (B,)."""
    from scipy.special import gammaincinv

    return np.asarray(np.sqrt(2.0 * gammaincinv(0.5 * rows, probability)))


def median_length(rows: NDArray[np.int64]) -> Array:
    """Median of chi with k degrees of freedom. Shapes: rows (B,) -> (B,)."""
    return length_quantile(rows, 0.5)


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


def _moments(loss: Loss, k: int, c: float) -> tuple[float, float]:
    """Mean curvature and mean square of the influence, per row, by Gauss-Legendre quadrature."""
    low, high = max(0.0, math.sqrt(k) - 9.0), math.sqrt(k) + 9.0
    kink = min(max(c, low), high)  # pieces between the kinks at the tuning constant
    half = np.array([[kink - low], [high - kink]]) / 2
    u = np.array([[low], [kink]]) + half * (1 + _NODES)
    log_density = (k - 1) * np.log(u) - u * u / 2 - (k / 2 - 1) * math.log(2) - math.lgamma(k / 2)
    share = _WEIGHTS * half * np.exp(log_density) / k
    _, weight, slope = loss_terms(loss, u, np.full_like(u, c))
    means = share * (slope + (k - 1) * weight), share * (weight * u) ** 2
    return float(means[0].sum()), float(means[1].sum())


@lru_cache(maxsize=256)
def _constant(loss: Loss, k: int) -> float:
    """Constant at which the efficiency is `EFFICIENCY`."""
    from scipy.optimize import root_scalar

    if loss is Loss.SQUARES:
        return math.inf

    def excess(c: float) -> float:
        slope, square = _moments(loss, k, c)
        return slope * slope - EFFICIENCY * square

    # below sqrt(k) Tukey's curvature is negative and its square misleads
    low = math.sqrt(k) if loss is Loss.TUKEY else 0.05
    if excess(low) >= 0.0:  # many rows: any constant is efficient
        return low
    return float(root_scalar(excess, bracket=(low, 3 * math.sqrt(k) + 20.0), xtol=1e-13).root)
