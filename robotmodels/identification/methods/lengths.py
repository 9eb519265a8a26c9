"""Medians of residuals in bounded memory: counts of their lengths on a logarithmic scale."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..._arrays import Array
from ...estimation.losses import median_length

_OCTAVE = 64
"""Bins for a factor of two: 1.1 % each, and a median is interpolated in its bin."""
_LOW, _HIGH = -80, 60
"""Powers of two that are told apart; what is smaller is zero."""


class Lengths:
    """Histogram of residual lengths of each kind of equations."""

    def __init__(self, kinds: int) -> None:
        self.counts = np.zeros((kinds, (_HIGH - _LOW) * _OCTAVE + 1), dtype=np.int64)

    def add(self, lengths: Array, use: NDArray[np.bool_]) -> None:
        """Count lengths ``(k, m)``, where they take part."""
        with np.errstate(divide="ignore"):
            place = np.floor((np.log2(lengths) - _LOW) * _OCTAVE) + 1
        last = self.counts.shape[1] - 1
        bins = np.clip(place, 0, last).astype(np.int64)
        for kind, row in enumerate(self.counts):
            row += np.bincount(bins[use[:, kind], kind], minlength=last + 1)

    def deviations(self) -> Array:
        """Standard deviations of normal noise with the same medians, shape (m,); 0 for none."""
        found = np.zeros(len(self.counts))
        for kind, row in enumerate(self.counts):
            total = np.cumsum(row)
            if not total[-1]:
                continue
            half = 0.5 * total[-1]
            k = int(np.searchsorted(total, half))
            if k == 0:
                continue
            inside = (half - total[k - 1]) / row[k]
            found[kind] = 2.0 ** (_LOW + (k - 1 + inside) / _OCTAVE)
        return found / float(median_length(np.ones(1, dtype=np.int64))[0])
