"""Noise of measured positions: its size by joint, and samples of such noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..._arrays import Array
from ...logs import Log
from ...logs.channel_checks import resolution
from ...logs.stretches import stretches
from .filters import zero_phase
from .spectrum import power_density

_WINDOWS, _SAMPLES = 4, 4096
"""Number and length in samples of the windows from which the noise is estimated."""
_WINDOW = 1024
_SMOOTH, _SHARE = 20.0, 0.2
"""Smoothing cutoff of quantised positions: Hz, and at most this part of the sampling rate."""


@dataclass(frozen=True, slots=True, eq=False)
class NoiseLevels:
    """Standard deviation of the noise of each joint's positions, and steps of its encoder (n,)."""

    deviation: Array
    step: Array


def noise_levels(log: Log) -> NoiseLevels:
    """Estimate the noise of positions: white noise, or the quantisation of an encoder."""
    part = stretches(log, _SAMPLES, _WINDOWS * _SAMPLES)
    deviation, step = np.zeros(log.n), np.zeros(log.n)
    for rows in part.recordings():
        # the largest, since an encoder shows no noise while its joint rests
        q = np.asarray(part.q[rows])
        length = min(len(q), _WINDOW)
        if length >= 16:
            f, P = power_density(q - q[0], 1.0, length)
            high = (f > 0.25) & (f < 0.45)
            deviation = np.maximum(deviation, np.sqrt(0.5 * np.median(P[high], axis=0)))
        step = np.maximum(step, [resolution(x) for x in q.T])
    uniform = step / np.sqrt(12.0)
    coarse = uniform > deviation / 1.5
    return NoiseLevels(
        np.where(coarse, np.maximum(uniform, deviation), deviation), np.where(coarse, step, 0.0)
    )


def noise_draw(q: Array, dt: float, levels: NoiseLevels, rng: np.random.Generator) -> Array:
    """Draw noise like that of positions q (N, n): white, or the quantisation error of an encoder.

    The latter is coloured in slow motion: smoothed positions are quantised with random offsets.
    """
    found = levels.deviation * rng.normal(size=q.shape)
    coarse = np.flatnonzero(levels.step > 0.0)
    if coarse.size and len(q) > 1:
        step = levels.step[coarse]
        moved = zero_phase(q[:, coarse], min(_SMOOTH, _SHARE / dt), dt)
        moved = moved + step * rng.random(len(step))
        found[:, coarse] = np.round(moved / step) * step - moved
    return found
