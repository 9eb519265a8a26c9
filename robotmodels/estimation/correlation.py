"""Estimates that data hardly tell apart: pairs with strong correlation."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .._arrays import Array


def correlated_pairs(
    correlation: Array, names: Sequence[str], least: float
) -> tuple[tuple[str, str, float], ...]:
    """Pairs of estimates whose correlation is above a bound, the strongest first.

    Parameters
    ----------
    correlation : ndarray, shape (p, p)
        Of the estimates; NaN where one of them has no deviation.
    names : sequence of str, length p
        Of the estimates.
    least : float
        Magnitude above which a pair is named.

    Returns
    -------
    tuple of (str, str, float)
        Names and correlation.

    Examples
    --------
    >>> correlated_pairs(np.array([[1.0, -0.95], [-0.95, 1.0]]), ("a", "b"), 0.9)
    (('a', 'b', -0.95),)
    """
    first, second = np.nonzero(np.triu(np.abs(np.nan_to_num(correlation)) > least, k=1))
    pairs = [
        (names[i], names[j], float(correlation[i, j]))
        for i, j in zip(first.tolist(), second.tolist(), strict=True)
    ]
    return tuple(sorted(pairs, key=lambda pair: -abs(pair[2])))
