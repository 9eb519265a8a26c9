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
"""Windows of a log, spread over it, and samples of each, that its noise is judged by."""
_WINDOW = 1024
_SMOOTH, _SHARE = 20.0, 0.2
"""Hz, and sampling rates: below it is motion that an encoder quantises, not noise."""


@dataclass(frozen=True, slots=True, eq=False)
class NoiseLevels:
    """Standard deviation of the noise of each joint's positions, and steps of its encoder (n,)."""

    deviation: Array
    step: Array


def noise_levels(log: Log) -> NoiseLevels:
    """Measure the noise of positions: white where it has a floor, else an encoder's steps."""
    part = stretches(log, _SAMPLES, _WINDOWS * _SAMPLES)
    deviation, step = np.zeros(log.n), np.zeros(log.n)
    for rows in part.recordings():
        # the largest: an encoder of a joint at rest shows no noise
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
    """Noise as that of positions q (N, n): white, or what an encoder of such steps makes of them.

    The error of an encoder is white only where it moves over many steps between two samples; in
    slow motion it has most of its power at low frequencies. So it is that of quantising the
    smoothed positions once more, the steps elsewhere.
    """
    found = levels.deviation * rng.normal(size=q.shape)
    coarse = np.flatnonzero(levels.step > 0.0)
    if coarse.size and len(q) > 1:
        step = levels.step[coarse]
        moved = zero_phase(q[:, coarse], min(_SMOOTH, _SHARE / dt), dt)
        moved = moved + step * rng.random(len(step))
        found[:, coarse] = np.round(moved / step) * step - moved
    return found
