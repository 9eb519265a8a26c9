"""Samples between samples."""

from __future__ import annotations

import numpy as np

from .._arrays import Array
from ..errors import InvalidValueError


def splined(stamps: Array, values: Array, wanted: Array, source: str) -> Array:
    """Values at other times, by a cubic spline through those of a recording.

    Parameters
    ----------
    stamps : ndarray, shape (N,)
        Ascending, s.
    values : ndarray, shape (N, m)
        At these.
    wanted : ndarray, shape (M,)
        Between the first and the last, s.
    source : str
        Name of the file, for the message.

    Returns
    -------
    ndarray, shape (M, m)
        Finite.

    Raises
    ------
    InvalidValueError
        Differences between rows that are no numbers any more.
    """
    from scipy.interpolate import CubicSpline

    try:
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            found = CubicSpline(stamps, values)(wanted)
    except ValueError:  # SciPy's word for slopes that are infinite
        found = np.full(1, np.nan)
    if not np.isfinite(found).all():
        raise InvalidValueError(
            f"{source}: its numbers, up to {np.abs(values).max():.3g}, change by so much within "
            f"{np.diff(stamps).min():.3g} s that nothing can be interpolated between its rows."
        )
    return found
