"""Strongly correlated pairs of estimates."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .._arrays import Array


def correlated_pairs(
    correlation: Array, names: Sequence[str], least: float
) -> tuple[tuple[str, str, float], ...]:
    """Pairs of estimates whose correlation is above a bound, the strongest first.

    Shapes: correlation (p, p).
    """
    first, second = np.nonzero(np.triu(np.abs(np.nan_to_num(correlation)) > least, k=1))
    pairs = [
        (names[i], names[j], float(correlation[i, j]))
        for i, j in zip(first.tolist(), second.tolist(), strict=True)
    ]
    return tuple(sorted(pairs, key=lambda pair: -abs(pair[2])))
