"""Samples between samples, and in place of those that are missing."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from .._arrays import Array
from ..errors import InvalidValueError

_BESIDE = 4


def splined(stamps: Array, values: Array, wanted: Array, source: str) -> Array:
    """Values at other times, by a cubic spline through those of a recording.

    Shapes: stamps (N,), values (N, m), wanted (M,) -> (M, m).
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


def filled(places: ArrayLike, values: Array, wanted: ArrayLike) -> Array:
    """Values at missing places, by cubics through the samples on both sides of each gap.

    Shapes: places (N,), values (N, m), wanted (M,) -> (M, m).
    """
    x, at = np.asarray(places, np.float64), np.asarray(wanted, np.float64)
    found = np.empty((len(at), values.shape[1]))
    ends = [0, *(np.flatnonzero(np.diff(at) != 1.0) + 1).tolist(), len(at)]
    for start, end in pairwise(ends if len(at) else ()):
        gap = at[start:end]
        near, k = int(np.searchsorted(x, gap[0])), max(_BESIDE, end - start)
        beside = slice(max(0, near - k), near + k)
        middle, size = gap.mean(), float(np.ptp(x[beside]))
        powers = np.arange(min(4, len(x[beside])))
        A, B = (((z - middle)[:, None] / size) ** powers for z in (x[beside], gap))
        found[start:end] = B @ np.linalg.lstsq(A, values[beside], rcond=None)[0]
    return found
