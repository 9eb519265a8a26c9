"""Power spectra of logs.

Source: P. D. Welch, "The use of fast Fourier transform for the estimation of power spectra", IEEE
Trans. Audio and Electroacoustics 15(2), 1967.
"""

from __future__ import annotations

import numpy as np

from ..._arrays import Array


def power_density(x: Array, rate: float, length: int) -> tuple[Array, Array]:
    """Power spectral density by Welch's method: Hann windows that overlap by half.

    Shapes: x (N, c) -> f (length // 2 + 1,), P (length // 2 + 1, c).
    """
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(length) / length)
    step = length - length // 2
    starts = range(0, len(x) - length + 1, step)
    total = np.zeros((length // 2 + 1, x.shape[1]))
    for start in starts:
        part = x[start : start + length]
        total += np.abs(np.fft.rfft((part - part.mean(axis=0)) * window[:, None], axis=0)) ** 2
    P = total / (len(starts) * rate * float(window @ window))
    # one side holds the power of both; zero and half the rate have no other
    P[1 : (length + 1) // 2] *= 2.0
    return np.arange(length // 2 + 1, dtype=np.float64) * (rate / length), P
