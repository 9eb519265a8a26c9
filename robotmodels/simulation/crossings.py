"""When a function of time becomes negative within a step of an integrator."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from .._arrays import Array

_CLOSE = 1e-7  # of the time between looks: a dip is that flat around its bottom


def first_below(
    g: Callable[[float], float], ts: Array, values: Array, least: float, zero: float
) -> tuple[float, float] | None:
    """First root of a function before it falls below a level.

    Shapes: ts, values (K,) -> (t, low).
    """
    last = len(ts) - 1
    for k in range(last + 1):
        if k and values[k] < least:
            low = float(ts[k])
        elif _may_dip(values, k, least):
            low = _bottom(g, float(ts[max(k - 1, 0)]), float(ts[min(k + 1, last)]))
            if g(low) >= least:
                continue
        else:
            continue
        start = float(ts[max(int(np.searchsorted(ts, low)) - 1, 0)])
        return _passes(g, start, low, zero), low
    return None


def _may_dip(values: Array, k: int, least: float) -> bool:
    """Whether the function may be below the level beside a look that is not."""
    near = values[max(k - 2, 0) : k + 3]
    beside = values[max(k - 1, 0) : k + 2]
    # smooth functions go no deeper between looks than they differ at these
    depth = float(near.max() - near.min())
    return bool(least <= values[k] == beside.min() and values[k] - depth < least)


def _bottom(g: Callable[[float], float], left: float, right: float) -> float:
    """Where the function is lowest."""
    from scipy.optimize import fminbound

    return float(np.asarray(fminbound(g, left, right, xtol=_CLOSE * (right - left))))


def _passes(g: Callable[[float], float], left: float, right: float, zero: float) -> float:
    """Where the function passes zero, or the left end if it is not above zero after it."""
    from scipy.optimize import brentq

    def above(t: float) -> float:
        return g(t) - zero

    low, high = left, right
    if above(left) <= 0.0:  # it begins at zero, as after an event: it may rise before it falls
        width = right - left
        for _ in range(40):
            width *= 0.5
            if above(left + width) > 0.0:
                break
        else:
            return left
        low, high = left + width, left + 2.0 * width
    if above(high) >= 0.0:
        return high
    found: Any = brentq(above, low, high, xtol=1e-15 * max(1.0, abs(right)))
    return float(found)


def beyond(g: Callable[[float], float], t: float, end: float, zero: float) -> float:
    """First representable time from a root on at which a function is negative."""
    step = float(np.spacing(max(abs(t), abs(end))))
    while t < end and g(t) >= zero:
        t = min(t + step, end)
        step *= 2.0
    return t
