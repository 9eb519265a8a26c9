"""The functions of t = angle^2 by which rotation vectors turn their rates into angular velocity.

For a rotation vector v with ``R = exp([v])``: ``w = (1 + a [v] + b [v]^2) dv/dt`` and, inverted,
``dv/dt = (1 - [v] / 2 + gamma [v]^2) w``. All are even in the angle, hence functions of t, smooth
at 0, where they are summed as series.
"""

from __future__ import annotations

from math import factorial

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array

_SERIES_BELOW = 4.0


def _gamma_coefficients(count: int) -> list[float]:
    """Coefficients ``|B_2k| / (2k)!`` of gamma, by the recurrence ``(2k + 1) c_k = sum c_j c_k-j``.

    It is Riccati's equation of the cotangent; every term is positive, so no digit is lost.
    """
    c = [1.0 / 12.0]
    for k in range(2, count + 1):
        c.append(sum(x * y for x, y in zip(c, reversed(c), strict=True)) / (2 * k + 1))
    return c


_GAMMA = _gamma_coefficients(20)
_GAMMA_SLOPE = [k * c for k, c in enumerate(_GAMMA)][1:]
_SECOND = [(-1) ** k / factorial(2 * k + 3) for k in range(13)]


def left_factors(t: Array) -> tuple[Array, Array]:
    """Factors ``a = (1 - cos) / angle^2`` and ``b = (angle - sin) / angle^3``."""
    angle = np.sqrt(t)
    a = 0.5 * np.sinc(angle / (2.0 * np.pi)) ** 2
    small, safe = _split(t)
    b = np.where(small, _sum(_SECOND, t), (np.sqrt(safe) - np.sin(np.sqrt(safe))) / safe**1.5)
    return a, b


def inverse_left_factor(t: Array) -> Array:
    """Factor ``gamma = (1 - (angle / 2) cot(angle / 2)) / angle^2``."""
    small, safe = _split(t)
    half = 0.5 * np.sqrt(safe)
    with np.errstate(divide="ignore"):
        far = (1.0 - half / np.tan(half)) / safe
    return np.where(small, _sum(_GAMMA, t), far)


def inverse_left_factor_slope(t: Array) -> Array:
    """Derivative of `inverse_left_factor` with respect to t."""
    small, safe = _split(t)
    half = 0.5 * np.sqrt(safe)
    with np.errstate(divide="ignore"):
        turning = half / np.tan(half) + (half / np.sin(half)) ** 2
    return np.where(small, _sum(_GAMMA_SLOPE, t), (0.5 * turning - 1.0) / safe**2)


def _split(t: Array) -> tuple[NDArray[np.bool_], Array]:
    """Where the series serves, and values that are safe to divide by."""
    small = t < _SERIES_BELOW
    return small, np.where(small, _SERIES_BELOW, t)


def _sum(coefficients: list[float], t: Array) -> Array:
    """Power series at values that are small enough for it; elsewhere of no meaning."""
    x = np.minimum(t, _SERIES_BELOW)
    total = np.zeros_like(x)
    for coefficient in reversed(coefficients):
        total = total * x + coefficient
    return total
