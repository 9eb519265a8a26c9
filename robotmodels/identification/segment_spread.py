"""Block jackknife: variation of the parameters between segments of a log.

Source: H. Kuensch, "The jackknife and the bootstrap for general stationary observations", Annals of
Statistics 17(3), 1989.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .._arrays import Array
from .equations import Equations
from .methods.ridge import segments
from .preparation.delay_rows import looked_at
from .scale.reduction import Reduction

_SEGMENTS = 25
_LARGEST_SHARE = 0.5
"""Largest leverage: a direction that one segment alone determines shows no spread."""


def segment_inflation(
    system: Equations, reduction: Reduction, weights: Array, deviations: Array
) -> float:
    """Factor, at least 1, by which standard errors grow to those of a block jackknife."""
    part = looked_at(system.log, system.processing.motion)
    own = system if part is system.log else replace(system, log=part)
    total = sum(len(block) for block in own.blocks())
    if total < _SEGMENTS:
        return 1.0
    parts = segments(own, _SEGMENTS)
    R, y, _ = reduction.stacked(weights)
    inverse = np.linalg.inv(R)
    values = inverse @ y
    covariance = np.zeros(R.shape)
    for segment in parts:
        T, z, _ = segment.stacked(weights)
        A = T @ inverse
        leverage, Q = np.linalg.eigh(A @ A.T)
        # residuals of the segment by the parameters of all others
        corrected = (Q.T @ (z - T @ values)) / (1.0 - np.clip(leverage, 0.0, _LARGEST_SHARE))
        score = A.T @ (Q @ corrected)
        covariance += np.outer(score, score)
    # of a long log only a part was looked at
    between = np.diag(inverse @ covariance @ inverse.T) * (len(system.log) / len(part))
    ratio = between / np.maximum(deviations**2, 1e-300)
    return float(max(1.0, np.sqrt(ratio.mean())))
