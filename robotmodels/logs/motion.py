"""How fast what was recorded moves."""

from __future__ import annotations

import numpy as np

from .._arrays import Array

_POWER, _BULK, _FAR, _WIDER = 0.999, 0.95, 8.0, 3.0
"""The motion has 99.9 % of the power of the velocities; where that is far beyond 95 %, the steps of
a coarse encoder are in it, and the motion ends at three times that of 95 %."""
_ABOVE = 10.0
"""Density relative to that of the noise below which a spectrum is noise."""
_LONGEST = 16.0
_LEAST = 32
SHARE = 0.1
"""Of the shortest period of the motion, over which samples may be interpolated."""


def shortest_period(q: Array, dt: float) -> float:
    """Shortest period of the motion: 99.9 % of the velocity power is below its frequency.

    Shapes: q (N, n).
    """
    from scipy.signal import welch

    if len(q) < _LEAST:
        return 0.0
    rate = 1.0 / dt
    v = np.diff(q, axis=0) * rate
    f, density = welch(v, rate, nperseg=min(len(v), max(_LEAST, int(_LONGEST * rate))), axis=0)
    f, density = f[1:], density[1:]
    # of a difference of white noise
    gain = (2.0 * rate * np.sin(np.pi * f / rate))[:, None] ** 2
    floor = np.median((density / gain)[(f > 0.25 * rate) & (f < 0.45 * rate)], axis=0)
    noise = gain * floor
    motion = np.where(density / _ABOVE > noise, density - noise, 0.0)
    power = np.cumsum(motion, axis=0)
    moves = power[-1] > 1e-12 * power[-1].max(initial=0.0)
    if not moves.any():
        return 0.0
    most, bulk = (
        f[(power >= share * power[-1]).argmax(axis=0)][moves] for share in (_POWER, _BULK)
    )
    return float(1.0 / np.where(most > _FAR * bulk, _WIDER * bulk, most).max())
